"""What an engine records, and how flights and batches end."""

from __future__ import annotations

import numpy as np
import pytest
from engine_flights import POSITION, every_engine, run, set_chunk, short

from rotorfault.engine import ENGINES, have_simd
from rotorfault.flight.assembly import assemble, assemble_all
from rotorfault.maths.records import leaf_names

CHUNK = 60  # steps in these tests: how many there are changes nothing but when an engine looks about


@pytest.fixture(autouse=True)
def short_chunks(monkeypatch: pytest.MonkeyPatch) -> None:
    set_chunk(monkeypatch, CHUNK)


def test_only_wanted_signals_are_recorded() -> None:
    batch = assemble(short())
    for engine in ENGINES:
        if engine == "simd" and not have_simd():
            continue
        full = run(batch, engine)
        some = run(batch._replace(wanted=(2, 0, 50)), engine)
        np.testing.assert_array_equal(some.signals, full.signals[:, [2, 0, 50]])


@every_engine
def test_only_every_tenth_step_is_recorded(engine: str) -> None:
    full, thin = run(short(), engine), run(short(record_period=0.05), engine)
    assert full.steps.tolist() == list(range(60))
    assert thin.steps.tolist() == [0, 10, 20, 30, 40, 50]
    np.testing.assert_array_equal(thin.signals, full.signals[::10])


@every_engine
def test_records_cross_chunks(engine: str) -> None:
    """7 divides no chunk: the count of steps goes on, it does not begin anew."""
    thin = run(short(duration=0.005 * (CHUNK + 60), record_period=0.035), engine)
    assert thin.steps.tolist() == list(range(0, CHUNK + 60, 7))


@every_engine
def test_a_watch_ends_a_batch(engine: str) -> None:
    seen: list[int] = []

    def watch(done: int) -> bool:
        seen.append(done)
        return done >= CHUNK

    recording = run(short(duration=0.005 * 3 * CHUNK, record_period=0.01), engine, watch)
    assert seen == [CHUNK]
    assert len(recording.steps) == len(recording.signals) == CHUNK // 2
    assert not recording.interrupted


@every_engine
def test_an_interrupted_flight_keeps_what_it_has(engine: str) -> None:
    def watch(done: int) -> bool:
        raise KeyboardInterrupt

    batch = assemble(short(duration=0.005 * 2 * CHUNK))
    recording = run(batch, engine, watch)
    assert recording.interrupted
    assert len(recording.steps) == len(recording.signals) == CHUNK
    names = leaf_names(batch.state)
    assert recording.state[names.index("steps"), 0] == recording.state[names.index("scores.seen"), 0] == CHUNK


@every_engine
def test_a_lost_flight_is_data(engine: str) -> None:
    """A vehicle without mass has no numbers; its neighbours fly on, unchanged to the last bit."""
    good = short(sensors="ideal")
    batch = assemble_all([good, good])
    # Mass is a row of the parameters like any other.
    vehicle = batch.parameters.vehicle
    dead = batch.parameters._replace(vehicle=vehicle._replace(mass=np.array([0.0, vehicle.mass[1]])))
    signals = run(batch._replace(parameters=dead), engine).signals
    assert not np.isfinite(signals[-1, POSITION, 0]).any()
    np.testing.assert_array_equal(signals[:, :, 1], run(good, engine).signals[:, :, 0])


@every_engine
def test_records_end_with_the_flight_and_not_with_the_chunk(engine: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """The last record of a flight is the first one from its end on, whenever the engine notices the end."""
    falling = [
        short(
            duration=1.25, record_period=0.035, sensors="ideal", diagnosis="off", fault=[fault], plant="paper_model"
        )
        for fault in (
            {"kind": "step", "rotor": 2, "time": 0.02, "loss": 1.0},
            {"kind": "step", "rotor": 2, "time": 0.25, "loss": 1.0},
        )
    ]
    both = run(assemble_all(falling), engine)
    names = leaf_names(assemble(falling[0]).state)
    ends = both.state[names.index("scores.end")]
    assert (both.state[names.index("scores.over")] != 0.0).all()
    last = np.ceil(ends / 7).astype(int)
    assert ends[0] < CHUNK < ends[1]
    assert last[0] < last[1] == len(both.steps) - 1
    assert np.isfinite(both.signals[: last[0] + 1, :, 0]).all()
    assert np.isnan(both.signals[last[0] + 1 :, :, 0]).all()
    for i, scenario in enumerate(falling):
        alone = run(scenario, engine)
        assert len(alone.steps) == last[i] + 1
        np.testing.assert_array_equal(alone.signals[:, :, 0], both.signals[: last[i] + 1, :, i])
    set_chunk(monkeypatch, 13)
    np.testing.assert_array_equal(run(assemble_all(falling), engine).signals, both.signals)


@every_engine
def test_an_end_between_two_records_far_apart_is_recorded(engine: str) -> None:
    """The engine flies on until the record, though nothing else is left to fly for."""
    fault = {"kind": "step", "rotor": 2, "time": 0.02, "loss": 1.0}
    batch = assemble(
        short(
            duration=0.005 * 3 * CHUNK,
            record_period=0.005 * (CHUNK + 3),
            fault=[fault],
            plant="paper_model",
            diagnosis="off",
        )
    )
    found = run(batch, engine)
    assert 0 < found.state[leaf_names(batch.state).index("scores.end"), 0] < CHUNK
    assert found.steps.tolist() == [0.0, CHUNK + 3.0]
