"""The linearisation about hover, entry by entry, on every vehicle."""

import numpy as np
import pytest

from rotorfault.analysis.linearisation import INPUTS, STATES, equations, hover_model
from rotorfault.model.vehicle_file import load_vehicle, vehicle_names


@pytest.mark.parametrize("name", vehicle_names())
def test_entries_are_those_of_newton_and_euler(name: str) -> None:
    vehicle = load_vehicle(name).vehicle
    A, B = np.zeros((12, 12)), np.zeros((12, 4))
    A[0:3, 3:6] = np.eye(3)
    A[3:6, 3:6] = -vehicle.linear_drag / vehicle.mass * np.eye(3)
    A[3, STATES.index("pitch")] = vehicle.gravity  # positive pitch is nose down and accelerates forward
    A[4, STATES.index("roll")] = -vehicle.gravity
    A[6:9, 9:12] = np.eye(3)
    B[5, INPUTS.index("T")] = 1.0 / vehicle.mass
    B[9:12, 1:4] = np.diag(1.0 / np.array(list(vehicle.inertia)))
    found_A, found_B = hover_model(vehicle)
    assert found_A == pytest.approx(A, abs=1e-7)
    assert found_B == pytest.approx(B, rel=1e-8, abs=1e-7)


def test_equations_read_well() -> None:
    lines = equations(load_vehicle("paper").vehicle)
    assert "  d v_y/dt = -0.079661 v_y - 9.81 roll" in lines
    assert "  d p/dt = 462.96 tau_roll" in lines
    assert len(lines) == len(STATES) + 1
