r"""From six virtual accelerations to thrust, attitude demand and torque: the cascade that flies a `Law`.

The vehicle has four inputs, the laws six virtual ones. The position group's acceleration, with what keeps the error
at zero (reference acceleration, gravity, believed drag),

.. math:: f_W = a_{ref} + u_p + \tfrac{k_d}{m} v_W + g e_z,

is a specific force, limited vertical part first, then by tilt and available thrust. At the measured yaw it asks for

.. math:: \theta_d = \mathrm{atan2}(f_x', f_z), \quad \phi_d = \mathrm{atan2}(-f_y', \sqrt{f_x'^2 + f_z^2}), \quad
          T = m f_z / \max(\cos\phi\cos\theta, c_{min})

with f' = f turned into the heading frame. The demand passes a critically damped second-order command filter, exact
for a held input and so stable at any sampling period; its rate and acceleration are the attitude reference's, and
the attitude group turns the error into torque = J (u_a + d(omega_ref)/dt - W omega_ref). Euler rates are taken for
body rates, as the paper does.

The unphysical option ``six_inputs`` is the paper's literal (34): accelerations on x and y act directly, the
attitude reference is level, thrust and torques still pass through the rotors.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from pydantic import Field, create_model

from rotorfault.autopilot.control.protocol import (
    CONTROLLERS,
    ControlInputs,
    ControlOutput,
    ControlTelemetry,
    Law,
    Prediction,
    TrackingError,
)
from rotorfault.autopilot.control.sdre import gyroscopic_drift
from rotorfault.base.config import Strict
from rotorfault.maths.geometry import Mat3, Vec3, zeros
from rotorfault.maths.scalar import Scalar, atan2, clip, cos, exp, maximum, minimum, sin, sqrt, wrap_angle
from rotorfault.model.signals import Measurement, Reference, Wrench
from rotorfault.model.vehicle import Vehicle


class CascadeSettings(Strict):
    """How virtual accelerations become thrust and attitude demand."""

    tilt_max: float = Field(default=0.9, gt=0.0, lt=1.5, description="largest demanded tilt [rad]")
    thrust_share: float = Field(
        default=0.95,
        gt=0.0,
        le=1.0,
        description="share of the thrust that the believed rotors have in balance, for position control",
    )
    fall_share: float = Field(
        default=0.3, gt=0.0, lt=1.0, description="least vertical specific force demanded, as a share of gravity"
    )
    cos_min: float = Field(
        default=0.3, gt=0.0, le=1.0, description="thrust rises as 1/cos(tilt) down to this cosine, no further"
    )
    filter_bandwidth: float = Field(
        default=25.0, gt=0.0, description="double pole of the attitude command filter [rad/s]"
    )
    horizontal_lag: float = Field(
        default=8.0, gt=0.0, description="bandwidth with which horizontal acceleration is believed to come [rad/s]"
    )
    six_inputs: bool = Field(default=False, description="x and y accelerations act directly: unphysical, for study")


class CascadeParameters(NamedTuple):
    """Numbers of the cascade around a law."""

    law: Any
    tilt_tangent: Scalar
    thrust_share: Scalar
    fall_share: Scalar
    cos_min: Scalar
    filter_bandwidth: Scalar  # rad/s
    horizontal_lag: Scalar  # rad/s


class AttitudeReference(NamedTuple):
    """State of the command filter: what the attitude loop tracks."""

    attitude: Vec3  # rad
    rate: Vec3  # rad/s


class CascadeMemory(NamedTuple):
    """Memory of the cascade."""

    position: Any
    attitude: Any
    reference: AttitudeReference


def limited_force(f_W: Vec3, available: Scalar, vehicle: Vehicle, parameters: CascadeParameters) -> Vec3:
    """Specific force in m/s^2 within available thrust [N] and tilt; the vertical part is served first."""
    most = parameters.thrust_share * available / vehicle.mass
    f_z = clip(f_W.z, parameters.fall_share * vehicle.gravity, most)
    # Factored: a compiler may fuse most^2 - f_z^2 into one rounding, which can be below zero where the two are equal.
    room = minimum(sqrt((most - f_z) * (most + f_z)), parameters.tilt_tangent * f_z)
    # The small term keeps the quotient finite at rest; it changes nothing that could be measured.
    horizontal = sqrt(f_W.x * f_W.x + f_W.y * f_W.y + 1e-18)
    scale = minimum(room / horizontal, 1.0)
    return Vec3(f_W.x * scale, f_W.y * scale, f_z)


def attitude_for(f_W: Vec3, yaw: Scalar, yaw_ref: Scalar) -> Vec3:
    """Attitude in rad whose thrust axis points along f, roll and pitch taken at the present yaw."""
    c, s = cos(yaw), sin(yaw)
    forward, left = c * f_W.x + s * f_W.y, c * f_W.y - s * f_W.x
    return Vec3(
        atan2(-left, sqrt(forward * forward + f_W.z * f_W.z)),
        atan2(forward, f_W.z),
        yaw_ref,
    )


def filtered(
    reference: AttitudeReference, demand: Vec3, bandwidth: Scalar, dt: Scalar
) -> tuple[AttitudeReference, Vec3]:
    """One period of the critically damped command filter: (next state, acceleration now in rad/s^2)."""
    gap = Vec3(
        reference.attitude.x - demand.x, reference.attitude.y - demand.y, wrap_angle(reference.attitude.z - demand.z)
    )
    slope = reference.rate + gap * bandwidth
    decay = exp(-bandwidth * dt)
    after = (gap + slope * dt) * decay
    rate = (reference.rate - slope * (bandwidth * dt)) * decay
    acceleration = -(gap * (bandwidth * bandwidth)) - reference.rate * (2.0 * bandwidth)
    return AttitudeReference(reference.attitude + after - gap, rate), acceleration


class Cascade:
    """A controller made of a law: position loop, command filter, attitude loop."""

    def __init__(self, law: Law, settings: CascadeSettings) -> None:
        self.law = law
        self.settings = settings

    def parameters(self, vehicle: Vehicle, period: float) -> CascadeParameters:
        """Numbers of the controller for a believed vehicle and a sampling period in s."""
        s = self.settings
        return CascadeParameters(
            self.law.parameters(vehicle, period),
            math.tan(s.tilt_max),
            s.thrust_share,
            s.fall_share,
            s.cos_min,
            s.filter_bandwidth,
            s.horizontal_lag,
        )

    def initial(self, measurement: Measurement, reference: Reference, parameters: CascadeParameters) -> CascadeMemory:
        """Memory before the first step; the command filter starts at the measured attitude."""
        level = zeros()
        start = AttitudeReference(level if self.settings.six_inputs else measurement.attitude, level)
        nothing = Prediction(level, level)
        still = Mat3.diagonal(level)
        position = _position_error(measurement, reference, nothing, level)
        attitude = _attitude_error(measurement, start, level, nothing, still, level)
        law = self.law.initial(position, attitude, parameters.law)
        return CascadeMemory(law.position, law.attitude, start)

    def step(
        self, memory: CascadeMemory, inputs: ControlInputs, parameters: CascadeParameters, dt: Scalar
    ) -> tuple[CascadeMemory, ControlOutput]:
        """One sampling instant."""
        measurement, reference, vehicle = inputs.measurement, inputs.reference, inputs.vehicle
        six_inputs = self.settings.six_inputs
        w0 = vehicle.rotor_bandwidth
        drag_W = measurement.v_W * (vehicle.linear_drag / vehicle.mass)

        # Position loop: specific force wanted.
        lag = w0 if six_inputs else parameters.horizontal_lag
        position = _position_error(measurement, reference, inputs.prediction, Vec3(lag, lag, w0))
        position_memory, outer = self.law.position(memory.position, position, parameters.law, dt)
        gravity_W = Vec3(0.0, 0.0, vehicle.gravity)
        wanted = reference.a_W + outer.u + drag_W + gravity_W
        force_W = limited_force(wanted, inputs.thrust_available, vehicle, parameters)

        # Attitude demand and its filter.
        if six_inputs:
            demand, direct = Vec3(0.0, 0.0, reference.yaw), Vec3(wanted.x, wanted.y, 0.0)
            given = Vec3(outer.u.x, outer.u.y, force_W.z - wanted.z + outer.u.z)
        else:
            demand, direct = attitude_for(force_W, measurement.attitude.z, reference.yaw), zeros()
            given = outer.u + force_W - wanted
        following, acceleration = filtered(memory.reference, demand, parameters.filter_bandwidth, dt)

        # Attitude loop: torque.
        drift = gyroscopic_drift(vehicle, measurement.omega_B, inputs.residual_speed)
        attitude = _attitude_error(
            measurement, memory.reference, acceleration, inputs.prediction, drift, Vec3(w0, w0, w0)
        )
        attitude_memory, inner = self.law.attitude(memory.attitude, attitude, parameters.law, dt)
        torque_B = (inner.u + attitude.feed_forward).times(vehicle.inertia)

        level = cos(measurement.attitude.x) * cos(measurement.attitude.y)
        thrust = vehicle.mass * force_W.z / maximum(level, parameters.cos_min)
        telemetry = ControlTelemetry(
            attitude_demand=demand,
            attitude_command=memory.reference.attitude,
            virtual_position_W=given,
            virtual_attitude=inner.u,
            sigma_position=outer.sigma,
            sigma_attitude=inner.sigma,
            lyapunov=(outer.sigma.dot(outer.sigma) + inner.sigma.dot(inner.sigma)) * 0.5,
            gain_position=outer.gain_e.diag,
            gain_velocity=outer.gain_rate.diag,
            gain_angle=inner.gain_e,
            gain_rate=inner.gain_rate,
            riccati_residual=inner.riccati_residual,
            riccati_guarded=inner.riccati_guarded,
            outside_position=outer.outside,
            outside_attitude=inner.outside,
        )
        output = ControlOutput(Wrench(thrust, torque_B), direct, telemetry)
        return CascadeMemory(position_memory, attitude_memory, following), output


def _position_error(
    measurement: Measurement, reference: Reference, prediction: Prediction, actuator: Vec3
) -> TrackingError:
    return TrackingError(
        e=measurement.p_W - reference.p_W,
        e_dot=measurement.v_W - reference.v_W,
        rate=measurement.v_W,
        predicted=prediction.delta_v_W,
        feed_forward=reference.a_W,
        drift=Mat3.diagonal(zeros()),
        actuator=actuator,
    )


def _attitude_error(
    measurement: Measurement,
    reference: AttitudeReference,
    acceleration: Vec3,
    prediction: Prediction,
    drift: Mat3,
    actuator: Vec3,
) -> TrackingError:
    gap = measurement.attitude - reference.attitude
    return TrackingError(
        e=Vec3(gap.x, gap.y, wrap_angle(gap.z)),
        e_dot=measurement.omega_B - reference.rate,
        rate=measurement.omega_B,
        predicted=prediction.delta_omega_B,
        feed_forward=acceleration - drift @ reference.rate,
        drift=drift,
        actuator=actuator,
    )


class CascadeKind:
    """A registered law with the cascade around it: call it with its settings to get the controller.

    Parameters
    ----------
    law : class
        Satisfies `rotorfault.autopilot.control.protocol.Law`; has `Settings` and takes them in its constructor.
    """

    def __init__(self, name: str, law: Any) -> None:
        self.law = law
        self.__doc__ = law.__doc__
        self.Settings: Any = create_model(
            f"{name.capitalize()}Controller",
            __base__=Strict,
            __doc__=f"Settings of the controller {name}.",
            law=(law.Settings, Field(default=law.Settings(), description="the control law")),
            cascade=(CascadeSettings, Field(default=CascadeSettings(), description=CascadeSettings.__doc__)),
        )

    def __call__(self, settings: Any) -> Cascade:
        """Make the controller."""
        return Cascade(self.law(settings.law), settings.cascade)


def register_law(name: str, law: Any) -> None:
    """Make a law available as a controller under a name, with the cascade around it."""
    CONTROLLERS.register(name)(CascadeKind(name, law))
