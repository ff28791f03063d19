"""Time per solve of the attitude block of the SDRE Riccati equation (22): library solvers against rotorfault's.

Problems are those of a tumbling flight at the paper's weights. The compiled batch is timed on one thread, as in
flight: warm Newton-Kleinman steps with residual, tests and guard. One step is what flies; its residual is no
rounding error, that of two more is, which is the fair comparison with a library. Libraries that are missing are
left out. Set OPENBLAS_NUM_THREADS=1, as the threads of BLAS only get in each other's way at n = 6.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Callable
from typing import Any

import numpy as np

from rotorfault.control.riccati import AttitudeProblem, Gain, attitude_problem, fly
from rotorfault.control.riccati_reference import DenseProblem, dense_problem, matrix, solve_dense, solve_iterated
from rotorfault.geometry import Mat3, Vec3
from rotorfault.records import flatten, unflatten

heyoka: Any
ctrlsys: Any
try:
    import heyoka
except ImportError:
    heyoka = None
try:
    import ctrlsys
except ImportError:
    ctrlsys = None

ONE = Vec3(1.0, 1.0, 1.0)
SHAPE_COUPLING = Vec3(-0.75, 0.70, 0.08)  # (J_y - J_z)/J_x and so on, of a small quadrotor


def arguments(omega: Vec3, weight: float) -> tuple[Mat3, Vec3, Vec3, Vec3, Vec3]:
    """Arguments of `attitude_problem` at body rates in rad/s: Q = 1, R = weight, unit acceleration input."""
    a, h = SHAPE_COUPLING, omega * 0.5
    drift = Mat3(0.0, a.x * h.z, a.x * h.y, a.y * h.z, 0.0, a.y * h.x, a.z * h.y, a.z * h.x, 0.0)
    return drift, ONE, ONE, ONE, ONE * weight


def seconds_each(run: Callable[[], object], count: int, repeats: int) -> float:
    """Median CPU time per solve in s, of a call that solves `count` problems."""
    run()
    times = []
    for _ in range(repeats):
        start = time.process_time()
        run()
        times.append((time.process_time() - start) / count)
    return statistics.median(times)


def worst_residual(dense: list[DenseProblem], costs: list[np.ndarray]) -> float:
    """Largest |A'P + PA - PBR^-1B'P + Q| / |Q| over the problems."""
    return max(
        float(np.linalg.norm(A.T @ P + P @ A - P @ B @ np.linalg.solve(R, B.T @ P) + Q) / np.linalg.norm(Q))
        for (A, B, Q, R), P in zip(dense, costs, strict=True)
    )


def cost(problem: AttitudeProblem, gain: Gain) -> np.ndarray:
    """P of a gain in flight, whose X is symmetric."""
    Y, X, W = matrix(gain.Y), matrix(gain.X), matrix(problem.W)
    unscale = np.tile(1.0 / np.array(list(problem.S)), 2)
    return np.outer(unscale, unscale) * np.block([[Y.T @ (X - W), Y.T], [Y, X]])


def compiled_batch(
    problems: list[AttitudeProblem], starts: list[Gain], steps: int
) -> tuple[Callable[[], object], np.ndarray]:
    """One call of the compiled `fly` for all problems, and the array that it writes."""
    template = (problems[0], starts[0])
    # Zeros of the structure stay numbers, as they do when the whole closed loop is compiled.
    leaves = [heyoka.expression(f"v{i}") if x != 0.0 else 0.0 for i, x in enumerate(flatten(template))]
    kept = [i for i, leaf in enumerate(leaves) if not isinstance(leaf, float)]
    outputs = flatten(fly(*unflatten(template, leaves), steps))
    function = heyoka.cfunc(outputs, [leaves[i] for i in kept])
    rows = np.array([flatten(pair) for pair in zip(problems, starts, strict=True)]).T
    inputs, found = np.ascontiguousarray(rows[kept]), np.empty((len(outputs), len(problems)))
    return lambda: function(inputs, outputs=found), found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.ArgumentDefaultsHelpFormatter)
    parser.add_argument("--problems", type=int, default=200, help="problems for the library solvers")
    parser.add_argument("--batch", type=int, default=4096, help="problems per call of the compiled batch")
    parser.add_argument("--repeats", type=int, default=7, help="repetitions, of which the median is taken")
    parser.add_argument("--rate", type=float, default=5.0, help="largest body rate [rad/s]")
    parser.add_argument("--weight", type=float, default=0.0088, help="R of (35)")
    parser.add_argument("--steps", type=int, default=1, help="steps of the compiled batch; two more are timed too")
    options = parser.parse_args()

    rng = np.random.default_rng(1)
    rates = rng.uniform(-options.rate, options.rate, (options.problems, 3))
    given = [arguments(Vec3.of(map(float, omega)), options.weight) for omega in rates]
    dense = [dense_problem(*each) for each in given]
    problems = [attitude_problem(*each) for each in given]
    table: list[tuple[str, float, float]] = []

    def measure(name: str, solve: Callable[[int], np.ndarray]) -> None:
        count = range(options.problems)
        each = seconds_each(lambda: [solve(i) for i in count], options.problems, options.repeats)
        table.append((name, each, worst_residual(dense, [solve(i) for i in count])))

    measure("scipy solve_continuous_are", lambda i: solve_dense(dense[i]))
    if ctrlsys:
        triples = [tuple(map(np.asfortranarray, (A, B @ np.linalg.solve(R, B.T), Q))) for A, B, Q, R in dense]

        def sb02pd(i: int) -> np.ndarray:
            return np.asarray(ctrlsys.sb02pd(*triples[i])[0])

        def sb02md(i: int) -> np.ndarray:
            return np.asarray(ctrlsys.sb02md("C", "D", "U", "N", "S", 6, *(M.copy("F") for M in triples[i]))[0])

        measure("ctrlsys sb02md (Schur)", sb02md)
        measure("ctrlsys sb02pd (sign function)", sb02pd)
    measure("rotorfault iterated, Python floats", lambda i: cost(problems[i], solve_iterated(problems[i])))

    if heyoka:
        # Warm start as in flight: the solution one millisecond ago, at angular accelerations of 10 rates per second.
        drifting = 1.0 + 0.01 * rng.uniform(-1, 1, rates.shape)
        before = [arguments(Vec3.of(map(float, omega)), options.weight) for omega in rates * drifting]
        starts = [solve_iterated(attitude_problem(*each)) for each in before]
        many = [i % options.problems for i in range(options.batch)]
        for steps in (options.steps, options.steps + 2):
            run, found = compiled_batch([problems[i] for i in many], [starts[i] for i in many], steps)
            each = seconds_each(run, options.batch, 20 * options.repeats)
            gains = [unflatten(starts[0], [float(x) for x in found[:18, i]]) for i in range(options.problems)]
            costs = [cost(problem, gain) for problem, gain in zip(problems, gains, strict=True)]
            table.append((f"rotorfault compiled, {steps} warm step(s)", each, worst_residual(dense, costs)))

    base = table[0][1]
    print(f"{'solver':<38}{'us per solve':>14}{'faster than scipy':>20}{'worst residual':>18}")
    for name, each, worst in table:
        print(f"{name:<38}{each * 1e6:>14.3f}{base / each:>20.1f}{worst:>18.1e}")


if __name__ == "__main__":
    main()
