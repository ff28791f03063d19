r"""From a specific force and a heading to the attitude that a law tracks: command filter and tracking error.

Two ways, a setting of the cascade (``tracking``):

``so3``
    The wanted thrust axis b passes a critically damped command filter in the world frame, so that a turning body
    changes nothing of it: as n = 2 (b_x, b_y)/(1 + b_z), twice its stereographic projection, which is the tilt in rad
    to second order and fails at no angle but straight down. Yaw is filtered about the reference's yaw, which turns at
    the reference's rate: a heading that turns evenly is followed without lag. The error has two parts, as vectors in
    the body frame: the shortest turn that takes the wanted thrust axis to the true one, about an axis in the rotor
    plane; and, about the thrust axis, the heading that is then left. So a heading that is off, or given up after a
    fault, costs the thrust axis nothing. With :math:`b_B = R^T b = (d_x, d_y, d_z)`,
    :math:`g = (b + R e_z)/(1 + d_z)` and the frame turned that shortest way back, :math:`x' = R e_x - d_x g`,
    :math:`y' = R e_y - d_y g`,

    .. math:: e = \Big(d_y, -d_x\Big)\frac{\mathrm{atan2}(s, d_z)}{s}, \quad s^2 = d_x^2 + d_y^2, \qquad
              e_z = \mathrm{atan2}(x'_y, x'_x) - \psi

    .. math:: \omega'_x = -y'\cdot\dot b, \quad \omega'_y = x'\cdot\dot b, \quad
              \omega'_z = \dot\psi\,(b_z + y'_z t) - \omega'_y t, \quad t = y'_z / b_z

    The law's rate error is omega less omega' in body coordinates; what keeps it there is the derivative of omega',
    :math:`R^T R'\dot\omega' - \omega\times R^T R'\omega'`. The decomposition is that of D. Brescianini and
    R. D'Andrea, "Tilt-prioritized quadrocopter attitude control", 2020.

``euler``
    Roll and pitch at the measured yaw, filtered as angles; Euler rates are taken for body rates, as the paper does in
    (3) and (34). Right near hover only: on a circle of 3 rad/s yaw stands off by a radian. For its reproduction.
"""

from __future__ import annotations

from typing import Literal, NamedTuple, Protocol, final

from rotorfault.maths.geometry import Mat3, Vec3, zeros
from rotorfault.maths.rotation import Quat
from rotorfault.maths.scalar import Scalar, atan2, exp, less, maximum, select, sqrt, wrap_angle
from rotorfault.model.signals import Estimate, Reference

Tracking = Literal["so3", "euler"]

# Of 1 + d_z and of the squared length of a heading: both reach 0 only where a body hangs upside down or points
# straight up, and there the floor keeps their quotients numbers.
_LEAST = 1e-15


class AttitudeReference(NamedTuple):
    """State of the command filter: tilt (n_x, n_y) of the thrust axis and yaw, or three Euler angles."""

    attitude: Vec3  # rad
    rate: Vec3  # rad/s


class Wanted(NamedTuple):
    """What the attitude loop tracks at one sampling instant, and how far the body is from it."""

    demand: Vec3  # rad: roll, pitch at the measured heading, and yaw, before the command filter
    command: Vec3  # rad: the same after it
    e: Vec3  # rad: error about the body axes, or of the Euler angles
    rate: Vec3  # rad/s: wanted rates, of the body or of the Euler angles
    acceleration: Vec3  # rad/s^2: their derivative
    after: AttitudeReference  # of the command filter, one period later


class AttitudeTracking(Protocol):
    """How the cascade tracks attitude."""

    def start(self, q_WB: Quat, tilt_tangent: Scalar) -> AttitudeReference:
        """State of the command filter at an attitude, at rest.

        Parameters
        ----------
        q_WB : Quat
            Attitude.
        tilt_tangent : scalar
            Of the largest tilt that is ever demanded; rotations begin there where the body hangs upside down.
        """
        ...

    def track(
        self,
        state: AttitudeReference,
        estimate: Estimate,
        R_WB: Mat3,
        f_W: Vec3,
        reference: Reference,
        bandwidth: Scalar,
        dt: Scalar,
    ) -> Wanted:
        """What is wanted now.

        Parameters
        ----------
        state : AttitudeReference
            Of the command filter.
        estimate : Estimate
        R_WB : Mat3
            Rotation matrix of its attitude.
        f_W : Vec3
            Along the wanted thrust axis, world frame; its vertical part above 0.
        reference : Reference
            Its yaw with rate and acceleration.
        bandwidth : scalar, rad/s
            Double pole of the command filter.
        dt : scalar, s
            Sampling period.
        """
        ...

    def ahead_of_lag(self, torque_B: Vec3, now_B: Vec3, omega_B: Vec3, bandwidth: Scalar) -> Vec3:
        """The torque in N m to ask for so that a wanted one comes about while the body turns.

        Parameters
        ----------
        torque_B : Vec3, N m
            Wanted.
        now_B : Vec3, N m
            That the rotors are believed to give now.
        omega_B : Vec3, rad/s
            Body rates.
        bandwidth : scalar, rad/s
            Of the rotors' lag.
        """
        ...


