"""Marks of tests that cannot run everywhere."""

from __future__ import annotations

import pytest

from rotorfault.engine import have_simd

needs_simd = pytest.mark.skipif(not have_simd(), reason="needs llvmlite")
