"""The direction of a wanted force."""

from __future__ import annotations

import pytest

from rotorfault.autopilot.control.force_limits import direction_of
from rotorfault.maths.geometry import Vec3


def test_no_force_points_upwards() -> None:
    """As the thrust limit of a body without living rotors leaves it."""
    assert tuple(direction_of(Vec3(0.0, 0.0, 0.0))) == (0.0, 0.0, 1.0)


@pytest.mark.parametrize("force", [(3.0, -4.0, 0.0), (1e-3, 2e-3, -5e-3), (0.0, 0.0, 9.81), (-7.0, 2.0, 30.0)])
def test_a_force_keeps_its_direction_to_the_last_bit(force: tuple[float, float, float]) -> None:
    """Whatever it is that stands for no force is lost in rounding."""
    x, y, z = force
    size = (x * x + y * y + z * z) ** 0.5
    assert tuple(direction_of(Vec3(x, y, z))) == pytest.approx((x / size, y / size, z / size), rel=1e-15)