def level_attitude() -> AttitudeReference:
    """Level, at yaw 0, at rest; the same in both ways of tracking."""
    return AttitudeReference(zeros(), zeros())


def attitude_for(f_W: Vec3, cos_yaw: Scalar, sin_yaw: Scalar, yaw_ref: Scalar) -> Vec3:
    """Attitude in rad whose thrust axis points along f, roll and pitch taken at the present yaw."""
    c, s = cos_yaw, sin_yaw
    forward, left = c * f_W.x + s * f_W.y, c * f_W.y - s * f_W.x
    return Vec3(
        atan2(-left, sqrt(forward * forward + f_W.z * f_W.z)),
        atan2(forward, f_W.z),
        yaw_ref,
    )


def settling(gap: Vec3, rate: Vec3, bandwidth: Scalar, dt: Scalar) -> tuple[Vec3, Vec3, Vec3]:
    """One period of the critically damped filter, exact for a held input: change, next rate, acceleration now.

    Parameters
    ----------
    gap, rate : Vec3
        Output less input, and its rate.
    bandwidth : scalar, rad/s
        Double pole.
    dt : scalar, s
    """
    slope = rate + gap * bandwidth
    decay = exp(-bandwidth * dt)
    after = (gap + slope * dt) * decay
    next_rate = (rate - slope * (bandwidth * dt)) * decay
    acceleration = -(gap * (bandwidth * bandwidth)) - rate * (2.0 * bandwidth)
    return after - gap, next_rate, acceleration


def filtered(
    reference: AttitudeReference, demand: Vec3, bandwidth: Scalar, dt: Scalar
) -> tuple[AttitudeReference, Vec3]:
    """One period of the command filter on Euler angles: (next state, acceleration now in rad/s^2)."""
    gap = Vec3(
        reference.attitude.x - demand.x, reference.attitude.y - demand.y, wrap_angle(reference.attitude.z - demand.z)
    )
    change, rate, acceleration = settling(gap, reference.rate, bandwidth, dt)
    return AttitudeReference(reference.attitude + change, rate), acceleration


def _heading(R_WB: Mat3) -> tuple[Scalar, Scalar]:
    """Cosine and sine of yaw."""
    size = 1.0 / maximum(sqrt(R_WB.xx * R_WB.xx + R_WB.yx * R_WB.yx), _LEAST)
    return R_WB.xx * size, R_WB.yx * size


@final
class EulerTracking:
    """Euler angles, their rates taken for body rates."""

    def start(self, q_WB: Quat, tilt_tangent: Scalar) -> AttitudeReference:
        """At the attitude's angles."""
        return AttitudeReference(q_WB.euler(), zeros())

    def track(
        self,
        state: AttitudeReference,
        estimate: Estimate,
        R_WB: Mat3,
        f_W: Vec3,
        reference: Reference,
        bandwidth: Scalar,
        dt: Scalar,
    ) -> Wanted:
        """What is wanted now; see `AttitudeTracking`."""
        demand = attitude_for(f_W, *_heading(R_WB), reference.yaw)
        after, acceleration = filtered(state, demand, bandwidth, dt)
        gap = estimate.q_WB.euler() - state.attitude
        return Wanted(
            demand=demand,
            command=state.attitude,
            e=Vec3(gap.x, gap.y, wrap_angle(gap.z)),
            rate=state.rate,
            acceleration=acceleration,
            after=after,
        )

    def ahead_of_lag(self, torque_B: Vec3, now_B: Vec3, omega_B: Vec3, bandwidth: Scalar) -> Vec3:
        """The wanted torque itself."""
        return torque_B


