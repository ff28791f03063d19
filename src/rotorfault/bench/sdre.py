"""Time per solve of the Riccati equation (22) of SDRE: rotorfault's compiled solver against packaged ones.

Problems are those of flights of the paper's quadrotor with the weights of the preset ``tuned``: body rates up to
20 rad/s and rotor speeds out of balance by up to 500 rad/s. At n = 6 it is the attitude block, at n = 12 the whole
equation, position axes at errors of 0.05 to 2 m. Every solver is measured from nothing to a solution: rotorfault's
starts from the guaranteed gain and makes as many Newton-Kleinman steps as the worst of the problems needs. It is
compiled for any weights: they are inputs like the rates.
"""

from __future__ import annotations

import os
import statistics
import time
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from scipy.linalg import block_diag, solve_continuous_are

from rotorfault.autopilot.control.riccati import AttitudeProblem, Gain, attitude_problem, fly, guaranteed_gain
from rotorfault.autopilot.control.riccati_reference import cost_matrix, dense_problem
from rotorfault.autopilot.control.sdre import (
    SdreParameters,
    Weights,
    error_magnitude,
    gyroscopic_drift,
    position_gains,
    sdre_parameters,
)
from rotorfault.autopilot.presets import presets
from rotorfault.engine.function import CompiledFunction
from rotorfault.engine.machine import grouped
from rotorfault.engine.native import lanes
from rotorfault.maths.arrays import Array
from rotorfault.maths.geometry import Mat3, Vec3
from rotorfault.maths.records import flatten, unflatten
from rotorfault.maths.scalar import Scalar
from rotorfault.model.vehicle import Vehicle
from rotorfault.model.vehicle_file import load_vehicle

RATE_MAX = 20.0  # rad/s
RESIDUAL_SPEED_MAX = 500.0  # rad/s
TOLERANCE = 1e-12
_ONE = Vec3(1.0, 1.0, 1.0)


OURS = ("rotorfault, batch", "rotorfault, single call")
SCIPY = "scipy solve_continuous_are"


class Case(NamedTuple):
    """All that the equation depends on at one instant."""

    vehicle: Vehicle
    omega_B: Vec3  # rad/s
    residual_speed: Scalar  # rad/s, sum of the rotor speeds with sign
    e: Vec3  # m, position error
    weights: SdreParameters

    @property
    def drift(self) -> Mat3:
        return gyroscopic_drift(self.vehicle, self.omega_B, self.residual_speed)


class _Dense(NamedTuple):
    A: Array
    B: Array
    Q: Array
    R: Array
    G: Array  # B R^-1 B^T, which SLICOT wants


def measure(quick: bool = False) -> dict[str, Any]:
    """Measure all solvers that are installed.

    Parameters
    ----------
    quick : bool
        Fewer problems and repetitions: a few seconds instead of about a minute.

    Returns
    -------
    dict
        ``steps``: Newton-Kleinman steps from the guaranteed gain to a residual of 1e-12 in the worst problem.
        ``own_residual``: that residual, `rotorfault.autopilot.control.riccati.residual`, after those steps.
        ``batch``: problems per call of the compiled batch. ``in_flight_us``: one warm step with residual and test of
        stability, as a flight makes it, per problem of a batch. ``one_blas_thread``: whether OPENBLAS_NUM_THREADS is
        1; else the packages' times are several times too long and the factors below flatter.
        ``sizes``: for "6" and "12", ``solvers`` maps each name to None where it is missing, else to ``us``, the
        median CPU time per solve of the calling thread, and ``residual``, the worst Frobenius norm of (22) relative
        to Q. "rotorfault, batch" and "rotorfault, single call" are ours. ``best_package`` names the fastest package
        with a residual of at most 1e-12; ``batch_over_scipy``, ``batch_over_best_package`` and
        ``single_over_scipy`` say how many times faster ours is.
    """
    problems, batch, repeats = (32, 1024, 3) if quick else (256, 4096, 9)
    cases = _cases(problems)
    steps, own_residual = _steps_needed(cases)
    sizes = {}
    for size, solve in ((6, _solve), (12, _solve_whole)):
        dense = [_dense(size, case) for case in cases]
        solvers = _packages(dense, repeats)
        solvers.update(_ours(partial(solve, steps=steps), cases, dense, batch, repeats))
        sizes[str(size)] = _summary(solvers)
    return {
        "steps": steps,
        "own_residual": own_residual,
        "batch": batch,
        "in_flight_us": _in_flight(cases, batch, repeats),
        "one_blas_thread": os.environ.get("OPENBLAS_NUM_THREADS") == "1",
        "sizes": sizes,
    }


