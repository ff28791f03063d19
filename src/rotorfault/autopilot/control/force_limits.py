"""How much specific force a position loop may ask for: within thrust and tilt, the vertical part first."""

from __future__ import annotations

from typing import Protocol

from rotorfault.maths.geometry import PerRotor, Vec3
from rotorfault.maths.scalar import Scalar, clip, minimum, sqrt
from rotorfault.model.motion import greatest_thrust
from rotorfault.model.vehicle import Vehicle


class ForceLimits(Protocol):
    """Limits of a specific force."""

    @property
    def tilt_tangent(self) -> Scalar:
        """Of the largest tilt."""

    @property
    def thrust_share(self) -> Scalar:
        """Of the available thrust."""

    @property
    def fall_share(self) -> Scalar:
        """Of gravity: the least vertical part."""


def limited_force(f_W: Vec3, available: Scalar, vehicle: Vehicle, parameters: ForceLimits) -> Vec3:
    """Specific force in m/s^2 within available thrust [N] and tilt; the vertical part is served first."""
    most = parameters.thrust_share * available / vehicle.mass
    f_z = clip(f_W.z, parameters.fall_share * vehicle.gravity, most)
    # Factored: a compiler may fuse most^2 - f_z^2 into one rounding, which can be below zero where the two are equal.
    room = minimum(sqrt((most - f_z) * (most + f_z)), parameters.tilt_tangent * f_z)
    # The small term keeps the quotient finite at rest; it changes nothing that could be measured.
    horizontal = sqrt(f_W.x * f_W.x + f_W.y * f_W.y + 1e-18)
    scale = minimum(room / horizontal, 1.0)
    return Vec3(f_W.x * scale, f_W.y * scale, f_z)


def full_thrust(vehicle: Vehicle) -> Scalar:
    """Thrust in N of all rotors, sound and at their largest."""
    most = greatest_thrust(vehicle)
    return most.sum() if isinstance(most, PerRotor) else most * vehicle.rotors
