"""Short flights for the tests of the engines, and how alike two engines must fly them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from gates import needs_simd
from numpy.typing import NDArray

from rotorfault.engine import ENGINES, have_simd, load_engine
from rotorfault.engine.batch import Batch, Recording, no_watch
from rotorfault.flight.assembly import assemble
from rotorfault.loop.recorded import LoopSignals
from rotorfault.model.telemetry import Layout, signals_of
from rotorfault.scenario.library import load_scenario
from rotorfault.scenario.scenario import Scenario, scenario_from

Array = NDArray[np.float64]
OWN = Layout(signals_of(LoopSignals))  # the loop's own signals: the first rows of every recording
POSITION = OWN.place("position")
SPREAD = 5e-9  # relative, over all signals: rates and switching inputs are large and steep
_NEEDS = {"simd": [needs_simd]}
every_engine = pytest.mark.parametrize("engine", [pytest.param(name, marks=_NEEDS.get(name, [])) for name in ENGINES])


FAULTS = {"fault.0.time": 0.2, "fault.1.time": 0.2}  # of case 1, early


def faulty_case_one(**changes: Any) -> Scenario:
    """Half a second of case 1 with both faults in it."""
    return load_scenario("paper-set-point", {"controller.kind": "roismc", "duration": 0.5} | FAULTS | changes)


def short(**tables: Any) -> Scenario:
    """A cheap flight with sensor noise and a fault."""
    return scenario_from(
        {
            "name": "short",
            "vehicle": "paper",
            "duration": 0.3,
            "period": 0.005,
            "step": 0.005,
            "reference": {"kind": "set_point", "position": [0.2, -0.1, 0.3]},
            "controller": {"kind": "smc", "preset": "none"},
            "fault": [{"kind": "step", "rotor": 2, "time": 0.1, "loss": 0.2}],
            "sensors": "noisy",
            "wind": "constant",
        }
        | tables,
        "test",
    )


def run(batch: Batch | Scenario, engine: str, watch: Any = no_watch) -> Recording:
    return load_engine(engine)(assemble(batch) if isinstance(batch, Scenario) else batch, watch)


def set_chunk(monkeypatch: pytest.MonkeyPatch, steps: int) -> None:
    """Let engines look about after that many steps: how many there are changes nothing else."""
    for module in ("batch", "simd"):
        if module != "simd" or have_simd():
            monkeypatch.setattr(f"rotorfault.engine.{module}.CHUNK", steps)


def assert_same(found: Array, wanted: Array) -> None:
    """1e-9 m in position, and every other signal to a like share of its size."""
    assert np.abs(found[:, POSITION] - wanted[:, POSITION]).max() <= 1e-9
    size = np.maximum(1.0, np.abs(wanted).max(axis=0, keepdims=True))
    worst = np.abs(found - wanted) / size
    row = int(np.argmax(worst.max(axis=(0, 2))))
    assert worst.max() <= SPREAD, OWN.rows[row] if row < len(OWN) else f"row {row}, of a part"
