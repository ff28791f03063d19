"""A flight has the same numbers alone and in any batch, on any threads, whatever is recorded."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from engine_flights import Array, every_engine, faulty_case_one, run, short

from rotorfault.base.errors import InputError
from rotorfault.engine import cache
from rotorfault.engine.batch import CHUNK, Batch, Recording
from rotorfault.engine.noise import Noise, Stream
from rotorfault.flight.assembly import assemble_all
from rotorfault.maths.records import leaf_names
from rotorfault.scenario.neighbours import neighbour
from rotorfault.scenario.scenario import scenario_from


@every_engine
@pytest.mark.parametrize("sensors", ["ideal", "noisy"])
def test_a_flight_does_not_depend_on_its_batch(engine: str, sensors: str) -> None:
    """Exactly, not about: whatever its neighbours, its place and the size of the batch."""
    base = short(sensors=sensors, seed=7)
    others = [neighbour(base, k).model_copy(update={"seed": 100 + k}) for k in range(8)]
    alone = run(base, engine).signals[:, :, 0]
    assert np.isfinite(alone).all()
    places: list[tuple[int, int, int]] = [(3, 0, 0), (3, 2, 4), (9, 0, 0), (9, 8, 0), (9, 5, 3)]
    for size, place, shift in places if engine == "simd" else places[1:2]:
        batch = [others[(k + shift) % 8] for k in range(size - 1)]
        batch.insert(place, base)
        together = run(assemble_all(batch), engine).signals
        assert together.shape[2] == size
        np.testing.assert_array_equal(together[:, :, place], alone)
        if size > 1:
            assert np.abs(together[:, :, (place + 1) % size] - alone).max() > 1e-3


def test_a_compiled_flight_does_not_depend_on_its_batch(simd_faulty_case_one: Array) -> None:
    base = faulty_case_one()
    for size in (3, 9):
        batch = assemble_all([base, *(neighbour(base, k) for k in range(1, size))])
        np.testing.assert_array_equal(run(batch, "simd").signals[:, :, 0], simd_faulty_case_one[:, :, 0])


def many(count: int, **tables: Any) -> Batch:
    """Flights of which some are lost early: they differ in the size of the fault and in their seed."""
    base = short(
        sensors="noisy",
        duration=0.005 * (2 * CHUNK + 100),
        diagnosis="off",
        plant="paper_model",
        **tables,
    ).as_tables()
    return assemble_all(
        [
            scenario_from(
                base | {"seed": k, "fault": [{"kind": "step", "rotor": 2, "time": 0.1, "loss": loss}]}, "test"
            )
            for k, loss in enumerate(np.linspace(0.0, 0.9, count))
        ]
    )


def assert_same_flights(batch: Batch, found: Recording, wanted: Recording, every: int = 1) -> None:
    """The same bits: all scores, and everything of flights that lasted; when a lost one is dropped is no matter."""
    over = leaf_names(batch.state).index("scores.over")
    flying = wanted.state[over] == 0.0
    np.testing.assert_array_equal(found.state[over:-1], wanted.state[over:-1])
    np.testing.assert_array_equal(found.state[:, flying], wanted.state[:, flying])
    if every:
        np.testing.assert_array_equal(found.signals[:, :, flying], wanted.signals[::every, :, flying])


def test_numbers_depend_on_nothing_but_the_flight(monkeypatch: pytest.MonkeyPatch) -> None:
    """Neither on threads, nor on blocks, nor on what is recorded, nor on who leaves its lane."""
    pytest.importorskip("llvmlite")
    from rotorfault.engine import simd

    batch = many(29)
    wanted = simd.run(batch, threads=1)
    over = wanted.state[leaf_names(batch.state).index("scores.over")]
    assert 5 < np.count_nonzero(over) < 25, "some must be lost, and some not"
    for groups, threads, every in ((1, 1, 0), (1, 2, 0), (2, 2, 7), (8, 2, 1), (1, 2, 1)):
        monkeypatch.setattr(simd, "GROUPS", groups)
        found = simd.run(batch._replace(every=every), threads=threads)
        assert_same_flights(batch, found, wanted, every)


@pytest.mark.parametrize("lanes", [2, 4, 8])
@pytest.mark.parametrize("step", [0.005, 0.001])
def test_the_width_of_vectors_changes_nothing(monkeypatch: pytest.MonkeyPatch, lanes: int, step: float) -> None:
    """On a processor with shorter vectors the same code flies the same numbers, five steps in a period or one."""
    pytest.importorskip("llvmlite")
    from rotorfault.engine import machine, native, simd

    batch = many(9, step=step)._replace(every=50)
    wanted = simd.run(batch)
    monkeypatch.setenv("ROTORFAULT_CACHE", "")
    monkeypatch.setattr(machine, "_LOADED", {})
    monkeypatch.setattr(cache, "_KEPT", {})
    monkeypatch.setattr(native, "lanes", lambda: lanes)
    assert_same_flights(batch, simd.run(batch), wanted)


def test_a_flight_that_is_over_stops_costing(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("llvmlite")
    from rotorfault.engine import simd

    batch = many(32)._replace(every=0)
    lost = assemble_all(
        [
            scenario_from(
                short(diagnosis="off", duration=10.0, fault=[{"kind": "total", "rotor": 2, "time": 0.1}]).as_tables(),
                "test",
            )
        ]
        * 3
    )
    assert simd.run(batch).flown < 0.95 * batch.flights * batch.steps
    assert simd.run(lost._replace(every=0)).flown <= 3 * CHUNK


def test_noise_belongs_to_the_flight() -> None:
    seeds = ((7, 0), (7, 4711), (8, 0))
    stream = Stream(12, 0)
    together = Noise(seeds, stream).draw(40)
    assert together.shape == (40, 12, 3)
    for i, seed in enumerate(seeds):
        alone = Noise((seed,), stream)
        pieces = np.concatenate([alone.draw(1), alone.draw(29), alone.draw(10)])  # in whatever pieces it is drawn
        np.testing.assert_array_equal(pieces[:, :, 0], together[:, :, i])
    assert np.abs(np.corrcoef(together.reshape(480, 3).T) - np.eye(3)).max() < 0.2
    assert abs(together.mean()) < 0.1
    assert abs(together.std() - 1.0) < 0.1


@every_engine
def test_the_seed_is_all_that_names_the_noise(engine: str) -> None:
    base = short(duration=0.05)
    first, again, other = (run(short(duration=0.05, seed=s), engine).signals for s in (1, 1, 2))
    np.testing.assert_array_equal(first, again)
    assert np.abs(first - other).max() > 1e-3
    assert np.isfinite(run(base, engine).signals).all()


def test_a_batch_of_unlike_flights_is_refused() -> None:
    with pytest.raises(InputError, match="at least one"):
        assemble_all([])
    for change in (
        {"sensors": "ideal"},
        {"duration": 0.35},
        {"reference": {"kind": "set_point", "position": [0.0, 0.0, 0.0]}},
        {"allocation": "nominal"},
        {"record_period": 0.01},
        {"step": 0.0025},
        {"controller": "sdre"},
    ):
        with pytest.raises(InputError, match="scenario 'other' differs from the first in more than numbers"):
            assemble_all([short(), short(name="other", **change)])
