"""Sensors: what they give of the truth, how noisy, and how late."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from plant_flights import T, array, part

from rotorfault.base.errors import InputError
from rotorfault.engine import load_engine
from rotorfault.engine.batch import no_watch
from rotorfault.flight.assembly import assemble
from rotorfault.maths.geometry import Vec3, zeros
from rotorfault.maths.records import flatten
from rotorfault.maths.rotation import Quat
from rotorfault.model.block import Context, Nothing
from rotorfault.model.signals import Reading, Readings, State
from rotorfault.model.vehicle_file import load_vehicle
from rotorfault.plant import SENSORS
from rotorfault.plant.sensors import SensorInputs
from rotorfault.scenario.scenario import Scenario, scenario_from

CONTEXT = Context(load_vehicle("paper").vehicle, T)
STATE = State(Vec3(1.0, 2.0, 3.0), Vec3(4.0, 5.0, 6.0), Quat.from_euler(Vec3(0.1, 0.2, 0.3)), Vec3(7.0, 8.0, 9.0))
STILL = State(zeros(), zeros(), Quat.identity(), zeros())
FORCE = Vec3(0.5, -0.4, 9.9)
SPREADS = {"position": 0.1, "velocity": 0.2, "attitude": 0.001, "rate": 0.4}


def inputs(state: State = STATE, normals: Any = (0.0,) * 12, force: Vec3 = FORCE, time: float = 0.0) -> SensorInputs:
    return SensorInputs(time, state, force, tuple(normals))


def noisy(**settings: Any) -> Any:
    return part(SENSORS, "noisy", **settings)


def read(sensors: Any, given: list[SensorInputs], dt: float = T) -> list[Readings]:
    """Readings of consecutive instants from the first one on, as the loop takes them."""
    numbers = sensors.parameters(CONTEXT)
    memory = sensors.initial(given[0], numbers)
    taken = []
    for one in given:
        memory, readings, telemetry = sensors.step(memory, one, numbers, dt)
        assert telemetry == Nothing()
        taken.append(readings)
    return taken


def values(readings: Readings) -> tuple[Any, ...]:
    return tuple(reading.value for reading in readings if isinstance(reading, Reading))


# -------------------------------------------------------------------------------------------------------------- ideal


def test_ideal_sensors_give_the_truth_at_once() -> None:
    (readings,) = read(part(SENSORS, "ideal"), [inputs(normals=())])
    assert values(readings) == (*STATE, FORCE)
    assert all((reading.valid, reading.age) == (1.0, 0.0) for reading in readings[:5])  # type: ignore[union-attr]
    ideal = SENSORS.registry["ideal"]
    assert (ideal.normals, ideal.first_normals) == (0, None)  # type: ignore[attr-defined]


# -------------------------------------------------------------------------------------------------------------- noise


def test_without_noise_noisy_sensors_give_the_truth() -> None:
    (readings,) = read(noisy(**SPREADS), [inputs()])
    np.testing.assert_allclose(array(values(readings)), array((*STATE, FORCE)), rtol=0, atol=1e-15)
    assert all((reading.valid, reading.age) == (1.0, 0.0) for reading in readings[:5])  # type: ignore[union-attr]


def test_each_number_goes_to_one_component_times_its_standard_deviation() -> None:
    """In the order position, velocity, attitude, rates; the last a rotation about the axes of the body."""
    assert SENSORS.registry["noisy"].normals == 12  # type: ignore[attr-defined]
    normals = np.arange(1.0, 13.0)
    (readings,) = read(noisy(**SPREADS), [inputs(normals=normals)])
    position, velocity, attitude, rates, force = values(readings)
    found = [
        *(position - STATE.p_W), *(velocity - STATE.v_W), *(STATE.q_WB.conjugate() @ attitude).rotation_vector(),
        *(rates - STATE.omega_B),
    ]  # fmt: skip
    expected = normals * np.repeat(list(SPREADS.values()), 3)
    np.testing.assert_allclose(found, expected, rtol=1e-4)  # a small rotation is short by its cube over 12
    np.testing.assert_allclose(np.delete(found, slice(6, 9)), np.delete(expected, slice(6, 9)), atol=1e-14)
    assert force == FORCE
    assert attitude.dot(attitude) == pytest.approx(1.0, abs=1e-14)


def test_attitude_noise_is_alike_at_any_attitude() -> None:
    """Noise on angles would be singular with the nose down, and turn by much more than it says."""
    normals = np.zeros(12)
    normals[6:9] = 1.0, -2.0, 0.5
    for euler in (zeros(), Vec3(0.3, -0.5, 2.0), Vec3(0.0, 1.5707, 0.0), Vec3(3.0, 0.1, -1.0)):
        q = Quat.from_euler(euler)
        (readings,) = read(noisy(attitude=0.01), [inputs(STATE._replace(q_WB=q), normals)])
        turned = (q.conjugate() @ readings.attitude.value).rotation_vector()  # type: ignore[union-attr]
        np.testing.assert_allclose(array(turned), [0.01, -0.02, 0.005], rtol=1e-3)


def test_noise_has_the_stated_spread() -> None:
    draws = np.random.default_rng(7).normal(size=(12, 20000))
    (readings,) = read(noisy(), [inputs(STILL, draws)])
    position, velocity, attitude, rates, _ = values(readings)
    seen = [*flatten((position, velocity)), *flatten(attitude.rotation_vector()), *flatten(rates)]
    np.testing.assert_allclose(np.std(seen, axis=1), np.repeat([0.005, 0.01, 0.002, 0.005], 3), rtol=0.03)


# -------------------------------------------------------------------------------------------------------------- delay


def moving(count: int) -> list[SensorInputs]:
    """Everything changes from instant to instant: truth, force and noise."""
    draw = np.random.default_rng(3)
    return [
        inputs(
            State(
                Vec3(k, -k, 2 * k), Vec3(1 + k, 0.0, k), Quat.from_euler(Vec3(0.1 * k, 0.05 * k, -k)), Vec3(k, k, 5)
            ),
            draw.normal(size=12),
            Vec3(0.0, k, 9.0),
            k * T,
        )
        for k in range(count)
    ]


@pytest.mark.parametrize("delay", [1, 3, 7])
def test_late_readings_are_those_of_that_many_periods_before(delay: int) -> None:
    """Noise included: it belongs to the measurement. Before there was one, it is the first."""
    given = moving(12)
    prompt, late = read(noisy(**SPREADS), given), read(noisy(**SPREADS, delay=delay), given)
    for k, readings in enumerate(late):
        assert values(readings) == values(prompt[max(k - delay, 0)]), k
    assert len({repr(values(readings)) for readings in prompt}) == 12


@pytest.mark.parametrize(("delay", "dt"), [(0, 0.005), (1, 0.005), (4, 0.002)])
def test_readings_say_how_old_they_are(delay: int, dt: float) -> None:
    for readings in read(noisy(delay=delay), moving(6), dt):
        for name in Readings._fields[:5]:
            reading = getattr(readings, name)
            assert reading.age == pytest.approx(delay * dt, abs=1e-15), name
            assert reading.valid == 1.0, name


def test_memory_is_as_long_as_the_delay_and_keeps_its_shape() -> None:
    given = moving(3)
    for delay, leaves in ((0, 0), (1, 16), (5, 80)):
        sensors = noisy(delay=delay)
        numbers = sensors.parameters(CONTEXT)
        memory = sensors.initial(given[0], numbers)
        after = sensors.step(memory, given[1], numbers, T)[0]
        assert len(flatten(memory)) == len(flatten(after)) == leaves


def test_spreads_may_differ_between_the_flights_of_a_batch() -> None:
    numbers = noisy().parameters(CONTEXT)._replace(position=np.array([0.0, 1.0, 2.0]))
    normals = [*([0.5] * 3), *([0.0] * 9)]
    readings = noisy().step(noisy().initial(inputs(), numbers), inputs(normals=normals), numbers, T)[1]
    np.testing.assert_allclose(readings.position.value.x, [1.0, 1.5, 2.0])


@pytest.mark.parametrize(
    ("key", "value"), [("position", -0.1), ("attitude", -1.0), ("rate", float("nan")), ("delay", -1), ("delay", 101)]
)
def test_wrong_settings_are_refused_with_their_key(key: str, value: float) -> None:
    with pytest.raises(InputError, match=rf"^test: sensors\.{key}: "):
        short(sensors={"kind": "noisy", key: value})


# ---------------------------------------------------------------------------------------------------------- in flight


def short(**tables: Any) -> Scenario:
    given = {
        "name": "short",
        "vehicle": "paper",
        "duration": 0.2,
        "period": 0.005,
        "step": 0.005,
        "seed": 3,
        "reference": {"kind": "set_point", "position": [0.2, -0.1, 0.3]},
        "controller": {"kind": "smc", "preset": "none"},
    }
    return scenario_from(given | tables, "test")


def rows(scenario: Scenario, *names: str) -> Any:
    batch = assemble(scenario)
    layout, signals = batch.loop.layout, load_engine("python")(batch, no_watch).signals[:, :, 0]
    return [signals[:, layout.place(name)] for name in names]


def test_the_autopilot_sees_the_truth_of_as_many_periods_before() -> None:
    sensors = {"kind": "noisy", "position": 0.0, "velocity": 0.0, "attitude": 0.0, "rate": 0.0, "delay": 3}
    for true, estimated in (("position", "position_estimated"), ("quaternion", "quaternion_estimated")):
        truth, estimate = rows(short(sensors=sensors), true, estimated)
        np.testing.assert_allclose(estimate[3:], truth[:-3], rtol=0, atol=1e-14)
        np.testing.assert_allclose(estimate[:3], truth[[0, 0, 0]], rtol=0, atol=1e-14)
        assert np.abs(truth[-1] - truth[-4]).max() > 1e-4


def test_what_is_estimated_is_the_truth_plus_noise_of_the_stated_size() -> None:
    truth, estimate = rows(short(sensors="noisy", duration=2.0), "position", "position_estimated")
    error = estimate - truth
    np.testing.assert_allclose(error.std(axis=0), 0.005, rtol=0.15)
    assert np.abs(error.mean(axis=0)).max() < 4.0 * 0.005 / np.sqrt(len(error))
