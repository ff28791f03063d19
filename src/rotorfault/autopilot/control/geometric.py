r"""Geometric tracking control on SE(3), without integral or with adaptation: two controllers, no fault information.

T. Lee, M. Leok and N. H. McClamroch, "Geometric tracking control of a quadrotor UAV on SE(3)", CDC 2010:

.. math:: f_W = a_{ref} - k_x e_x - k_v e_v + g e_z, \qquad T = m f_W\cdot Re_3,

.. math:: e_R = \tfrac12(R_d^TR - R^TR_d)^\vee, \quad e_\Omega = \Omega - R^TR_d\Omega_d, \qquad
          \tau = J(-k_R e_R - k_\Omega e_\Omega) + \Omega\times J\Omega - \tau_{gyro},

with :math:`R_d` of the direction of the force, :math:`b_3`, and the heading: :math:`b_2\parallel b_3\times b_{1d}`.
`geometric` is that. `geometric_adaptive` adds what F. A. Goodarzi, D. Lee and T. Lee, "Geometric adaptive tracking
control of a quadrotor UAV on SE(3) for agile maneuvers", JDSMC 137(9), 2015, estimate of a constant force and torque:

.. math:: \dot\Delta_x = \gamma_x (e_v + c_x e_x), \qquad \dot\Delta_R = \gamma_R (e_\Omega + c_R e_R),

taken off the acceleration and the angular acceleration, and kept within bounds (projection). A rotor that gives less
is such a torque, fixed in the body; so this one is a passive fault-tolerant controller that is told nothing.

Departures. Gains are divided by mass and inertia, so that they do not depend on the vehicle. :math:`\dot b_3` is that
of the force through a critically damped filter of second order, in place of derivatives of the position loop; the
term with :math:`\dot\Omega_d` is left out. The force is limited in thrust and tilt (`force_limits`), position errors
to `reach`.
"""

from __future__ import annotations

import math
from typing import Annotated, ClassVar, NamedTuple, final

from pydantic import Field

from rotorfault.autopilot.control.attitude import settling
from rotorfault.autopilot.control.force_limits import full_thrust, limited_force
from rotorfault.autopilot.control.protocol import ControlInputs, Controller, ControlOutput, Search
from rotorfault.base.config import Strict
from rotorfault.maths.geometry import Mat3, Vec3, zeros
from rotorfault.maths.scalar import Scalar, clip, cos, maximum, sin, sqrt
from rotorfault.model.block import Context, Record
from rotorfault.model.motion import drag_acceleration, torque_of_motion
from rotorfault.model.signals import Wrench
from rotorfault.model.telemetry import RPY, B, Q, W
from rotorfault.model.vehicle import body_momentum

LEAST = 1e-9  # of the length of b3 x b1d, which is 0 where the thrust axis lies along the heading


class GeometricParameters(NamedTuple):
    """Numbers of the law."""

    position: Scalar  # 1/s^2
    velocity: Scalar  # 1/s
    reach: Scalar  # m
    tilt_tangent: Scalar
    thrust_share: Scalar
    fall_share: Scalar
    attitude: Vec3  # 1/s^2
    rate: Vec3  # 1/s
    filter_bandwidth: Scalar  # rad/s
    force_adaptation: Scalar  # 1/s^2
    torque_adaptation: Vec3  # 1/s^2
    force_max: Scalar  # m/s^2
    torque_max: Scalar  # rad/s^2
    force_slope: Scalar  # 1/s
    torque_slope: Scalar  # 1/s


class GeometricMemory(NamedTuple):
    """What is carried on."""

    force_W: Vec3  # m/s^2: filtered
    changing_W: Vec3  # m/s^3
    disturbance_W: Vec3  # m/s^2: estimated
    turning_B: Vec3  # rad/s^2: estimated


class GeometricSignals(NamedTuple):
    """What it records."""

    virtual_position: Annotated[Vec3, Q("m/s^2", W, "commanded acceleration less gravity and feed-forward, limited")]
    virtual_attitude: Annotated[Vec3, Q("rad/s^2", RPY, "commanded angular acceleration less feed-forward")]
    attitude_error: Annotated[Vec3, Q("1", B, "e_R, the sine of the turn that is lacking near zero")]


class AdaptiveSignals(NamedTuple):
    """What it records with adaptation."""

    virtual_position: Annotated[Vec3, Q("m/s^2", W, "commanded acceleration less gravity and feed-forward, limited")]
    virtual_attitude: Annotated[Vec3, Q("rad/s^2", RPY, "commanded angular acceleration less feed-forward")]
    attitude_error: Annotated[Vec3, Q("1", B, "e_R, the sine of the turn that is lacking near zero")]
    disturbance_force: Annotated[Vec3, Q("m/s^2", W, "estimated acceleration by a constant force")]
    disturbance_torque: Annotated[Vec3, Q("rad/s^2", B, "estimated angular acceleration by a constant torque")]


