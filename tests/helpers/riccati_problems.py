"""Random Riccati problems and what the tests of the solvers share."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

import numpy as np
from scipy.linalg import solve_continuous_are

from rotorfault.autopilot.control.riccati import (
    AttitudeProblem,
    Gain,
    attitude_problem,
    guaranteed_gain,
    newton_kleinman_step,
    routh_stable,
)
from rotorfault.autopilot.control.riccati_reference import DenseProblem, matrix
from rotorfault.maths.geometry import Mat3, Vec3
from rotorfault.maths.records import flatten, unflatten

ONE = Vec3(1.0, 1.0, 1.0)


def random_arguments(rng: np.random.Generator, n: int, rate: float) -> tuple[Mat3, Vec3, Vec3, Vec3, Vec3]:
    """Drift, b and weights of n random vehicles at body rates up to `rate` rad/s, one element per problem."""
    J = np.sort(rng.uniform(0.2, 1.0, (3, n)), axis=0)
    J[2] = np.minimum(J[2], 0.98 * (J[0] + J[1]))  # what moments of inertia of a body have to keep
    J = rng.permuted(J, axis=0) * 10 ** rng.uniform(-2.5, -1.0, n)
    p, q, r = rng.uniform(-rate, rate, (3, n)) / 2
    rotor = rng.uniform(-0.05, 0.05, n) * rate
    a = (J[1] - J[2]) / J[0], (J[2] - J[0]) / J[1], (J[0] - J[1]) / J[2]
    zero = np.zeros(n)
    drift = Mat3(zero, a[0] * r - rotor, a[0] * q, a[1] * r + rotor, zero, a[1] * p, a[2] * q, a[2] * p, zero)
    b = Vec3(*np.where(rng.random(n) < 0.5, 1.0, 1.0 / J))
    q_angle, q_rate, r = (Vec3(*10 ** rng.uniform(low, high, (3, n))) for low, high in ((-1, 2), (-2, 1), (-3, 1)))
    return drift, b, q_angle, q_rate, r.times(b).times(b)


def random_problem(rng: np.random.Generator, n: int, rate: float) -> AttitudeProblem:
    return broadcast(attitude_problem(*random_arguments(rng, n, rate)), n)


def broadcast(record: Any, n: int) -> Any:
    return unflatten(record, [np.broadcast_to(np.asarray(leaf, float), n) for leaf in flatten(record)])


def one(record: Any, i: int) -> Any:
    return unflatten(record, [float(leaf[i]) for leaf in flatten(record)])


def noise(rng: np.random.Generator, n: int, low: float, high: float) -> Mat3:
    size = 10 ** rng.uniform(low, high, n)
    return Mat3(*(rng.normal(size=n) * size for _ in range(9)))


def stack(M: Mat3) -> np.ndarray:
    return np.stack(np.broadcast_arrays(*M), axis=-1).reshape(-1, 3, 3)


def rightmost(problem: AttitudeProblem, gain: Gain) -> np.ndarray:
    """Largest real part of the closed loop's poles by eigenvalues, NaN where the gain is not finite."""
    Y, K, W = np.broadcast_arrays(stack(gain.Y), stack(gain.X), stack(problem.W))
    A = np.zeros((len(Y), 6, 6))
    A[:, :3, 3:], A[:, 3:, :3], A[:, 3:, 3:] = np.eye(3), -Y, W - K
    finite = np.isfinite(A).all((1, 2))
    found = np.full(len(Y), np.nan)
    found[finite] = np.linalg.eigvals(A[finite]).real.max(1)
    return found


def closed_loop_poles(problem: AttitudeProblem, gain: Gain) -> np.ndarray:
    """The six poles in 1/s of the attitude block of one problem under a gain."""
    zero, one_ = np.zeros((3, 3)), np.eye(3)
    return np.linalg.eigvals(np.block([[zero, one_], [-matrix(gain.Y), matrix(problem.W) - matrix(gain.X)]]))


def solve_dense(problem: DenseProblem) -> np.ndarray:
    """P of (22), (6, 6), by SciPy's Schur method."""
    return np.asarray(solve_continuous_are(problem.A, problem.B, problem.Q, problem.R))


