"""Fixtures that many tests share."""

from __future__ import annotations

import os

import pytest
from hypothesis import settings

from rotorfault.model.vehicle import Vehicle
from rotorfault.model.vehicle_file import load_vehicle

# Matrices are small, and the tests run side by side: threads of BLAS would wait for each other. SciPy and SLICOT
# bring one each, which asks when it is loaded, by the tests that need it.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
# Pages show what a wide terminal prints; whoever runs the tests may have a narrow one, or none.
os.environ["COLUMNS"] = "118"

# The same examples in every run, and none judged by the time it takes.
settings.register_profile("rotorfault", deadline=None, derandomize=True, max_examples=60)
settings.load_profile("rotorfault")


@pytest.fixture(scope="session")
def paper_vehicle() -> Vehicle:
    """The paper's quadrotor."""
    return load_vehicle("paper").vehicle
