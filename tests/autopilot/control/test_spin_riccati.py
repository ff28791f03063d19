"""The Riccati equation of a spinning thrust axis against an independent solver, and how fast it is followed."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.linalg import solve_continuous_are

from rotorfault.autopilot.control.spin_riccati import SpinGain, SpinProblem, improve, optimal, spin_gain

spins = st.floats(-150.0, 150.0)
problems = st.builds(SpinProblem, spins, spins, st.floats(10.0, 100.0), st.floats(1e3, 1e6), st.floats(0.0, 1e4))


def dynamics(problem: SpinProblem) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
    """A and B, from the equations of the docstring."""
    r, beta, w = problem.spin, problem.precession, problem.bandwidth
    A = np.array([[0.0, 1.0, 0.0], [0.0, 1j * beta, 1.0], [0.0, 0.0, 1j * r - w]])
    return A, np.array([[0.0], [0.0], [w]], complex)


def row(gain: SpinGain) -> NDArray[np.complex128]:
    return np.array([[complex(*one) for one in gain]])


@given(problem=problems)
def test_the_gain_is_that_of_the_riccati_equation(problem: SpinProblem) -> None:
    A, B = dynamics(problem)
    P = solve_continuous_are(A, B, np.diag([problem.angle, problem.rate, 0.0]).astype(complex), np.eye(1))
    wanted = B.conj().T @ P
    found = row(spin_gain(problem, optimal(problem)))
    np.testing.assert_allclose(found, wanted, atol=1e-6 * np.abs(wanted).max())


@given(problem=problems)
def test_the_closed_loop_is_stable_at_every_step_from_afar(problem: SpinProblem) -> None:
    A, B = dynamics(problem)
    poles = optimal(problem._replace(spin=0.0, precession=0.0))
    for _ in range(8):
        poles = improve(problem, poles)
        assert np.linalg.eigvals(A - B @ row(spin_gain(problem, poles))).real.max() < 0.0


@given(problem=problems, faster=st.floats(-200.0, 200.0))
def test_one_step_a_period_follows_a_spin_that_grows(problem: SpinProblem, faster: float) -> None:
    """By up to 200 rad/s^2, which is more than drag torque does to any vehicle here."""
    poles = optimal(problem)
    for _ in range(50):
        problem = problem._replace(spin=problem.spin + faster * 1e-3, precession=problem.precession + faster * 5e-4)
        poles = improve(problem, poles)
    exact, found = row(spin_gain(problem, optimal(problem))), row(spin_gain(problem, poles))
    np.testing.assert_allclose(found, exact, atol=1e-3 * np.abs(exact).max())
