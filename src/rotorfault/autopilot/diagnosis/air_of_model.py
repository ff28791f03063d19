r"""What the air does to a body with sound rotors, as the filter of the detectors believes it.

A force of the air across body z has levers about roll and pitch that nobody knows (drag above the centre of mass,
flapping blades), and about yaw one that the rotors' speeds and the shift of the centre of mass give. Rotor i has the
drag :math:`k\Omega_iv`, so the share :math:`\beta` of all drag that acts at rotors goes with the sum of their speeds
and attacks at the mean of their places by speed, beside which the centre of mass lies by the shift that the offsets d
tell,

.. math:: \dot\omega_z \mathrel{+}= \tfrac{\beta m}{J_z}(\bar xf_y - \bar yf_x)
                                    - \tfrac{\beta}{gJ_z}(J_xf_xd_x + J_yf_yd_y) ,

with f, which is felt, the force over mass: on a mass that is learned to be another all of it goes with that mass.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from rotorfault.maths.geometry import PerRotor, Vec3
from rotorfault.maths.scalar import Scalar, absolute, maximum, sqrt
from rotorfault.model.aerodynamics import Aerodynamics
from rotorfault.model.mixer import hover_thrust
from rotorfault.model.signals import Estimate
from rotorfault.model.vehicle import Vehicle, lateral_force, rotor_speeds

# m/s: what falls faster has no drag that an airspeed could be told by.
FASTEST_FALL = 300.0
# Of tilt, 78 degrees: beyond it the climb says little of the airspeed along body z.
LEAST_COSINE = 0.2


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


def more_drag(speeds: PerRotor, hover: Scalar, share: Scalar) -> Scalar:
    """Drag over that in hover: each rotor's goes with its speed.

    Parameters
    ----------
    speeds : PerRotor, rad/s
    hover : scalar, rad/s
        Sum of their sizes in hover.
    share : scalar
        Of drag that acts at the rotors.
    """
    return 1.0 + share * (speeds.map(absolute).sum() / hover - 1.0)


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


def airspeed_felt(vehicle: Vehicle, now: Estimate, speeds: PerRotor, thrust: PerRotor) -> Vec3:
    r"""Velocity in m/s against the air, body axes, by what an accelerometer feels across body z, in level wind.

    There rotors push only if they are tilted; the rest is drag, of the rotors, linear, and of the frame, C, which
    goes with the square of the airspeed:

    .. math:: v_\perp = -\frac{2mf_\perp}{K + \sqrt{K^2 + 4Cm|f_\perp|}}, \qquad K = k\sum\Omega_i + k_d

    and along body z it is what makes it the estimated climb along the vertical.

    Parameters
    ----------
    vehicle : Vehicle
        As believed, with `air`.
    now : Estimate
        Its specific force is zero where nothing is felt; then this is zero but for the climb.
    speeds : PerRotor, rad/s
        Of the rotors.
    thrust : PerRotor, N
        Of the rotors.
    """
    assert isinstance(vehicle.air, Aerodynamics)
    m, R_WB = vehicle.mass, now.q_WB.matrix()
    forward, left = now.specific_force_B.x, now.specific_force_B.y
    if vehicle.tilt != ():
        pushed = lateral_force(vehicle, thrust) / m
        forward, left = forward - pushed.x, left - pushed.y
    alike = vehicle.air.rotor_drag * speeds.map(absolute).sum() + vehicle.linear_drag
    frame = 0.5 * (vehicle.air.frame_drag.x + vehicle.air.frame_drag.y)
    over = alike + sqrt(alike * alike + frame * m * 4.0 * sqrt(forward * forward + left * left))
    per_force = 2.0 * m / maximum(over, 2.0 * m * vehicle.gravity / FASTEST_FALL)
    x, y = -forward * per_force, -left * per_force
    upright = R_WB.zz / maximum(R_WB.zz * R_WB.zz, LEAST_COSINE * LEAST_COSINE)
    return Vec3(x, y, (now.v_W.z - R_WB.zx * x - R_WB.zy * y) * upright)


def drag_of_each(vehicle: Vehicle, airspeed_B: Vec3, speeds: PerRotor) -> PerRotor:
    """Torque in N m about yaw by the drag of each rotor.

    Parameters
    ----------
    vehicle : Vehicle
        As believed, with `air`.
    airspeed_B : Vec3, m/s
        Velocity against the air, body axes.
    speeds : PerRotor, rad/s
        Of the rotors.
    """
    assert isinstance(vehicle.air, Aerodynamics)
    across = vehicle.rotor_y * airspeed_B.x - vehicle.rotor_x * airspeed_B.y
    turned: PerRotor = across * speeds.map(absolute) * vehicle.air.rotor_drag
    return turned


class Blown(NamedTuple):
    """What the air changes the rates by over a period."""

    yaw: Scalar  # rad/s: drag of the rotors about yaw, at the believed centre of mass
    levers: tuple[Scalar, Scalar]  # rad/s/m: about roll and pitch, at a lever of 1 m
    offsets: tuple[Scalar, ...]  # s: about yaw, per offset about roll and pitch; empty where rotors have no drag
    beside: tuple[Scalar, Scalar]  # rad/s: these, times the offsets
    wind: tuple[Vec3, ...]  # s/m: of each axis, per force of the air over mass, world axes, at levers that are known


def blown_about(
    believed: Vehicle,
    learned: Vehicle,
    speeds: PerRotor,
    air_W: Vec3,
    level_W: Sequence[Vec3],
    arms: tuple[Sequence[Scalar], Sequence[Scalar]],
    share: Scalar,
    dt: Scalar,
    heavier: Scalar = 1.0,
) -> Blown:
    """What the air changes the rates by.

    Levers are learned as what they turn a body of the believed inertia by; where drag of the rotors attacks is known,
    so that turns the body as its learned inertia has it, with the force of the air on its learned mass: known is that
    force over mass, for that is felt.

    Parameters
    ----------
    believed, learned : Vehicle
        With the inertia as believed, and as learned.
    speeds : PerRotor, rad/s
    air_W : Vec3, m/s^2
        The air's force over mass, world axes.
    level_W : sequence of Vec3
        Body x and y in world axes.
    arms : two sequences of scalar
        Levers in m about roll and pitch, and offsets in rad/s^2 about them.
    share : scalar
        Of drag that acts at the rotors.
    dt : scalar, s
        Length of the period.
    heavier : scalar
        The learned mass over the believed one.
    """
    share = share * heavier
    forward, left = air_W.dot(level_W[0]), air_W.dot(level_W[1])
    roll, pitch = lever_rows(believed, forward, left)
    each = [arm * one for arm, one in zip(arms[0], lever_rows(believed, 1.0, 1.0), strict=True)]
    wind = [level_W[1] * (each[0] * dt), level_W[0] * (each[1] * dt)]
    if learned.air == ():
        return Blown(0.0, (roll * dt, pitch * dt), (), (0.0, 0.0), tuple(wind))
    yaw, rows = drag_about_yaw(learned, speeds, forward, left, share)
    a, b = (row * offset * dt for row, offset in zip(rows, arms[1], strict=True))
    ahead, aside = (drag_about_yaw(learned, speeds, x, y, share) for x, y in ((1.0, 0.0), (0.0, 1.0)))
    wind.append(level_W[0] * ((ahead[0] + ahead[1][0] * arms[1][0]) * dt))
    wind[2] = wind[2] + level_W[1] * ((aside[0] + aside[1][1] * arms[1][1]) * dt)
    return Blown(yaw * dt, (roll * dt, pitch * dt), (rows[0] * dt, rows[1] * dt), (a, b), tuple(wind))
