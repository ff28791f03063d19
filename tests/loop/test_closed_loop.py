"""The closed loop: what the autopilot is shown, and when."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from engine_flights import short

import rotorfault
from rotorfault.maths.geometry import Vec3


@pytest.mark.parametrize("delay", [0, 1, 7])
def test_late_readings_are_those_of_earlier_steps(delay: int) -> None:
    """The autopilot sees at step k what was true at step k - d; before step d, the start."""
    seen: list[list[float]] = []

    class Watching:
        def update(self, time: float, estimate: Any, reference: Any, vehicle: Any) -> Any:
            seen.append([float(x) for x in (*estimate.p_W, *estimate.q_WB, *estimate.omega_B)])
            weight = vehicle.mass * vehicle.gravity
            return rotorfault.Wrench(1.1 * weight, Vec3(0.001, -0.001, 0.0))

    exact = {"kind": "noisy", "position": 0.0, "velocity": 0.0, "attitude": 0.0, "rate": 0.0, "delay": delay}
    flight = rotorfault.fly(short(sensors=exact, fault=[], diagnosis="off"), controller=Watching())
    true = np.hstack([flight.data[name].values for name in ("position", "quaternion", "body_rates")])
    count = len(true)
    wanted = np.vstack([np.repeat(true[:1], delay, axis=0), true[: count - delay]])
    np.testing.assert_array_equal(np.array(seen)[-count:], wanted)
