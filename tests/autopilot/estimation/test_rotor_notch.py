"""Notches that follow the rotors: against SciPy's, against a wrong belief, and what they are worth to a detector."""

from __future__ import annotations

import math

import numpy as np
import pytest
from gates import needs_simd
from numpy.typing import NDArray
from scipy.signal import iirnotch, lfilter

import rotorfault
from rotorfault.autopilot.estimation import FilterInputs, RotorNotch
from rotorfault.autopilot.estimation.phase_slip import ERRORS, Slip, slipped
from rotorfault.autopilot.estimation.rotor_notch import MEMORY
from rotorfault.autopilot.rotor_model import RotorModel
from rotorfault.maths.geometry import PerRotor, Vec3
from rotorfault.model.block import Context
from rotorfault.model.mixer import hover_thrust
from rotorfault.model.motion import mean_bandwidth
from rotorfault.model.sensor_model import SensorModel, SensorNoise, Timing
from rotorfault.model.signals import Reading, Readings
from rotorfault.model.vehicle import Vehicle, rotor_speeds
from rotorfault.model.vehicle_file import load_vehicle
from rotorfault.scenario.library import load_scenario

Array = NDArray[np.float64]
T = 0.001
SHAKEN = SensorModel(rates=SensorNoise(0.0, vibration=0.3, limit=35.0))


@pytest.fixture
def vehicle() -> Vehicle:
    return load_vehicle("hummingbird").vehicle


def hover_speed(vehicle: Vehicle) -> float:
    return float(rotor_speeds(vehicle, hover_thrust(vehicle))[0])


def passed(
    vehicle: Vehicle,
    x: Array,
    speed: Array,
    sensors: SensorModel = SHAKEN,
    measured: Array | None = None,
    valid: Array | None = None,
    speeds_valid: Array | None = None,
    **settings: float,
) -> tuple[Array, Array]:
    """What comes of rates (n, 3) with believed speeds (n, rotors), and the variance that is said to be left."""
    part = RotorNotch(RotorNotch.Settings(**settings))
    context = Context(vehicle, T, sensors)
    numbers = part.parameters(context._replace(sensors=part.left(sensors, context)))
    hover = hover_thrust(vehicle)
    rotors = RotorModel(hover / vehicle.rotor_gain, hover)
    memory, out, left, before = None, [], [], speed[0]
    for k, (rates, now) in enumerate(zip(x.tolist(), speed, strict=True)):
        readings = Readings(rates=Reading(Vec3(*rates), 1.0 if valid is None else float(valid[k])))
        if measured is not None:
            came = 1.0 if speeds_valid is None else float(speeds_valid[k])
            readings = readings._replace(rotor_speeds=Reading(PerRotor(*measured[k].tolist()), came))
        inputs = FilterInputs(readings, rotors, PerRotor(*now.tolist()), PerRotor(*(now - before).tolist()), vehicle)
        if memory is None:
            memory = part.initial(inputs, numbers)
        memory, given, _ = part.step(memory, inputs, numbers, T)
        assert isinstance(given.rates, Reading)
        out.append([*given.rates.value])
        left.append(given.rates.shaken)
        before = now
    return np.array(out), np.array(left)


def level(vehicle: Vehicle, steps: int, speed: float) -> Array:
    return np.full((steps, vehicle.rotors), speed)


def test_of_rotors_that_turn_alike_it_is_the_notch_of_scipy(vehicle: Vehicle) -> None:
    speed = 1.1 * hover_speed(vehicle)
    x = 1e-4 * np.random.default_rng(1).standard_normal((400, 3))  # so small that the body's spin turns it nowhere
    x[0] = 0.0
    found, _ = passed(vehicle, x, level(vehicle, 400, speed), delay=0.1)
    width = 10.0 * 0.05 * hover_speed(vehicle)  # rad/s: ten times the error of the speed
    # SciPy warps the width, this notch does not.
    hertz = math.atan(0.5 * width * T) / (math.pi * T)
    b, a = iirnotch(speed / (2.0 * math.pi), speed / (2.0 * math.pi) / hertz, 1.0 / T)
    # What is expected follows what is given: y = k + H (x - k), z k = k + c (y - k).
    c = T / (MEMORY + T)
    numerator, denominator = np.convolve(b, [1.0, c - 1.0]), np.convolve(a, [1.0, -1.0]) + c * np.append(0.0, b)
    np.testing.assert_allclose(found, lfilter(numerator, denominator, x, axis=0), atol=1e-10)


