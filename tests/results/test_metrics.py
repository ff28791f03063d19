"""What records tell besides the scores, on made-up flights whose numbers can be worked out by hand."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
import xarray as xr
from made_up_records import LAYOUT, dataset
from made_up_scores import TIME, scored, steps

from rotorfault.results import metrics


def flight(time: Any = TIME, **values: Any) -> xr.Dataset:
    """Records that are zero but for what is given: signal (``__`` for a dot) -> value per record and component."""
    rows = np.zeros((len(time), len(LAYOUT)))
    for name, value in values.items():
        rows[:, LAYOUT.place(name.replace("__", "."))] = value
    return dataset(rows, np.asarray(time, dtype=float), {})


# Every term of J at once.
CONSTANT: dict[str, Any] = {
    "position": [2.0, -0.5, 0.005],
    "velocity": [0.3, 0.0, -0.4],
    "velocity_reference": [0.1, 0.0, 0.0],
    "attitude": [0.1, -0.2, 0.5],
    "yaw_reference": 0.2,
    "body_rates": [1.0, 2.0, -3.0],
    "torque_demand": [1.5, -0.5, 0.2],
    "torque_unallocated": [0.5, 0.5, 0.0],
    "controller__virtual_position": [1.0, 2.0, -3.0],
}


def test_cost_of_constant_errors() -> None:
    """J = T/2 (e'Qe + u'Ru), every term by hand; the attitude error in Euler angles."""
    Q = 0.3 * 2.0 + 0.3 * 0.5 + 0.3 / 0.01 * 0.005**2 + 0.005 * (0.2**2 + 0.4**2)
    Q += 0.1**2 + 0.2**2 + 0.3**2 + 1.0 + 4.0 + 9.0
    R = 0.2 * 4.0 * 1.0 + 0.2 * 0.25 * 4.0 + 0.4 * 0.01**2 * 9.0 + 0.0088 * (1.0 + 1.0 + 0.04)
    assert metrics.cost(flight(**CONSTANT)) == pytest.approx(0.5 * 10.0 * (Q + R), rel=1e-12)


def test_cost_is_that_of_the_scores_but_for_the_attitude_error() -> None:
    """Of small angles they are the same to third order."""
    small = {**CONSTANT, "attitude": [0.01, -0.02, 0.22]}
    found = metrics.cost(flight(**small))
    assert found == pytest.approx(scored(**small)["cost"], rel=1e-6)
    level = {**CONSTANT, "attitude": [0.0, 0.0, 0.5]}
    assert metrics.cost(flight(**level)) == pytest.approx(scored(**level)["cost"], rel=1e-14)


def test_cost_integrates_over_time() -> None:
    """Rates that fall linearly from 1 to 0: half of the integral of a square, by the trapezoidal rule."""
    falling = np.outer(1.0 - TIME / 10.0, [1.0, 0.0, 0.0])
    found = metrics.cost(flight(body_rates=falling))
    assert found == pytest.approx(0.5 * (10.0 / 3.0 + 10.0 * 0.01**2 / 6.0), rel=1e-12)


def test_attitude_errors_go_the_short_way() -> None:
    data = flight(attitude=[0.0, 0.0, 3.1], yaw_reference=-3.1, controller__attitude_demand=[0.1, 0.2, -3.0])
    np.testing.assert_allclose(metrics.attitude_error(data, "reference")[0], [0.0, 0.0, 6.2 - 2 * math.pi])
    np.testing.assert_allclose(metrics.attitude_error(data, "demand")[0], [-0.1, -0.2, 6.1 - 2 * math.pi])


def test_violations_are_counted_outside_the_layer_alone() -> None:
    """Of the 50 steps outside it the first 25 rise; what happens inside does not count."""
    sigma = np.concatenate([np.linspace(-1.0, -2.0, 26), np.linspace(-2.0, 0.0, 75)])
    data = flight(
        controller__sigma_position=np.outer(sigma, [1.0, 0.0, 0.0]),
        controller__outside_layer_position=steps((51, [1.0, 0.0, 0.0]), (50, [0.0, 0.0, 0.0])),
    )
    assert metrics.lyapunov_violations(data) == pytest.approx(0.5)
    assert metrics.lyapunov_violations(flight()) is None  # never outside
