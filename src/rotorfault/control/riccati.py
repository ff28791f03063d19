r"""The Riccati equation (22) of the SDRE law, solved at every sampling instant without a branch.

A position axis has a closed form, `position_gain`. The attitude block has A = [[0, I], [0, W]], B = [0; diag b],
Q = (Qp, Qd) and R = diag r, where W is the gyroscopic coupling of (3) frozen at the current rates; "stabilising"
below means for this frozen W, in continuous time. Scaled with S = diag(b/sqrt r), e = S e', omega = S omega', the
input weight becomes I and, with Y and X = X^T for the lower half [Y, X] of P and Z = X - W, the equation reads

.. math::  Y^T Y = Q_p, \quad Z^T Z = Q_d + W^T W + Y + Y^T, \quad Y^T Z = Z^T Y.

The gain is u = -(Y e' + X omega'), the closed loop lambda^2 I + lambda Z + Y. The solution wanted is the one with
P = [[Y^T Z, Y^T], [Y, X]] > 0; others have residual zero too, so a small residual alone proves nothing.

In flight every engine runs the same fixed sequence, `fly`: Newton-Kleinman steps from the stored gain, a test that
the outcome stabilises, and a select of the guaranteed gain where it does not. Kleinman's step (IEEE TAC 13, 1968,
p. 114) is an exact Lyapunov solve, here reduced to 3x3 algebra. The iterated reference solver is in
`rotorfault.control.riccati_reference`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from rotorfault.geometry import Mat3, Vec3
from rotorfault.records import select_record
from rotorfault.scalar import NAN, Scalar, absolute, both, greater, is_finite, negated, select, sqrt

_SKEW_BASIS = (
    Mat3.skew(Vec3(1.0, 0.0, 0.0)),
    Mat3.skew(Vec3(0.0, 1.0, 0.0)),
    Mat3.skew(Vec3(0.0, 0.0, 1.0)),
)


class AttitudeProblem(NamedTuple):
    """The attitude block of (22), scaled to unit input weight."""

    W: Mat3  # 1/s: S^-1 W S, drift of the scaled rates
    Qp: Mat3  # 1/s^4: S Qp S, weight of the angles; symmetric, positive definite
    Qd: Mat3  # 1/s^2: S Qd S, weight of the rates; symmetric, positive semidefinite
    S: Vec3  # 1/s^2: b/sqrt(r), scales angles, rates and accelerations alike


class Gain(NamedTuple):
    """Gain of the scaled problem, u = -(Y e + X omega), and the state that `fly` stores.

    X is the lower right block of P, and symmetric, after any Newton-Kleinman or chord step. The X of
    `guaranteed_gain` is a gain only: it is not symmetric.
    """

    Y: Mat3  # 1/s^2
    X: Mat3  # 1/s


def position_gain(q1: Scalar, q2: Scalar, r: Scalar) -> tuple[Scalar, Scalar]:
    """Optimal gain of one position axis, x_ddot = u with cost q1 e^2 + q2 e_dot^2 + r u^2.

    Parameters
    ----------
    q1, q2, r : scalar
        Weights in 1/m^2, s^2/m^2 and s^4/m^2, or any common multiple; q1, r > 0 and q2 >= 0.

    Returns
    -------
    k1, k2 : scalar
        u = -k1 e - k2 e_dot, in 1/s^2 and 1/s.
    """
    k1 = sqrt(q1 / r)
    return k1, sqrt(q2 / r + 2.0 * k1)


def attitude_problem(drift: Mat3, b: Vec3, q_angle: Vec3, q_rate: Vec3, r: Vec3) -> AttitudeProblem:
    """Scale the attitude block omega_dot = W omega + diag(b) u of (34) to unit input weight.

    Parameters
    ----------
    drift : Mat3, 1/s
        W, frozen at the current body rates; its diagonal need not be zero.
    b : Vec3
        Acceleration in rad/s^2 per unit of input: 1 where the input is an acceleration, 1/J where it is a torque.
    q_angle, q_rate, r : Vec3
        Weights of angles (> 0), rates (>= 0) and inputs (> 0), equation (35).
    """
    S = Vec3.of(b_i / sqrt(r_i) for b_i, r_i in zip(b, r, strict=True))
    W = Mat3.diagonal(S.map(lambda s: 1.0 / s)) @ drift @ Mat3.diagonal(S)
    return AttitudeProblem(W, Mat3.diagonal(q_angle.times(S.times(S))), Mat3.diagonal(q_rate.times(S.times(S))), S)


def feedback(problem: AttitudeProblem, gain: Gain) -> tuple[Mat3, Mat3]:
    """Gain in physical units: the acceleration diag(b) u = -K_angle e - K_rate omega, in 1/s^2 and 1/s."""
    S, S_inverse = Mat3.diagonal(problem.S), Mat3.diagonal(problem.S.map(lambda s: 1.0 / s))
    return S @ gain.Y @ S_inverse, S @ gain.X @ S_inverse


def guaranteed_gain(problem: AttitudeProblem) -> Gain:
    """The gain Y = diag sqrt(q_p), K = diag sqrt(q_d + 2 sqrt(q_p)) + W, which stabilises for every W.

    It cancels W, which leaves three stable double integrators. A start for Newton-Kleinman and the gain of an
    emergency, and nothing else: K is not symmetric, so a chord step from it would "converge" to a wrong answer,
    and no cost matrix belongs to it.
    """
    start = chord_start(problem)
    return Gain(start.Y, start.X + problem.W)


def chord_start(problem: AttitudeProblem) -> Gain:
    """The solution for W = 0 and diagonal weights, three axes by themselves; cold start of `chord_step`."""
    y = problem.Qp.diag.map(sqrt)
    return Gain(Mat3.diagonal(y), Mat3.diagonal((problem.Qd.diag + 2.0 * y).map(sqrt)))


def newton_kleinman_step(problem: AttitudeProblem, gain: Gain) -> tuple[Gain, Scalar]:
    """Improve a stabilising gain: solve the Lyapunov equation of its closed loop for the cost, take its gain.

    Parameters
    ----------
    problem : AttitudeProblem
    gain : Gain
        [Y, K]; K need not be symmetric.

    Returns
    -------
    gain : Gain
        [N, X], X symmetric. Where `gain` was stabilising, so is this one, and at most as costly.
    stabilising : scalar, 1 or 0
        1 where `gain` was stabilising, told from the cost matrix being positive definite; 0 for NaN.
        Where it was not, the new gain is not either.
    """
    W, Qp, Qd, _ = problem
    Y, K = gain
    Z = K - W
    M1, M2, M3 = Qp + Y.T @ Y, Y.T @ K, Qd + K.T @ K
    solve = _LyapunovSolver(Z)
    Y_inverse_T = _inverse(Y).T

    # Y^T N + N^T Y = M1 fixes N up to a skew matrix, Y^-T skew(s), and X follows from N linearly.
    N_0 = Y_inverse_T @ M1 * 0.5
    X_0 = solve(N_0 + N_0.T + M3)
    N_s = [Y_inverse_T @ skew for skew in _SKEW_BASIS]
    X_s = [solve(N_k + N_k.T) for N_k in N_s]

    # s makes the upper left block of the cost matrix, N^T Z + Y^T X - M2, symmetric.
    a, b, c = (_axial(N_k.T @ Z + Y.T @ X_k) for N_k, X_k in zip(N_s, X_s, strict=True))
    s = -(_inverse(Mat3.columns(a, b, c)) @ _axial(N_0.T @ Z + Y.T @ X_0 - M2))
    N, X = N_0, X_0
    for s_k, N_k, X_k in zip(s, N_s, X_s, strict=True):
        N, X = N + N_k * s_k, X + X_k * s_k
    return Gain(N, X), _positive_definite(N.T @ Z + Y.T @ X - M2, N, X)


def chord_step(problem: AttitudeProblem, gain: Gain) -> Gain:
    """Improve a symmetric gain cheaply: Newton's step with the off-diagonal parts of Y and Z left out of its slope.

    For diagonal Qp, zero diagonal of W and |W| < 0.5 min z_ii only (no failure in 12,000 cold starts). The weaker
    |W| < 0.5 |Z| is enough where the axes' weights are alike, not where they span decades: 1 in 30 of those diverge.
    Start it from `chord_start` or another gain with symmetric X, never from `guaranteed_gain`, and test its outcome
    with `routh_stable`.
    """
    Y, X = gain
    Z = X - problem.W
    E1 = problem.Qp - Y.T @ Y
    E2 = _rate_defect(problem, gain)
    F = Y.T @ Z - Z.T @ Y
    y, z = Y.diag, Z.diag
    dy = E1.diag.over(2.0 * y)
    dx = (E2.diag + 2.0 * dy).over(2.0 * z)

    def pair(
        y_i: Scalar, y_j: Scalar, z_i: Scalar, z_j: Scalar, e1: Scalar, e2: Scalar, f: Scalar
    ) -> tuple[Scalar, Scalar, Scalar]:
        kappa = (y_i - y_j) / (z_i + z_j)
        rho = -f - kappa * e2
        delta = y_i * (z_j + kappa) - y_j * (kappa - z_i)
        dy_ij = (e1 * (z_j + kappa) - y_j * rho) / delta
        dy_ji = (y_i * rho - (kappa - z_i) * e1) / delta
        return dy_ij, dy_ji, (e2 + dy_ij + dy_ji) / (z_i + z_j)

    xy, yx, x_xy = pair(y.x, y.y, z.x, z.y, E1.xy, E2.xy, F.xy)
    xz, zx, x_xz = pair(y.x, y.z, z.x, z.z, E1.xz, E2.xz, F.xz)
    yz, zy, x_yz = pair(y.y, y.z, z.y, z.z, E1.yz, E2.yz, F.yz)
    return Gain(
        Y + Mat3(dy.x, xy, xz, yx, dy.y, yz, zx, zy, dy.z),
        X + Mat3(dx.x, x_xy, x_xz, x_xy, dx.y, x_yz, x_xz, x_yz, dx.z),
    )


def routh_stable(problem: AttitudeProblem, gain: Gain) -> Scalar:
    """1 where the gain stabilises, by Routh's test on det(lambda^2 I + lambda Z + Y); X need not be symmetric."""
    Y, Z = gain.Y, gain.X - problem.W
    adj_Y, adj_Z = Y.adjugate(), Z.adjugate()
    t_Y, t_Z = Y.trace(), Z.trace()
    coefficients = (
        1.0,
        t_Z,
        adj_Z.trace() + t_Y,
        Z.det() + t_Z * t_Y - (Z @ Y).trace(),
        adj_Y.trace() + (adj_Z @ Y).trace(),
        (adj_Y @ Z).trace(),
        Y.det(),
    )
    above, row = list(coefficients[0::2]), list(coefficients[1::2])
    stable = greater(row[0], 0.0)
    while len(above) > 1:
        ratio = above[0] * _reciprocal(row[0])
        below = [a - ratio * b for a, b in zip(above[1:], [*row[1:], 0.0], strict=False)]
        above, row = row, below
        stable = both(stable, greater(row[0], 0.0))
    return stable


