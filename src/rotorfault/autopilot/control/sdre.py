r"""SDRE control on the tracking error: u = -R^{-1} g^T P(x) e, equations (21), (22), (34), (35).

The SDC form (34) is read as double integrators on six axes with one unit acceleration input each; the gyroscopic
products of (3) are shared half and half between their two rates, giving the matrix `gyroscopic_drift` W(omega).
The Riccati equation then falls apart into three scalar position axes, solved in closed form, and one 6x6 attitude
block, solved by `rotorfault.autopilot.control.riccati`.

Weights (35), axes ordered (roll, x, pitch, y, yaw, z): on a position axis q1 = 0.3/|e|, q2 = 0.005 and
r = 0.2 e^2 (0.4 e^2 for z). They vanish or blow up at e = 0, so |e| is floored and capped smoothly; the floor sets
the bandwidth at the target, k1 = sqrt(1.5/floor^3), the cap the bandwidth far from it.
"""

from __future__ import annotations

from typing import NamedTuple

from pydantic import Field, field_validator

from rotorfault.autopilot.control.protocol import Law, LawMemory, LawOutput, RiccatiSignals, TrackingError
from rotorfault.autopilot.control.relaxed import SpinWeights
from rotorfault.autopilot.control.riccati import Gain, attitude_problem, feedback, fly, guaranteed_gain
from rotorfault.base.config import Strict, Three
from rotorfault.maths.geometry import Mat3, Vec3
from rotorfault.maths.scalar import Scalar, sqrt
from rotorfault.model.block import Context, Nothing
from rotorfault.model.vehicle import Vehicle, inertia_matrix, rotor_momentum


class Weights(Strict):
    """Weights of the quadratic cost, equation (35)."""

    attitude_q_angle: Three = Field(default=(1.0, 1.0, 1.0), description="Q on roll, pitch, yaw error [1/rad^2]")
    attitude_q_rate: Three = Field(default=(1.0, 1.0, 1.0), description="Q on their rates [s^2/rad^2]")
    attitude_r: Three = Field(default=(0.0088, 0.0088, 0.0088), description="R on angular acceleration [s^4/rad^2]")
    position_q: Three = Field(
        default=(0.3, 0.3, 0.3), description="numerator of Q on x, y, z error, q1 = value/|e| [1/m]"
    )
    position_q_rate: Three = Field(default=(0.005, 0.005, 0.005), description="Q on velocity error [s^2/m^2]")
    position_r: Three = Field(default=(0.2, 0.2, 0.4), description="factor of R, r = value e^2 [s^4/m^4]")
    error_floor: Three = Field(default=(0.1, 0.1, 0.1), description="smooth floor of |e| in Q and R, x, y, z [m]")
    error_cap: Three = Field(default=(1e6, 1e6, 1e6), description="smooth cap of |e| in Q and R, x, y, z [m]")
    newton_steps: int = Field(default=1, ge=1, le=20, description="Newton-Kleinman steps per sampling instant")

    @field_validator("attitude_q_angle", "attitude_r", "position_q", "position_r", "error_floor", "error_cap")
    @classmethod
    def _positive(cls, value: Three) -> Three:
        if not min(value) > 0.0:
            raise ValueError("must be greater than 0 on each axis: the Riccati equation has no solution otherwise")
        return value

    @field_validator("attitude_q_rate", "position_q_rate")
    @classmethod
    def _not_negative(cls, value: Three) -> Three:
        if min(value) < 0.0:
            raise ValueError("must be 0 or greater on each axis")
        return value


class SdreParameters(NamedTuple):
    """Numbers of the SDRE law."""

    attitude_q_angle: Vec3
    attitude_q_rate: Vec3
    attitude_r: Vec3
    position_q: Vec3
    position_q_rate: Vec3
    position_r: Vec3
    error_floor: Vec3  # m
    error_cap: Vec3  # m


def sdre_parameters(weights: Weights) -> SdreParameters:
    """Numbers of the weights as a record."""
    return SdreParameters(
        Vec3.of(weights.attitude_q_angle),
        Vec3.of(weights.attitude_q_rate),
        Vec3.of(weights.attitude_r),
        Vec3.of(weights.position_q),
        Vec3.of(weights.position_q_rate),
        Vec3.of(weights.position_r),
        Vec3.of(weights.error_floor),
        Vec3.of(weights.error_cap),
    )


def spin_weights(parameters: SdreParameters) -> SpinWeights:
    """Weights of roll and pitch, their means."""
    q, qd, r = parameters.attitude_q_angle, parameters.attitude_q_rate, parameters.attitude_r
    both = r.x + r.y
    return SpinWeights((q.x + q.y) / both, (qd.x + qd.y) / both)