@final
class RotationTracking:
    """Thrust axis first, heading about it: an error on SO(3)."""

    def start(self, q_WB: Quat, tilt_tangent: Scalar) -> AttitudeReference:
        """At the attitude's thrust axis and heading; of what hangs upside down at the largest tilt that way."""
        axis = q_WB.z_axis()
        lean = 2.0 / maximum(1.0 + axis.z, _LEAST)
        # Upside down the filter would hold the body there for the time that it takes to come to what is demanded.
        across = sqrt(axis.x * axis.x + axis.y * axis.y)
        most = 2.0 * tilt_tangent / (1.0 + sqrt(1.0 + tilt_tangent * tilt_tangent))
        lean = select(less(axis.z, 0.0), most / maximum(across, _LEAST), lean)
        return AttitudeReference(Vec3(axis.x * lean, axis.y * lean, q_WB.heading()), zeros())

    def track(
        self,
        state: AttitudeReference,
        estimate: Estimate,
        R_WB: Mat3,
        f_W: Vec3,
        reference: Reference,
        bandwidth: Scalar,
        dt: Scalar,
    ) -> Wanted:
        """What is wanted now; see `AttitudeTracking`."""
        lean = 2.0 / (sqrt(f_W.dot(f_W)) + f_W.z)
        gap = Vec3(
            state.attitude.x - f_W.x * lean,
            state.attitude.y - f_W.y * lean,
            wrap_angle(state.attitude.z - reference.yaw),
        )
        # Tilt is filtered towards the demand, yaw towards a reference that turns.
        turning = Vec3(0.0, 0.0, reference.yaw_rate)
        change, rate, acceleration = settling(gap, state.rate - turning, bandwidth, dt)
        speeding = Vec3(0.0, 0.0, reference.yaw_acceleration)
        acceleration = acceleration + speeding
        gone = Vec3(0.0, 0.0, (reference.yaw_rate + 0.5 * reference.yaw_acceleration * dt) * dt)
        after = AttitudeReference(state.attitude + change + gone, rate + turning + speeding * dt)

        # The wanted axis, b = (n_x, n_y, 2)/D - e_z, and the two derivatives of D.
        n, n_dot, n_ddot = (Vec3(v.x, v.y, 0.0) for v in (state.attitude, state.rate, acceleration))
        shrink = 1.0 / (1.0 + 0.25 * n.dot(n))
        D_dot, D_ddot = 0.5 * n.dot(n_dot), 0.5 * (n_dot.dot(n_dot) + n.dot(n_ddot))
        b_W = Vec3(n.x * shrink, n.y * shrink, 2.0 * shrink - 1.0)
        X, Y, Z = (Vec3(*column) for column in _columns(R_WB))
        dx, dy, dz = X.dot(b_W), Y.dot(b_W), Z.dot(b_W)
        h = 1.0 / maximum(1.0 + dz, _LEAST)
        g = (b_W + Z) * h
        x_W, y_W = X - g * dx, Y - g * dy

        # The small term is lost in rounding but where there is no tilt error; there it keeps the quotient at 1.
        sine = sqrt(dx * dx + dy * dy + 1e-40)
        angle = atan2(sine, dz) / sine
        e = Vec3(dy * angle, -dx * angle, wrap_angle(atan2(x_W.y, x_W.x) - state.attitude.z))

        # Rates of the wanted frame, and their derivatives, in its own coordinates.
        def along(axis_W: Vec3) -> tuple[Scalar, Scalar]:
            """Parts of the wanted axis's first and second derivative along one across it."""
            first = (axis_W.dot(n_dot) - axis_W.z * D_dot) * shrink
            return first, (axis_W.dot(n_ddot) - axis_W.z * D_ddot - 2.0 * D_dot * first) * shrink

        (wy, by), (wx, bx) = along(x_W), along(y_W)
        wx, bx = -wx, -bx
        # Beyond 84 degrees a heading rate says little of the rate about the axis; the floor keeps it a number.
        steep = 1.0 / maximum(b_W.z, 0.1)
        yaw_rate, t = state.rate.z, y_W.z * steep
        share = b_W.z + y_W.z * t
        wz = yaw_rate * share - wy * t
        ax, ay = wy * wz + bx, by - wx * wz
        sinking = wy * x_W.z - wx * y_W.z
        tipping = wx * b_W.z - wz * x_W.z
        t_dot = (tipping - t * sinking) * steep
        az = acceleration.z * share + yaw_rate * (sinking + tipping * t + y_W.z * t_dot) - ay * t - wy * t_dot

        def in_body(v: Vec3) -> Vec3:
            q = dx * v.x + dy * v.y
            turned = v.z - q * h
            return Vec3(v.x + dx * turned, v.y + dy * turned, v.z * dz - q)

        rate_B = in_body(Vec3(wx, wy, wz))
        c, s = _heading(R_WB)
        return Wanted(
            demand=attitude_for(f_W, c, s, reference.yaw),
            command=attitude_for(b_W, c, s, state.attitude.z),
            e=e,
            rate=rate_B,
            acceleration=in_body(Vec3(ax, ay, az)) - estimate.omega_B.cross(rate_B),
            after=after,
        )

    def ahead_of_lag(self, torque_B: Vec3, now_B: Vec3, omega_B: Vec3, bandwidth: Scalar) -> Vec3:
        """More by what a spinning body turns the rotors' torque away from where it was wanted.

        Seen from the world, torque that lags in the body falls behind by the spin r,
        tau_dot = w0 (u - tau) + r x tau; with u less r x tau/w0 the lag is that of a body that does not spin. Of the
        spin about the thrust axis alone: other rates are those of the manoeuvre itself.
        """
        angle = omega_B.z / bandwidth
        return Vec3(torque_B.x + now_B.y * angle, torque_B.y - now_B.x * angle, torque_B.z)


def _columns(R: Mat3) -> tuple[tuple[Scalar, Scalar, Scalar], ...]:
    return (R.xx, R.yx, R.zx), (R.xy, R.yy, R.zy), (R.xz, R.yz, R.zz)


TRACKINGS: dict[Tracking, AttitudeTracking] = {"so3": RotationTracking(), "euler": EulerTracking()}
