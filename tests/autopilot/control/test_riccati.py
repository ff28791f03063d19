"""The Riccati solvers against their defining equation, eigenvalues, SciPy and SLICOT, and against hostile starts."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from riccati_problems import (
    ONE,
    broadcast,
    closed_loop_poles,
    converged,
    cost_is_positive,
    exactly_stable,
    hostile_starts,
    noise,
    on_the_verge,
    one,
    random_arguments,
    random_problem,
    relative,
    rightmost,
    solve_dense,
    stack,
)
from scipy.linalg import block_diag, solve_continuous_are, solve_continuous_lyapunov

from rotorfault.autopilot.control.riccati import (
    AttitudeProblem,
    Gain,
    attitude_problem,
    feedback,
    fly,
    guaranteed_gain,
    newton_kleinman_step,
    position_gain,
    residual,
    routh_stable,
)
from rotorfault.autopilot.control.riccati_reference import (
    cost_matrix,
    dense_problem,
    matrix,
    solve_iterated,
)
from rotorfault.base.errors import InputError
from rotorfault.maths.geometry import Mat3, Vec3
from rotorfault.maths.records import flatten, unflatten

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
    """Which takes its time: every fourth of them."""
    for arguments, problem, gain in thousand[::4]:
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
        gain = newton_kleinman_step(problem, start)
        W, Qp, Qd = mats
        K = np.hstack([matrix(start.Y), matrix(start.X)])
        A = np.block([[np.zeros((3, 3)), np.eye(3)], [-K[:, :3], W - K[:, 3:]]])
        P = solve_continuous_lyapunov(A.T, -(block_diag(Qp, Qd) + K.T @ K))
        assert np.linalg.eigvals(A).real.max() < 0.0
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
        gain = newton_kleinman_step(problem, gain)
        course.append(residual(problem, gain))
    assert any(after > before > 0.1 for before, after in pairwise(course))
    assert residual(problem, solve_iterated(problem)) < 1e-12


def test_the_step_keeps_its_digits_under_violent_drift() -> None:
    """No guard here: algebra that loses a digit fails in one problem of a thousand at such rates."""
    problem = random_problem(np.random.default_rng(3), 20000, 300.0)
    gain = converged(problem)
    assert np.all(rightmost(problem, gain) < 0.0)
    assert np.max(residual(problem, gain)) < 1e-10


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


def test_a_start_at_the_edge_is_judged_by_the_gain_that_would_be_flown() -> None:
    """Poles at -7e-4/s. Rounding once made a gain with a pole at +10/s of it, while its cost had positive pivots."""
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
    assert -1e-3 < closed_loop_poles(problem, stored).real.max() < 0.0
    for steps in (1, 2, 3):
        flown, _, _ = fly(problem, stored, steps)
        assert closed_loop_poles(problem, flown).real.max() < 0.0


@pytest.mark.parametrize("rate", [2.0, 30.0, 300.0])
def test_no_rounding_lets_an_unstable_gain_pass(rate: float) -> None:
    """Steps from the verge of stability have gains up to 1e20. Where eigenvalues object, exact arithmetic decides."""
    rng = np.random.default_rng(int(rate))
    n = 4000
    problem = broadcast(random_problem(rng, n, rate), n)
    with np.errstate(all="ignore"):
        gain = on_the_verge(rng, problem, n)
        for _ in range(2):
            gain = newton_kleinman_step(problem, gain)
            passed, stable = routh_stable(problem, gain) == 1.0, rightmost(problem, gain) < 0.0
            assert np.sum(passed) > 0.2 * n
            assert np.sum(passed & ~stable) < 0.01 * n
            for i in np.flatnonzero(passed & ~stable):
                assert exactly_stable(one(problem, i), one(gain, i))
    assert not exactly_stable(one(problem, 0), Gain(Mat3.identity(), -Mat3.identity()))


@pytest.mark.parametrize("bad", [math.inf, -math.inf, math.nan])
def test_a_gain_that_is_no_number_is_not_stable(bad: float) -> None:
    problem = attitude_problem(Mat3.skew(ONE), ONE, ONE, ONE, ONE)
    gain = solve_iterated(problem)
    assert routh_stable(problem, gain) == 1.0
    for leaf in range(18):
        leaves = flatten(gain)
        leaves[leaf] = bad
        assert routh_stable(problem, unflatten(gain, leaves)) == 0.0


def test_stability_of_a_start_shows_in_routh_in_its_cost_and_in_the_next_gain() -> None:
    """Kleinman's theorem, both ways, against eigenvalues: so that testing the new gain alone is enough."""
    rng = np.random.default_rng(11)
    n, seen = 3000, 0
    for rate in (2.0, 30.0):
        problem = random_problem(rng, n, rate)
        with np.errstate(all="ignore"):
            for name, gain in hostile_starts(rng, problem, n).items():
                if name in ("holes", "zero", "NaN"):
                    continue
                stable = rightmost(problem, gain) < 0.0
                new = newton_kleinman_step(problem, gain)
                assert np.array_equal(routh_stable(problem, gain) == 1.0, stable), name
                assert np.array_equal(cost_is_positive(problem, gain, new), stable), name
                assert np.array_equal(rightmost(problem, new) < 0.0, stable), name
                assert np.array_equal(routh_stable(problem, new) == 1.0, stable), name
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
