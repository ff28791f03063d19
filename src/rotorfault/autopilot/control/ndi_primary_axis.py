r"""Nonlinear dynamic inversion of the primary axis: the model is inverted, loop by loop.

With h the wanted direction of thrust in body coordinates and n the primary axis
(`rotorfault.autopilot.control.primary_axis`),

.. math:: \dot h = h\times\omega: \qquad \dot h_x = h_y r - h_z q, \qquad \dot h_y = h_z p - h_x r .

The outer inversion asks of :math:`\dot h` to be :math:`\nu = -k_h (h - n) - z`, :math:`\dot z = k_i (h - n)`, and
solves for roll and pitch rate at the measured yaw rate,

.. math:: p_d = (\nu_y + h_x r)/h_z, \qquad q_d = (-\nu_x + h_y r)/h_z;

the inner one asks of the rates to follow, :math:`\dot\omega = k_\omega(\omega_d - \omega)`, and solves Euler's
equation for the torque:

.. math:: \tau = J\dot\omega + \omega\times J\omega - \tau_{gyro} .

While yaw is held, n is body z and the yaw rate has a demand of its own by the heading. P. Lu and E.-J. van Kampen,
"Active fault-tolerant control for quadrotors subjected to a complete rotor failure", IROS 2015; S. Sun, L. Sijbers,
X. Wang and C. de Visser, "High-speed flight of quadrotor despite loss of single rotor", RA-L 3(4), 2018.

Departures. :math:`h_z` is kept 0.2 away from 0, where the inversion is singular: beyond 78 degrees it does what it
does there. The thrusts of the living rotors follow from thrust and tilt torque within their limits, by the same
allocation as for our own law. The rotors' lag is not part of the method: where they turn the thrust more slowly than
the body spins, that shows.
"""

from __future__ import annotations

from typing import Annotated, ClassVar, NamedTuple, final

from pydantic import Field

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
)
from rotorfault.autopilot.control.protocol import ControlInputs, Controller, ControlOutput, Search
from rotorfault.base.config import Strict
from rotorfault.maths.geometry import Vec3, zeros
from rotorfault.maths.scalar import Scalar, absolute, clip, less, maximum, select
from rotorfault.model.block import Context
from rotorfault.model.motion import torque_of_motion
from rotorfault.model.signals import Wrench
from rotorfault.model.telemetry import RPY, B, Q, W
from rotorfault.model.vehicle import body_momentum

LEAST_UP = 0.2  # of h_z, where the inversion ends. Our choice: 78 degrees
MOST_INTEGRAL = 1.0  # rad/s: of z. Our choice: more than any steady error of tilt asks for


class NdiParameters(NamedTuple):
    """Numbers of the law."""

    position: OuterParameters
    axis: AxisParameters
    direction: Scalar  # 1/s
    integral: Scalar  # 1/s^2
    rate: Scalar  # 1/s
    heading: Scalar  # 1/s
    yaw_rate: Scalar  # 1/s


class NdiMemory(NamedTuple):
    """What is carried on."""

    integral: Vec3  # m/s^2: of the position loop
    lean: Vec3  # of the primary axis
    direction: Vec3  # rad/s: integral of h - n; its z is 0


class NdiSignals(NamedTuple):
    """What it records."""

    virtual_position: Annotated[Vec3, Q("m/s^2", W, "commanded acceleration less gravity and feed-forward, limited")]
    virtual_attitude: Annotated[Vec3, Q("rad/s^2", RPY, "commanded angular acceleration less feed-forward")]
    rate_demand: Annotated[Vec3, Q("rad/s", B, "rates that the loop around them asks for")]
    primary_axis: Annotated[Vec3, Q("1", B, "axis that is to point along the wanted thrust")]


@final
class NdiPrimaryAxis(Controller[NdiMemory, NdiParameters]):
    """Nonlinear dynamic inversion of the direction of thrust, then of the rates (Lu 2015, Sun 2018)."""

    class Settings(Strict):
        """Gains of the loops."""

        position: OuterSettings = Field(default=OuterSettings(), description="position loop")
        axis: AxisSettings = Field(default=AxisSettings(), description="axis of the spin once yaw is lost")
        direction: float = Field(default=7.0, gt=0.0, description="k_h, rate per error of the direction [1/s]")
        integral: float = Field(default=0.5, ge=0.0, description="k_i, of the same [1/s^2]")
        rate: float = Field(default=16.0, gt=0.0, description="k_omega of roll and pitch [1/s]")
        heading: float = Field(default=2.0, gt=0.0, description="yaw rate per heading error [1/s]")
        yaw_rate: float = Field(default=5.0, gt=0.0, description="k_omega of yaw [1/s]")

    Telemetry = NdiSignals
    search: ClassVar[Search] = {
        **OUTER_SEARCH,
        "direction": (2.0, 7.0, 25.0),
        "integral": (0.05, 0.5, 5.0),
        "rate": (5.0, 16.0, 50.0),
        "heading": (0.5, 2.0, 8.0),
        "yaw_rate": (1.5, 5.0, 20.0),
    }

    def parameters(self, context: Context) -> NdiParameters:
        """The settings as a record."""
        s = self.settings
        return NdiParameters(
            outer_parameters(s.position, context),
            AxisParameters(s.axis.lean, s.axis.time),
            s.direction,
            s.integral,
            s.rate,
            s.heading,
            s.yaw_rate,
        )

    def initial(self, inputs: ControlInputs, parameters: NdiParameters) -> NdiMemory:
        """Nothing has been integrated."""
        return NdiMemory(zeros(), zeros(), zeros())

    def step(
        self, memory: NdiMemory, inputs: ControlInputs, parameters: NdiParameters, dt: Scalar
    ) -> tuple[NdiMemory, ControlOutput, NdiSignals]:
        """One sampling instant."""
        p, vehicle, omega = parameters, inputs.vehicle, inputs.estimate.omega_B
        R_WB = inputs.estimate.q_WB.matrix()
        axis = primary_axis(memory.lean, inputs, p.axis, dt)
        outer = lift(memory.integral, inputs, axis.available, p.position, dt)

        # The outer inversion.
        h = direction_in_body(outer.force_W, R_WB)
        off = h - axis.n_B
        nu_x, nu_y = -p.direction * off.x - memory.direction.x, -p.direction * off.y - memory.direction.y
        up = maximum(absolute(h.z), LEAST_UP)
        over = 1.0 / select(less(h.z, 0.0), -up, up)
        yaw_rate = inputs.reference.yaw_rate - heading_error(inputs) * p.heading
        wanted = Vec3((nu_y + h.x * omega.z) * over, (-nu_x + h.y * omega.z) * over, yaw_rate)

        # The inner one.
        gain = Vec3(p.rate, p.rate, p.yaw_rate * (1.0 - axis.given_up))
        nu = (wanted - omega).times(gain)
        torque_B = body_momentum(vehicle, nu) - torque_of_motion(vehicle, omega, inputs.residual_speed)
        thrust = upward_thrust(outer.force_W, R_WB.zz, vehicle.mass, vehicle.gravity)
        wrench = handed_over(inputs, Wrench(thrust, torque_B), axis.given_up)

        def grown(z: Scalar, x: Scalar) -> Scalar:
            return clip(z + x * (p.integral * dt), -MOST_INTEGRAL, MOST_INTEGRAL)

        integral = Vec3(grown(memory.direction.x, off.x), grown(memory.direction.y, off.y), 0.0)
        after = NdiMemory(outer.integral, axis.lean, integral)
        return after, ControlOutput(wrench), NdiSignals(outer.given, nu, wanted, axis.n_B)