def exactly_stable(problem: AttitudeProblem, gain: Gain) -> bool:
    """Routh's test in exact rational arithmetic, for gains so large that eigenvalues err by more than their size."""
    Y, X, W = (np.array([Fraction(float(x)) for x in M]).reshape(3, 3) for M in (gain.Y, gain.X, problem.W))
    one_, zero = np.vectorize(Fraction)(np.eye(3, dtype=int)), np.vectorize(Fraction)(np.zeros((3, 3), dtype=int))
    A = np.block([[zero, one_], [-Y, W - X]])
    # Faddeev and LeVerrier's characteristic polynomial.
    M, coefficients = A * 0, [Fraction(1)]
    for k in range(1, 7):
        M = A @ M + coefficients[-1] * np.vectorize(Fraction)(np.eye(6, dtype=int))
        coefficients.append(-np.trace(A @ M) / k)
    above, row = coefficients[0::2], coefficients[1::2]
    while row and row[0] > 0:
        padded = [*row[1:], Fraction(0)]
        above, row = row, [a - above[0] / row[0] * b for a, b in zip(above[1:], padded, strict=False)]
    return not row


def on_the_verge(rng: np.random.Generator, problem: AttitudeProblem, n: int) -> Gain:
    """Gains next to the border of stability, at relative distances from 1e-15 to 0.1, on both sides."""
    right, wild = converged(problem), Gain(noise(rng, n, 0, 3), noise(rng, n, 0, 2))
    inside, outside = np.zeros(n), np.ones(n)
    for _ in range(48):
        middle = 0.5 * (inside + outside)
        stable = routh_stable(problem, Gain(right.Y + wild.Y * middle, right.X + wild.X * middle)) == 1.0
        inside, outside = np.where(stable, middle, inside), np.where(stable, outside, middle)
    share = inside * (1.0 + 10 ** rng.uniform(-15, -1, n) * rng.choice([-1, 1], n))
    return Gain(right.Y + wild.Y * share, right.X + wild.X * share)


def cost_is_positive(problem: AttitudeProblem, gain: Gain, after: Gain) -> np.ndarray:
    """Whether the cost matrix of a gain, whose lower half is the gain `after` it, is positive definite."""
    Y, K, W, N, X = np.broadcast_arrays(*map(stack, (*gain, problem.W, *after)))
    T = (0, 2, 1)
    P = np.block([[N.transpose(T) @ (K - W) + Y.transpose(T) @ (X - K), N.transpose(T)], [N, X]])
    d = 1.0 / np.sqrt(np.abs(np.diagonal(P, axis1=1, axis2=2)))
    return np.linalg.eigvalsh(d[:, :, None] * P * d[:, None, :]).min(1) > 0.0


def converged(problem: AttitudeProblem, steps: int = 30) -> Gain:
    gain = guaranteed_gain(problem)
    for _ in range(steps):
        gain = newton_kleinman_step(problem, gain)
    return gain


def relative(found: np.ndarray, expected: np.ndarray) -> float:
    return float(np.linalg.norm(found - expected) / np.linalg.norm(expected))


def hostile_starts(rng: np.random.Generator, problem: AttitudeProblem, n: int) -> dict[str, Gain]:
    """Stored gains that belong to other problems, do not stabilise, are singular or are no numbers."""
    other = random_problem(rng, n, 30.0)
    solved, wild = converged(other), Gain(noise(rng, n, 0, 3), noise(rng, n, 0, 2))
    right, near = converged(problem), 10 ** rng.uniform(-4, 0, n)
    holes = flatten(broadcast(solved, n))
    for leaf in range(18):
        holes[leaf] = np.where(rng.random(n) < 0.1, rng.choice([np.nan, np.inf, -np.inf, 0.0, 1e200], n), holes[leaf])
    return {
        "another problem's": solved,
        "another problem's guaranteed": guaranteed_gain(other),
        "at random": wild,
        "unstable": Gain(solved.Y, -solved.X),
        "at the edge": Gain(right.Y + wild.Y * near, right.X + wild.X * near),
        "holes": unflatten(solved, holes),
        "zero": broadcast(Gain(solved.Y * 0.0, solved.X * 0.0), n),
        "NaN": broadcast(Gain(solved.Y * np.nan, solved.X * np.nan), n),
    }