def _attitude(case: Case) -> AttitudeProblem:
    w = case.weights
    return attitude_problem(case.drift, _ONE, w.attitude_q_angle, w.attitude_q_rate, w.attitude_r)


def _solve(case: Case, steps: int) -> tuple[Gain, Scalar, Scalar]:
    problem = _attitude(case)
    return fly(problem, guaranteed_gain(problem), steps)


def _solve_whole(case: Case, steps: int) -> tuple[Gain, Scalar, Scalar, Vec3, Vec3]:
    return (*_solve(case, steps), *position_gains(case.e, case.weights))


def _cases(count: int) -> list[Case]:
    vehicle = load_vehicle("paper").vehicle
    weights = sdre_parameters(Weights(**presets("sdre")["tuned"]["law"]))
    rng = np.random.default_rng(1)
    cases = []
    for _ in range(count):
        direction = rng.normal(size=3)
        omega = direction / np.linalg.norm(direction) * rng.uniform(0.0, RATE_MAX)
        e = rng.uniform(0.05, 2.0, 3) * rng.choice([-1.0, 1.0], 3)
        speed = float(rng.uniform(-RESIDUAL_SPEED_MAX, RESIDUAL_SPEED_MAX))
        cases.append(Case(vehicle, Vec3.of(map(float, omega)), speed, Vec3.of(map(float, e)), weights))
    return cases


def _steps_needed(cases: list[Case]) -> tuple[int, float]:
    """Fewest steps that bring every problem to the tolerance, and the worst residual after them."""
    for steps in range(1, 30):
        worst = max(float(_solve(case, steps)[1]) for case in cases)
        if worst <= TOLERANCE:
            return steps, worst
    raise RuntimeError(f"no residual of {TOLERANCE} within 29 Newton-Kleinman steps; the worst is {worst:.1e}")


def _microseconds(run: Callable[[], object], count: int, repeats: int) -> float:
    """Median CPU time per solve of a call that makes `count` solves."""
    run()
    times = []
    for _ in range(repeats):
        start = time.thread_time()
        run()
        times.append((time.thread_time() - start) / count)
    return 1e6 * statistics.median(times)


def _ours(
    solve: Callable[[Case], Any], cases: list[Case], dense: list[_Dense], batch: int, repeats: int
) -> dict[str, dict[str, float] | None]:
    """Time of the compiled solver in a batch and from a single call, which is Python's overhead for the most part."""
    compiled = CompiledFunction(solve, cases[0])
    template, rows = solve(cases[0]), _rows(cases)
    solutions = compiled(rows)
    costs = [
        _cost(case, unflatten(template, [float(x) for x in solutions[:, i]]), d)
        for i, (case, d) in enumerate(zip(cases, dense, strict=True))
    ]
    many, one, calls = grouped(_rows(cases, batch), lanes()), grouped(rows[:, :1], lanes()), 200
    out, out_one = compiled.evaluate(many), compiled.evaluate(one)

    once = compiled.bound(one, out_one)

    def single() -> None:
        for _ in range(calls):
            once()

    residual = _worst_residual(dense, costs)
    return {
        OURS[0]: {
            "us": _microseconds(lambda: compiled.evaluate(many, out), batch, 20 * repeats),
            "residual": residual,
        },
        OURS[1]: {"us": _microseconds(single, calls, 5 * repeats), "residual": residual},
    }


def _in_flight(cases: list[Case], batch: int, repeats: int) -> float:
    """Time per problem of one step from a stored gain."""
    stored = _solve(cases[0], 6)[0]
    compiled = CompiledFunction(lambda case, gain: fly(_attitude(case), gain, 1), cases[0], stored)
    groups = grouped(_rows([(case, _solve(case, 6)[0]) for case in cases], batch), lanes())
    out = compiled.evaluate(groups)
    return _microseconds(lambda: compiled.evaluate(groups, out), batch, 20 * repeats)


def _rows(records: Sequence[Any], count: int | None = None) -> Array:
    """Records as columns of a contiguous array, repeated up to `count` columns."""
    columns = np.array([flatten(record) for record in records]).T
    return np.ascontiguousarray(columns[:, np.arange(count or len(records)) % len(records)])


