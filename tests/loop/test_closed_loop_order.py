"""The closed loop converges at the integrator's order, 4, as the plant's steps are refined.

The sampling period stays: refining it would change the controller. The references are smooth and the faults set in on
a boundary of steps; between sampling instants the plant then is a smooth system under a held command.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from engine_flights import OWN
from numpy.typing import NDArray

from rotorfault.engine import load_engine
from rotorfault.engine.batch import no_watch
from rotorfault.flight.assembly import assemble
from rotorfault.plant import PLANT
from rotorfault.scenario.scenario import scenario_from

Array = NDArray[np.float64]
PERIOD = 0.01
TRUTH = [k for k, name in enumerate(OWN.rows) if name.partition(".")[0] in ("position", "velocity", "attitude")]


def flown(substeps: int, fault_time: float = 0.15, **tables: Any) -> Array:
    """Position, velocity and attitude at all sampling instants of 0.3 s."""
    scenario = scenario_from(
        {
            "name": "order",
            "vehicle": "paper",
            "duration": 0.3,
            "period": PERIOD,
            "step": PERIOD / substeps,
            "start": {"position": [0.1, 0.2, 0.0], "attitude": [0.2, -0.3, 0.4], "body_rates": [0.5, 1.0, -0.5]},
            "reference": {
                "kind": "sinusoid",
                "amplitude": [0.3, 0.2, 0.1],
                "frequency": [1.0, 2.0, 3.0],
                "phase": [0.0, 0.5, 1.0],
            },
            "wind": "paper",
            "fault": [
                {"kind": "step", "rotor": 1, "time": fault_time, "loss": 0.1},
                {"kind": "step", "rotor": 3, "time": fault_time, "loss": 0.15},
            ],
            "controller": {"kind": "smc", "preset": "none"},
        }
        | tables,
        "test",
    )
    recording = load_engine("python")(assemble(scenario), no_watch)
    return recording.signals[:, TRUTH, 0]


def orders(**changes: Any) -> tuple[Array, Array]:
    """Largest errors for 2, 4 and 8 steps a period against 32, and the slopes between them."""
    truth = flown(32, **changes)
    errors = np.array([np.abs(flown(n, **changes) - truth).max() for n in (2, 4, 8)])
    return errors, np.log2(errors[:-1] / errors[1:])


@pytest.mark.parametrize("plant", list(PLANT.registry))
@pytest.mark.parametrize("controller", ["smc", "ismc"])
def test_fourth_order(plant: str, controller: str) -> None:
    errors, slopes = orders(plant=plant, controller={"kind": controller, "preset": "none"})
    assert errors[0] < 1e-3
    assert errors[-1] > 1e-12, "too small to tell an order from rounding"
    np.testing.assert_allclose(slopes, 4.0, atol=0.35)


def test_gusts_keep_the_order() -> None:
    """They are held over a sampling period, so nothing changes within one."""
    errors, slopes = orders(wind={"kind": "dryden", "wind_at_6m": 15.0, "altitude": 5.0})
    assert errors[-1] > 1e-12
    np.testing.assert_allclose(slopes, 4.0, atol=0.35)


def test_a_fault_inside_a_step_costs_the_order() -> None:
    """Why faults have to set in on a boundary: the test above can fail."""
    errors, slopes = orders(fault_time=0.15 + PERIOD * 0.3)
    assert slopes.min() < 2.0
    assert errors[-1] > 1e-6
