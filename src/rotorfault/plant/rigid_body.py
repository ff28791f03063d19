r"""The full rigid body: attitude as a unit quaternion, no angle at which it fails.

.. math:: \dot p = v, \qquad \dot q = \tfrac12\, q \otimes (0, \omega)

with Newton's and Euler's equations of `rotorfault.plant.models`. Unlike the paper's (3), body rates and Euler rates
are told apart.
"""

from __future__ import annotations

from typing import ClassVar, NamedTuple, final

from rotorfault.maths.geometry import Vec3
from rotorfault.maths.rotation import Quat
from rotorfault.maths.scalar import Scalar
from rotorfault.model.motion import angular_acceleration
from rotorfault.model.signals import State, Wrench
from rotorfault.model.slot import register
from rotorfault.model.vehicle import Vehicle
from rotorfault.plant.models import BodyModel, about_z, acceleration
from rotorfault.plant.wind import Air


class RigidBodyState(NamedTuple):
    """State of the rigid body."""

    p_W: Vec3  # m
    v_W: Vec3  # m/s
    q_WB: Quat  # body to world, of unit length
    omega_B: Vec3  # rad/s


@final
@register("rigid_body")
class RigidBody(BodyModel[RigidBodyState]):
    """Rigid body on SO(3): quaternion attitude, valid at any angle."""

    # Our choice. A vehicle that loses a rotor may roll over once and fly on; one that stays upside down for longer
    # has fallen by more than a metre, its thrust pushing it down.
    upside_down: ClassVar[float] = 0.5

    def start(self, p_W: Vec3, v_W: Vec3, attitude: Vec3, omega_B: Vec3) -> RigidBodyState:
        """State for position [m], velocity [m/s], (roll, pitch, yaw) [rad] and body rates [rad/s]."""
        return RigidBodyState(p_W, v_W, Quat.from_euler(attitude), omega_B)

    def derivative(
        self,
        body: RigidBodyState,
        wrench: Wrench,
        extra_acceleration_W: Vec3,
        vehicle: Vehicle,
        residual_speed: Scalar | Vec3,
        air: Air,
    ) -> RigidBodyState:
        """Time derivative; see `rotorfault.plant.models.BodyModel`."""
        R_WB = body.q_WB.matrix()
        thrust_axis_W = Vec3(R_WB.xz, R_WB.yz, R_WB.zz)
        return RigidBodyState(
            p_W=body.v_W,
            v_W=acceleration(vehicle, wrench.thrust, thrust_axis_W, body.v_W, air, extra_acceleration_W),
            q_WB=body.q_WB.derivative(body.omega_B),
            omega_B=angular_acceleration(vehicle, wrench.torque_B, body.omega_B, residual_speed),
        )

    def turned(self, body: RigidBodyState, rate: Scalar | Vec3) -> RigidBodyState:
        """The state with its rate about body z, or all body rates, changed by so much [rad/s]."""
        return body._replace(omega_B=body.omega_B + about_z(rate))

    def after_step(self, body: RigidBodyState) -> RigidBodyState:
        """Bring the quaternion back to unit length, which integration keeps only to its own order."""
        return body._replace(q_WB=body.q_WB.normalised())

    def observe(self, body: RigidBodyState) -> State:
        """The state as it is."""
        return State(body.p_W, body.v_W, body.q_WB, body.omega_B)
