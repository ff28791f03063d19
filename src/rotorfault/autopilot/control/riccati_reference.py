r"""The attitude block of the Riccati equation (22) solved to rounding error, for tests and for design. Not in flight.

On floats: `solve_iterated` repeats the Newton-Kleinman step of `rotorfault.autopilot.control.riccati` until it is
done; `dense_problem` writes the block as the 6x6 matrices that other libraries take. The state is ordered angles,
rates.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from rotorfault.autopilot.control.riccati import (
    AttitudeProblem,
    Gain,
    guaranteed_gain,
    newton_kleinman_step,
    residual,
)
from rotorfault.base.errors import InputError
from rotorfault.maths.geometry import Mat3, Vec3
from rotorfault.maths.records import flatten, unflatten

Matrix = npt.NDArray[np.float64]

TOLERANCE = 1e-12
MOST_STEPS = 60
# Far from the solution the residual may rise for a step (seen up to 1e8, in one problem of a thousand) although the
# cost falls; only below this does "no longer falling" mean that rounding error is reached.
_NEAR = 1e-6


def solve_iterated(problem: AttitudeProblem) -> Gain:
    """Newton-Kleinman from the guaranteed gain until the residual is 1e-12 or stops falling; at most 60 steps.

    Few steps (2 to 4) where the drift is small against the rate gain, else about 6 + 2 log2 of their ratio.

    Parameters
    ----------
    problem : AttitudeProblem
        Of numbers.

    Returns
    -------
    Gain
        Of floats: the stabilising solution.

    Raises
    ------
    InputError
        If 60 steps do not bring the residual below 1e-6, or a number is not finite.
    """
    problem = unflatten(problem, [float(number) for number in flatten(problem)])
    best, least = guaranteed_gain(problem), math.inf
    gain = best
    for _ in range(MOST_STEPS):
        gain = newton_kleinman_step(problem, gain)
        now = residual(problem, gain)
        if not now < least and least < _NEAR:
            break
        best, least = gain, now
        if least <= TOLERANCE:
            break
    if not least < _NEAR:
        raise InputError(
            f"the Riccati equation of the attitude block has no solution to working accuracy: relative residual "
            f"{least:.1e} after {MOST_STEPS} steps. Weights of angles and inputs must be positive, those of rates "
            f"not negative, and their orders of magnitude not too far apart. Scaled problem: {problem}"
        )
    return best


def cost_matrix(problem: AttitudeProblem, gain: Gain) -> Matrix:
    """P of (22) in physical units, (6, 6), of a gain that solves the Riccati equation.

    Raises
    ------
    InputError
        If X is not symmetric, as that of `guaranteed_gain`: such a gain belongs to no cost matrix.
    """
    X, Y, W = matrix(gain.X), matrix(gain.Y), matrix(problem.W)
    asymmetry = float(np.linalg.norm(X - X.T))
    if not asymmetry <= 1e-9 * float(np.linalg.norm(X)):
        raise InputError(
            f"X of this gain is not symmetric (by {asymmetry:.1e} 1/s), so no cost matrix belongs to it; "
            f"take the gain of a Newton-Kleinman step or of solve_iterated, not the guaranteed one"
        )
    P11 = Y.T @ (X - W)
    unscale = np.tile(1.0 / np.array([float(s) for s in problem.S]), 2)
    scaled = np.block([[0.5 * (P11 + P11.T), Y.T], [Y, X]])
    return np.asarray(np.outer(unscale, unscale) * scaled, dtype=np.float64)


class DenseProblem(NamedTuple):
    """The attitude block as plain matrices, unscaled: x_dot = A x + B u, cost x^T Q x + u^T R u."""

    A: Matrix  # (6, 6)
    B: Matrix  # (6, 3)
    Q: Matrix  # (6, 6)
    R: Matrix  # (3, 3)


def dense_problem(drift: Mat3, b: Vec3, q_angle: Vec3, q_rate: Vec3, r: Vec3) -> DenseProblem:
    """The problem of `rotorfault.autopilot.control.riccati.attitude_problem` as plain matrices, not scaled.

    Parameters
    ----------
    drift, b, q_angle, q_rate, r
        As for `attitude_problem`.

    Returns
    -------
    DenseProblem
    """
    zero, one = np.zeros((3, 3)), np.eye(3)
    return DenseProblem(
        A=np.block([[zero, one], [zero, matrix(drift)]]),
        B=np.vstack([zero, np.diag([float(b_i) for b_i in b])]),
        Q=np.diag([float(q_i) for q_i in (*q_angle, *q_rate)]),
        R=np.diag([float(r_i) for r_i in r]),
    )


def matrix(M: Mat3) -> Matrix:
    """A Mat3 of numbers as an array (3, 3)."""
    return np.array([[float(element) for element in row] for row in M.rows])
