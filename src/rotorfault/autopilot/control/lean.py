"""The axis about which a body without some rotors turns in balance."""

from __future__ import annotations

import math

from rotorfault.maths.geometry import Vec3, zeros
from rotorfault.maths.scalar import Scalar, maximum
from rotorfault.model.aerodynamics import Aerodynamics
from rotorfault.model.vehicle import Vehicle, rotor_momentum

LEAST_RATE = 1.0  # rad/s: a body that turns slower has no axis of its own


def lean_in_balance(
    vehicle: Vehicle, tau: Vec3, spin: Scalar, residual_speed: Scalar | Vec3, most: Scalar = math.inf
) -> Vec3:
    """(n_x, n_y)/n_z of the axis about which a spinning body balances a tilt torque.

    While a body spins up, its own gyroscopic torque outgrows that of its rotors, and the axis that balances changes
    sides through infinity. No further than `most` it leans by as much as its stiffness has left of that of `most`,
    so it passes through body z.

    Parameters
    ----------
    vehicle : Vehicle
        As believed.
    tau : Vec3, N m
        Torque in balance.
    spin : scalar, rad/s
        Yaw rate.
    residual_speed : scalar, rad/s
        Believed Omega of (4); of tilted rotors its vector.
    most : scalar, optional
        Tangent of the largest lean; without bound if not given.
    """
    J, momentum = vehicle.inertia, rotor_momentum(vehicle, residual_speed)
    d = vehicle.air.damping if isinstance(vehicle.air, Aerodynamics) else zeros()
    # What does not go by p and q turns a body whose axes are no principal ones, or whose rotors are tilted.
    if isinstance(vehicle.inertia_products, Vec3):
        xy, xz, yz = vehicle.inertia_products * spin
        tau, d = tau + Vec3(yz, -xz, 0.0) * spin, Vec3(d.x - xy, d.y + xy, d.z)
    if isinstance(momentum, Vec3):
        tau, momentum = tau + Vec3(momentum.y, -momentum.x, 0.0) * spin, momentum.z
    cx, cy = (J.y - J.z) * spin - momentum, (J.z - J.x) * spin + momentum
    # (p, q)/r by Cramer's rule. Where the body hardly turns, or has no balance, the floors keep it finite.
    fast = maximum(spin * spin, LEAST_RATE * LEAST_RATE)
    tiny = 1e-6 * (J.x * J.y) * LEAST_RATE * LEAST_RATE
    stiff = (tau.x * tau.x + tau.y * tau.y) / (most * most * fast)
    scale = spin / (maximum(d.x * d.y - cx * cy, stiff + tiny) * fast)
    return Vec3((d.y * tau.x + cx * tau.y) * scale, (cy * tau.x + d.x * tau.y) * scale, 0.0)