def residual(problem: AttitudeProblem, gain: Gain) -> Scalar:
    """Relative residual of the Riccati equation: the sum of its three blocks' and of the asymmetry of X.

    Zero for *every* solution of (22), also for those that do not stabilise. The asymmetry shows up a gain that is
    no part of any cost matrix, such as `guaranteed_gain`.
    """
    Y, X = gain
    YZ = Y.T @ (X - problem.W)
    diagonal = YZ.diag.map(absolute)
    return (
        (problem.Qp - Y.T @ Y).norm() / problem.Qp.trace()
        + _rate_defect(problem, gain).norm() / X.diag.dot(X.diag)
        + (YZ - YZ.T).norm() / (diagonal.x + diagonal.y + diagonal.z)
        + (X - X.T).norm() / X.norm()
    )


def fly(problem: AttitudeProblem, stored: Gain, steps: int) -> tuple[Gain, Scalar, Scalar]:
    """The gain to be flown and stored at one sampling instant: a fixed sequence of operations on every engine.

    Parameters
    ----------
    problem : AttitudeProblem
        At the current rates.
    stored : Gain
        Outcome of the last instant. Anything is allowed; it should stabilise, and does unless W jumps.
    steps : int
        Newton-Kleinman steps, at least 1.

    Returns
    -------
    gain : Gain
        Stabilises for the frozen W, always (if W is finite).
    residual : scalar
        `residual` of this gain.
    guarded : scalar, 1 or 0
        1 where the steps failed and the guaranteed gain is returned.
    """
    if steps < 1:
        raise ValueError(f"steps is {steps}; at least one Newton-Kleinman step is needed, as only it brings a test")
    gain, improved = newton_kleinman_step(problem, stored)
    for _ in range(steps - 1):
        gain, improved = newton_kleinman_step(problem, gain)  # from a stabilising gain, all later ones stabilise
    # But for rounding the two tests are one: a step's gain stabilises exactly where its cost matrix is positive
    # definite. About 1 of 100,000 wild starts is ill-conditioned enough to pass the cost matrix by mistake.
    stabilising = both(improved, routh_stable(problem, gain))
    gain = select_record(stabilising, gain, guaranteed_gain(problem))
    return gain, residual(problem, gain), negated(stabilising)


