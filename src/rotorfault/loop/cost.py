"""The cost J of (19) with the printed weights (35), and the attitude error that it counts."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rotorfault.loop.scores import ERROR_FLOOR
from rotorfault.maths.geometry import Vec3
from rotorfault.maths.rotation import Quat
from rotorfault.maths.scalar import Scalar, absolute, less_equal, maximum, select

Q_POSITION, Q_VELOCITY = 0.3, 0.005
"""Of (35): Q on the position error, over its magnitude, and on its rate."""
R_TORQUE, R_POSITION = 0.0088, (0.2, 0.2, 0.4)
"""Of (35): R on the torque, and on the virtual accelerations along x, y, z, times the squared position error."""


def attitude_error(attitude: Quat, yaw_reference: Scalar) -> Vec3:
    """Rotation vector in rad from the attitude that is level at the reference's yaw [rad] to an attitude."""
    return attitude.turned(-yaw_reference).rotation_vector()


def cost_rate(signals: Any, error: Vec3, turn: Vec3) -> Scalar:
    """e'Qe + u'Ru of (19) with the printed weights (35).

    Parameters
    ----------
    signals : record
        Of a controller with the signal ``virtual_position``.
    error : Vec3, m
        Position less reference.
    turn : Vec3, rad
        Attitude error.
    """
    slope = signals.velocity - signals.velocity_reference
    torque = signals.torque_demand - signals.torque_unallocated
    size = error.map(lambda e: maximum(absolute(e), ERROR_FLOOR))
    # e^2 / max(|e|, floor), without the division.
    share = each(
        lambda e, most: select(less_equal(absolute(e), ERROR_FLOOR), e * e * (1.0 / ERROR_FLOOR), most), error, size
    )
    push = size.times(signals.parts.controller.virtual_position)
    rates = signals.body_rates
    state = turn.dot(turn) + rates.dot(rates) + Q_POSITION * share.sum() + Q_VELOCITY * slope.dot(slope)
    return state + R_TORQUE * torque.dot(torque) + push.dot(Vec3.of(R_POSITION).times(push))


def each(function: Callable[..., Scalar], *vectors: Vec3) -> Vec3:
    """Apply a function to the components of vectors along x, y, z in turn."""
    return Vec3.of(function(*components) for components in zip(*vectors, strict=True))
