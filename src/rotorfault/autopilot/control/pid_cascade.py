r"""The cascade of PX4: P on position, PID on velocity, P on attitude as a quaternion, PID on rates, its own mixer.

.. math:: v_d = v_{ref} + K_p (p_{ref} - p), \qquad
          a_d = a_{ref} + P_v(v_d - v) + \textstyle\int I_v(v_d - v) - D_v\,\dot v

The specific force :math:`a_d + g e_z` is limited in thrust and tilt, the vertical part first. Its direction and the
heading make the wanted attitude, by D. Brescianini, M. Hehn and R. D'Andrea, "Nonlinear quadrocopter attitude
control", ETH Zurich, 2013: the shortest turn of the thrust axis first, then a share w of the heading that is left,

.. math:: \omega_d = 2 K_q\,\mathrm{sgn}(q_{e,w})\,q_{e,xyz} + R^T e_z\dot\psi_{ref}, \qquad
          q_e = q^{-1} q_d

within rate limits, and the rates have a PID whose D acts on the measured rate, low-passed:

.. math:: \dot\omega_c = P(\omega_d - \omega) + z - D\,\dot\omega_f, \qquad
          \dot z = I s (\omega_d - \omega), \quad s = \max(0, 1 - |\omega_d - \omega|^2/\omega_s^2)

with the slowing of the integral by :math:`\omega_s` = 400 deg/s. The torque :math:`J\dot\omega_c` and the thrust go
through sequential desaturation (`rotorfault.autopilot.allocation.sequential`) for sound rotors, whatever the
diagnosis: it commands the rotors itself, and of a fault it knows nothing but what its integrals make of it.

Source: PX4's documentation of main, "Controller Diagrams" and the parameters MPC_*, MC_* (read in November 2026).
None of PX4's code is used. Departures: torque and thrust are in N m and N, so gains are in 1/s and 1/s^2 and do not
depend on the vehicle; the feed-forward of the rates and the jerk-limited trajectory are left out; the integrals stop
at limits of their own, not at saturation of the mixer.
"""

from __future__ import annotations

import math
from typing import Annotated, Any, ClassVar, NamedTuple, final

from pydantic import Field

from rotorfault.autopilot.allocation.protocol import AllocationInputs
from rotorfault.autopilot.allocation.sequential import Airmode, Sequential
from rotorfault.autopilot.control.attitude import settling
from rotorfault.autopilot.control.force_limits import direction_of, full_thrust, limited_force
from rotorfault.autopilot.control.outer_loop import upward_thrust
from rotorfault.autopilot.control.primary_axis import turn_to
from rotorfault.autopilot.control.protocol import ControlInputs, Controller, ControlOutput, Search
from rotorfault.base.angles import FASTEST_TURN, Radians
from rotorfault.base.config import Strict
from rotorfault.maths.geometry import Vec3, zeros
from rotorfault.maths.rotation import Quat
from rotorfault.maths.scalar import Scalar, atan2, clip, cos, less, maximum, minimum, select, sin, sqrt
from rotorfault.model.block import Context
from rotorfault.model.mixer import hover_thrust
from rotorfault.model.signals import Wrench, healthy
from rotorfault.model.telemetry import RPY, B, Q, W
from rotorfault.model.vehicle import body_momentum

SLOWING = math.radians(400.0)  # rad/s: PX4's, of the error at which the integral of rates stops


class PidParameters(NamedTuple):
    """Numbers of the cascade."""

    position: Scalar  # 1/s
    velocity: Scalar  # 1/s
    velocity_integral: Scalar  # 1/s^2
    velocity_derivative: Scalar  # 1
    speed_max: Scalar  # m/s
    climb_max: Scalar  # m/s
    sink_max: Scalar  # m/s
    tilt_tangent: Scalar
    thrust_share: Scalar
    fall_share: Scalar
    attitude: Scalar  # 1/s
    yaw: Scalar  # 1/s
    yaw_weight: Scalar
    rate_max: Scalar  # rad/s
    yaw_rate_max: Scalar  # rad/s
    rate: Vec3  # 1/s
    rate_integral: Vec3  # 1/s^2
    rate_integral_max: Scalar  # rad/s^2
    rate_derivative: Vec3  # 1
    derivative_bandwidth: Scalar  # rad/s
    mixer: Any  # of the sequential desaturation


