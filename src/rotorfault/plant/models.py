r"""What a model of the body's motion is, the registry of those that exist, and Newton's and Euler's equations.

.. math:: \dot v = e\,\frac{T}{m} - g e_z + \frac{k_d}{m}(v_{wind} - v) + \delta, \qquad
          J\dot\omega = \tau + \tau_{gyro} - \omega\times J\omega

with e the thrust axis in the world: equations (1) and (2) of the paper, with gravity. They stand here once; the
models differ in their kinematics.
"""

from __future__ import annotations

from typing import Any, ClassVar, TypeVar

from rotorfault.maths.geometry import Vec3
from rotorfault.maths.scalar import Scalar
from rotorfault.model.block import Block, Nothing
from rotorfault.model.motion import angular_acceleration, drag_acceleration
from rotorfault.model.signals import State, Wrench
from rotorfault.model.slot import Slot
from rotorfault.model.vehicle import Vehicle
from rotorfault.plant.wind import Air

BodyT = TypeVar("BodyT", bound=tuple[Any, ...])

__all__ = ["PLANT", "BodyModel", "about_z", "acceleration", "angular_acceleration"]


class BodyModel(Block[State, BodyT, BodyT, Nothing]):
    """Motion of the body under a wrench: a state record and its derivative, which the plant integrates.

    Attributes
    ----------
    upside_down : float
        For how long in s it may be tilted beyond 90 degrees and still fly on; 0 for a model that is wrong there.
    """

    upside_down: ClassVar[float] = 0.0

    def start(self, p_W: Vec3, v_W: Vec3, attitude: Vec3, omega_B: Vec3) -> BodyT:
        """State record for position [m], velocity [m/s], (roll, pitch, yaw) [rad] and rates [rad/s]."""
        raise NotImplementedError(f"{type(self).__name__} has no start")

    def derivative(
        self,
        body: BodyT,
        wrench: Wrench,
        extra_acceleration_W: Vec3,
        vehicle: Vehicle,
        residual_speed: Scalar | Vec3,
        air: Air,
    ) -> BodyT:
        """Time derivative of the state, as a record of the same shape.

        Parameters
        ----------
        body : record
            State of the body.
        wrench : Wrench
            Of the thrusts that the rotors deliver.
        extra_acceleration_W : Vec3, m/s^2, world frame
            Added to the translational acceleration.
        vehicle : Vehicle
            The true one.
        residual_speed : scalar or Vec3, rad/s
            Sum of the signed rotor speeds, Omega of (4); of tilted rotors its vector in body axes.
        air : Air
            At the time of the state.
        """
        raise NotImplementedError(f"{type(self).__name__} has no derivative")

    def turned(self, body: BodyT, rate: Scalar | Vec3) -> BodyT:
        """The state with its rate about body z changed by so much [rad/s]; all its body rates, if it is a vector.

        The plant needs it for the reaction of rotors. As it is here it serves models that have body rates `omega_B`.
        """
        omega_B = getattr(body, "omega_B", None)
        if omega_B is None:
            raise NotImplementedError(f"{type(self).__name__} has no turned, and its state no omega_B")
        return body._replace(omega_B=omega_B + about_z(rate))  # type: ignore[attr-defined,no-any-return]

    def after_step(self, body: BodyT) -> BodyT:
        """Put a state that an integration step has left back on its constraints, if it has any."""
        return body

    def observe(self, body: BodyT) -> State:
        """Position, velocity, attitude and rates."""
        raise NotImplementedError(f"{type(self).__name__} cannot be observed")


PLANT = Slot(
    "plant", BodyModel, "truth", "model of the body's motion", "plants", default="rigid_body",
)  # fmt: skip


def about_z(rate: Scalar | Vec3) -> Vec3:
    """Body rates in rad/s: a number is the rate about body z."""
    return rate if isinstance(rate, Vec3) else Vec3(0.0, 0.0, rate)


def acceleration(
    vehicle: Vehicle, thrust: Scalar, thrust_axis_W: Vec3, v_W: Vec3, air: Air, extra_acceleration_W: Vec3
) -> Vec3:
    """Translational acceleration in m/s^2, world frame, for a thrust in N along a unit vector in the world frame."""
    gravity_W = Vec3(0.0, 0.0, -vehicle.gravity)
    disturbance_W = air.acceleration_W + extra_acceleration_W
    lift_W: Vec3 = thrust_axis_W * (thrust / vehicle.mass)
    return lift_W + gravity_W + drag_acceleration(vehicle, air.velocity_W - v_W) + disturbance_W
