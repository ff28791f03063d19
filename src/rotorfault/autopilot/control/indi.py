r"""Incremental nonlinear dynamic inversion: what the last torque did says what the next must add.

.. math:: \tau = \tau_f + J\,(\nu - \dot\omega_f)

:math:`\dot\omega_f` is the filtered derivative of the gyros, :math:`\tau_f` the torque of the rotors through the same
filter, so both are equally late; then whatever else turns the body (air, centre of mass, a rotor that gives less than
believed) is in :math:`\dot\omega_f` and is made up for without being known. E. J. J. Smeur, Q. P. Chu and G. C. H. E.
de Croon, "Adaptive incremental nonlinear dynamic inversion for attitude control of micro air vehicles", JGCD 39(3),
2016. The filter is of second order, critically damped.

The demand is that of two loops in a row, attitude and rate, about the primary axis n
(`rotorfault.autopilot.control.primary_axis`), which is body z while yaw is held:

.. math:: \nu = k_\omega\,(k_\theta\theta + n\,(n\cdot\omega) - \omega) + k_\theta\,\dot\theta, \qquad
          \dot\theta = n\times(h\times\omega)

with :math:`\theta` the shortest turn from n to the wanted direction h; about n itself, while yaw is held, the heading
takes the place of :math:`\theta`. As a law that flies on without yaw: S. Sun, X. Wang, Q. Chu and C. de Visser,
"Incremental nonlinear fault-tolerant control of a quadrotor with complete loss of two opposing rotors", T-RO 37(1),
2021.

Departures. Smeur estimates effectiveness on board, here it is the believed one; his term for the rotors' own inertia
is here the momentum of the rotors, taken out of the measured yaw rate before it is differentiated. Sensors here have
no rotor speeds: the autopilot's rotor model stands for them, with the believed losses. Sun's output for two opposite
rotors is turned by a fixed angle about z, and his position loop's integral lives in that frame; here the axes that
the living rotors reach are found by the allocation.
"""

from __future__ import annotations

from typing import Annotated, ClassVar, NamedTuple, final

from pydantic import Field

from rotorfault.autopilot.control.attitude import settling
from rotorfault.autopilot.control.outer_loop import (
    OUTER_SEARCH,
    OuterParameters,
    OuterSettings,
    lift,
    outer_parameters,
    upward_thrust,
)
from rotorfault.autopilot.control.primary_axis import (
    AxisParameters,
    AxisSettings,
    direction_in_body,
    handed_over,
    heading_error,
    primary_axis,
    turn_to,
)
from rotorfault.autopilot.control.protocol import ControlInputs, Controller, ControlOutput, Search
from rotorfault.base.config import Strict
from rotorfault.maths.geometry import Vec3, zeros
from rotorfault.maths.scalar import Scalar
from rotorfault.model.block import Context
from rotorfault.model.signals import Wrench
from rotorfault.model.telemetry import RPY, B, Q, W
from rotorfault.model.vehicle import body_momentum, turn_against_rotors, wrench_of


class IndiParameters(NamedTuple):
    """Numbers of the law."""

    position: OuterParameters
    axis: AxisParameters
    angle: Scalar  # 1/s
    rate: Scalar  # 1/s
    heading: Scalar  # 1/s
    yaw_rate: Scalar  # 1/s
    filter_bandwidth: Scalar  # rad/s


class Filtered(NamedTuple):
    """A vector through a filter of second order."""

    value: Vec3
    rate: Vec3  # per s


class IndiMemory(NamedTuple):
    """What is carried on."""

    integral: Vec3  # m/s^2
    lean: Vec3  # of the primary axis
    omega: Filtered  # rad/s
    torque: Filtered  # N m


class IndiSignals(NamedTuple):
    """What it records."""

    virtual_position: Annotated[Vec3, Q("m/s^2", W, "commanded acceleration less gravity and feed-forward, limited")]
    virtual_attitude: Annotated[Vec3, Q("rad/s^2", RPY, "commanded angular acceleration less feed-forward")]
    angular_acceleration: Annotated[Vec3, Q("rad/s^2", B, "filtered derivative of the body rates")]
    primary_axis: Annotated[Vec3, Q("1", B, "axis that is to point along the wanted thrust")]