def test_what_rotors_shake_is_gone_at_any_speeds_and_beyond_half_the_sampling_rate(vehicle: Vehicle) -> None:
    time, rng = T * np.arange(3000), np.random.default_rng(2)
    for base in (hover_speed(vehicle), 4300.0):  # 684 Hz, seen at 316 Hz
        speed = base * (1.0 + np.array([-0.08, -0.01, 0.01, 0.1]) + 0.05 * np.sin(3.0 * time)[:, None])
        phase = rng.uniform(0, 6, 4) + np.cumsum(speed, axis=0) * T
        shaken = ((speed / base) ** 2 * np.sin(phase)).sum(axis=1) * 0.15
        found, _ = passed(vehicle, shaken[:, None] * [1.0, -0.5, 2.0], speed, delay=0.1)
        assert found[1500:, 0].std() < 0.06 * shaken.std()


def test_a_wrong_speed_leaves_what_is_computed_of_it(vehicle: Vehicle) -> None:
    speed = hover_speed(vehicle)
    shaken = 0.3 * np.sin(1.05 * speed * T * np.arange(2000))
    found, _ = passed(vehicle, shaken[:, None] * np.ones(3), level(vehicle, 2000, speed), delay=0.1)
    seen = math.sqrt(2.0) * float(found[1000:].std())
    part, context = RotorNotch(RotorNotch.Settings(delay=0.1)), Context(vehicle, T)
    after = part.left(SHAKEN, context).rates
    assert isinstance(after, SensorNoise)
    assert after.vibration == pytest.approx(0.3 / math.hypot(5.0, 1.0))
    assert seen == pytest.approx(float(after.vibration), rel=0.06)  # the formula is that of narrow notches
    # Speeds that are measured are better than those that are believed.
    right = level(vehicle, 2000, 1.05 * speed)
    known = SHAKEN._replace(rotor_speeds=SensorNoise(5.0))
    found, _ = passed(vehicle, shaken[:, None] * np.ones(3), level(vehicle, 2000, speed), known, right)
    assert found[1000:].std() < 0.01 * shaken.std()


def test_slow_signals_come_no_later_than_was_said(vehicle: Vehicle) -> None:
    ramp = 2.0 * T * np.arange(1500)[:, None] * np.ones(3)
    for share in (1.0, 0.5, 0.1, 0.0):
        found, _ = passed(vehicle, ramp, level(vehicle, 1500, share * hover_speed(vehicle)))
        late = (ramp - found)[-200:].mean() / 2.0
        assert -1e-6 < late < 0.00101, share
    # One rotor whose alias is at rest.
    found, _ = passed(vehicle, ramp, level(vehicle, 1500, 2.0 * math.pi / T))
    np.testing.assert_allclose(found, ramp, atol=1e-9)


def test_what_is_left_is_said_at_the_start_and_while_speeds_change(vehicle: Vehicle) -> None:
    speed = level(vehicle, 1500, hover_speed(vehicle))
    speed[1000:1030] *= np.linspace(1.0, 1.4, 30)[:, None]
    speed[1030:] *= 1.4
    _, left = passed(vehicle, np.zeros((1500, 3)), speed)
    assert left[0] == pytest.approx(0.5 * 0.3**2, rel=0.1)
    assert left[900] < 0.01 * left[0]
    assert left[1030] > 0.3 * left[0]
    assert left[-1] < 0.01 * left[0]