# ------------------------------------------------------------------------------------------------------------ algebra


class _LyapunovSolver:
    """Z^T X + X Z = C for a 3x3 Z and several symmetric C, in closed form by Cayley and Hamilton."""

    def __init__(self, Z: Mat3) -> None:
        self._Z, self._Z2 = Z, Z @ Z
        self._t, self._u = Z.trace(), Z.adjugate().trace()
        self._divisor = _inverse((self._Z2.T * self._t + Mat3.diagonal(Vec3(1.0, 1.0, 1.0) * Z.det())) * 2.0)

    def __call__(self, C: Mat3) -> Mat3:
        Z, Z2, t, u = self._Z, self._Z2, self._t, self._u
        CZ = C @ Z
        X: Mat3 = self._divisor @ (C @ Z2 - Z.T @ CZ + Z2.T @ C - (CZ - CZ.T) * t + C * u)
        return Mat3.__mul__(X + X.T, 0.5)  # symmetric already but for rounding


def _rate_defect(problem: AttitudeProblem, gain: Gain) -> Mat3:
    """Defect of the rate block, Q_d + W^T W + Y + Y^T - Z^T Z, in the form that does not cancel W^T W."""
    Y, X = gain
    XW = X.T @ problem.W
    return problem.Qd + Y + Y.T - X.T @ X + XW + XW.T


