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
p. 114) is an exact Lyapunov solve, here reduced to two 3x3 systems. The iterated reference solver is in
`rotorfault.autopilot.control.riccati_reference`.

Every operation counts, for `fly` is a large part of a control step: products known to be symmetric are mirrored,
and what depends on the weights alone (S, Qp, Qd and their quotients) is kept together, to be computed once.
"""

from __future__ import annotations

from typing import NamedTuple

from rotorfault.maths.geometry import Mat3, Vec3
from rotorfault.maths.records import select_record
from rotorfault.maths.scalar import Scalar, absolute, both, greater, is_finite, negated, reciprocal, select, sqrt


class AttitudeProblem(NamedTuple):
    """The attitude block of (22), scaled to unit input weight."""

    W: Mat3  # 1/s: S^-1 W S, drift of the scaled rates
    Qp: Mat3  # 1/s^4: S Qp S, weight of the angles; symmetric, positive definite
    Qd: Mat3  # 1/s^2: S Qd S, weight of the rates; symmetric, positive semidefinite
    S: Vec3  # 1/s^2: b/sqrt(r), scales angles, rates and accelerations alike


class Gain(NamedTuple):
    """Gain of the scaled problem, u = -(Y e + X omega), and the state that `fly` stores.

    X is the lower right block of P, and symmetric, after any Newton-Kleinman step. The X of `guaranteed_gain` is
    a gain only: it is not symmetric.
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
    W = drift.times(_ratios(S).T)
    return AttitudeProblem(W, Mat3.diagonal(q_angle.times(S.times(S))), Mat3.diagonal(q_rate.times(S.times(S))), S)


def feedback(problem: AttitudeProblem, gain: Gain) -> tuple[Mat3, Mat3]:
    """Gain in physical units: the acceleration diag(b) u = -K_angle e - K_rate omega, in 1/s^2 and 1/s."""
    ratios = _ratios(problem.S)  # S Y S^-1, element by element
    return gain.Y.times(ratios), gain.X.times(ratios)


def guaranteed_gain(problem: AttitudeProblem) -> Gain:
    """The gain Y = diag sqrt(q_p), K = diag sqrt(q_d + 2 sqrt(q_p)) + W, which stabilises for every W.

    It cancels W, which leaves three stable double integrators. A start for Newton-Kleinman and the gain of an
    emergency, and nothing else: K is not symmetric, so no cost matrix belongs to it.
    """
    y = problem.Qp.diag.map(sqrt)
    return Gain(Mat3.diagonal(y), Mat3.diagonal((problem.Qd.diag + 2.0 * y).map(sqrt)) + problem.W)


def newton_kleinman_step(problem: AttitudeProblem, gain: Gain) -> Gain:
    """Improve a stabilising gain: solve the Lyapunov equation of its closed loop for the cost, take its gain.

    The cost of [Y, K] has the lower half [N, X]. With Z = K - W its blocks read

        Y^T N + N^T Y = Q_p + Y^T Y,  Z^T X + X Z = N + N^T + Q_d + K^T K,  N^T Z + Y^T (X - K) symmetric.

    The first two leave one skew matrix each free. With vectors s and a for them,

        2 N = Y + G,  2 X Z = B + G + skew(a),  G = Y^-T (Q_p + skew(s)),

    with B = Y + Q_d + K^T K.

    Parameters
    ----------
    problem : AttitudeProblem
    gain : Gain
        [Y, K]; K need not be symmetric.

    Returns
    -------
    gain : Gain
        [N, X], X symmetric. Where `gain` was stabilising, so is this one, and at most as costly; where it was not,
        this one is not either. Not finite where Y, Z or the Lyapunov equation is singular.
    """
    W, Qp, Qd, _ = problem
    Y, K = gain
    Z = K - W
    Y_inverse = Y.inverse()
    V, YZ = Y_inverse @ Z, Y @ Z
    # Only the symmetric part of B counts; an upper triangular B would save 30 operations and cost a digit.
    B = Y + Qd + _mirrored(K.T @ K)

    # X and, multiplied by Z^T and Z, the third equation are symmetric when
    #     L(V) s + L(Z) a = f,  L(Z) s + (L(YZ) + L(Z) adj(Z)) a = g,  L(M) = M - tr(M) I.
    # Two rules lead there: axial(M^T skew(v)) = -L(M) v and axial(M^T C M) = adj(M) axial(C).
    ZB = _axial(Z.T @ B)
    adj_Z, t, d = Z.adjugate(), Z.trace(), Z.det()
    f = ZB + _axial(V.T @ Qp)
    g = _axial(YZ.T @ B) + _axial(Z.T @ Qp) + adj_Z @ (ZB - _axial(Y.T @ (K + W)))
    L_V, L_Z = _less_trace(V), _less_trace(Z)
    L_Z_inverse = (adj_Z + Z * t) * reciprocal(d - t * adj_Z.trace())
    U = _less_trace(YZ) @ L_Z_inverse + adj_Z
    s = _solve(L_Z - U @ L_V, g - U @ f)
    a = L_Z_inverse @ (f - L_V @ s)

    G = Y_inverse.T @ (Qp + Mat3.skew(s))
    N = (Y + G) * 0.5
    X = _mirrored((B + G + Mat3.skew(a)) @ adj_Z) * (0.5 * reciprocal(d))
    return Gain(N, X)


