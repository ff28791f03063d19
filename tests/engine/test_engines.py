"""The engines: the same numbers on all, and which one is chosen."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from cascade_step import cascade
from engine_flights import FAULTS, OWN, Array, assert_same, every_engine, faulty_case_one, run, set_chunk, short
from gates import needs_simd

import rotorfault
from rotorfault.autopilot.control.cascade import limited_force
from rotorfault.base.errors import InputError
from rotorfault.engine import default_engine, have_simd, load_engine
from rotorfault.flight.assembly import assemble_all
from rotorfault.maths.geometry import Vec3
from rotorfault.model.block import Context
from rotorfault.model.vehicle_file import load_vehicle
from rotorfault.scenario.neighbours import neighbour


def test_python_agrees_with_simd(simd_faulty_case_one: Array) -> None:
    """Half a second of case 1 with both faults at 0.2 s."""
    found = run(faulty_case_one(), "python").signals
    assert found[-1, OWN.rows.index("fault_flag.r1"), 0] == 1.0
    assert found[-1, OWN.rows.index("fault_flag.r3"), 0] == 1.0
    assert_same(found, simd_faulty_case_one)


def test_numpy_agrees_with_simd() -> None:
    """Half a second of case 1, and of a neighbour whose faults come earlier, at 2 ms."""
    pytest.importorskip("llvmlite")
    base = faulty_case_one(period=0.002, step=0.002)
    batch = assemble_all([base, neighbour(base, 3, onset=(0.15, 0.15))])
    found, wanted = run(batch, "numpy").signals, run(batch, "simd").signals
    assert found.shape == (250, len(batch.loop.layout), 2)
    assert (found[-1, OWN.rows.index("fault_flag.r1")] == 1.0).all()
    assert_same(found, wanted)


def test_force_limit_stays_real_on_compiled_code() -> None:
    """Fused operations round a^2 - b^2 once: where a = b that could fall below zero under the root."""
    pytest.importorskip("llvmlite")
    from rotorfault.engine.function import CompiledFunction

    vehicle = load_vehicle("paper").vehicle
    numbers = cascade("sdre").parameters(Context(vehicle, 1e-3))

    def limited(force: Vec3, share: Any) -> Vec3:
        return limited_force(force, 4.0 * vehicle.thrust_max, vehicle, numbers._replace(thrust_share=share))

    shares = np.linspace(0.5, 1.0, 4096)
    rows = np.array([np.full(4096, 9.0), np.full(4096, -4.0), np.full(4096, 1e3), shares])
    found = CompiledFunction(limited, Vec3(0.0, 0.0, 0.0), 0.0)(rows)
    assert np.isfinite(found).all()
    assert np.abs(found[:2]).max() < 1e-6
    np.testing.assert_allclose(found[2], shares * 4.0 * vehicle.thrust_max / vehicle.mass, rtol=1e-14)


@every_engine
def test_late_readings_fly_the_same_on_all_engines(engine: str) -> None:
    late = short(sensors={"kind": "noisy", "delay": 3})
    assert_same(run(late, engine).signals, run(late, "python").signals)


@needs_simd
def test_noise_crosses_chunks_the_same_on_all_engines(monkeypatch: pytest.MonkeyPatch) -> None:
    """More steps than are drawn at a time."""
    set_chunk(monkeypatch, 60)
    long = short(duration=0.005 * 100)
    assert_same(run(long, "python").signals, run(long, "simd").signals)


def test_engines_are_found_by_name() -> None:
    with pytest.raises(InputError, match=r"unknown engine 'nunpy'; did you mean 'numpy'\?"):
        load_engine("nunpy")
    assert default_engine(1) == ("simd" if have_simd() else "python")
    assert default_engine(1000) == ("simd" if have_simd() else "numpy")


def test_without_llvmlite_the_other_engines_serve(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    assert (default_engine(1), default_engine(16)) == ("python", "numpy")
    with pytest.raises(InputError, match="llvmlite, not installed; use --engine numpy or --engine python"):
        load_engine("simd")


@needs_simd
@pytest.mark.parametrize("period", [0.003, 0.01])
def test_many_integration_steps_in_a_period_agree_too(period: float) -> None:
    """The engine then compiles the sampling instant and the integration step apart."""
    settings = {"duration": 0.6, "period": period, "diagnosis.poles": [60.0, 80.0]} | FAULTS
    python = rotorfault.fly("paper-set-point", settings=settings, engine="python")
    simd = rotorfault.fly("paper-set-point", settings=settings, engine="simd")
    assert np.abs(python.data["position"] - simd.data["position"]).max() < 1e-9
    assert np.abs(python.data["thrust"] - simd.data["thrust"]).max() < 1e-8
