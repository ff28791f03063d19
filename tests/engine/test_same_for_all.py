"""What is the same in all flights of a batch is chosen before they fly: fewer operations, the same bits."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from engine_flights import faulty_case_one, run, short
from gates import needs_simd

from rotorfault.engine.program import SameForAll, program, same_for_all, trace
from rotorfault.engine.trace import Tape, add, less, multiply, subtract
from rotorfault.flight.assembly import assemble, assemble_all
from rotorfault.model.vehicle import Opposite
from rotorfault.scenario.scenario import Scenario

FLIGHTS: dict[str, Scenario] = {
    "paper": faulty_case_one(),
    "reaction": short(vehicle="hummingbird", controller={"kind": "roismc", "preset": "gentle"}),
    "rule": short(allocation="paper_rule"),
}


@needs_simd
@pytest.mark.parametrize("name", FLIGHTS)
def test_no_bit_depends_on_it(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    chosen = run(FLIGHTS[name], "simd")
    monkeypatch.setattr("rotorfault.engine.machine.same_for_all", lambda batch: SameForAll())
    open_ = run(FLIGHTS[name], "simd")
    np.testing.assert_array_equal(chosen.signals, open_.signals)
    np.testing.assert_array_equal(chosen.state[:20], open_.state[:20])


@pytest.mark.parametrize("name", FLIGHTS)
def test_it_saves_operations(name: str) -> None:
    batch = assemble(FLIGHTS[name])
    same = same_for_all(batch)
    assert len(same.absent) == (0 if name == "reaction" else 2)  # true and believed reaction
    assert same.told == (Opposite((0, 1, 2, 3)),) * 2  # of truth and belief
    saved = count(batch, SameForAll()) - count(batch, same)
    assert saved == 0 if name == "reaction" else saved > 50


def count(batch: Any, same: SameForAll) -> int:
    return program(trace(batch, same), 4, False).operations.total()


def test_what_differs_between_flights_is_not_taken_for_the_same() -> None:
    one, other = short(), short(**{"vehicle": short(vehicle="hummingbird").vehicle})
    both = same_for_all(assemble_all([one, other]))
    assert both.absent == ()  # the Hummingbird has a reaction


def test_an_absent_zero_leaves_rounding_as_it_was() -> None:
    tape = Tape()
    x, y = tape.leaves("state", 2)
    nothing = tape.absent()
    product = multiply(x, y)
    assert multiply(x, nothing) is nothing
    # Still rounded before a sum, and no other sum's summand.
    assert (add(product, nothing).op, subtract(nothing, product).op) == ("add", "sub")
    assert add(x, nothing) is not x
    assert add(x, nothing).args == (x,)
    assert less(0.0, nothing) is nothing