class GeometricSettings(Strict):
    """Gains and limits."""

    position: float = Field(default=4.0, gt=0.0, description="k_x over m [1/s^2]")
    velocity: float = Field(default=3.0, gt=0.0, description="k_v over m [1/s]")
    reach: float = Field(default=2.0, gt=0.0, description="largest position error that is answered [m]")
    tilt_max: float = Field(default=0.7, gt=0.0, lt=1.5, description="largest demanded tilt [rad]")
    thrust_share: float = Field(default=0.95, gt=0.0, le=1.0, description="share of the thrust of all rotors to use")
    fall_share: float = Field(
        default=0.4, gt=0.0, lt=1.0, description="least vertical specific force demanded, as a share of gravity"
    )
    attitude: float = Field(default=120.0, gt=0.0, description="k_R of roll and pitch over inertia [1/s^2]")
    rate: float = Field(default=18.0, gt=0.0, description="k_Omega of roll and pitch over inertia [1/s]")
    yaw: float = Field(default=8.0, gt=0.0, description="k_R of yaw over inertia [1/s^2]")
    yaw_rate: float = Field(default=5.0, gt=0.0, description="k_Omega of yaw over inertia [1/s]")
    filter_bandwidth: float = Field(
        default=25.0, gt=0.0, description="double pole of the filter on the wanted force [rad/s]"
    )


SEARCH = {
    "position": (1.0, 4.0, 20.0),
    "velocity": (1.0, 3.0, 10.0),
    "attitude": (30.0, 120.0, 600.0),
    "rate": (6.0, 18.0, 50.0),
    "yaw": (2.0, 8.0, 60.0),
    "yaw_rate": (1.5, 5.0, 20.0),
    "filter_bandwidth": (8.0, 25.0, 60.0),
    "tilt_max": (0.4, 0.7, 1.1),
    "fall_share": (0.05, 0.4, 0.8),
    "thrust_share": (0.8, 0.95, 1.0),
}


class _Geometric(Controller[GeometricMemory, GeometricParameters]):
    """What both have."""

    def parameters(self, context: Context) -> GeometricParameters:
        """The settings as a record."""
        s = self.settings
        adapts = isinstance(s, AdaptiveSettings)
        return GeometricParameters(
            s.position,
            s.velocity,
            s.reach,
            math.tan(s.tilt_max),
            s.thrust_share,
            s.fall_share,
            Vec3(s.attitude, s.attitude, s.yaw),
            Vec3(s.rate, s.rate, s.yaw_rate),
            s.filter_bandwidth,
            s.force_adaptation if adapts else 0.0,
            Vec3(s.torque_adaptation, s.torque_adaptation, s.yaw_adaptation) if adapts else zeros(),
            s.force_max if adapts else 0.0,
            s.torque_max if adapts else 0.0,
            s.force_slope if adapts else 0.0,
            s.torque_slope if adapts else 0.0,
        )

    def initial(self, inputs: ControlInputs, parameters: GeometricParameters) -> GeometricMemory:
        """The filter at the thrust axis as it is, at rest; no disturbance."""
        along = inputs.estimate.q_WB.z_axis() * inputs.vehicle.gravity
        return GeometricMemory(along, zeros(), zeros(), zeros())

    def step(
        self, memory: GeometricMemory, inputs: ControlInputs, parameters: GeometricParameters, dt: Scalar
    ) -> tuple[GeometricMemory, ControlOutput, Record]:
        """One sampling instant."""
        p, seen, wanted, vehicle = parameters, inputs.estimate, inputs.reference, inputs.vehicle
        R = seen.q_WB.matrix()
        e_x = (seen.p_W - wanted.p_W).map(lambda x: clip(x, -p.reach, p.reach))
        e_v = seen.v_W - wanted.v_W
        u = -(e_x * p.position) - e_v * p.velocity - memory.disturbance_W
        free = wanted.a_W + u - drag_acceleration(vehicle, -seen.v_W) + Vec3(0.0, 0.0, vehicle.gravity)
        force_W = limited_force(free, full_thrust(vehicle), vehicle, p)

        change, changing_W, _ = settling(memory.force_W - force_W, memory.changing_W, p.filter_bandwidth, dt)
        R_d, omega_d = frame_of(memory.force_W, memory.changing_W, wanted.yaw, wanted.yaw_rate)
        turn = R.T @ R_d
        e_R = _vee(turn.T - turn) * 0.5
        e_omega = seen.omega_B - turn @ omega_d
        nu = -(e_R.times(p.attitude)) - e_omega.times(p.rate) - memory.turning_B
        torque_B = body_momentum(vehicle, nu) - torque_of_motion(vehicle, seen.omega_B, inputs.residual_speed)
        axis_W = Vec3(R.xz, R.yz, R.zz)
        thrust = vehicle.mass * maximum(force_W.dot(axis_W), 0.0)

        # The estimates grow by what is off, within their bounds.
        pushed = memory.disturbance_W + (e_v + e_x * p.force_slope) * (p.force_adaptation * dt)
        turned = memory.turning_B + (e_omega + e_R * p.torque_slope).times(p.torque_adaptation) * dt
        after = GeometricMemory(
            memory.force_W + change,
            changing_W,
            pushed.map(lambda x: clip(x, -p.force_max, p.force_max)),
            turned.map(lambda x: clip(x, -p.torque_max, p.torque_max)),
        )
        signals = GeometricSignals(u + force_W - free, nu, e_R)
        own = signals if self.Telemetry is GeometricSignals else AdaptiveSignals(*signals, *memory[2:])
        return after, ControlOutput(Wrench(thrust, torque_B)), own