@final
class Indi(Controller[IndiMemory, IndiParameters]):
    """Incremental nonlinear dynamic inversion (Smeur 2016), about a primary axis once yaw is lost (Sun 2021)."""

    class Settings(Strict):
        """Gains of the loops, and the filter."""

        position: OuterSettings = Field(default=OuterSettings(), description="position loop")
        axis: AxisSettings = Field(default=AxisSettings(), description="axis of the spin once yaw is lost")
        angle: float = Field(default=8.0, gt=0.0, description="rate per tilt error [1/s]")
        rate: float = Field(
            default=16.0, gt=0.0, description="angular acceleration per rate error, roll, pitch [1/s]"
        )
        heading: float = Field(default=2.0, gt=0.0, description="yaw rate per heading error [1/s]")
        yaw_rate: float = Field(default=5.0, gt=0.0, description="angular acceleration per yaw rate error [1/s]")
        filter_bandwidth: float = Field(
            default=50.0, gt=0.0, description="double pole of the filter on gyros and rotors alike [rad/s]"
        )

    Telemetry = IndiSignals
    search: ClassVar[Search] = {
        **OUTER_SEARCH,
        "angle": (2.0, 8.0, 25.0),
        "rate": (5.0, 16.0, 50.0),
        "heading": (0.5, 2.0, 8.0),
        "yaw_rate": (1.5, 5.0, 20.0),
        "filter_bandwidth": (15.0, 50.0, 200.0),
    }

    def parameters(self, context: Context) -> IndiParameters:
        """The settings as a record."""
        s = self.settings
        return IndiParameters(
            outer_parameters(s.position, context),
            AxisParameters(s.axis.lean, s.axis.time),
            s.angle,
            s.rate,
            s.heading,
            s.yaw_rate,
            s.filter_bandwidth,
        )

    def initial(self, inputs: ControlInputs, parameters: IndiParameters) -> IndiMemory:
        """Filters at rest at what is measured."""
        level = zeros()
        return IndiMemory(level, level, Filtered(_turning(inputs), level), Filtered(_given(inputs), level))

    def step(
        self, memory: IndiMemory, inputs: ControlInputs, parameters: IndiParameters, dt: Scalar
    ) -> tuple[IndiMemory, ControlOutput, IndiSignals]:
        """One sampling instant."""
        p, vehicle, omega = parameters, inputs.vehicle, inputs.estimate.omega_B
        R_WB = inputs.estimate.q_WB.matrix()
        axis = primary_axis(memory.lean, inputs, p.axis, dt)
        outer = lift(memory.integral, inputs, axis.available, p.position, dt)

        # What turns the body, and what the rotors gave, both equally late.
        turned = _passed(memory.omega, _turning(inputs), p.filter_bandwidth, dt)
        given = _passed(memory.torque, _given(inputs), p.filter_bandwidth, dt)

        # About axes across n the tilt, about n the heading.
        h, n = direction_in_body(outer.force_W, R_WB), axis.n_B
        tilt = turn_to(n, h)
        wanted = tilt * p.angle + n * n.dot(omega)
        tilting = (wanted - omega) * p.rate + n.cross(h.cross(omega)) * p.angle
        yaw_rate = inputs.reference.yaw_rate - heading_error(inputs) * p.heading
        turning = (yaw_rate - omega.z) * p.yaw_rate + inputs.reference.yaw_acceleration
        nu = Vec3(tilting.x, tilting.y, turning * (1.0 - axis.given_up) + turned.rate.z * axis.given_up)

        torque_B = given.value + body_momentum(vehicle, nu - turned.rate)
        thrust = upward_thrust(outer.force_W, R_WB.zz, vehicle.mass, vehicle.gravity)
        wrench = handed_over(inputs, Wrench(thrust, torque_B), axis.given_up)
        after = IndiMemory(outer.integral, axis.lean, turned, given)
        return after, ControlOutput(wrench), IndiSignals(outer.given, nu, turned.rate, n)


def _turning(inputs: ControlInputs) -> Vec3:
    """Rates in rad/s that the body would have if its rotors' momentum were its own: only torque changes them."""
    against = turn_against_rotors(inputs.vehicle, inputs.residual_speed)
    own = against if isinstance(against, Vec3) else Vec3(0.0, 0.0, against)
    return inputs.estimate.omega_B + own


def _given(inputs: ControlInputs) -> Vec3:
    """Torque in N m that the believed rotors give now."""
    believed = inputs.diagnosis
    thrust = believed.stuck.thrust_of(inputs.expected_thrust, believed.loss)
    return wrench_of(inputs.vehicle, thrust).torque_B


def _passed(state: Filtered, value: Vec3, bandwidth: Scalar, dt: Scalar) -> Filtered:
    """The filter one period later."""
    change, rate, _ = settling(state.value - value, state.rate, bandwidth, dt)
    return Filtered(state.value + change, rate)
