r"""Where yaw cannot be held: the axis of the body that points along the wanted thrust, and turns about itself.

Upright, with the body's z axis vertical, a quadrotor without one rotor leaves the rotor opposite nothing to do: it
stands still and can push one way only. Turning steadily about an axis n that is fixed in the body but not z, it has
thrusts of its own choice (relaxed hover, `rotorfault.analysis.relaxed_hover`). At a yaw rate r that axis follows from
the torque that is wanted in balance, without a search: with :math:`\omega = (p, q, r)` parallel to n,

.. math:: \tau_x + ((J_y - J_z)r - J_r\Omega)\,q - d_x p = 0, \qquad
          \tau_y + ((J_z - J_x)r + J_r\Omega)\,p - d_y q = 0, \qquad n \parallel (p, q, r)

where tau is a share, `push`, of the tilt torque with all believed rotors at the same share of what they can give. The
yaw rate is the measured one: it finds its own balance, between the rotors' drag torque and the air's damping.

How much of yaw is given up goes from 0 to 1 as the thrust that believed rotors have with yaw in balance falls from the
weight to `YAW_LOST` of it; the axis moves from z to n with the time constant `axis_time`. With yaw given up the law
sees no yaw error, and what it sees of the other two it sees in a frame whose z axis is n.
"""

from __future__ import annotations

from typing import NamedTuple

from rotorfault.maths.geometry import Mat3, PerRotor, Vec3, zeros
from rotorfault.maths.rotation import Quat
from rotorfault.maths.scalar import Scalar, clip, maximum, minimum, sqrt
from rotorfault.model.aerodynamics import Aerodynamics
from rotorfault.model.motion import effect_of
from rotorfault.model.signals import Diagnosis
from rotorfault.model.vehicle import Vehicle, rotor_momentum, wrench_of

YAW_LOST = 0.95  # of the weight. Our choice: a twentieth below it, at hover the altitude would be lost within a second
LEAST_RATE = 1.0  # rad/s: a body that turns slower has no axis of its own


class RelaxedAxis(NamedTuple):
    """Of the body, and how far yaw is given up."""

    lean: Vec3  # (n_x, n_y)/n_z, and 0
    given_up: Scalar  # 0 to 1


class Leaning(NamedTuple):
    """Numbers of the relaxed axis."""

    push: Scalar  # 0 to 1
    most: Scalar  # tangent of the largest angle between the axis and body z
    time: Scalar  # s


def upright() -> RelaxedAxis:
    """The body's z axis, yaw held."""
    return RelaxedAxis(zeros(), 0.0)


def lean(
    memory: RelaxedAxis,
    vehicle: Vehicle,
    believed: Diagnosis,
    with_yaw: Scalar,
    yaw_rate: Scalar,
    residual_speed: Scalar,
    numbers: Leaning,
    dt: Scalar,
) -> RelaxedAxis:
    """The axis one period later.

    Parameters
    ----------
    memory : RelaxedAxis
    vehicle : Vehicle
        As believed.
    believed : Diagnosis
        Of its rotors.
    with_yaw : scalar, N
        Thrust that the believed rotors have with yaw in balance.
    yaw_rate : scalar, rad/s
        Of the body.
    residual_speed : scalar, rad/s
        Believed Omega of (4).
    numbers : Leaning
    dt : scalar, s
        Sampling period.
    """
    weight = vehicle.mass * vehicle.gravity
    given_up = clip((1.0 - with_yaw / weight) / (1.0 - YAW_LOST), 0.0, 1.0)
    able = effect_of(vehicle, believed.loss, believed.stuck) * vehicle.thrust_max
    alike: PerRotor = able * (weight / maximum(able.sum(), 1e-3 * weight))
    tau = wrench_of(vehicle, alike).torque_B * (numbers.push * given_up)
    J, h, r = vehicle.inertia, rotor_momentum(vehicle, residual_speed), yaw_rate
    damping = vehicle.air.damping if isinstance(vehicle.air, Aerodynamics) else zeros()
    cx, cy = (J.y - J.z) * r - h, (J.z - J.x) * r + h
    # (p, q) r = adj(M) (-tau) r / det(M), the quotient kept finite where the body hardly turns.
    det = damping.x * damping.y - cx * cy
    scale = r / (maximum(det, 0.0) * maximum(r * r, LEAST_RATE * LEAST_RATE) + 1e-12)
    nx, ny = (damping.y * tau.x + cx * tau.y) * scale, (cy * tau.x + damping.x * tau.y) * scale
    size = sqrt(nx * nx + ny * ny + 1e-18)
    within = minimum(numbers.most / size, 1.0)
    share = dt / (numbers.time + dt)
    return RelaxedAxis(
        Vec3(
            memory.lean.x + (nx * within - memory.lean.x) * share,
            memory.lean.y + (ny * within - memory.lean.y) * share,
            0.0,
        ),
        given_up,
    )


def turn_to(axis: RelaxedAxis) -> Mat3:
    """Matrix that takes coordinates of the frame with n for its z axis to body coordinates: the shortest turn."""
    x, y = axis.lean.x, axis.lean.y
    z = 1.0 / sqrt(1.0 + x * x + y * y)
    nx, ny = x * z, y * z
    k = 1.0 / (1.0 + z)
    return Mat3(
        1.0 - nx * nx * k, -nx * ny * k, nx,
        -nx * ny * k, 1.0 - ny * ny * k, ny,
        -nx, -ny, z,
    )  # fmt: skip


def leaning_quat(axis: RelaxedAxis) -> Quat:
    """The same turn as a quaternion."""
    x, y = axis.lean.x, axis.lean.y
    z = 1.0 / sqrt(1.0 + x * x + y * y)
    w = sqrt(0.5 * (1.0 + z))
    half = 0.5 / w
    return Quat(w, -y * z * half, x * z * half, 0.0)
