r"""The paper's model: Euler angles whose rates are taken for body rates, equation (3) with its misprints mended.

.. math:: \ddot x &= (c_\phi s_\theta c_\psi + s_\phi s_\psi)\,u_1/m + \delta_x \\
          \ddot y &= (c_\phi s_\theta s_\psi - s_\phi c_\psi)\,u_1/m + \delta_y \\
          \ddot z &= -g + c_\phi c_\theta\,u_1/m + \delta_z \\
          \ddot\phi &= \dot\theta\dot\psi(I_y - I_z)/I_x - (J_r/I_x)\dot\theta\Omega + \tau_\phi/I_x \\
          \ddot\theta &= \dot\phi\dot\psi(I_z - I_x)/I_y + (J_r/I_y)\dot\phi\Omega + \tau_\theta/I_y \\
          \ddot\psi &= \dot\phi\dot\theta(I_x - I_y)/I_z + \tau_\psi/I_z

Differences from print: cos psi in the y row, 1/m in the z row, the sign of the gyroscopic term in the pitch row,
torques in N m instead of l u (docs/paper.md). It holds near level flight only, where `rigid_body` agrees with it.
"""

from __future__ import annotations

from typing import NamedTuple, final

from rotorfault.maths.geometry import Vec3
from rotorfault.maths.rotation import Quat, body_z_axis
from rotorfault.maths.scalar import Scalar
from rotorfault.model.motion import angular_acceleration
from rotorfault.model.signals import State, Wrench
from rotorfault.model.slot import register
from rotorfault.model.vehicle import Vehicle
from rotorfault.plant.models import BodyModel, about_z, acceleration
from rotorfault.plant.wind import Air


class PaperState(NamedTuple):
    """State of the paper's model, x1..x12 of (5) under names."""

    p_W: Vec3  # m
    v_W: Vec3  # m/s
    attitude: Vec3  # rad: roll, pitch, yaw; yaw counts on beyond a turn
    attitude_rate: Vec3  # rad/s, their derivatives


@final
@register("paper_model")
class PaperModel(BodyModel[PaperState]):
    """The paper's equation (3), corrected: Euler angles, Euler rates taken for body rates."""

    def start(self, p_W: Vec3, v_W: Vec3, attitude: Vec3, omega_B: Vec3) -> PaperState:
        """State for position [m], velocity [m/s], (roll, pitch, yaw) [rad] and their rates [rad/s]."""
        return PaperState(p_W, v_W, attitude, omega_B)

    def derivative(
        self,
        body: PaperState,
        wrench: Wrench,
        extra_acceleration_W: Vec3,
        vehicle: Vehicle,
        residual_speed: Scalar | Vec3,
        air: Air,
    ) -> PaperState:
        """Time derivative; see `rotorfault.plant.models.BodyModel`."""
        thrust_axis_W = body_z_axis(body.attitude)
        return PaperState(
            p_W=body.v_W,
            v_W=acceleration(vehicle, wrench.thrust, thrust_axis_W, body.v_W, air, extra_acceleration_W),
            attitude=body.attitude_rate,
            attitude_rate=angular_acceleration(vehicle, wrench.torque_B, body.attitude_rate, residual_speed),
        )

    def turned(self, body: PaperState, rate: Scalar | Vec3) -> PaperState:
        """The state with its yaw rate, or all its rates, changed by so much [rad/s]."""
        return body._replace(attitude_rate=body.attitude_rate + about_z(rate))

    def observe(self, body: PaperState) -> State:
        """The state as it is; omega_B holds the Euler rates."""
        return State(body.p_W, body.v_W, Quat.from_euler(body.attitude), body.attitude_rate)
