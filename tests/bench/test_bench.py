"""Compiling a function by itself, and the measurement of the Riccati solvers, without asking how fast it was."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("llvmlite")

from rotorfault.bench import flights, peak, study
from rotorfault.bench.sdre import OURS, SCIPY
from rotorfault.engine.function import CompiledFunction
from rotorfault.maths.geometry import Mat3, Vec3
from rotorfault.maths.records import flatten, unflatten


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


@pytest.fixture(scope="module")
def everything() -> dict[str, Any]:
    """All measurements, of small sizes, but accuracy, which is measured elsewhere."""
    said: list[str] = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(flights, "SIZES", (9, 10_000))
        patch.setattr(flights, "SCALES", (64, 256, 1_024))
        patch.setattr(flights, "different", lambda count, seed=1: {"seed": np.arange(min(count, 20))})
        patch.setattr(study.importlib.util, "find_spec", lambda name: None if name == "heyoka" else True)
        found = study.run(False, True, said.append)
    assert said
    return found


def test_the_riccati_measurement_solves_what_it_times(everything: dict[str, Any]) -> None:
    found = everything["sdre"]
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


def test_bench_measures_everything_and_says_it(everything: dict[str, Any], tmp_path: Path) -> None:
    """No time is judged, only that each number is there and is what it says."""
    found = everything
    study.save(found, tmp_path / "bench.json")
    saved = json.loads((tmp_path / "bench.json").read_text())
    assert saved["batch"]["10000"]["steps_per_s_per_core"] > 0.0
    assert saved["batch"]["10000"]["simulated_s_per_s_per_core"] == pytest.approx(
        1e-3 * saved["batch"]["10000"]["steps_per_s_per_core"]
    )
    assert 0.0 < saved["operations"]["share_of_peak"] < 1.0
    assert saved["operations"]["flops"] > 1000
    assert set(saved["scaling"]) == {"64", "256"}
    assert all(part["us_per_flight"] > 0.0 for part in saved["scaling"].values())
    assert set(saved["latency"]) == {"simd", "python", "numpy"}
    rows = {cells[0]: cells[1:] for line in study.text(found).splitlines() if len(cells := re.split("  +", line)) > 2}
    assert set(saved["batch"]) == {"9", "10000"}
    for size, part in saved["batch"].items():
        steps, simulated = rows[f"batch of {int(size):,}"][:2]
        assert steps == f"{1e-6 * part['steps_per_s']:.2f} M"
        assert number(simulated) == pytest.approx(part["simulated_s_per_s_per_core"], abs=0.51)
    assert set(saved["frames"]) == {"4", "6", "8"}
    for rotors, part in saved["frames"].items():
        shown = rows[f"{rotors} rotors, {part['vehicle']}"]
        assert shown[0] == f"{1e-6 * part['steps_per_s']:.2f} M"
        assert number(shown[2]) == pytest.approx(part["cost_factor"], abs=0.0051)
    for engine, part in saved["latency"].items():
        assert [number(cell) for cell in rows[engine]] == pytest.approx(
            [part["median_us"], part["p99_9_us"]], abs=0.051
        )
    for name, solver in saved["sdre"]["sizes"]["12"]["solvers"].items():
        if solver is not None:
            assert number(rows[name][0]) == pytest.approx(solver["us"], abs=5.1e-4)


def number(cell: str) -> float:
    return float(cell.replace(",", ""))


def test_peers_stand_in_the_table() -> None:
    ours = {"steps_per_s": 8e6, "steps_per_s_per_core": 8e6, "simulated_s_per_s_per_core": 8e3}
    peer = {"version": "1.0", "step": 0.002, "steps_per_s_per_core": 2e6, "simulated_s_per_s_per_core": 4e3}
    table = study._peers(
        {
            "batch": {"10000": ours},
            "peers": {"one": peer | {"variants": {"euler": peer}}, "two": {"error": "no disk"}},
        }
    )
    assert "4.0" in table
    assert "one, euler" in table
    assert "two: no disk" in table


def test_an_operation_of_the_peak_is_what_it_counts() -> None:
    """The kernel that the share refers to does as many fused operations as it says."""
    text = peak._module(8)
    assert text.count("@llvm.fma.v8f64(") == peak.CHAINS + 1  # and its declaration
