"""How much specific force a position loop may ask for: within thrust and tilt, the vertical part first."""

from __future__ import annotations

from typing import Protocol

from rotorfault.maths.geometry import PerRotor, Vec3
from rotorfault.maths.scalar import Scalar, clip, maximum, minimum, sqrt
from rotorfault.model.motion import greatest_thrust
from rotorfault.model.vehicle import Vehicle

# Of the weight, kept at any tilt: a rotor without thrust gives no torque. Our choice.
LEAST_THRUST = 0.3
# Cosine of the tilt down to which thrust may rise as 1/cos, and from which on it fades: that of the cascade's default
# `cos_min`, 73 degrees. Upside down thrust only adds to the fall.
LEAST_COSINE = 0.3


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


def limited_force(
    f_W: Vec3, available: Scalar, vehicle: Vehicle, parameters: ForceLimits, steady_W: Vec3 | None = None
) -> Vec3:
    """Specific force in m/s^2 within available thrust and tilt; the vertical part is served first.

    Parameters
    ----------
    f_W : Vec3, m/s^2
        Wanted, world frame.
    available : scalar, N
        Largest thrust.
    vehicle : Vehicle
        As believed.
    parameters : ForceLimits
    steady_W : Vec3, m/s^2, optional
        Horizontal part that holds against a steady force: tilt counts from there, and from no more than the largest.
    """
    most = parameters.thrust_share * available / vehicle.mass
    f_z = clip(f_W.z, parameters.fall_share * vehicle.gravity, most)
    # The small term keeps the quotient finite at rest; it changes nothing that could be measured.
    horizontal = sqrt(f_W.x * f_W.x + f_W.y * f_W.y + 1e-18)
    tilted = parameters.tilt_tangent * f_z
    if steady_W is not None:
        tilted = tilted + _reach_further(f_W, steady_W, 1.0 / horizontal, tilted)
    # Factored: a compiler may fuse most^2 - f_z^2 into one rounding, which can be below zero where the two are equal.
    room = minimum(sqrt((most - f_z) * (most + f_z)), tilted)
    scale = minimum(room / horizontal, 1.0)
    return Vec3(f_W.x * scale, f_W.y * scale, f_z)


def _reach_further(f_W: Vec3, steady_W: Vec3, per: Scalar, radius: Scalar) -> Scalar:
    """How much further than its radius a circle about the steady force reaches from zero, along the wanted one.

    As a difference, so that without a steady force nothing changes to the last bit.
    """
    size = sqrt(steady_W.x * steady_W.x + steady_W.y * steady_W.y + 1e-18)
    part = per * minimum(radius / size, 1.0)
    along = (steady_W.x * f_W.x + steady_W.y * f_W.y) * part
    across = (steady_W.x * f_W.y - steady_W.y * f_W.x) * part
    return along - across * across / (radius + sqrt(maximum(radius * radius - across * across, 0.0)))


def full_thrust(vehicle: Vehicle) -> Scalar:
    """Thrust in N of all rotors, sound and at their largest."""
    most = greatest_thrust(vehicle)
    return most.sum() if isinstance(most, PerRotor) else most * vehicle.rotors


def direction_of(force_W: Vec3) -> Vec3:
    """The unit vector along a specific force in m/s^2; upwards where there is none, as without any living rotor.

    Parameters
    ----------
    force_W : Vec3, m/s^2
        In the world or in any other frame whose z axis is up.
    """
    # Lost in rounding beside any force there is.
    some = Vec3(force_W.x, force_W.y, force_W.z + 1e-100)
    unit: Vec3 = some / sqrt(some.dot(some))
    return unit
