"""Compiling a function by itself, and the measurement of the Riccati solvers, without asking how fast it was."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("llvmlite")

from rotorfault.bench.sdre import OURS, SCIPY, measure
from rotorfault.engine.function import CompiledFunction
from rotorfault.geometry import Mat3, Vec3
from rotorfault.records import flatten, unflatten


def turned(matrix: Mat3, v: Vec3) -> tuple[Vec3, float]:
    return matrix @ v, 2.0


def test_a_compiled_function_does_what_it_does_on_floats() -> None:
    template = (Mat3.identity(), Vec3(0.0, 0.0, 0.0))
    compiled = CompiledFunction(turned, *template)
    rows = np.random.default_rng(1).normal(size=(12, 37))
    found = compiled(rows)
    for case, column in zip(rows.T, found.T, strict=True):
        expected = flatten(turned(*unflatten(template, [float(x) for x in case])))
        assert column == pytest.approx(expected, rel=1e-14, abs=1e-14)
    np.testing.assert_array_equal(compiled(rows[:, 5:6]), found[:, 5:6])  # the same alone and in any batch


def test_the_riccati_measurement_solves_what_it_times() -> None:
    found = measure(quick=True)
    assert 2 <= found["steps"] <= 8
    assert found["own_residual"] <= 1e-12
    assert found["in_flight_us"] > 0.0
    for size in ("6", "12"):
        part = found["sizes"][size]
        for name in (SCIPY, *OURS):
            assert part["solvers"][name]["us"] > 0.0
            assert part["solvers"][name]["residual"] <= 1e-12
        assert part["best_package"] not in OURS
        assert part["batch_over_scipy"] >= part["batch_over_best_package"] > 0.0
        assert part["single_over_scipy"] > 0.0
