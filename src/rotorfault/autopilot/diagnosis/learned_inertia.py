r"""The body as the filter has come to know it: with the moments of inertia that it has learned.

States are the logarithms :math:`e_J` of the true moments over the believed ones. A torque that sets in turns the body
at first as :math:`e^{e_w - e_J}` says, with the rotors' bandwidth :math:`e^{e_w}w`: what the motion cannot tell apart
is a straight line of these states, and has one direction wherever the filter is linearised. With a share
:math:`1/(1 + e)` that direction turns with the estimate, and the filter takes its turning for knowledge.
"""

from __future__ import annotations

from rotorfault.maths.geometry import Vec3
from rotorfault.maths.scalar import Scalar, exp, sqrt
from rotorfault.model.vehicle import Vehicle


def with_inertia(vehicle: Vehicle, learned: Vec3) -> Vehicle:
    """The believed vehicle with other moments of inertia; products go with the roots of both factors.

    Parameters
    ----------
    vehicle : Vehicle
    learned : Vec3
        Logarithms of the moments over the believed ones.
    """
    factor = learned.map(exp)
    heavier = vehicle._replace(inertia=vehicle.inertia.times(factor))
    if not isinstance(vehicle.inertia_products, Vec3):
        return heavier
    x, y, z = factor.map(sqrt)
    return heavier._replace(inertia_products=vehicle.inertia_products.times(Vec3(x * y, x * z, y * z)))


def inertia_row(
    vehicle: Vehicle, axis: int, turned: Scalar, angle_B: Vec3, omega_B: Vec3, beside: tuple[Scalar, Scalar]
) -> tuple[Scalar, Scalar, Scalar]:
    """What the rate about an axis changes by over a period, in rad/s, for each logarithm of a moment of inertia.

    Parameters
    ----------
    vehicle : Vehicle
        From `with_inertia`.
    axis : int
        0, 1, 2 for x, y, z.
    turned : scalar, rad/s
        By which all torques and the spin of the body change the rate about it.
    angle_B : Vec3, rad
        By which the body turns in the period.
    omega_B : Vec3, rad/s
    beside : two scalars, rad/s
        By which drag of the rotors turns it about yaw, for the centre of mass lies beside: by the offsets about roll
        and pitch, which tell how far by the inertia.
    """
    J, omega, angle = tuple(vehicle.inertia), tuple(omega_B), tuple(angle_B)
    row = [-turned, -turned, -turned]
    a, b = (axis + 1) % 3, (axis + 2) % 3
    spun = omega[a] * angle[b] / J[axis]
    row[a], row[b] = J[a] * spun, -J[b] * spun
    if axis == 2:
        row = [row[0] + beside[0], row[1] + beside[1], row[2] - beside[0] - beside[1]]
    return row[0], row[1], row[2]
