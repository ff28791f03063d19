r"""What the air does to a body with sound rotors, as the filter of the detectors believes it.

A force of the air across body z has levers about roll and pitch that nobody knows (drag above the centre of mass,
flapping blades), and about yaw one that the rotors' speeds and the shift of the centre of mass give. Rotor i has the
drag :math:`k\Omega_iv`, so all of it attacks at the mean of the rotors' places by speed.
"""

from __future__ import annotations

from rotorfault.maths.geometry import PerRotor
from rotorfault.maths.scalar import Scalar, absolute
from rotorfault.model.mixer import hover_thrust
from rotorfault.model.turbulence import turbulence
from rotorfault.model.vehicle import Vehicle, rotor_speeds

ALTITUDE = 10.0  # m: at which gusts are expected; that they are weaker and longer higher up is on the safe side
STILL = 1.0  # m/s: least wind that carries gusts past


def air_drag(vehicle: Vehicle) -> tuple[float, float]:
    """Drag over airspeed in N s/m in hover, linear drag and that of the rotors; and that along body z, over it.

    Rotors have drag across their axes; along them inflow takes thrust.

    Parameters
    ----------
    vehicle : Vehicle
        As believed.
    """
    drag = along = float(vehicle.linear_drag)
    if vehicle.air != ():
        turning = float(rotor_speeds(vehicle, hover_thrust(vehicle)).sum())
        drag += float(vehicle.air.rotor_drag) * turning  # type: ignore[union-attr]
        along += float(vehicle.air.inflow) * turning  # type: ignore[union-attr]
    return drag, along / drag if drag > 0.0 else 1.0


def gust_gradient(wind: float, drag: float, arms: float) -> float:
    """Density in (N m)^2 s of the torque of gusts that differ from one side of the vehicle to the other.

    Parameters
    ----------
    wind : float, m/s
        Mean wind at 6 m whose gusts are expected.
    drag : float, N s/m
    arms : float, m
        Of the rotors.
    """
    gusts, across = turbulence(wind, ALTITUDE), 2.0 * arms
    torque = 0.5 * drag * arms
    both = (gusts.sigma_up**2 / gusts.length_up, gusts.sigma_level**2 / gusts.length_level)
    return max(2.0 * across * share for share in both) * torque**2 * 2.0 * across / max(wind, STILL)


def lever_rows(vehicle: Vehicle, forward: Scalar, left: Scalar) -> tuple[Scalar, Scalar]:
    """Angular accelerations in rad/s^2 about roll and pitch by the air's lateral force, at a lever of 1 m.

    Parameters
    ----------
    vehicle : Vehicle
        As believed.
    forward, left : scalar, m/s^2
        The air's force over mass, body axes.
    """
    m, J = vehicle.mass, vehicle.inertia
    return -left * (m / J.x), forward * (m / J.y)


def drag_about_yaw(
    vehicle: Vehicle, speeds: PerRotor, forward: Scalar, left: Scalar, share: Scalar
) -> tuple[Scalar, tuple[Scalar, Scalar]]:
    """Angular acceleration in rad/s^2 about yaw by the rotors' drag, and of it per offset about roll and pitch.

    A rotor that turns faster has more drag, so the force attacks where the speeds have their mean; a centre of mass
    that is shifted by (s_x, s_y) = g^-1 (J_y d_y, -J_x d_x)/m lies beside that.

    Parameters
    ----------
    vehicle : Vehicle
        As believed.
    speeds : PerRotor, rad/s
    forward, left : scalar, m/s^2
        The air's force over mass, body axes.
    share : scalar
        Of it that acts at the rotors.
    """
    J, size = vehicle.inertia, speeds.map(absolute)
    over = share * vehicle.mass / J.z
    x, y = (place.dot(size) for place in (vehicle.rotor_x, vehicle.rotor_y))
    turned = (x * left - y * forward) * (over / size.sum())
    beside = share / (vehicle.gravity * J.z)
    return turned, (-forward * (J.x * beside), -left * (J.y * beside))
