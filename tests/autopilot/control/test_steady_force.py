"""The observer of a steady force, against motion that is known."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rotorfault.autopilot.control.steady_force import TIME, SteadyForce, observed, unexplained
from rotorfault.maths.geometry import Vec3, zeros

DT = 1e-3
WIND = Vec3(3.0, -1.0, 0.5)


def test_a_constant_force_is_found_with_its_time_constant_whatever_is_commanded() -> None:
    commanded = np.random.default_rng(1).normal(0.0, 5.0, (3000, 3))
    v, memory = Vec3(1.0, 2.0, 3.0), SteadyForce(Vec3(1.0, 2.0, 3.0))
    for k, acceleration in enumerate(commanded, start=1):
        explained = Vec3(*acceleration.tolist())
        memory = observed(memory, unexplained(memory, v), explained, DT)
        v = v + (explained + WIND) * DT
        found = unexplained(memory, v)
        share = 1.0 - math.exp(-k * DT / TIME)
        for seen, true in zip(found, WIND, strict=True):
            assert seen == pytest.approx(share * true, abs=2e-3 * abs(true))


def test_what_is_explained_is_no_force() -> None:
    v, memory = zeros(), SteadyForce(zeros())
    for _ in range(1000):
        memory = observed(memory, unexplained(memory, v), Vec3(4.0, 0.0, -2.0), DT)
        v = v + Vec3(4.0, 0.0, -2.0) * DT
        assert max(map(abs, unexplained(memory, v))) < 1e-9
