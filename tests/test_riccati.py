"""The Riccati solvers against their defining equation, eigenvalues, SciPy and SLICOT, and against hostile starts."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from scipy.linalg import block_diag, solve_continuous_are, solve_continuous_lyapunov

from rotorfault.control.riccati import (
    AttitudeProblem,
    Gain,
    _positive_definite,
    attitude_problem,
    chord_start,
    chord_step,
    feedback,
    fly,
    guaranteed_gain,
    newton_kleinman_step,
    position_gain,
    residual,
    routh_stable,
)
from rotorfault.control.riccati_reference import (
    closed_loop_poles,
    cost_matrix,
    dense_problem,
    matrix,
    solve_dense,
    solve_iterated,
)
from rotorfault.errors import InputError
from rotorfault.geometry import Mat3, Vec3
from rotorfault.records import flatten, unflatten

ONE = Vec3(1.0, 1.0, 1.0)


# ------------------------------------------------------------------------------------------------ problems at random


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


def converged(problem: AttitudeProblem, steps: int = 30) -> Gain:
    gain = guaranteed_gain(problem)
    for _ in range(steps):
        gain, _ = newton_kleinman_step(problem, gain)
    return gain


def relative(found: np.ndarray, expected: np.ndarray) -> float:
    return float(np.linalg.norm(found - expected) / np.linalg.norm(expected))


# --------------------------------------------------------------------------------------------------- closed forms


WEIGHTS = [(1.0, 1.0, 1.0), (3.0, 0.01, 0.002), (0.3, 0.0, 20.0), (900.0, 1.0, 0.1)]


@pytest.mark.parametrize(("q1", "q2", "r"), WEIGHTS)
def test_position_gain_is_the_lqr_gain(q1: float, q2: float, r: float) -> None:
    P = solve_continuous_are([[0.0, 1.0], [0.0, 0.0]], [[0.0], [1.0]], np.diag([q1, q2]), [[r]])
    assert position_gain(q1, q2, r) == pytest.approx(tuple(P[1] / r), rel=1e-9)


def test_without_drift_the_axes_are_their_own_lqr() -> None:
    b, q_angle, q_rate, r = Vec3(1.0, 40.0, 3.0), Vec3(1.0, 7.0, 0.2), Vec3(1.0, 0.0, 5.0), Vec3(0.0088, 2.0, 0.3)
    problem = attitude_problem(Mat3.diagonal(ONE * 0.0), b, q_angle, q_rate, r)
    K_angle, K_rate = feedback(problem, solve_iterated(problem))
    for i in range(3):
        b_i, q1, q2, r_i = (list(v)[i] for v in (b, q_angle, q_rate, r))
        k1, k2 = position_gain(q1, q2, r_i / (b_i * b_i))
        assert matrix(K_angle)[i] == pytest.approx(np.eye(3)[i] * k1, abs=1e-11 * k1)
        assert matrix(K_rate)[i] == pytest.approx(np.eye(3)[i] * k2, abs=1e-11 * k2)


# --------------------------------------------------------------------------------------- the solution against oracles


@pytest.fixture(scope="module")
def thousand() -> list[tuple[Any, AttitudeProblem, Gain]]:
    """1,000 problems, body rates up to 30 rad/s, with the iterated solution."""
    rng = np.random.default_rng(2024)
    found = []
    for rate in (1.0, 10.0, 30.0, 30.0):
        batch = tuple(broadcast(a, 250) for a in random_arguments(rng, 250, rate))
        for i in range(250):
            arguments = one(batch, i)
            problem = attitude_problem(*arguments)
            found.append((arguments, problem, solve_iterated(problem)))
    return found


def test_iterated_solution_satisfies_the_riccati_equation(thousand: Any) -> None:
    assert max(residual(problem, gain) for _, problem, gain in thousand) <= 1e-12


def test_iterated_solution_has_stable_poles_and_positive_cost(thousand: Any) -> None:
    for _, problem, gain in thousand:
        assert closed_loop_poles(problem, gain).real.max() < 0.0
        P = cost_matrix(problem, gain)
        d = 1.0 / np.sqrt(np.diag(P))
        assert np.array_equal(P, P.T)
        assert np.linalg.eigvalsh(d[:, None] * P * d).min() > 0.0


def test_agrees_with_scipy(thousand: Any) -> None:
    for arguments, problem, gain in thousand:
        dense = dense_problem(*arguments)
        P = solve_dense(dense)
        assert relative(cost_matrix(problem, gain), P) < 1e-8
        K = np.hstack([matrix(block) for block in feedback(problem, gain)])
        assert relative(K, dense.B[3:] @ np.linalg.solve(dense.R, dense.B.T @ P)) < 1e-8


def test_agrees_with_slicot(thousand: Any) -> None:
    ctrlsys = pytest.importorskip("ctrlsys")
    for arguments, problem, gain in thousand:
        A, B, Q, R = dense_problem(*arguments)
        G = B @ np.linalg.solve(R, B.T)
        P, *_, info = ctrlsys.sb02pd(*(np.asfortranarray(M) for M in (A, G, Q)))
        assert info == 0
        assert relative(cost_matrix(problem, gain), P) < 1e-8


def test_newton_kleinman_step_solves_the_lyapunov_equation_of_its_start() -> None:
    """Also for full weights, a full W and a K that is not symmetric."""
    rng = np.random.default_rng(7)
    for _ in range(100):
        root = rng.normal(size=(3, 3))
        mats = [rng.normal(size=(3, 3)) * 5, root @ root.T + np.eye(3), np.diag(rng.uniform(0, 3, 3))]
        problem = AttitudeProblem(*(Mat3(*map(float, M.ravel())) for M in mats), ONE)
        start = guaranteed_gain(problem)
        start = Gain(start.Y + one(noise(rng, 1, -2, -1), 0), start.X + one(noise(rng, 1, -2, -1), 0))
        gain, stabilising = newton_kleinman_step(problem, start)
        W, Qp, Qd = mats
        K = np.hstack([matrix(start.Y), matrix(start.X)])
        A = np.block([[np.zeros((3, 3)), np.eye(3)], [-K[:, :3], W - K[:, 3:]]])
        P = solve_continuous_lyapunov(A.T, -(block_diag(Qp, Qd) + K.T @ K))
        assert np.linalg.eigvals(A).real.max() < 0.0
        assert stabilising == 1.0
        assert relative(np.hstack([matrix(gain.Y), matrix(gain.X)]), P[3:]) < 1e-10


def test_reference_refuses_what_has_no_answer() -> None:
    problem = attitude_problem(Mat3.skew(ONE), ONE, ONE, ONE, ONE)
    with pytest.raises(InputError, match="not symmetric"):
        cost_matrix(problem, guaranteed_gain(problem))
    for q_angle in (Vec3(-1.0, 1.0, 1.0), Vec3(math.nan, 1.0, 1.0), Vec3(1.0, 1.0, 0.0)):
        with pytest.raises(InputError, match="no solution"):
            solve_iterated(attitude_problem(Mat3.skew(ONE), ONE, q_angle, ONE, ONE))


def test_reference_converges_where_the_residual_rises_on_the_way() -> None:
    problem = AttitudeProblem(
        Mat3(0.0, 0.78, 170.0, 140.0, 0.0, 5.7, -30.0, -0.72, 0.0),
        Mat3.diagonal(Vec3(10.0, 9.2, 2100.0)), Mat3.diagonal(Vec3(5.0, 0.4, 14.0)), ONE,
    )  # fmt: skip
    gain, course = guaranteed_gain(problem), []
    for _ in range(14):
        gain, _ = newton_kleinman_step(problem, gain)
        course.append(residual(problem, gain))
    assert any(after > before > 0.1 for before, after in pairwise(course))
    assert residual(problem, solve_iterated(problem)) < 1e-12


# ------------------------------------------------------------------------------------------------------ stability


@pytest.mark.parametrize("rate", [0.0, 30.0, 1000.0, 1e5])
def test_guaranteed_gain_stabilises_for_every_drift(rate: float) -> None:
    rng = np.random.default_rng(5)
    problem = random_problem(rng, 3000, 5.0)
    problem = problem._replace(W=Mat3(*(rng.uniform(-rate, rate, 3000) for _ in range(9))))
    gain = guaranteed_gain(problem)
    # Exactly: without rounding of K - W, where eigenvalues of a matrix that large would be the test's own error.
    assert np.all(rightmost(problem._replace(W=problem.W * 0.0), gain._replace(X=gain.X - problem.W)) < 0.0)
    assert np.all(routh_stable(problem, gain) == 1.0)


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


@pytest.mark.parametrize("steps", [1, 2, 3])
@pytest.mark.parametrize("rate", [2.0, 30.0, 300.0])
def test_flown_gain_always_stabilises(rate: float, steps: int) -> None:
    rng = np.random.default_rng(int(rate) + steps)
    n = 4000
    problem = random_problem(rng, n, rate)
    with np.errstate(all="ignore"):
        for name, stored in hostile_starts(rng, problem, n).items():
            gain, last, guarded = fly(problem, stored, steps)
            assert np.all(rightmost(problem, gain) < 0.0), name
            assert np.all(np.isfinite(last)), name
            emergency = stack(guaranteed_gain(problem).X)
            assert np.array_equal(stack(gain.X)[guarded == 1.0], emergency[guarded == 1.0]), name
            if name == "holes":
                continue  # with numbers of 1e200 in it, not even the eigenvalues know whether it was stable
            was_stable = rightmost(problem, stored) < 0.0
            if steps == 1:
                assert np.array_equal(guarded == 0.0, was_stable), name
            else:
                # The cost of a start at the very edge is so large that rounding in the next step may raise an alarm.
                assert np.sum(guarded[was_stable]) <= 2e-3 * n, name


def test_a_start_that_passes_the_cost_matrix_by_rounding_is_not_flown() -> None:
    """Found among 100,000 starts: a pole at +10/s, and yet six positive pivots."""
    problem = AttitudeProblem(
        Mat3(
            0.0, -0.030478402190791707, 0.23652299607631658,
            0.07152759760029348, 0.0, -0.012639224779747235,
            0.02057969667682488, -0.003295572589606334, 0.0,
        ),
        Mat3.diagonal(Vec3(0.21342483043501062, 40.980753376313345, 601.0844629094671)),
        Mat3.diagonal(Vec3(0.18988864541438236, 0.6971433674972457, 21.67650039500362)),
        ONE,
    )  # fmt: skip
    stored = Gain(
        Mat3(
            1.6034063297483676, 45.78251247749362, -25.84518138167365,
            -3.1366921388992655, 27.263972743056563, 18.480085477222925,
            1.3311472474884696, 9.09804902572288, 74.67767734263062,
        ),
        Mat3(
            265.13735027795997, -855.0166526352351, -303.77572579291353,
            -855.0166526352351, 2757.721518454499, 979.5851630119258,
            -303.77572579291353, 979.5851630119258, 348.1392593011112,
        ),
    )  # fmt: skip
    flown, _, guarded = fly(problem, stored, 1)
    assert guarded == 1.0
    assert closed_loop_poles(problem, flown).real.max() < 0.0


def test_an_infinite_cost_is_not_positive_definite() -> None:
    none, one_ = Mat3.diagonal(ONE * 0.0), Mat3.identity()
    assert _positive_definite(one_, none, one_) == 1.0
    for bad in (0.0, -1.0, math.inf, math.nan):
        assert _positive_definite(Mat3.diagonal(Vec3(1.0, bad, 1.0)), none, one_) == 0.0
        assert _positive_definite(one_, none, Mat3.diagonal(Vec3(1.0, 1.0, bad))) == 0.0


def test_both_tests_of_stability_agree_with_eigenvalues() -> None:
    rng = np.random.default_rng(11)
    n, seen = 3000, 0
    for rate in (2.0, 30.0):
        problem = random_problem(rng, n, rate)
        with np.errstate(all="ignore"):
            for name, gain in hostile_starts(rng, problem, n).items():
                if name in ("holes", "zero", "NaN"):
                    continue
                stable = rightmost(problem, gain) < 0.0
                new, previous_stabilises = newton_kleinman_step(problem, gain)
                assert np.array_equal(previous_stabilises == 1.0, stable), name
                assert np.array_equal(routh_stable(problem, gain) == 1.0, stable), name
                assert np.all(rightmost(problem, new)[stable] < 0.0), name
                seen += int(np.sum(~stable))
    assert seen > 2000


def test_false_solutions_have_residual_zero_and_are_not_flown() -> None:
    """Other invariant subspaces of the Hamiltonian solve (22) as well; Newton-Kleinman stays with them."""
    rng = np.random.default_rng(13)
    problems = random_problem(rng, 40, 20.0)
    caught = 0
    for i in range(40):
        problem = one(problems, i)
        zero, eye = np.zeros((3, 3)), np.eye(3)
        A = np.block([[zero, eye], [zero, matrix(problem.W)]])
        H = np.block([[A, -block_diag(zero, eye)], [-block_diag(matrix(problem.Qp), matrix(problem.Qd)), -A.T]])
        poles, vectors = np.linalg.eig(H)
        # The stable half with one real pole, or one pair, exchanged for its mirror image.
        stable = np.flatnonzero(poles.real < 0)
        swapped = np.isclose(np.abs(poles[stable].real), np.abs(poles[stable[0]].real), rtol=1e-9)
        mirror = [int(np.argmin(np.abs(poles + poles[k].conj()))) for k in stable[swapped]]
        basis = vectors[:, [*stable[~swapped], *mirror]]
        P = np.real(basis[6:] @ np.linalg.inv(basis[:6]))
        gain = Gain(Mat3(*map(float, P[3:, :3].ravel())), Mat3(*map(float, P[3:, 3:].ravel())))
        assert residual(problem, gain) < 1e-8
        assert closed_loop_poles(problem, gain).real.max() > 0.0
        assert routh_stable(problem, gain) == 0.0
        for steps in (1, 3):
            flown, _, _ = fly(problem, gain, steps)
            assert closed_loop_poles(problem, flown).real.max() < 0.0
        caught += int(fly(problem, gain, 1)[2] == 1.0)
    assert caught == 40


# ----------------------------------------------------------------------------------------------------- chord step


def chord_converged(problem: AttitudeProblem, steps: int) -> Gain:
    gain = chord_start(problem)
    for _ in range(steps):
        gain = chord_step(problem, gain)
    return gain


def test_chord_step_converges_in_its_domain_to_the_same_solution() -> None:
    rng = np.random.default_rng(17)
    problem = random_problem(rng, 8000, 10.0)
    right = converged(problem)
    z = (right.X - problem.W).diag
    inside = problem.W.norm() < 0.5 * np.minimum(np.minimum(z.x, z.y), z.z)
    assert np.sum(inside) > 300
    with np.errstate(all="ignore"):
        gain = chord_converged(problem, 60)
        last, stable = residual(problem, gain), routh_stable(problem, gain)
    assert np.all(last[inside] < 1e-11)
    assert np.all(stable[inside] == 1.0)
    for found, expected in ((gain.Y, right.Y), (gain.X, right.X)):
        assert np.max(((found - expected).norm() / expected.norm())[inside]) < 1e-9


def test_chord_step_is_of_first_order_in_the_drift() -> None:
    """One warm step contracts the error by about |W|/|Z|: the terms it leaves out are the off-diagonal ones."""
    rng = np.random.default_rng(19)
    problem = random_problem(rng, 500, 10.0)
    for factor in (1e-2, 1e-3):
        small = problem._replace(W=problem.W * factor)
        start = chord_start(small)
        before = residual(small, start)
        after = residual(small, chord_step(small, start))
        assert np.median(after / before) < 10.0 * factor


def test_chord_step_from_the_guaranteed_gain_is_shown_up_by_the_residual() -> None:
    """It converges to a gain whose three blocks vanish, but whose X is not symmetric."""
    problem = attitude_problem(Mat3.skew(Vec3(0.3, -0.2, 0.1)), ONE, Vec3(1.0, 2.0, 3.0), ONE, ONE)
    gain = guaranteed_gain(problem)
    for _ in range(60):
        gain = chord_step(problem, gain)
    Y, X, W = (matrix(M) for M in (gain.Y, gain.X, problem.W))
    Z = X - W
    assert np.abs(Z.T @ Z - matrix(problem.Qd) - W.T @ W - Y - Y.T).max() < 1e-12
    assert np.abs(Y.T @ Z - Z.T @ Y).max() < 1e-12
    assert residual(problem, gain) > 1e-2


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
