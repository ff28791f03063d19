"""Sets of sensors: rates, delays, ranges, noise and vibration are those that their settings say."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from plant_flights import part

from rotorfault.base.errors import InputError
from rotorfault.maths.geometry import PerRotor, Vec3, zeros
from rotorfault.maths.rotation import Quat
from rotorfault.model.block import Context
from rotorfault.model.mixer import hover_thrust
from rotorfault.model.sensor_model import SensorNoise, Timing
from rotorfault.model.signals import Reading, Readings, State
from rotorfault.model.vehicle import rotor_speeds
from rotorfault.model.vehicle_file import load_vehicle
from rotorfault.plant import SENSORS
from rotorfault.plant.sampling import arrival, on_its_way
from rotorfault.plant.sensors import SensorInputs
from rotorfault.scenario.library import load_scenario

DT = 0.001
CONTEXT = Context(load_vehicle("hummingbird").vehicle, DT)
HOVER = rotor_speeds(CONTEXT.vehicle, hover_thrust(CONTEXT.vehicle))
WEIGHT = Vec3(0.0, 0.0, 9.81)
STILL = State(Vec3(0.0, 0.0, 1.0), zeros(), Quat.identity(), zeros())


def read(made: Any, states: list[State], normals: Any = None, force: Vec3 = WEIGHT) -> list[Readings]:
    """Readings of consecutive instants; without noise unless normal numbers are given, one row for each."""
    numbers = made.parameters(CONTEXT)
    memory = made.initial(SensorInputs(0.0, states[0], force, (0.0,) * made.first_normals, HOVER), numbers)
    taken = []
    for k, state in enumerate(states):
        drawn = (0.0,) * made.normals if normals is None else tuple(normals[k])
        memory, readings, _ = made.step(memory, SensorInputs(k * DT, state, force, drawn, HOVER), numbers, DT)
        taken.append(readings)
    return taken


@pytest.mark.parametrize(
    ("every", "late"), [(1, 0), (1, 3), (10, 0), (10, 4), (10, 10), (10, 25), (100, 110), (7, 20)]
)
def test_measurements_come_with_their_rate_and_delay_and_say_their_age(every: int, late: int) -> None:
    """The value is the number of the instant at which it was measured, so all of it can be counted."""
    timing = Timing(every, late)
    queue = on_its_way(0.0, timing)
    arrived = []
    for k in range(400):
        queue, reading = arrival(queue, float(k), timing, k * DT, DT)
        assert len(queue) <= timing.pending + 1, "no longer than what is on its way"
        if k >= late:
            assert reading.value == every * ((k - late) // every), k
            assert reading.age == pytest.approx((k - reading.value) * DT, abs=1e-12), k
        if reading.valid:
            arrived.append(k)
    assert arrived == list(range(late, 400, every))


def test_a_single_measurement_is_valid_at_the_start_alone() -> None:
    queue = on_its_way(5.0, Timing(0))
    valid = []
    for k in range(4):
        queue, reading = arrival(queue, float(k), Timing(0), k * DT, DT)
        valid.append(reading.valid)
        assert reading.value == 5.0
    assert valid == [1.0, 0.0, 0.0, 0.0]


def test_beyond_its_range_a_reading_is_cut() -> None:
    fast = STILL._replace(omega_B=Vec3(40.0, -50.0, 3.0))
    last = read(part(SENSORS, "mocap"), [fast, fast], force=Vec3(0.0, -500.0, 9.81))[-1]
    assert isinstance(last.rates, Reading)
    assert isinstance(last.specific_force, Reading)
    end = math.radians(2000.0)
    np.testing.assert_allclose([*last.rates.value], [end, -end, 3.0], rtol=1e-6)
    np.testing.assert_allclose([*last.specific_force.value], [0.0, -16.0 * 9.80665, 9.81], rtol=1e-6)


def test_off_the_centre_of_mass_an_accelerometer_feels_the_turning() -> None:
    """On a circle the acceleration points inwards, r w^2; a spin-up adds r times its derivative along the circle."""
    arm, rate, spin_up = 0.1, 5.0, 20.0
    states = [STILL._replace(omega_B=Vec3(0.0, 0.0, rate + spin_up * DT * k)) for k in range(2)]
    last = read(part(SENSORS, "mocap", imu={"place": (arm, 0.0, 0.0)}), states, force=zeros())[-1]
    assert isinstance(last.specific_force, Reading)
    inwards = -arm * (rate + spin_up * DT) ** 2
    np.testing.assert_allclose([*last.specific_force.value], [inwards, arm * spin_up, 0.0], atol=1e-9)


def test_white_noise_has_the_density_of_the_data_sheet_and_bias_walks() -> None:
    draw = np.random.default_rng(4)
    made = part(SENSORS, "mocap")
    count, flights = 3, 20000
    normals = draw.normal(size=(count, made.normals, flights))
    readings = read(made, [STILL] * count, normals)
    rates = np.array([[*one.rates.value] for one in readings])  # type: ignore[union-attr]
    np.testing.assert_allclose(rates[0].std(axis=1), math.radians(0.0028) / math.sqrt(DT), rtol=0.03)
    walk = part(SENSORS, "mocap", imu={"gyro_noise": 0.0, "gyro_bias_walk": 0.5})
    rates = np.array([[*one.rates.value] for one in read(walk, [STILL] * count, normals)])  # type: ignore[union-attr]
    np.testing.assert_allclose(rates[2].std(axis=1), 0.5 * math.sqrt(2 * DT), rtol=0.03)


def test_rotors_shake_the_gyro_with_their_own_frequency_and_the_amplitude_that_is_asked_for() -> None:
    made = part(SENSORS, "mocap", imu={"gyro_vibration": 0.3})
    rates = np.array([[*one.rates.value] for one in read(made, [STILL] * 4000)])  # type: ignore[union-attr]
    # All rotors at one angle and speed: N sines of amplitude 0.3 / sqrt(N).
    np.testing.assert_allclose(rates.std(axis=0), 0.3 * math.sqrt(4) / math.sqrt(2.0), rtol=0.01)
    strongest = np.fft.rfftfreq(4000, DT)[np.abs(np.fft.rfft(rates[:, 0])).argmax()]
    assert strongest == pytest.approx(HOVER[0] / (2.0 * math.pi), abs=0.3)


def test_a_magnetometer_sees_the_field_in_the_axes_of_the_body() -> None:
    turned = STILL._replace(q_WB=Quat.about_z(math.pi / 2.0))
    last = read(part(SENSORS, "gps-consumer"), [turned])[-1]
    assert isinstance(last.magnetic_field, Reading)
    np.testing.assert_allclose([*last.magnetic_field.value], [0.0, -21.6e-6, -43.3e-6], atol=1e-12)


def test_flow_and_range_of_a_vehicle_that_moves_and_turns_are_those_of_the_geometry() -> None:
    moving = STILL._replace(v_W=Vec3(0.5, -0.2, 0.0), omega_B=Vec3(0.3, 0.1, 0.0), p_W=Vec3(0.0, 0.0, 2.0))
    last = read(part(SENSORS, "crazyflie"), [moving])[-1]
    assert isinstance(last.flow, Reading)
    assert isinstance(last.range, Reading)
    np.testing.assert_allclose([*last.flow.value], [0.25 - 0.1, -0.1 + 0.3])
    assert (last.range.value, last.range.valid) == (2.0, 1.0)
    high = STILL._replace(p_W=Vec3(0.0, 0.0, 5.0))
    last = read(part(SENSORS, "crazyflie"), [high])[-1]
    assert isinstance(last.range, Reading)
    assert last.range.valid == 0.0


def test_rotor_speeds_are_there_if_asked_for() -> None:
    assert read(part(SENSORS, "mocap"), [STILL])[-1].rotor_speeds == ()
    made = part(SENSORS, "mocap", rotor_speeds={"on": True})
    last = read(made, [STILL] * 3)[-1]
    assert isinstance(last.rotor_speeds, Reading)
    assert isinstance(last.rotor_speeds.value, PerRotor)
    np.testing.assert_allclose([*last.rotor_speeds.value], [*HOVER])
    assert isinstance(made.model(CONTEXT).rotor_speeds, SensorNoise)


@pytest.mark.parametrize("kind", ["mocap", "gps-consumer", "crazyflie"])
def test_what_is_believed_names_the_sensors_that_there_are(kind: str) -> None:
    made = part(SENSORS, kind)
    model, readings = made.model(CONTEXT), read(made, [STILL])[-1]
    for name in Readings._fields:
        assert (getattr(model, name) == ()) == (getattr(readings, name) == ()), name
    wider = model.scaled(2.0)
    assert wider.rates.std == 2.0 * model.rates.std
    assert wider.rates.limit == model.rates.limit


def test_rates_and_delays_are_whole_sampling_periods() -> None:
    with pytest.raises(InputError, match=r"sensors.mocap.rate: got 300 Hz, every 3.333 .* such as 250 or 500 Hz$"):
        load_scenario("hover-fault", {"sensors": {"kind": "mocap", "mocap": {"rate": 300}}})
    with pytest.raises(InputError, match=r"sensors.gps.delay_ms: got 5 ms, 2.5 sampling periods of 0.002 s"):
        load_scenario("hover-fault", {"sensors": {"kind": "gps-consumer", "gps": {"delay_ms": 5}}, "period": 0.002})


def test_real_sensors_get_the_filter_and_others_none() -> None:
    """Unless an estimator is named; and what was the default of former sensors does not stay."""
    assert load_scenario("hover-fault").estimator.kind == "direct"  # type: ignore[attr-defined]
    real = load_scenario("hover-fault", {"sensors": "mocap"})
    assert real.estimator.kind == "eskf"  # type: ignore[attr-defined]
    tuned = load_scenario("hover-fault", {"sensors": "mocap", "estimator.start_tilt": 0.1})
    assert tuned.estimator.settings.start_tilt == 0.1  # type: ignore[attr-defined]
    named = load_scenario("hover-fault", {"sensors": "mocap", "estimator": "direct"})
    assert named.estimator.kind == "direct"  # type: ignore[attr-defined]