def _dense(size: int, case: Case) -> _Dense:
    """The equation as plain matrices: attitude and its rates, then position and velocity."""
    w = case.weights
    A, B, Q, R = dense_problem(case.drift, _ONE, w.attitude_q_angle, w.attitude_q_rate, w.attitude_r)
    if size == 12:
        floored = [error_magnitude(*each) for each in zip(case.e, w.error_floor, w.error_cap, strict=True)]
        q = [q_i / e_i for q_i, e_i in zip(w.position_q, floored, strict=True)]
        r = [r_i * e_i * e_i for r_i, e_i in zip(w.position_r, floored, strict=True)]
        zero, one = np.zeros((3, 3)), np.eye(3)
        A = block_diag(A, np.block([[zero, one], [zero, zero]]))
        B = block_diag(B, np.vstack([zero, one]))
        Q, R = block_diag(Q, np.diag([*q, *w.position_q_rate])), block_diag(R, np.diag(r))
    return _Dense(A, B, Q, R, B @ np.linalg.solve(R, B.T))


def _cost(case: Case, solution: Any, dense: _Dense) -> Array:
    """P of a solution, whose gains are R^-1 B^T P."""
    P = cost_matrix(_attitude(case), solution[0])
    if len(solution) > 3:
        r, k1, k2 = np.diag(dense.R)[3:], np.array(list(solution[3])), np.array(list(solution[4]))
        P11, P12, P22 = np.diag(r * k1 * k2), np.diag(r * k1), np.diag(r * k2)
        P = block_diag(P, np.block([[P11, P12], [P12, P22]]))
    return np.asarray(P, dtype=np.float64)


def _worst_residual(dense: list[_Dense], costs: list[Array]) -> float:
    return max(
        float(np.linalg.norm(A.T @ P + P @ A - P @ G @ P + Q) / np.linalg.norm(Q))
        for (A, _, Q, _, G), P in zip(dense, costs, strict=True)
    )


def _packages(dense: list[_Dense], repeats: int) -> dict[str, dict[str, float] | None]:
    """Time and residual of each packaged solver, None for those that are not installed."""
    ctrlsys, control = _ctrlsys(), _control_with_slycot()

    def scipy(d: _Dense) -> Any:
        return solve_continuous_are(d.A, d.B, d.Q, d.R)

    def python_control(d: _Dense) -> Any:
        return control.care(d.A, d.B, d.Q, d.R, method="slycot")[0]

    def sb02md(d: _Dense) -> Any:
        return ctrlsys.sb02md("C", "D", "U", "N", "S", len(d.A), *(M.copy("F") for M in (d.A, d.G, d.Q)))[0]

    def sb02pd(d: _Dense) -> Any:
        return ctrlsys.sb02pd(*(M.copy("F") for M in (d.A, d.G, d.Q)))[0]

    solvers = (
        (SCIPY, scipy, True),
        ("python-control with slycot", python_control, control is not None),
        ("ctrlsys sb02md (Schur)", sb02md, ctrlsys is not None),
        ("ctrlsys sb02pd (sign function)", sb02pd, ctrlsys is not None),
    )
    return {name: _package(solve, dense, repeats) if installed else None for name, solve, installed in solvers}


def _package(solve: Callable[[_Dense], Any], dense: list[_Dense], repeats: int) -> dict[str, float]:
    us = _microseconds(lambda: [solve(each) for each in dense], len(dense), repeats)
    return {"us": us, "residual": _worst_residual(dense, [np.asarray(solve(each)) for each in dense])}


def _ctrlsys() -> Any:
    """SLICOT through ctrlsys, or None where it is not installed."""
    try:
        import ctrlsys
    except ImportError:
        return None
    return ctrlsys


def _control_with_slycot() -> Any:
    """python-control, or None where it or slycot is not installed."""
    try:
        import control
        import slycot  # noqa: F401  control calls it
    except ImportError:
        return None
    return control


def _summary(solvers: dict[str, dict[str, float] | None]) -> dict[str, Any]:
    measured = {name: solver for name, solver in solvers.items() if solver is not None}
    packages = {name: solver for name, solver in measured.items() if name not in OURS}
    accurate = {name: solver for name, solver in packages.items() if solver["residual"] <= TOLERANCE} or packages
    best = min(accurate, key=lambda name: accurate[name]["us"])
    batch, single = (measured[name]["us"] for name in OURS)
    return {
        "solvers": solvers,
        "best_package": best,
        "batch_over_scipy": packages[SCIPY]["us"] / batch,
        "batch_over_best_package": packages[best]["us"] / batch,
        "single_over_scipy": packages[SCIPY]["us"] / single,
    }
