"""What a controller is: the interface that every control law and every user's controller keeps.

A *controller* turns measurement, reference and belief into a wrench. A *law* is smaller: it turns the tracking
error of three axes into three virtual accelerations; `rotorfault.autopilot.control.cascade` makes a controller of it.
"""

from __future__ import annotations

from typing import Any, NamedTuple, Protocol

from rotorfault.base.registry import Registry
from rotorfault.maths.geometry import Mat3, Vec3, zeros
from rotorfault.maths.scalar import Scalar
from rotorfault.model.signals import Measurement, Reference, Wrench
from rotorfault.model.vehicle import Vehicle


class Prediction(NamedTuple):
    """Velocity changes over the last sampling period that the believed model explains; zero at the first step."""

    delta_v_W: Vec3  # m/s
    delta_omega_B: Vec3  # rad/s


class ControlInputs(NamedTuple):
    """All that a controller may use at one sampling instant."""

    measurement: Measurement
    reference: Reference
    vehicle: Vehicle  # the autopilot's belief, not the truth
    prediction: Prediction
    residual_speed: Scalar  # rad/s, believed overall residual rotor speed Omega of (4)
    thrust_available: Scalar  # N: largest total thrust of the believed rotors in balance


class ControlTelemetry(NamedTuple):
    """What a controller reports for the record; zero where a law has no such quantity."""

    attitude_demand: Vec3  # rad: attitude that the position loop asks for
    attitude_command: Vec3  # rad: the same after the command filter; the attitude loop tracks it
    virtual_position_W: Vec3  # m/s^2: commanded acceleration less gravity and feed-forward, after limits
    virtual_attitude: Vec3  # rad/s^2: commanded angular acceleration
    sigma_position: Vec3  # sliding variable, unit of velocity times the law's weight
    sigma_attitude: Vec3
    lyapunov: Scalar  # V = sigma^T sigma / 2
    gain_position: Vec3  # 1/s^2, diagonal position gain
    gain_velocity: Vec3  # 1/s, diagonal velocity gain
    gain_angle: Mat3  # 1/s^2
    gain_rate: Mat3  # 1/s
    riccati_residual: Scalar  # relative residual of (22) for the attitude block
    riccati_guarded: Scalar  # 1 where the guaranteed gain had to be flown
    outside_position: Vec3 = zeros()  # 1 on axes whose sliding variable is outside the boundary layer
    outside_attitude: Vec3 = zeros()


def no_telemetry() -> ControlTelemetry:
    """Telemetry of a controller that reports nothing but its wrench."""
    nothing, none = zeros(), Mat3.diagonal(zeros())
    return ControlTelemetry(
        nothing, nothing, nothing, nothing, nothing, nothing, 0.0, nothing, nothing, none, none, 0.0, 0.0
    )


class ControlOutput(NamedTuple):
    """Wrench demanded, and what to record."""

    wrench: Wrench
    direct_acceleration_W: Vec3  # m/s^2, zero but for the unphysical option `six_inputs`
    telemetry: ControlTelemetry


class Controller(Protocol):
    """A block: static choices in the object, numbers in `parameters`, memory passed through `step`."""

    def parameters(self, vehicle: Vehicle, period: float) -> Any:
        """Numbers of the controller as a record, for a believed vehicle and a sampling period in s."""

    def initial(self, measurement: Measurement, reference: Reference, parameters: Any) -> Any:
        """Memory before the first step."""

    def step(self, memory: Any, inputs: ControlInputs, parameters: Any, dt: Scalar) -> tuple[Any, ControlOutput]:
        """One sampling instant; pure."""


CONTROLLERS: Registry[Any] = Registry("controller")


class TrackingError(NamedTuple):
    """Error of three axes as a law sees it: position axes in W, or attitude axes (roll, pitch, yaw)."""

    e: Vec3  # m or rad: state less reference
    e_dot: Vec3  # m/s or rad/s
    rate: Vec3  # m/s or rad/s: the rate itself, v_W or omega_B
    predicted: Vec3  # change of the rate over the last period that the believed model explains
    feed_forward: Vec3  # m/s^2 or rad/s^2: acceleration that keeps e at zero
    drift: Mat3  # 1/s: W of the SDC form, rate_dot = W rate + u; zero for the position axes
    actuator: Vec3  # rad/s: bandwidth with which a demanded acceleration comes about, per axis


class LawOutput(NamedTuple):
    """Virtual accelerations of one group of axes, without feed-forward."""

    u: Vec3  # m/s^2 or rad/s^2
    sigma: Vec3
    gain_e: Mat3  # 1/s^2
    gain_rate: Mat3  # 1/s
    riccati_residual: Scalar
    riccati_guarded: Scalar
    outside: Vec3 = zeros()  # 1 on axes outside the boundary layer


class Law(Protocol):
    """Six double integrators' control law, position and attitude axes as two groups of three."""

    def parameters(self, vehicle: Vehicle, period: float) -> Any:
        """Numbers of the law as a record."""

    def initial(self, position: TrackingError, attitude: TrackingError, parameters: Any) -> Any:
        """Memory before the first step, a record with fields `position` and `attitude`."""

    def position(self, memory: Any, error: TrackingError, parameters: Any, dt: Scalar) -> tuple[Any, LawOutput]:
        """Virtual accelerations of x, y, z."""

    def attitude(self, memory: Any, error: TrackingError, parameters: Any, dt: Scalar) -> tuple[Any, LawOutput]:
        """Virtual accelerations of roll, pitch, yaw."""
