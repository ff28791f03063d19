"""From evidence to a verdict: probabilities of faults."""

from __future__ import annotations

import numpy as np
import pytest

from rotorfault.autopilot.diagnosis.verdict import RAISE, fewest, probabilities
from rotorfault.maths.geometry import PerRotor

NONE = PerRotor.all(0.0, 4)


def of(*evidence: float, level: float = 20.0, flagged: PerRotor = NONE) -> list[float]:
    return [*probabilities(PerRotor.of(evidence), level, flagged)]


def test_one_rotor_alone_has_what_raises_a_flag_at_the_level() -> None:
    assert of(20.0, -50.0, -50.0, -50.0)[0] == pytest.approx(RAISE)


def test_probabilities_are_shares_of_the_ratios() -> None:
    evidence, level = np.array([21.0, 19.0, 3.0, -2.0]), 20.0
    shares = np.exp(evidence - level)
    assert of(*evidence) == pytest.approx([*(shares / (shares.sum() + (1.0 - RAISE) / RAISE))])


@pytest.mark.parametrize("much", [30.0, 200.0, 5000.0])
def test_where_much_is_said_for_two_rotors_the_difference_counts(much: float) -> None:
    """As of two rotors on an arm, either of which explains a total loss well."""
    p = of(much, much - 5.0, 0.0, 0.0)
    assert p[0] == pytest.approx(1.0 / (1.0 + np.exp(-5.0)), rel=1e-3)
    assert sum(p) == pytest.approx(1.0, abs=1e-3)
    assert max(of(much, much, 0.0, 0.0)) < RAISE


def test_a_rotor_that_is_flagged_has_no_new_fault() -> None:
    flagged = PerRotor.of([1.0, 0.0, 0.0, 0.0])
    assert of(500.0, 30.0, 0.0, 0.0, flagged=flagged)[0] == 0.0
    assert of(500.0, 30.0, 0.0, 0.0, flagged=flagged)[1] > RAISE


def test_no_evidence_at_all_is_no_fault() -> None:
    assert max(of(-1e4, -1e5, -1e300, -20.0)) < 1e-6


@pytest.mark.parametrize(
    ("probability", "named"),
    [
        ((0.995, 0.002, 0.001, 0.0), [1, 0, 0, 0]),
        ((0.5, 0.002, 0.495, 0.0), [1, 0, 1, 0]),
        ((0.49, 0.49, 0.0, 0.0), [0, 0, 0, 0]),  # none is sure yet
        ((0.4, 0.3, 0.2, 0.1), [1, 1, 1, 1]),
        ((0.5, 0.5, 0.0, 0.0), [1, 1, 0, 0]),
    ],
)
def test_the_fewest_rotors_that_have_the_fault_are_named(probability: tuple[float, ...], named: list[int]) -> None:
    assert [*fewest(PerRotor.of(probability))] == named


def test_a_change_of_what_is_believed_competes_with_a_new_fault() -> None:
    """As where a fault comes and goes: that the faulty rotor is sound looks as if the opposite one were not."""
    flagged, evidence = PerRotor.of([1.0, 0.0, 0.0, 0.0]), PerRotor.of([24.0, 0.0, 25.0, 0.0])
    alone = probabilities(evidence, 20.0, flagged)
    beside = probabilities(evidence, 20.0, flagged, 10.0)
    assert alone[2] == pytest.approx(99.0 * np.exp(5.0) / (1.0 + 99.0 * np.exp(5.0)), rel=1e-6)
    assert beside[0] == pytest.approx(np.exp(14.0) / (np.exp(14.0) + np.exp(5.0) + 1.0 / 99.0 + 2e-4), rel=1e-4)
    assert beside[2] < 1e-3
