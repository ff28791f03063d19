"""A compiled flight that several tests of the engines compare with."""

from __future__ import annotations

import pytest
from engine_flights import Array, faulty_case_one, run

from rotorfault.engine import have_simd


@pytest.fixture(scope="session")
def simd_faulty_case_one() -> Array:
    if not have_simd():
        pytest.skip("needs llvmlite")
    return run(faulty_case_one(), "simd").signals
