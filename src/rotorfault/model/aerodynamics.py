r"""Forces of the air on rotors and frame beyond linear drag, and what damps the turning body.

With :math:`v_i = v + \omega\times r_i` the velocity of rotor i against the air, in body axes, and its speed
:math:`\Omega_i \ge 0`,

.. math:: F = \sum_i\left(-k_d\Omega_i\,v_{i,\perp} - k_z\Omega_i\,v_{i,z}\,e_z + k_h|v_{i,\perp}|^2 e_z\right)
              - |v|\,C v, \qquad
          \tau = \sum_i\left(r_i\times F_i - k_{flap}\Omega_i\,v_i\times e_z\right)
              - D\omega - D_2|\omega|\omega

axis by axis in the last two: drag of a rotor across its axis (H-force), inflow, translational lift, parasitic drag of
the frame, the moment of flapping blades, and damping. What the rotors' thrusts give in still air is not in it.

Sources: J. Foerster, "System Identification of the Crazyflie 2.0", ETH Zurich, 2015, for rotor drag; the terms and
their signs as in S. Folk, J. Paulos, V. Kumar, "RotorPy", arXiv 2306.04485, 2023, against whose code they are tested
(tests/plant/test_aerodynamics.py); M. Mueller, R. D'Andrea, ICRA 2014, for the damping of a spinning body, which sets
how fast it spins when yaw is given up.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from rotorfault.base.one_line import record_line
from rotorfault.maths.geometry import PerRotor, Vec3, zeros
from rotorfault.maths.scalar import Scalar, absolute


class Aerodynamics(NamedTuple):
    """Coefficients; 0 for what a vehicle has not got."""

    rotor_drag: Scalar  # kg/rad: force across the axis per rotor speed and airspeed
    inflow: Scalar  # kg/rad: thrust lost per rotor speed and speed along the axis
    translational_lift: Scalar  # kg/m: thrust won per squared airspeed across the axis
    flapping: Scalar  # kg m/rad: moment per rotor speed and airspeed across the axis
    frame_drag: Vec3  # kg/m: force per squared airspeed, along body x, y, z
    damping: Vec3  # N m s: torque per body rate
    damping_squared: Vec3  # N m s^2: torque per squared body rate

    def __repr__(self) -> str:
        return record_line(self)


def still_air() -> Aerodynamics:
    """Coefficients of a vehicle on which the air does nothing."""
    return Aerodynamics(0.0, 0.0, 0.0, 0.0, zeros(), zeros(), zeros())


def air_wrench(
    air: Aerodynamics,
    places: Sequence[Vec3],
    speeds: PerRotor,
    airspeed_B: Vec3,
    omega_B: Vec3,
    gusts_B: Sequence[Vec3] = (),
) -> tuple[Vec3, Vec3]:
    """Force in N and torque in N m of the air on the vehicle, body axes.

    Parameters
    ----------
    air : Aerodynamics
    places : sequence of Vec3, m
        Where the rotors are, from the centre of mass, body axes.
    speeds : PerRotor, rad/s
        Of the rotors; those that are reversed count by their size.
    airspeed_B : Vec3, m/s
        Velocity of the vehicle against the air, body axes.
    omega_B : Vec3, rad/s
        Body rates.
    gusts_B : sequence of Vec3, m/s
        By how much faster the air is at each rotor than at the centre of mass, body axes; empty for not at all.
    """
    force, torque = zeros(), zeros()
    for i, (place, speed) in enumerate(zip(places, speeds, strict=True)):
        size = absolute(speed)
        v = airspeed_B + omega_B.cross(place)
        v = v - gusts_B[i] if gusts_B else v
        lift = air.translational_lift * (v.x * v.x + v.y * v.y)
        pull = Vec3(-air.rotor_drag * size * v.x, -air.rotor_drag * size * v.y, lift - air.inflow * size * v.z)
        flap = air.flapping * size
        force = force + pull
        torque = torque + place.cross(pull) + Vec3(-flap * v.y, flap * v.x, 0.0)
    drag = air.frame_drag.times(airspeed_B) * airspeed_B.norm()
    damped = air.damping.times(omega_B) + air.damping_squared.times(omega_B.times(omega_B.map(absolute)))
    return force - drag, torque - damped