def test_a_brake_with_a_wrong_lag_leaves_what_is_said(vehicle: Vehicle) -> None:
    """Rotors slow down to a third of the thrust, later than believed: the learned vibration is at a wrong phase."""
    error, lag, hover, flights = 0.3, 1.0 / mean_bandwidth(vehicle), hover_speed(vehicle), 64
    phase = np.random.default_rng(4).uniform(0.0, 2.0 * math.pi, (vehicle.rotors, flights))
    part, context = RotorNotch(RotorNotch.Settings(lag_error=error)), Context(vehicle, T, SHAKEN)
    numbers = part.parameters(context)
    rotors = RotorModel(hover_thrust(vehicle) / vehicle.rotor_gain, hover_thrust(vehicle))
    memory, believed, true, before, seen, said = None, 1.0, 1.0, hover, [], []
    for k in range(900):
        given = 1.0 / 3.0 if 700 <= k < 850 else 1.0
        # A quarter of a turn apart, as the inertial unit has them, so that their mean square is even.
        x, y = (0.3 / math.sqrt(vehicle.rotors) * true * f(phase).sum(axis=0) for f in (np.sin, np.cos))
        phase = phase + math.sqrt(true) * hover * T
        now = math.sqrt(believed) * hover
        speed, sped = PerRotor.all(now, vehicle.rotors), PerRotor.all(now - before, vehicle.rotors)
        inputs = FilterInputs(Readings(rates=Reading(Vec3(x, y, x))), rotors, speed, sped, vehicle)
        memory = part.initial(inputs, numbers) if memory is None else memory
        memory, filtered, _ = part.step(memory, inputs, numbers, T)
        assert isinstance(filtered.rates, Reading)
        seen.append(0.5 * (np.mean(filtered.rates.value.x**2) + np.mean(filtered.rates.value.y**2)))
        said.append(filtered.rates.shaken)
        before = now
        believed = given + (believed - given) * math.exp(-T / lag)
        true = given + (true - given) * math.exp(-T / (lag * (1.0 + error)))
    for first in range(705, 900, 15):
        here = slice(first, first + 15)
        assert np.mean(seen[here]) < 1.15 * np.mean(said[here]), first
    # In the first half of the brake nothing is learned anew, and it is as much as that.
    assert np.mean(seen[710:740]) > 0.4 * np.mean(said[710:740])
    assert max(said[700:]) > 0.05 * 0.3**2 > 50.0 * said[690], "it is much, and nothing before"


def test_a_slip_that_comes_back_is_none(vehicle: Vehicle) -> None:
    fast, none = PerRotor.all(1.0, 4), PerRotor.all(0.0, 4)
    hover, late = PerRotor.all(1050.0, 4), PerRotor.all(0.05, 4)
    slip = Slip(none, ((fast, none),) * len(ERRORS))
    shares = []
    for behind in [late] * 400 + [-late] * 400:
        slip, left = slipped(slip, fast, behind, hover, none, 0.3, T)
        shares.append(left)
    # 0.4 s of 1050 rad/s by half of 0.3 times 0.05 are half a turn.
    assert max(shares) == pytest.approx(4.0, abs=0.2), "half a turn doubles the vibration"
    assert shares[-1] == pytest.approx(0.0, abs=2e-3)


def test_speeds_that_drop_out_are_those_believed(vehicle: Vehicle) -> None:
    """A reading that drops out keeps its value and looks as if it were new."""
    hover, steps = hover_speed(vehicle), 800
    speed = level(vehicle, steps, hover)
    speed[300:] *= 1.2
    shaken = 0.3 * np.sin(np.cumsum(speed[:, 0]) * T)[:, None] * np.ones(3)
    known = SHAKEN._replace(rotor_speeds=SensorNoise(5.0, Timing(2, 2)))
    stale, valid = level(vehicle, steps, hover), np.arange(steps) % 2 == 0
    valid[290:] = False
    found, said = passed(vehicle, shaken, speed, known, stale, speeds_valid=valid)
    assert np.abs(found[700:]).max() < 0.02 * 0.3
    assert said[301] > 3.0 * said[280], "what is believed may lag"
    # As long as they come they are taken, whatever is believed.
    right = passed(
        vehicle, shaken, level(vehicle, steps, hover), known, speed, speeds_valid=np.arange(steps) % 2 == 0
    )
    assert np.abs(right[0][700:]).max() < 0.02 * 0.3


