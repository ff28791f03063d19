"""Fixtures that many tests share."""

from __future__ import annotations

import pytest

from rotorfault.vehicle import Vehicle
from rotorfault.vehicle_file import load_vehicle


@pytest.fixture(scope="session")
def paper_vehicle() -> Vehicle:
    """The paper's quadrotor."""
    return load_vehicle("paper").vehicle