@final
class Geometric(_Geometric):
    """Geometric tracking control on SE(3) (Lee 2010); of faults only its allocation knows."""

    Settings = GeometricSettings
    Telemetry = GeometricSignals
    search: ClassVar[Search] = SEARCH


class AdaptiveSettings(GeometricSettings):
    """Gains, limits and adaptation."""

    force_adaptation: float = Field(default=0.8, ge=0.0, description="gamma_x [1/s^2]")
    force_slope: float = Field(default=1.0, gt=0.0, description="c_x of e_v + c_x e_x [1/s]")
    force_max: float = Field(default=5.0, ge=0.0, description="bound of the estimated acceleration [m/s^2]")
    torque_adaptation: float = Field(default=120.0, ge=0.0, description="gamma_R of roll and pitch [1/s^2]")
    torque_slope: float = Field(default=4.0, gt=0.0, description="c_R of e_Omega + c_R e_R [1/s]")
    torque_max: float = Field(default=200.0, ge=0.0, description="bound of the estimated acceleration [rad/s^2]")
    yaw_adaptation: float = Field(default=5.0, ge=0.0, description="gamma_R of yaw [1/s^2]")


@final
class GeometricAdaptive(_Geometric):
    """Geometric control that learns a constant force and torque (Goodarzi 2015); of faults it learns them alone."""

    Settings = AdaptiveSettings
    Telemetry = AdaptiveSignals
    search: ClassVar[Search] = {
        **SEARCH,
        "force_adaptation": (0.1, 0.8, 8.0),
        "torque_adaptation": (10.0, 120.0, 1500.0),
        "yaw_adaptation": (0.5, 5.0, 50.0),
    }


def frame_of(force_W: Vec3, changing_W: Vec3, yaw: Scalar, yaw_rate: Scalar) -> tuple[Mat3, Vec3]:
    """The attitude whose third axis lies along a force, with a heading, and its rates in rad/s in its own axes.

    Parameters
    ----------
    force_W : Vec3, m/s^2
    changing_W : Vec3, m/s^3
        Its derivative.
    yaw : scalar, rad
    yaw_rate : scalar, rad/s
    """
    forward, left = Vec3(cos(yaw), sin(yaw), 0.0), Vec3(-sin(yaw), cos(yaw), 0.0)
    b3, b3_dot = _unit(force_W, changing_W)
    b2, b2_dot = _unit(b3.cross(forward), b3_dot.cross(forward) + b3.cross(left * yaw_rate))
    b1 = b2.cross(b3)
    b1_dot = b2_dot.cross(b3) + b2.cross(b3_dot)
    R_d = Mat3(b1.x, b2.x, b3.x, b1.y, b2.y, b3.y, b1.z, b2.z, b3.z)
    return R_d, Vec3(b3.dot(b2_dot), b1.dot(b3_dot), b2.dot(b1_dot))


def _unit(v: Vec3, v_dot: Vec3) -> tuple[Vec3, Vec3]:
    """A vector brought to length 1, and the derivative of that."""
    over = 1.0 / maximum(sqrt(v.dot(v)), LEAST)
    unit = v * over
    return unit, (v_dot - unit * unit.dot(v_dot)) * over


def _vee(S: Mat3) -> Vec3:
    """The vector of a skew matrix."""
    return Vec3(S.zy, S.xz, S.yx)