def gyroscopic_drift(vehicle: Vehicle, omega_B: Vec3, residual_speed: Scalar | Vec3) -> Mat3:
    """W(omega) of the SDC form in 1/s: omega_dot = W(omega) omega + J^{-1} tau, rows as in (3).

    Each product of two rates is shared half and half between them; the rotor term is linear in one rate already. With
    S(v) u = v x u it is J^{-1}(S(h) - (S(omega) J - S(J omega)) / 2) for any inertia matrix and any momentum h of the
    rotors.
    """
    if vehicle.inertia_products != () or isinstance(residual_speed, Vec3):
        matrix, momentum = inertia_matrix(vehicle), rotor_momentum(vehicle, residual_speed)
        h = momentum if isinstance(momentum, Vec3) else Vec3(0.0, 0.0, momentum)
        turning = Mat3.skew(omega_B) @ matrix - Mat3.skew(matrix @ omega_B)
        return matrix.inverse() @ (Mat3.skew(h) - turning * 0.5)
    J = vehicle.inertia
    a1, a3, a5 = (J.y - J.z) / J.x, (J.z - J.x) / J.y, (J.x - J.y) / J.z
    rotor = vehicle.rotor_inertia * residual_speed
    p, q, r = omega_B * 0.5
    return Mat3(
        0.0, a1 * r - rotor / J.x, a1 * q,
        a3 * r + rotor / J.y, 0.0, a3 * p,
        a5 * q, a5 * p, 0.0,
    )  # fmt: skip


def error_magnitude(e: Scalar, floor: Scalar, cap: Scalar) -> Scalar:
    """|e| floored and capped smoothly, in m."""
    return 1.0 / sqrt(_inverse_square(e, floor, cap))


def _inverse_square(e: Scalar, floor: Scalar, cap: Scalar) -> Scalar:
    return 1.0 / (e * e + floor * floor) + 1.0 / (cap * cap)


def position_gains(e: Vec3, parameters: SdreParameters) -> tuple[Vec3, Vec3]:
    """Gains (k1, k2) of u = -k1 e - k2 e_dot per position axis, in 1/s^2 and 1/s.

    `rotorfault.autopilot.control.riccati.position_gain` with the weights (35) put in: with s = 1/|e|, floored and
    capped, k1 = sqrt(q/r) s^(3/2) and k2 = sqrt(q_rate/r s^2 + 2 k1): three roots and one quotient an axis.
    """
    p = parameters

    def axis(e_i: Scalar, floor: Scalar, cap: Scalar, q: Scalar, q_rate: Scalar, r: Scalar) -> tuple[Scalar, Scalar]:
        square = _inverse_square(e_i, floor, cap)
        s = sqrt(square)
        k1 = sqrt(q / r) * (s * sqrt(s))
        return k1, sqrt(q_rate / r * square + 2.0 * k1)

    numbers = (p.error_floor, p.error_cap, p.position_q, p.position_q_rate, p.position_r)
    k1, k2 = zip(*(axis(*values) for values in zip(e, *numbers, strict=True)), strict=True)
    return Vec3.of(k1), Vec3.of(k2)


def attitude_gains(
    stored: Gain, drift: Mat3, parameters: SdreParameters, steps: int
) -> tuple[Gain, Mat3, Mat3, Scalar, Scalar]:
    """Stored gain for the next step, (K_angle, K_rate) in 1/s^2 and 1/s, Riccati residual, guard indicator."""
    problem = attitude_problem(
        drift, Vec3(1.0, 1.0, 1.0), parameters.attitude_q_angle, parameters.attitude_q_rate, parameters.attitude_r
    )
    gain, residual, guarded = fly(problem, stored, steps)
    K_angle, K_rate = feedback(problem, gain)
    return gain, K_angle, K_rate, residual, guarded


def initial_gain(drift: Mat3, parameters: SdreParameters) -> Gain:
    """The guaranteed gain, stabilising for any drift: where the in-flight iteration starts."""
    return guaranteed_gain(
        attitude_problem(
            drift, Vec3(1.0, 1.0, 1.0), parameters.attitude_q_angle, parameters.attitude_q_rate, parameters.attitude_r
        )
    )


class Sdre(Law[SdreParameters]):
    """SDRE state feedback alone, equation (21): optimal weights, no sliding mode."""

    Settings = Weights
    records = (RiccatiSignals,)

    def parameters(self, context: Context) -> SdreParameters:
        """Numbers of the law."""
        return sdre_parameters(self.settings)

    def initial(self, position: TrackingError, attitude: TrackingError, parameters: SdreParameters) -> LawMemory:
        """Start from the guaranteed gain."""
        return LawMemory(position=Nothing(), attitude=initial_gain(attitude.drift, parameters))

    def spin_weights(self, parameters: SdreParameters) -> SpinWeights:
        """Of roll and pitch, their means."""
        return spin_weights(parameters)

    def position(
        self, memory: Nothing, error: TrackingError, parameters: SdreParameters, dt: Scalar
    ) -> tuple[Nothing, LawOutput]:
        """u = -k1 e - k2 e_dot on x, y, z."""
        k1, k2 = position_gains(error.e, parameters)
        u = -k1.times(error.e) - k2.times(error.e_dot)
        return memory, LawOutput(u, Mat3.diagonal(k1), Mat3.diagonal(k2))

    def attitude(
        self, memory: Gain, error: TrackingError, parameters: SdreParameters, dt: Scalar
    ) -> tuple[Gain, LawOutput]:
        """u = -K_angle e - K_rate e_dot on roll, pitch, yaw."""
        gain, K_angle, K_rate, residual, guarded = attitude_gains(
            memory, error.drift, parameters, self.settings.newton_steps
        )
        u = -(K_angle @ error.e) - K_rate @ error.e_dot
        return gain, LawOutput(u, K_angle, K_rate, riccati_residual=residual, riccati_guarded=guarded)