def test_what_the_rotors_reaction_turns_is_expected(vehicle: Vehicle) -> None:
    """Two pairs that change their speeds against each other turn the body at once: that is no vibration."""
    steps, signs = 300, np.array([*vehicle.rotor_yaw_sign])
    speed = level(vehicle, steps, hover_speed(vehicle))
    change = np.clip(np.arange(steps) - 200, 0, 20)[:, None] * 2.0 * signs
    turned = vehicle.rotor_inertia / vehicle.inertia.z * (change * signs).sum(axis=1)
    found, _ = passed(vehicle, turned[:, None] * [0.0, 0.0, 1.0], speed + change)
    assert turned.max() > 0.05
    np.testing.assert_allclose(found[:, 2], turned, atol=0.01 * turned.max())


def test_the_end_of_the_range_passes_and_what_is_not_new_stays(vehicle: Vehicle) -> None:
    x = 0.3 * np.sin(hover_speed(vehicle) * T * np.arange(600))[:, None] * np.ones(3)
    x[300:320] = 35.0
    valid = np.ones(600)
    valid[400:410] = 0.0
    found, _ = passed(vehicle, x, level(vehicle, 600, hover_speed(vehicle)), valid=valid)
    np.testing.assert_array_equal(found[300:320], 35.0)
    assert np.abs(found[320:]).max() < 0.05, "of the end nothing was learned"
    np.testing.assert_array_equal(found[400:410], np.broadcast_to(found[399], (10, 3)))


def test_readings_that_come_rarely_are_filtered_as_they_come(vehicle: Vehicle) -> None:
    speed, every = hover_speed(vehicle), 2
    x = 0.3 * np.sin(speed * T * np.arange(3000))[:, None] * np.ones(3)
    valid = (np.arange(3000) % every == 0).astype(float)
    rare = SensorModel(rates=SensorNoise(0.0, Timing(every), vibration=0.3, limit=35.0))
    found, _ = passed(vehicle, x, level(vehicle, 3000, speed), rare, valid=valid)
    assert np.abs(found[1000:]).max() < 0.003


def test_where_nothing_vibrates_readings_are_what_they_were(vehicle: Vehicle) -> None:
    x = np.random.default_rng(3).standard_normal((50, 3))
    still = SensorModel(rates=SensorNoise(0.1, limit=35.0))
    found, left = passed(vehicle, x, level(vehicle, 50, hover_speed(vehicle)), still)
    np.testing.assert_allclose(found, x, atol=1e-14)
    assert not left.any()


def test_sensors_with_an_inertial_unit_ask_for_it() -> None:
    kinds = {
        name: load_scenario("hover-fault", {"sensors": name}).imu_filter.kind
        for name in ("ideal", "noisy", "mocap", "gps-consumer", "crazyflie")
    }
    assert list(kinds.values()) == ["off", "off", "rotor_notch", "rotor_notch", "rotor_notch"]
    assert load_scenario("hover-fault", {"sensors": "mocap", "imu_filter": "off"}).imu_filter.kind == "off"


@needs_simd
def test_vibration_raises_no_alarm_and_delays_no_find() -> None:
    """Without any filter these losses are found after 60 ms, without vibration after 26 ms."""
    flown = load_scenario(
        "hover-fault",
        {
            "vehicle": "hummingbird",
            "controller.preset": "gentle",
            "duration": 1.7,
            "sensors": {"kind": "mocap", "imu": {"gyro_vibration": 0.3, "accelerometer_vibration": 5.0}},
            "diagnosis": "multiple_model",
            "fault": [{"kind": "step", "rotor": 2, "time": 1.5, "loss": 0.25}],
        },
    )
    table = rotorfault.fly_many(flown, {"seed": list(range(8))}, warn=False).table
    assert not table["false_alarms"].any()
    assert np.max(table["detected.2"]) - 1.5 < 0.05
