"""From a point of the search to settings, and what a training flight is worth."""

from __future__ import annotations

import numpy as np
import pytest

from rotorfault.autopilot.control.protocol import CONTROLLERS
from rotorfault.autopilot.control.riccati import attitude_problem, feedback
from rotorfault.autopilot.control.riccati_reference import solve_iterated
from rotorfault.autopilot.control.sdre import Weights
from rotorfault.base.config import validate
from rotorfault.maths.geometry import Mat3, Vec3
from rotorfault.tuning.space import SPACES, settings_at


@pytest.mark.parametrize("controller", SPACES)
def test_every_corner_of_a_space_is_a_valid_controller(controller: str) -> None:
    kind = CONTROLLERS[controller]
    for corner in (1, 2, 3):
        tables = settings_at(controller, {entry[0]: entry[corner] for entry in SPACES[controller]})
        validate(kind.Settings, tables, controller)


@pytest.mark.parametrize("controller", ["roismc", "ismc"])
def test_what_is_not_searched_keeps_its_default(controller: str) -> None:
    kind = CONTROLLERS[controller]
    tables = settings_at(controller, {entry[0]: entry[2] for entry in SPACES[controller]})
    ours, default = validate(kind.Settings, tables, controller).law, kind.Settings().law
    for group in ("position", "attitude"):
        assert getattr(ours, group).weight == getattr(default, group).weight
        assert getattr(ours, group).k == getattr(default, group).k
        assert getattr(ours, group).layer != getattr(default, group).layer


def test_attitude_weights_give_the_gains_that_are_searched() -> None:
    """By the Riccati equation itself, body at rest."""
    point = {entry[0]: entry[2] for entry in SPACES["sdre"]} | {"roll.k1": 150.0, "roll.k2": 30.0, "yaw.k2": 12.0}
    weights = Weights.model_validate(settings_at("sdre", point)["law"])
    problem = attitude_problem(
        Mat3.diagonal(Vec3(0.0, 0.0, 0.0)),
        Vec3(1.0, 1.0, 1.0),
        Vec3.of(weights.attitude_q_angle),
        Vec3.of(weights.attitude_q_rate),
        Vec3.of(weights.attitude_r),
    )
    K_angle, K_rate = feedback(problem, solve_iterated(problem))
    np.testing.assert_allclose(list(K_angle.diag), [150.0, 150.0, 30.0], rtol=1e-3)
    np.testing.assert_allclose(list(K_rate.diag), [30.0, 30.0, 12.0], rtol=1e-3)