class PidMemory(NamedTuple):
    """What is carried on."""

    velocity_integral: Vec3  # m/s^2
    velocity: Vec3  # m/s: filtered
    acceleration: Vec3  # m/s^2: its derivative
    rate_integral: Vec3  # rad/s^2
    omega: Vec3  # rad/s: filtered
    turning: Vec3  # rad/s^2: its derivative
    mixer: Any


class PidSignals(NamedTuple):
    """What it records."""

    virtual_position: Annotated[Vec3, Q("m/s^2", W, "commanded acceleration less gravity and feed-forward, limited")]
    virtual_attitude: Annotated[Vec3, Q("rad/s^2", RPY, "commanded angular acceleration less feed-forward")]
    velocity_demand: Annotated[Vec3, Q("m/s", W, "velocity that the position loop asks for")]
    rate_demand: Annotated[Vec3, Q("rad/s", B, "rates that the loop around them asks for")]


class PidSettings(Strict):
    """Gains and limits, in PX4's order."""

    position: float = Field(default=0.95, gt=0.0, description="P of position, as MPC_XY_P [1/s]")
    velocity: float = Field(default=2.5, gt=0.0, description="P of velocity, as MPC_XY_VEL_P_ACC [1/s]")
    velocity_integral: float = Field(default=0.8, ge=0.0, description="I of velocity, as MPC_XY_VEL_I_ACC [1/s^2]")
    velocity_derivative: float = Field(default=0.2, ge=0.0, description="D of velocity, as MPC_XY_VEL_D_ACC [-]")
    speed_max: float = Field(default=12.0, gt=0.0, description="largest horizontal velocity demand [m/s]")
    climb_max: float = Field(default=3.0, gt=0.0, description="largest upward velocity demand [m/s]")
    sink_max: float = Field(default=1.5, gt=0.0, description="largest downward velocity demand [m/s]")
    tilt_max: float = Field(default=0.785, gt=0.0, lt=1.5, description="largest demanded tilt [rad]")
    thrust_share: float = Field(default=1.0, gt=0.0, le=1.0, description="share of the thrust of all rotors to use")
    fall_share: float = Field(
        default=0.24,
        gt=0.0,
        lt=1.0,
        description="least thrust, as a share of hover, as MPC_THR_MIN over MPC_THR_HOVER",
    )
    attitude: float = Field(default=6.5, gt=0.0, description="P of roll and pitch, as MC_ROLL_P [1/s]")
    yaw: float = Field(default=2.8, gt=0.0, description="P of yaw, as MC_YAW_P [1/s]")
    yaw_weight: float = Field(default=0.4, ge=0.0, le=1.0, description="share of the heading, as MC_YAW_WEIGHT")
    rate_max: Annotated[float, Radians(FASTEST_TURN, "rad/s")] = Field(
        default=3.84, gt=0.0, description="largest roll and pitch rate demand, as MC_ROLLRATE_MAX [rad/s]"
    )
    yaw_rate_max: Annotated[float, Radians(FASTEST_TURN, "rad/s")] = Field(
        default=3.49, gt=0.0, description="largest yaw rate demand, as MC_YAWRATE_MAX [rad/s]"
    )
    rate: float = Field(default=16.0, gt=0.0, description="P of roll and pitch rate [1/s]")
    rate_integral: float = Field(default=15.0, ge=0.0, description="I of roll and pitch rate [1/s^2]")
    rate_derivative: float = Field(default=0.1, ge=0.0, description="D of roll and pitch rate [-]")
    yaw_rate: float = Field(default=5.0, gt=0.0, description="P of yaw rate [1/s]")
    yaw_rate_integral: float = Field(default=2.5, ge=0.0, description="I of yaw rate [1/s^2]")
    rate_integral_max: float = Field(default=40.0, ge=0.0, description="largest integral of the rates [rad/s^2]")
    derivative_bandwidth: float = Field(
        default=188.0, gt=0.0, description="double pole of the filter of D, as IMU_DGYRO_CUTOFF of 30 Hz [rad/s]"
    )
    airmode: Airmode = Field(default="off", description="axes for which thrust may be raised, as MC_AIRMODE")


