r"""What a model of the body's motion is, the registry of those that exist, and Newton's and Euler's equations.

.. math:: \dot v = e\,\frac{T}{m} - g e_z + \frac{k_d}{m}(v_{wind} - v) + \delta, \qquad
          J\dot\omega = \tau + \tau_{gyro} - \omega\times J\omega

with e the thrust axis in the world: equations (1) and (2) of the paper, with gravity. They stand here once; the
models differ in their kinematics.
"""

from __future__ import annotations

from typing import Any, Protocol

from rotorfault.base.registry import Registry
from rotorfault.maths.geometry import Vec3
from rotorfault.maths.scalar import Scalar
from rotorfault.model.signals import Measurement, Wrench
from rotorfault.model.vehicle import Vehicle, gyroscopic_torque
from rotorfault.plant.aero import drag_acceleration
from rotorfault.plant.wind import Air


class BodyModel(Protocol):
    """Motion of the body under a wrench: a state record and its derivative."""

    def initial(self, p_W: Vec3, v_W: Vec3, attitude: Vec3, omega_B: Vec3) -> Any:
        """State record for position [m], velocity [m/s], (roll, pitch, yaw) [rad] and rates [rad/s]."""

    def derivative(
        self,
        body: Any,
        wrench: Wrench,
        extra_acceleration_W: Vec3,
        vehicle: Vehicle,
        residual_speed: Scalar,
        air: Air,
    ) -> Any:
        """Time derivative of the state, as a record of the same shape.

        Parameters
        ----------
        body : record
        wrench : Wrench
            Of the thrusts that the rotors deliver.
        extra_acceleration_W : Vec3, m/s^2, world frame
            Added to the translational acceleration.
        vehicle : Vehicle
        residual_speed : scalar, rad/s
            Sum of the signed rotor speeds, Omega of (4).
        air : Air
        """

    def after_step(self, body: Any) -> Any:
        """Put a state that an integration step has left back on its constraints, if it has any."""

    def observe(self, body: Any) -> Measurement:
        """Position, velocity, attitude and rates as perfect sensors would give them."""


PLANTS: Registry[type] = Registry("plant")


def acceleration(
    vehicle: Vehicle, thrust: Scalar, thrust_axis_W: Vec3, v_W: Vec3, air: Air, extra_acceleration_W: Vec3
) -> Vec3:
    """Translational acceleration in m/s^2, world frame, for a thrust in N along a unit vector in the world frame."""
    gravity_W = Vec3(0.0, 0.0, -vehicle.gravity)
    disturbance_W = air.acceleration_W + extra_acceleration_W
    lift_W: Vec3 = thrust_axis_W * (thrust / vehicle.mass)
    return lift_W + gravity_W + drag_acceleration(vehicle, v_W, air.velocity_W) + disturbance_W


def angular_acceleration(vehicle: Vehicle, torque_B: Vec3, omega_B: Vec3, residual_speed: Scalar) -> Vec3:
    """Angular acceleration in rad/s^2, body frame, for a torque in N m; (1), and the attitude rows of (3)."""
    J = vehicle.inertia
    torque_all_B = torque_B + gyroscopic_torque(vehicle, omega_B, residual_speed) - omega_B.cross(J.times(omega_B))
    return torque_all_B.over(J)
