"""Predictions of a log: better than a guess where a model can know, and by a vehicle's own numbers."""

from __future__ import annotations

import numpy as np
import pytest
from made_up_logs import flown, log_of

from rotorfault.base.errors import InputError
from rotorfault.logs.estimates import in_body
from rotorfault.logs.log import Log, Series
from rotorfault.logs.prediction import in_world, turned, validated
from rotorfault.logs.segments import flight_spans


def whole_log() -> Log:
    """A made-up flight with the attitude that its rates make."""
    flight = flown(seed=3, seconds=20.0, noise=0.05)
    q = np.zeros((len(flight.time), 4))
    q[0] = [1.0, 0.0, 0.0, 0.0]
    for k in range(1, len(q)):
        q[k] = turned(q[k - 1 : k], flight.rates[k - 1 : k], 0.01)[0]
    log = log_of(flight)
    return Log("whole", "made up", log.layout, {**log.series, "attitude": Series(flight.time, q)})


def test_the_fitted_model_turns_the_body_better_than_constant_rates() -> None:
    found = validated(whole_log())
    fitted, guess = found.errors
    assert found.predictions > 50
    assert fitted.attitude_ahead < 0.8 * guess.attitude_ahead
    assert len(found.table()) == 3
    assert "fitted to the first half: predicts" in found.verdict
    worse = found._replace(errors=(fitted._replace(velocity_ahead=9.0, attitude_ahead=9.0), guess))
    assert "predicts neither better" in worse.verdict


def test_what_predictions_begin_with_is_asked_for() -> None:
    log = log_of(flown(seed=3, seconds=10.0))
    assert flight_spans(log)
    with pytest.raises(InputError, match="has no attitude"):
        validated(log)


def test_turning_and_axes_agree_with_scipy() -> None:
    from scipy.spatial.transform import Rotation

    rng = np.random.default_rng(1)
    turns = Rotation.random(20, random_state=2)
    q = turns.as_quat()[:, [3, 0, 1, 2]]
    v, w = rng.normal(size=(2, 20, 3))
    np.testing.assert_allclose(in_body(q, v), turns.inv().apply(v), atol=1e-12)
    np.testing.assert_allclose(in_world(q, v), turns.apply(v), atol=1e-12)
    after = (turns * Rotation.from_rotvec(0.3 * w)).as_quat()[:, [3, 0, 1, 2]]
    found = turned(q, w, 0.3)
    np.testing.assert_allclose(np.abs((found * after).sum(axis=1)), 1.0, atol=1e-12)
