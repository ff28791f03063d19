"""The cost J of (19) with the printed weights (35), and the attitude error that it counts."""

from __future__ import annotations

from collections.abc import Callable

from rotorfault.loop.scores import ERROR_FLOOR
from rotorfault.maths.geometry import Vec3
from rotorfault.maths.rotation import Quat
from rotorfault.maths.scalar import Scalar, absolute, less_equal, maximum, select, wrap_angle

Q_POSITION, Q_VELOCITY = 0.3, 0.005
"""Of (35): Q on the position error, over its magnitude, and on its rate."""
R_TORQUE, R_POSITION = 0.0088, (0.2, 0.2, 0.4)
"""Of (35): R on the torque, and on the virtual accelerations along x, y, z, times the squared position error."""


def attitude_error(attitude: Quat, yaw_reference: Scalar) -> Vec3:
    """Rotation vector in rad from the attitude that is level at the reference's yaw [rad] to an attitude."""
    return attitude.turned(-yaw_reference).rotation_vector()


def heading_error(attitude: Quat, yaw_reference: Scalar) -> Scalar:
    """Angle in rad from the reference's yaw [rad] to the heading of an attitude, the short way round."""
    return wrap_angle(attitude.heading() - yaw_reference)


def cost_rate(
    error: Vec3,
    slope: Vec3,
    turn: Vec3,
    rates: Vec3,
    acceleration: Vec3,
    torque: Vec3,
    floor: float = ERROR_FLOOR,
    floor_r: float = ERROR_FLOOR,
) -> Scalar:
    """e'Qe + u'Ru of (19) with the printed weights (35).

    Parameters
    ----------
    error, slope : Vec3, m and m/s
        Position and velocity less those of the reference.
    turn, rates : Vec3, rad and rad/s
        Attitude error, and the body's rates.
    acceleration : Vec3, m/s^2
        Virtual input of the position axes.
    torque : Vec3, N m
        Input of the attitude axes, as it was given.
    floor, floor_r : float, m
        Floor of |e| in Q and in R, which the paper leaves without one.
    """
    # e^2 / max(|e|, floor), without the division.
    share = each(
        lambda e, most: select(less_equal(absolute(e), floor), e * e * (1.0 / floor), most),
        error,
        error.map(lambda e: maximum(absolute(e), floor)),
    )
    push = error.map(lambda e: maximum(absolute(e), floor_r)).times(acceleration)
    state = turn.dot(turn) + rates.dot(rates) + Q_POSITION * share.sum() + Q_VELOCITY * slope.dot(slope)
    return state + R_TORQUE * torque.dot(torque) + push.dot(Vec3.of(R_POSITION).times(push))


def each(function: Callable[..., Scalar], *vectors: Vec3) -> Vec3:
    """Apply a function to the components of vectors along x, y, z in turn."""
    return Vec3.of(function(*components) for components in zip(*vectors, strict=True))
