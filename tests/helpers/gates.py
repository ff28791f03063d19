"""Marks of tests that cannot run everywhere."""

from __future__ import annotations

import os

import pytest

from rotorfault.engine import have_simd

needs_simd = pytest.mark.skipif(not have_simd(), reason="needs llvmlite")
needs_posix = pytest.mark.skipif(os.name == "nt", reason="needs signals and limits of POSIX")
