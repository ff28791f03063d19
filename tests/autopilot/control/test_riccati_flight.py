"""The solver in flight, and the engines on it."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from riccati_problems import ONE, broadcast, hostile_starts, one, random_problem

from rotorfault.autopilot.control.riccati import (
    Gain,
    attitude_problem,
    fly,
    guaranteed_gain,
)
from rotorfault.autopilot.control.riccati_reference import (
    solve_iterated,
)
from rotorfault.maths.geometry import Mat3, Vec3
from rotorfault.maths.records import flatten, unflatten

# ------------------------------------------------------------------------------------------------------ in flight


def flight(rate: float, steps: int, instants: int) -> tuple[float, float]:
    """Largest residual and number of guarded instants of a tumbling flight, 1 ms per instant, from a cold start."""
    a = Vec3(-0.75, 0.7, 0.08)
    stored, largest, guards = None, 0.0, 0.0
    for k in range(instants):
        t = 1e-3 * k
        p, q, r = (0.5 * rate * math.sin(f * t + c) for f, c in ((11.0, 0.0), (7.0, 1.0), (5.0, 2.0)))
        drift = Mat3(0.0, a.x * r, a.x * q, a.y * r, 0.0, a.y * p, a.z * q, a.z * p, 0.0)
        problem = attitude_problem(drift, ONE, ONE, ONE, ONE * 0.0088)
        stored, last, guarded = fly(problem, stored or guaranteed_gain(problem), steps)
        largest, guards = max(largest, last if k >= 6 else 0.0), guards + guarded
    return largest, guards


def test_one_warm_step_per_millisecond_tracks_the_solution() -> None:
    slow, slow_guards = flight(5.0, 1, 400)
    fast, fast_guards = flight(20.0, 1, 400)
    assert slow_guards == fast_guards == 0.0
    assert slow < 1e-4
    assert fast < 1e-3
    assert flight(20.0, 2, 200)[0] < 1e-3 * fast


def test_flight_recovers_from_a_lost_measurement() -> None:
    rng = np.random.default_rng(23)
    problem = one(random_problem(rng, 1, 10.0), 0)
    gain, _, _ = fly(problem._replace(W=problem.W * math.nan), solve_iterated(problem), 1)
    assert all(math.isnan(element) for element in flatten(gain.X))
    gain, last, guarded = fly(problem, gain, 1)
    assert guarded == 1.0
    for _ in range(30):
        gain, last, guarded = fly(problem, gain, 1)
        assert guarded == 0.0
    assert last < 1e-12


def test_a_flight_without_a_step_is_refused() -> None:
    problem = attitude_problem(Mat3.skew(ONE), ONE, ONE, ONE, ONE)
    with pytest.raises(ValueError, match="at least one"):
        fly(problem, guaranteed_gain(problem), 0)


# -------------------------------------------------------------------------------------------------------- engines


@pytest.fixture(scope="module")
def case() -> tuple[np.ndarray, np.ndarray, Any]:
    """64 problems and stored gains as rows of an array, the outcome of `fly` on arrays, and their shape."""
    rng = np.random.default_rng(29)
    problem = random_problem(rng, 64, 30.0)
    stored = broadcast(Gain(*hostile_starts(rng, problem, 64)["holes"]), 64)
    shape = (problem, stored)
    with np.errstate(all="ignore"):
        out = np.array([np.broadcast_to(leaf, 64) for leaf in flatten(fly(problem, stored, 2))])
    assert 0 < out[-1].sum() < 64
    return np.array(flatten(shape)), out, shape


def test_floats_agree_with_arrays(case: Any) -> None:
    rows, expected, shape = case
    for i in range(64):
        problem, stored = unflatten(shape, [float(x) for x in rows[:, i]])
        assert flatten(fly(problem, stored, 2)) == pytest.approx(list(expected[:, i]), rel=1e-12, abs=1e-12)


def scale(expected: np.ndarray) -> np.ndarray:
    """Size of the matrix that each number belongs to: rounding is relative to that, not to a small element."""
    return np.repeat([np.abs(expected[:9]).max(0), np.abs(expected[9:18]).max(0)], 9, axis=0)


def test_heyoka_agrees_with_arrays(case: Any) -> None:
    hy = pytest.importorskip("heyoka")
    rows, expected, shape = case
    variables = [hy.expression(f"v{i}") for i in range(len(rows))]
    function = hy.cfunc(flatten(fly(*unflatten(shape, variables), 2)), variables)
    found = function(np.ascontiguousarray(rows))
    assert np.array_equal(found[-1], expected[-1])
    assert np.max(np.abs(found[:18] - expected[:18]) / scale(expected)) < 1e-9


def test_casadi_agrees_with_arrays(case: Any) -> None:
    ca = pytest.importorskip("casadi")
    rows, expected, shape = case
    variables = [ca.SX.sym(f"v{i}") for i in range(len(rows))]
    outputs = flatten(fly(*unflatten(shape, variables), 2))
    found = np.array(ca.Function("fly", [ca.vertcat(*variables)], [ca.vertcat(*outputs)])(rows))
    assert np.array_equal(found[-1], expected[-1])
    assert np.max(np.abs(found[:18] - expected[:18]) / scale(expected)) < 1e-9