@final
class PidCascade(Controller[PidMemory, PidParameters]):
    """PX4's cascade of P and PID loops with its own mixer; it gets no fault information."""

    Settings = PidSettings
    Telemetry = PidSignals
    search: ClassVar[Search] = {
        "position": (0.4, 0.95, 3.0),
        "velocity": (0.8, 2.5, 8.0),
        "velocity_integral": (0.1, 0.8, 5.0),
        "velocity_derivative": (0.02, 0.2, 1.0),
        "attitude": (2.5, 6.5, 20.0),
        "yaw": (0.8, 2.8, 8.0),
        "rate": (5.0, 16.0, 50.0),
        "rate_integral": (2.0, 15.0, 150.0),
        "rate_derivative": (0.01, 0.1, 0.8),
        "yaw_rate": (1.5, 5.0, 20.0),
        "tilt_max": (0.4, 0.785, 1.1),
        "fall_share": (0.05, 0.24, 0.8),
    }

    def __init__(self, settings: Any = None) -> None:
        super().__init__(settings)
        self._mixer = Sequential(Sequential.Settings(airmode=self.settings.airmode))

    def parameters(self, context: Context) -> PidParameters:
        """The settings as a record, with the mixer's numbers."""
        s = self.settings
        return PidParameters(
            s.position,
            s.velocity,
            s.velocity_integral,
            s.velocity_derivative,
            s.speed_max,
            s.climb_max,
            s.sink_max,
            math.tan(s.tilt_max),
            s.thrust_share,
            s.fall_share,
            s.attitude,
            s.yaw,
            s.yaw_weight,
            s.rate_max,
            s.yaw_rate_max,
            Vec3(s.rate, s.rate, s.yaw_rate),
            Vec3(s.rate_integral, s.rate_integral, s.yaw_rate_integral),
            s.rate_integral_max,
            Vec3(s.rate_derivative, s.rate_derivative, 0.0),
            s.derivative_bandwidth,
            self._mixer.parameters(context),
        )

    def initial(self, inputs: ControlInputs, parameters: PidParameters) -> PidMemory:
        """Filters at rest at what is measured."""
        seen, level = inputs.estimate, zeros()
        mixer = self._mixer.initial(
            _mixed(inputs, Wrench(hover_thrust(inputs.vehicle).sum(), level)), parameters.mixer
        )
        return PidMemory(level, seen.v_W, level, level, seen.omega_B, level, mixer)

    def step(
        self, memory: PidMemory, inputs: ControlInputs, parameters: PidParameters, dt: Scalar
    ) -> tuple[PidMemory, ControlOutput, PidSignals]:
        """One sampling instant."""
        p, seen, wanted, vehicle = parameters, inputs.estimate, inputs.reference, inputs.vehicle
        R_WB = seen.q_WB.matrix()

        # Position and velocity.
        v_d = _limited_velocity(wanted.v_W + (wanted.p_W - seen.p_W) * p.position, p)
        change, acceleration, _ = settling(
            memory.velocity - seen.v_W, memory.acceleration, p.derivative_bandwidth, dt
        )
        behind = v_d - seen.v_W
        u = behind * p.velocity + memory.velocity_integral - acceleration * p.velocity_derivative
        free = wanted.a_W + u + Vec3(0.0, 0.0, vehicle.gravity)
        force_W = limited_force(free, full_thrust(vehicle), vehicle, p)
        # As in PX4 the integral stops growing where the demand is cut: what was cut is taken off the error.
        tracked = behind + (force_W - free) * (2.0 / p.velocity)
        integral = (memory.velocity_integral + tracked * (p.velocity_integral * dt)).map(
            lambda z: clip(z, -vehicle.gravity, vehicle.gravity)
        )

        # Attitude.
        rates = attitude_rates(seen.q_WB, force_W, wanted.yaw, Vec3(p.attitude, p.attitude, p.yaw), p.yaw_weight)
        ahead = Vec3(R_WB.zx, R_WB.zy, R_WB.zz) * wanted.yaw_rate
        omega_d = rates + ahead
        limits = Vec3(p.rate_max, p.rate_max, p.yaw_rate_max)
        omega_d = Vec3(*(clip(x, -most, most) for x, most in zip(omega_d, limits, strict=True)))

        # Rates.
        turned, turning, _ = settling(memory.omega - seen.omega_B, memory.turning, p.derivative_bandwidth, dt)
        error = omega_d - seen.omega_B
        nu = error.times(p.rate) + memory.rate_integral - turning.times(p.rate_derivative)

        def summed(z: Scalar, x: Scalar, gain: Scalar) -> Scalar:
            slowed = maximum(1.0 - x * x * (1.0 / (SLOWING * SLOWING)), 0.0)
            return clip(z + x * slowed * (gain * dt), -p.rate_integral_max, p.rate_integral_max)

        rate_integral = Vec3(*map(summed, memory.rate_integral, error, p.rate_integral))
        thrust = upward_thrust(force_W, R_WB.zz, vehicle.mass, vehicle.gravity)
        wrench = Wrench(thrust, body_momentum(vehicle, nu))
        mixer, mixed, _ = self._mixer.step(memory.mixer, _mixed(inputs, wrench), p.mixer, dt)
        after = PidMemory(
            integral,
            memory.velocity + change,
            acceleration,
            rate_integral,
            memory.omega + turned,
            turning,
            mixer,
        )
        return after, ControlOutput(mixed.command), PidSignals(u + force_W - free, nu, v_d, omega_d)


