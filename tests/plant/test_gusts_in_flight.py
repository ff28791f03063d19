"""Gusts in flight: the same in every batch and engine, moved on once a period, with random numbers of their own."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from gates import needs_simd
from numpy.typing import NDArray

from rotorfault.base.errors import InputError
from rotorfault.engine import load_engine
from rotorfault.engine.batch import CHUNK, drive_rows, no_watch, streams_of
from rotorfault.engine.noise import Noise, Stream
from rotorfault.engine.structure import structure
from rotorfault.flight.assembly import assemble, assemble_all
from rotorfault.maths.geometry import zeros
from rotorfault.maths.records import flatten
from rotorfault.model.signals import Command
from rotorfault.plant import SENSORS, WIND
from rotorfault.plant.plant import Held
from rotorfault.plant.timed import TimeInputs
from rotorfault.scenario.scenario import Scenario, scenario_from

Array = NDArray[np.float64]
GUSTS, FIRST_GUST = Stream(3, WIND.streams[0]), Stream(6, WIND.streams[1])
SENSOR_NOISE = Stream(12, SENSORS.streams[0])


def short(**tables: Any) -> Scenario:
    return scenario_from(
        {
            "name": "gusty",
            "vehicle": "paper",
            "duration": 0.2,
            "period": 0.005,
            "step": 0.005,
            "seed": 7,
            "reference": {"kind": "set_point", "position": [0.2, -0.1, 0.3]},
            "controller": {"kind": "smc", "preset": "none"},
            "fault": [{"kind": "step", "rotor": 2, "time": 0.1, "loss": 0.2}],
            "wind": {"kind": "dryden", "wind_at_6m": 15.0, "altitude": 5.0},
        }
        | tables,
        "test",
    )


def run(flown: Scenario, engine: str) -> Array:
    return load_engine(engine)(assemble(flown), no_watch).signals[:, :, 0]


LAYOUT = assemble(short()).loop.layout
AIR = LAYOUT.place("wind")


def test_without_intensity_it_is_the_constant_wind() -> None:
    """Exactly, flown in closed loop."""
    still = {"kind": "dryden", "velocity_W": [2.0, -1.0, 0.3], "wind_at_6m": 0.0}
    steady = {"kind": "constant", "velocity_W": [2.0, -1.0, 0.3]}
    np.testing.assert_array_equal(run(short(wind=still), "python"), run(short(wind=steady), "python"))


@pytest.mark.parametrize("sensors", ["ideal", "noisy"])
@pytest.mark.parametrize("engine", [pytest.param("simd", marks=needs_simd), "numpy", "python"])
def test_a_flight_does_not_depend_on_its_batch(engine: str, sensors: str) -> None:
    base = short(sensors=sensors)
    alone = run(base, engine)
    others = [
        short(sensors=sensors, seed=k, wind={"kind": "dryden", "altitude": 3.0 + k, "velocity_W": [k, 1.0, 0.0]})
        for k in (1, 2, 3, 4)
    ]
    together = load_engine(engine)(assemble_all([*others[:2], base, *others[2:]]), no_watch).signals
    np.testing.assert_array_equal(together[:, :, 2], alone)
    assert np.isfinite(together).all()
    assert all(np.abs(together[:, AIR, k] - alone[:, AIR]).max() > 0.1 for k in (0, 1, 3, 4))


@needs_simd
@pytest.mark.parametrize("step", [0.005, 0.0025, 0.001])
def test_compiled_it_is_the_same_flight(step: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """One function for the period, or two where it has many integration steps; over more than one chunk of noise."""
    for engine in ("batch", "simd"):
        monkeypatch.setattr(f"rotorfault.engine.{engine}.CHUNK", 50)
    flown = short(step=step, duration=0.005 * 120, sensors="noisy", fault=[])
    found, wanted = run(flown, "simd"), run(flown, "python")
    size = np.maximum(1.0, np.abs(wanted).max(axis=0))
    worst = (np.abs(found - wanted) / size).max(axis=0)
    assert worst[:3].max() <= 1e-9
    assert worst[AIR].max() <= 1e-9
    assert worst.max() <= 5e-9, LAYOUT.rows[int(np.argmax(worst))]


@pytest.mark.parametrize("engine", [pytest.param("simd", marks=needs_simd), "python"])
def test_the_air_moves_on_once_in_a_sampling_period(engine: str) -> None:
    """However many integration steps there are in it."""
    winds = [run(short(step=0.005 / n, duration=0.1), engine)[:, AIR] for n in (1, 2, 5)]
    np.testing.assert_allclose(winds[0], winds[1], rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(winds[0], winds[2], rtol=0.0, atol=1e-12)
    assert (np.abs(np.diff(winds[0], axis=0)) > 0.0).all()


def test_the_recorded_wind_is_the_block_stepped_by_hand() -> None:
    flown = short(duration=0.1)
    batch = assemble(flown)
    wind, numbers = batch.loop[WIND], batch.parameters.parts.wind
    first = Noise(batch.seeds, FIRST_GUST).draw(1)[0, :, 0].tolist()
    memory = wind.initial(TimeInputs(0.0, tuple(first)), numbers)
    # A flight begins on arrays, whose exponential may differ from that of floats in the last bit.
    assert flatten(memory) == pytest.approx(flatten(batch.state.truth.wind), rel=1e-12)
    memory = batch.state.truth.wind
    found = run(flown, "python")[:, AIR]
    for k, normals in enumerate(Noise(batch.seeds, GUSTS).draw(20)[:, :, 0].tolist()):
        memory, air, _ = wind.step(memory, TimeInputs(0.005 * k, tuple(normals)), numbers, 0.005)
        assert found[k].tolist() == flatten(air.velocity_W) == flatten(wind.at(0.0, memory, numbers).velocity_W)


def test_gusts_push_by_drag() -> None:
    """Level in hover, velocity approaches that of the air with the rate k_d/m, period by period."""
    batch = assemble(short(fault=[]))
    plant, numbers, T = batch.loop.plant, batch.loop.plant_numbers(batch.parameters), 0.005
    rate = numbers.vehicle.linear_drag / numbers.vehicle.mass
    state, memory, v = batch.state.plant, batch.state.truth.wind, np.zeros(3)
    hover = Command(state.rotors, zeros())
    for k in range(20):
        memory, blown, _ = plant.wind.step(memory, TimeInputs(k * T, (0.3, -1.0, 0.5)), numbers.wind, T)
        held = Held(memory, ())
        assert plant.observe(state, held, blown, k * T, numbers).air == blown
        air = np.array(flatten(blown.velocity_W))
        v = air + (v - air) * math.exp(-rate * T)
        state = plant.step(state, hover, held, k * T, numbers, T)
    np.testing.assert_allclose(flatten(plant.model.observe(state.body).v_W), v, atol=1e-9)
    assert np.abs(v).min() > 1e-3


# ------------------------------------------------------------------------------------------------ streams of numbers


def rows_of(**tables: Any) -> Array:
    return np.concatenate([rows for _, rows in drive_rows(assemble(short(duration=0.005 * (CHUNK + 9), **tables)))])


def test_gusts_and_sensor_noise_leave_each_other_alone() -> None:
    """Each has its rows only where it is there, and the same numbers whatever else there is."""
    none = rows_of(wind="none")
    gusts, noise, both = rows_of(), rows_of(wind="none", sensors="noisy"), rows_of(sensors="noisy")
    assert [rows.shape[1] for rows in (none, gusts, noise, both)] == [12, 15, 24, 27]
    np.testing.assert_array_equal(both[:, :15], gusts)
    np.testing.assert_array_equal(both[:, 15:], noise[:, 12:])
    assert streams_of(assemble(short(sensors="noisy"))) == {"wind": GUSTS, "sensors": SENSOR_NOISE}
    np.testing.assert_array_equal(run(short(sensors="noisy"), "python")[:, AIR], run(short(), "python")[:, AIR])


def test_sensor_noise_has_no_words_but_seed_and_index() -> None:
    wanted = Noise(((7, 4711),), SENSOR_NOISE).draw(30)[:, :, 0]
    np.testing.assert_array_equal(Noise(((8, 0), (7, 4711)), SENSOR_NOISE).draw(30)[:, :, 1], wanted)
    assert np.abs(Noise(((7, 4711),), GUSTS).draw(30)[:, :, 0] - wanted[:, :3]).min() > 1e-6


def test_streams_are_independent() -> None:
    """Of one flight, and of flights whose seeds are near: no two streams share numbers."""
    seeds = ((7, 0), (7, 1), (8, 0), (2**33 + 7, 0))
    count = 6000
    drawn = [Noise(seeds, stream).draw(count // stream.width) for stream in (SENSOR_NOISE, GUSTS, FIRST_GUST)]
    columns = np.concatenate([part.reshape(count, len(seeds)).T for part in drawn])
    assert np.abs(np.corrcoef(columns) - np.eye(len(columns))).max() < 5.0 / math.sqrt(count)
    pieces = Noise(seeds, GUSTS)
    again = np.concatenate([pieces.draw(1), pieces.draw(29)])
    np.testing.assert_array_equal(again, Noise(seeds, GUSTS).draw(30))


def test_a_wind_without_memory_has_no_place_in_the_state() -> None:
    for kind in ("none", "constant", "paper"):
        state = assemble(short(wind=kind)).state
        assert flatten(state.truth.wind) == []
    gusty = assemble(short())
    assert len(flatten(gusty.state)) == len(flatten(state)) + 5
    assert structure(gusty.loop) == structure(assemble(short(seed=9)).loop)


# ------------------------------------------------------------------------------------------------- settings refused


@pytest.mark.parametrize(
    ("key", "value", "words"),
    [
        ("altitude", 2.0, "greater than or equal to 3.048; got 2.0"),
        ("altitude", 400.0, "less than or equal to 304.8; got 400.0"),
        ("wind_at_6m", -1.0, "greater than or equal to 0; got -1.0"),
        ("airspeed_min", 0.0, "greater than or equal to 0.1; got 0.0"),
        ("airspeed_min", math.nan, "finite"),
        ("heigth", 5.0, "unknown key"),
    ],
)
def test_bad_settings_are_refused_in_one_line(key: str, value: float, words: str) -> None:
    with pytest.raises(InputError, match=words) as error:
        short(wind={"kind": "dryden", key: value})
    message = str(error.value)
    assert message.startswith(f"test: wind.{key}: ")
    assert "\n" not in message