def routh_stable(problem: AttitudeProblem, gain: Gain) -> Scalar:
    """1 where the gain stabilises, by Routh's test on det(lambda^2 I + lambda Z + Y); 0 for NaN and infinity.

    X need not be symmetric. Each row of Routh's table is multiplied by the head of the row above, which does not
    change signs as long as they are positive and saves the divisions. The last head is of 19th degree in the poles:
    it overflows, and counts as unstable, beyond 1e15 rad/s.

    A step from a start on the verge of stability has a gain so large that the coefficients are small differences of
    large numbers. It shows in det(Y) or det(Z), which then is tiny against the product of its columns' lengths
    (Hadamard's bound); below 1e-10 of that the signs are not trusted.
    """
    Y, Z = gain.Y, gain.X - problem.W
    adj_Y, adj_Z = Y.adjugate(), Z.adjugate()
    t_Y, t_Z, d_Y, d_Z = Y.trace(), Z.trace(), Y.det(), Z.det()
    above = [1.0, adj_Z.trace() + t_Y, adj_Y.trace() + _trace_of_product(adj_Z, Y), d_Y]
    row = [t_Z, d_Z + t_Z * t_Y - _trace_of_product(Z, Y), _trace_of_product(adj_Y, Z)]
    certain = both(_certain_determinant(Y, d_Y), _certain_determinant(Z, d_Z))
    stable = both(certain, both(greater(d_Y, 0.0), greater(t_Z, 0.0)))
    for _ in range(4):
        below = [row[0] * a - above[0] * b for a, b in zip(above[1:], [*row[1:], 0.0], strict=False)]
        above, row = row, below
        stable = both(stable, greater(row[0], 0.0))
    # The last head is made of all coefficients: where one of them is not finite, it is not either.
    return both(stable, is_finite(row[0]))


def residual(problem: AttitudeProblem, gain: Gain) -> Scalar:
    """Relative residual of the Riccati equation: the sum of its three blocks' and of the asymmetry of X.

    Zero for *every* solution of (22), also for those that do not stabilise. The asymmetry shows up a gain that is
    no part of any cost matrix, such as `guaranteed_gain`.
    """
    X = gain.X
    return _residual_of_blocks(problem, gain) + (X - X.T).norm() / X.norm()


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
        `residual` of this gain; 1 where the guaranteed gain is returned, which solves no Riccati equation.
    guarded : scalar, 1 or 0
        1 where the steps failed and the guaranteed gain is returned.
    """
    if steps < 1:
        raise ValueError(f"steps is {steps}; at least one Newton-Kleinman step is needed")
    gain = stored
    for _ in range(steps):
        gain = newton_kleinman_step(problem, gain)
    stabilising = routh_stable(problem, gain)
    flown = select_record(stabilising, gain, guaranteed_gain(problem))
    # X of a step is symmetric to the last bit, so that its asymmetry need not be measured.
    return flown, select(stabilising, _residual_of_blocks(problem, gain), 1.0), negated(stabilising)


# ------------------------------------------------------------------------------------------------------------ algebra


def _ratios(S: Vec3) -> Mat3:
    """The quotients s_i/s_j, for which S M S^-1 is an elementwise product."""
    return Mat3(1.0, S.x / S.y, S.x / S.z, S.y / S.x, 1.0, S.y / S.z, S.z / S.x, S.z / S.y, 1.0)


def _rate_defect(problem: AttitudeProblem, gain: Gain) -> Mat3:
    """Defect of the rate block, Q_d + W^T W + Y + Y^T - Z^T Z, in the form that does not cancel W^T W."""
    Y, X = gain
    W = problem.W
    return problem.Qd + _mirrored(Y + Y.T - (X.T @ (X - W) - W.T @ X))


def _residual_of_blocks(problem: AttitudeProblem, gain: Gain) -> Scalar:
    """`residual` without the asymmetry of X."""
    Y, X = gain
    YZ = Y.T @ (X - problem.W)
    skew, diagonal = _axial(YZ), YZ.diag.map(absolute)
    return (
        _norm_of_symmetric(problem.Qp - _mirrored(Y.T @ Y)) * (1.0 / problem.Qp.trace())
        + _norm_of_symmetric(_rate_defect(problem, gain)) / X.diag.dot(X.diag)
        + sqrt(2.0 * skew.dot(skew)) / (diagonal.x + diagonal.y + diagonal.z)
    )


def _axial(M: Mat3) -> Vec3:
    """The vector v for which M - M^T = skew(v); zero where M is symmetric."""
    return Vec3(M.zy - M.yz, M.xz - M.zx, M.yx - M.xy)


def _mirrored(M: Mat3) -> Mat3:
    """The symmetric matrix with this upper triangle, for a product that is symmetric but for rounding.

    A compiled function leaves out what only the elements below the diagonal would need.
    """
    return Mat3(M.xx, M.xy, M.xz, M.xy, M.yy, M.yz, M.xz, M.yz, M.zz)


def _less_trace(M: Mat3) -> Mat3:
    """M - tr(M) I."""
    return Mat3(-M.yy - M.zz, M.xy, M.xz, M.yx, -M.xx - M.zz, M.yz, M.zx, M.zy, -M.xx - M.yy)


def _solve(M: Mat3, v: Vec3) -> Vec3:
    """The vector u with M u = v; not finite where M is singular."""
    u: Vec3 = (M.adjugate() @ v) * reciprocal(M.det())
    return u


def _trace_of_product(A: Mat3, B: Mat3) -> Scalar:
    """tr(A B)."""
    return (A @ B).trace()


def _certain_determinant(M: Mat3, det: Scalar) -> Scalar:
    """1 where the determinant is above 1e-10 of Hadamard's bound, so that rounding leaves its sign alone."""
    squares = (M.T @ M).diag
    return greater(det * det, 1e-20 * squares.x * squares.y * squares.z)


def _norm_of_symmetric(M: Mat3) -> Scalar:
    """Frobenius norm, from the upper triangle."""
    diagonal, upper = M.diag, Vec3(M.xy, M.xz, M.yz)
    return sqrt(diagonal.dot(diagonal) + 2.0 * upper.dot(upper))