def attitude_rates(q_WB: Quat, force_W: Vec3, yaw: Scalar, gain: Vec3, yaw_weight: Scalar) -> Vec3:
    """Rates in rad/s, body axes, that turn the thrust axis to a force first, and the heading by its share.

    Parameters
    ----------
    q_WB : Quat
        Attitude.
    force_W : Vec3
        Along the wanted thrust axis.
    yaw : scalar, rad
        Wanted heading.
    gain : Vec3, 1/s
        Of roll, pitch and yaw.
    yaw_weight : scalar
        Share of the heading, 0 to 1.
    """
    up_W = direction_of(force_W)
    # The whole attitude: from level, turned by yaw, the shortest way to the wanted axis.
    whole = _shortest(Vec3(0.0, 0.0, 1.0), up_W) @ Quat.about_z(yaw)
    # With the thrust axis alone put right the shortest way, what is left of it is a turn about that axis.
    reduced = _shortest(q_WB.z_axis(), up_W) @ q_WB
    left = reduced.conjugate() @ whole
    half = atan2(left.z, left.w)
    turn = select(less(cos(half), 0.0), half - select(less(half, 0.0), -math.pi, math.pi), half) * yaw_weight
    wanted = reduced @ Quat(cos(turn), 0.0, 0.0, sin(turn))
    e = q_WB.conjugate() @ wanted
    two = select(less(e.w, 0.0), -2.0, 2.0)
    # The yaw gain is raised by the weight, so that a heading error alone is answered as if there were none.
    share = 1.0 / maximum(yaw_weight, 0.1)
    return Vec3(e.x * two * gain.x, e.y * two * gain.y, e.z * two * gain.z * share)


def _shortest(axis: Vec3, wanted: Vec3) -> Quat:
    """The shortest rotation between two unit vectors; from its turn, so that it fails at no angle."""
    half = turn_to(axis, wanted) * 0.5
    angle = sqrt(half.dot(half) + 1e-40)
    size = sin(angle) / angle
    return Quat(cos(angle), half.x * size, half.y * size, half.z * size)


def _limited_velocity(v_W: Vec3, p: PidParameters) -> Vec3:
    speed = sqrt(v_W.x * v_W.x + v_W.y * v_W.y + 1e-18)
    scale = minimum(p.speed_max / speed, 1.0)
    return Vec3(v_W.x * scale, v_W.y * scale, clip(v_W.z, -p.sink_max, p.climb_max))


def _mixed(inputs: ControlInputs, wrench: Wrench) -> AllocationInputs:
    """What the mixer sees: no diagnosis."""
    return AllocationInputs(wrench, healthy(inputs.vehicle.rotors), inputs.vehicle, inputs.command)
