"""A push from below against a loss: which of both it is, by the specific force alone."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import norm

from rotorfault.autopilot.diagnosis.kalman import Hypothesis, Innovation, follow_hypothesis
from rotorfault.autopilot.diagnosis.touch import NO_TOUCH, ODDS, rather_lost
from rotorfault.autopilot.diagnosis.verdict import RAISE
from rotorfault.maths.geometry import PerRotor


def test_it_is_the_posterior_of_two_means_of_opposite_sign() -> None:
    """Innovations of many instants, by SciPy's densities: that of a loss beside that of a push as strong."""
    random = np.random.default_rng(3)
    for loss in (0.03, 0.1, 0.4):
        g, S = random.uniform(-3.0, -1.0, size=12), random.uniform(0.2, 1.5, size=12)
        nu = random.normal(0.0, np.sqrt(S))
        lost, touched = (norm.logpdf(nu, mean, np.sqrt(S)).sum() for mean in (loss * g, -loss * g))
        felt = float((g * nu / S).sum())
        found = rather_lost(PerRotor.of([loss]), PerRotor.of([felt]))[0]
        assert found == pytest.approx(1.0 / (1.0 + ODDS * np.exp(touched - lost)), rel=1e-9)


def test_a_verdict_stands_where_nothing_is_felt_and_for_what_lasts_for_seconds() -> None:
    loss = PerRotor.of([0.2, 0.2, 0.2])
    pushed, silent, slow = rather_lost(loss, PerRotor.of([-40.0, 0.0, NO_TOUCH]))
    assert pushed < 1e-4
    assert RAISE < silent < 0.996
    assert slow == pytest.approx(1.0, abs=1e-12)


def test_the_score_of_the_last_number_is_kept_apart() -> None:
    """Two numbers measured together, of which the input shows in the second alone."""
    seen = (({0: 1.0}, Innovation(0.3, 2.0, (0.5,))), ({0: 0.0}, Innovation(-0.7, 4.0, (0.1,))))
    after = follow_hypothesis(Hypothesis((0.0,), 0.0, 0.0), {0: {}}, {0: 0.8}, seen, felt=-1.5)
    assert after.last == pytest.approx(-1.5 * -0.7 / 4.0)
    assert after.score - after.last == pytest.approx(0.8 * 0.3 / 2.0)