def _axial(M: Mat3) -> Vec3:
    """The vector v for which M - M^T = skew(v); zero where M is symmetric."""
    return Vec3(M.zy - M.yz, M.xz - M.zx, M.yx - M.xy)


def _reciprocal(x: Scalar) -> Scalar:
    """1/x, and NaN at zero, where Python floats would raise."""
    return 1.0 / select(greater(x * x, 0.0), x, NAN)


def _inverse(M: Mat3) -> Mat3:
    """Inverse; NaN where the matrix is singular."""
    inverse: Mat3 = M.adjugate() * _reciprocal(M.det())
    return inverse


def _positive_definite(P11: Mat3, P21: Mat3, P22: Mat3) -> Scalar:
    """1 where the symmetric 6x6 matrix [[P11, P21^T], [P21, P22]] is positive definite and finite, else 0."""
    left, right = [*P11.rows, *P21.rows], [*P21.T.rows, *P22.rows]
    rows: Sequence[Sequence[Scalar]] = [[*a, *b][: i + 1] for i, (a, b) in enumerate(zip(left, right, strict=True))]
    positive = is_finite(P11.trace() + P22.trace())  # the diagonal of a positive definite matrix bounds the rest
    while rows:
        # One step of Cholesky's elimination on the lower triangle; a pivot of zero or below fails at once.
        pivot, column = rows[0][0], [row[0] for row in rows[1:]]
        positive = both(positive, greater(pivot, 0.0))
        reciprocal = _reciprocal(pivot)
        scaled = [c * reciprocal for c in column]
        rows = [[a - scaled[i] * column[j] for j, a in enumerate(row[1:])] for i, row in enumerate(rows[1:])]
    return positive
