r"""From six virtual accelerations to thrust, attitude demand and torque: the cascade that flies a `Law`.

The vehicle has four inputs, the laws six virtual ones. The position group's acceleration, with what keeps the error
at zero (reference acceleration, gravity, believed drag),

.. math:: f_W = a_{ref} + u_p + \tfrac{k_d}{m} v_W + g e_z,

is a specific force, limited vertical part first, then by tilt and available thrust. It is the wanted thrust axis,
with the thrust

.. math:: T = m f_z / \max(\cos\phi\cos\theta, c_{min}).

Axis and heading pass a critically damped second-order command filter, exact for a held input and so stable at any
sampling period; its rate and acceleration are the attitude reference's, and the attitude group turns the error into
torque = J (u_a + d(omega_ref)/dt - W omega_ref). What error and rates are: `rotorfault.autopilot.control.attitude`.

Where a dead rotor leaves no balance of yaw, `rotorfault.autopilot.control.relaxed` steers a spinning body.

The unphysical option ``six_inputs`` is the paper's literal (34): accelerations on x and y act directly, the
attitude reference is level, thrust and torques still pass through the rotors.
"""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal, NamedTuple, cast

from pydantic import Field, create_model

from rotorfault.autopilot.control.attitude import TRACKINGS, AttitudeReference, Tracking, level_attitude
from rotorfault.autopilot.control.force_limits import limited_force
from rotorfault.autopilot.control.protocol import (
    CONTROLLER,
    ControlInputs,
    Controller,
    ControlOutput,
    Law,
    LawOutput,
    RiccatiSignals,
    SlidingSignals,
    TrackingError,
)
from rotorfault.autopilot.control.relaxed import (
    RelaxedMemory,
    RelaxedParameters,
    SpinWeights,
    at_rest,
    relaxed_parameters,
)
from rotorfault.autopilot.control.sdre import gyroscopic_drift
from rotorfault.autopilot.control.spinning import Spinning
from rotorfault.autopilot.prediction import Prediction
from rotorfault.base.config import Strict
from rotorfault.maths.geometry import Mat3, Vec3, zeros
from rotorfault.maths.scalar import Scalar, any_of, maximum
from rotorfault.model.block import Context, Record
from rotorfault.model.motion import drag_acceleration, mean_bandwidth
from rotorfault.model.signals import Estimate, Reference, Wrench
from rotorfault.model.telemetry import RPY, Q, W, joined
from rotorfault.model.vehicle import body_momentum, wrench_of

YawLost = Literal["relaxed", "upright"]


class CascadeSettings(Strict):
    """How virtual accelerations become thrust and attitude demand."""

    # Defaults are our choice; each says what it trades. Presets hold what a search found.
    # 52 degrees: at a thrust-to-weight ratio of 2 the vertical part of the thrust still exceeds the weight.
    tilt_max: float = Field(default=0.9, gt=0.0, lt=1.5, description="largest demanded tilt [rad]")
    # The rest is kept for attitude when position asks for everything.
    thrust_share: float = Field(
        default=0.95,
        gt=0.0,
        le=1.0,
        description="share of the thrust that the believed rotors have in balance, for position control",
    )
    # Less falls faster and leaves tilt less authority.
    fall_share: float = Field(
        default=0.3, gt=0.0, lt=1.0, description="least vertical specific force demanded, as a share of gravity"
    )
    # 73 degrees, beyond any demanded tilt: acts only on a vehicle that tumbles.
    cos_min: float = Field(
        default=0.3, gt=0.0, le=1.0, description="thrust rises as 1/cos(tilt) down to this cosine, no further"
    )
    # Half the bandwidth of the paper's rotors; a faster filter saturates them.
    filter_bandwidth: float = Field(
        default=25.0, gt=0.0, description="double pole of the attitude command filter [rad/s]"
    )
    # A third of the filter's; with more, the delay of the attitude looks like wind to a sliding surface.
    horizontal_lag: float = Field(
        default=8.0, gt=0.0, description="bandwidth with which horizontal acceleration is believed to come [rad/s]"
    )
    tracking: Tracking = Field(
        default="so3",
        description="so3: thrust axis and heading as rotations | euler: Euler rates taken for body rates, as in (3)",
    )
    yaw_lost: YawLost = Field(
        default="relaxed",
        description="where yaw cannot be held: relaxed: spins about an axis that leaves its rotors room | upright: "
        "about body z; `euler` is always upright",
    )
    # Less leaves the rotor opposite a dead one no thrust to take back, more costs thrust.
    relaxed_reserve: float = Field(
        default=0.3, ge=0.0, le=1.0, description="relaxed: least thrust of a living rotor, as a share of equal ones"
    )
    # 20 degrees: costs 6 % of lift.
    relaxed_lean: float = Field(
        default=0.35, gt=0.0, lt=1.5, description="relaxed: largest angle of the axis to body z [rad]"
    )
    relaxed_time: float = Field(
        default=0.5, gt=0.0, description="relaxed: time constant with which the axis moves [s]"
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
    relaxed: RelaxedParameters


class CascadeMemory(NamedTuple):
    """Memory of the cascade: of the law, and of its command filter."""

    position: Any
    attitude: Any
    reference: AttitudeReference
    relaxed: RelaxedMemory | tuple[()]  # empty where it stays upright


class CascadeSignals(NamedTuple):
    """What every law in the cascade records."""

    attitude_demand: Annotated[Vec3, Q("rad", RPY, "attitude that the position loop asks for")]
    attitude_command: Annotated[Vec3, Q("rad", RPY, "demand after the command filter; tracked by the attitude loop")]
    virtual_position: Annotated[Vec3, Q("m/s^2", W, "commanded acceleration less gravity and feed-forward, limited")]
    virtual_attitude: Annotated[Vec3, Q("rad/s^2", RPY, "commanded angular acceleration less feed-forward")]
    gain_position: Annotated[Vec3, Q("1/s^2", W, "gain on the position error")]
    gain_velocity: Annotated[Vec3, Q("1/s", W, "gain on the velocity error")]
    gain_angle: Annotated[Mat3, Q("1/s^2", RPY, "gain matrix on the attitude error")]
    gain_rate: Annotated[Mat3, Q("1/s", RPY, "gain matrix on the rate error")]


class Cascade(Controller[CascadeMemory, CascadeParameters]):
    """A controller made of a law: position loop, command filter, attitude loop.

    Parameters
    ----------
    law : Law
    settings : CascadeSettings
    telemetry : type of NamedTuple
        What is recorded; see `CascadeKind`.
    """

    def __init__(self, law: Law[Any], settings: CascadeSettings, telemetry: type[Record]) -> None:
        self.law = law
        self.settings = settings
        self.tracking = TRACKINGS[settings.tracking]
        self._record: Any = telemetry
        self.Telemetry = telemetry  # type: ignore[misc]  # of the law's kind

    def parameters(self, context: Context) -> CascadeParameters:
        """Numbers of the law and of the cascade around it."""
        s = self.settings
        law = self.law.parameters(context)
        weights = self.law.spin_weights(law)
        return CascadeParameters(
            law,
            math.tan(s.tilt_max),
            s.thrust_share,
            s.fall_share,
            s.cos_min,
            s.filter_bandwidth,
            s.horizontal_lag,
            relaxed_parameters(s.relaxed_reserve, s.relaxed_lean, s.relaxed_time, weights or SpinWeights(0.0, 0.0)),
        )

    def initial(self, inputs: ControlInputs, parameters: CascadeParameters) -> CascadeMemory:
        """Memory before the first step; the command filter starts at the estimated attitude."""
        estimate, level = inputs.estimate, zeros()
        at = self.tracking.start(estimate.q_WB, parameters.tilt_tangent)
        start = level_attitude() if self.settings.six_inputs else at
        nothing = Prediction(level, level)
        position = _position_error(estimate, inputs.reference, nothing, level)
        # Only its rate matters: surfaces begin there.
        attitude = _attitude_error(level, estimate.omega_B, level, level, nothing, Mat3.diagonal(level), level)
        law = self.law.initial(position, attitude, parameters.law)
        s = self.settings
        relaxes = s.yaw_lost == "relaxed" and s.tracking == "so3" and not s.six_inputs
        relaxes = relaxes and self.law.spin_weights(parameters.law) is not None
        return CascadeMemory(
            law.position,
            law.attitude,
            start,
            at_rest(parameters.relaxed, inputs.vehicle, estimate.v_W) if relaxes else (),
        )

    def step(
        self, memory: CascadeMemory, inputs: ControlInputs, parameters: CascadeParameters, dt: Scalar
    ) -> tuple[CascadeMemory, ControlOutput, Record]:
        """One sampling instant."""
        estimate, reference, vehicle, believed = inputs.estimate, inputs.reference, inputs.vehicle, inputs.diagnosis
        six_inputs = self.settings.six_inputs
        w0 = mean_bandwidth(vehicle)
        R_WB = estimate.q_WB.matrix()

        spinning, steady_W = None, None
        available = inputs.thrust_available
        if memory.relaxed != ():
            spinning = Spinning(cast("RelaxedMemory", memory.relaxed), parameters.relaxed, inputs, dt)
            available, steady_W = spinning.available(parameters.thrust_share), spinning.steady_W
        # Position loop: specific force wanted.
        lag = w0 if six_inputs else parameters.horizontal_lag
        position = _position_error(estimate, reference, inputs.prediction, Vec3(lag, lag, w0))
        position = position if spinning is None else spinning.held_back(position)
        position_memory, outer = self.law.position(memory.position, position, parameters.law, dt)
        gravity_W = Vec3(0.0, 0.0, vehicle.gravity)
        wanted = reference.a_W + outer.u - drag_acceleration(vehicle, -estimate.v_W) + gravity_W
        force_W = limited_force(wanted, available, vehicle, parameters, steady_W)

        # Thrust axis and heading, and how far the body is from them.
        if six_inputs:
            axis_W, direct = Vec3(0.0, 0.0, 1.0), Vec3(wanted.x, wanted.y, 0.0)
            given = Vec3(outer.u.x, outer.u.y, force_W.z - wanted.z + outer.u.z)
        else:
            axis_W, direct = force_W, zeros()
            given = outer.u + force_W - wanted
        bandwidth = parameters.filter_bandwidth
        if spinning is None:
            turn = self.tracking.track(memory.reference, estimate, R_WB, axis_W, reference, bandwidth, dt)
        else:
            bandwidth = spinning.filter_bandwidth(bandwidth, outer)
            turn = spinning.track(self.tracking, memory.reference, R_WB, axis_W, bandwidth)

        # Attitude loop: torque.
        attitude = _attitude_error(
            turn.e,
            estimate.omega_B,
            turn.rate,
            turn.acceleration,
            inputs.prediction,
            gyroscopic_drift(vehicle, estimate.omega_B, inputs.residual_speed),
            Vec3(w0, w0, w0),
        )
        attitude_memory, inner = self.law.attitude(memory.attitude, attitude, parameters.law, dt)
        believed_now = wrench_of(vehicle, believed.stuck.thrust_of(inputs.expected_thrust, believed.loss))
        torque_B = self.tracking.ahead_of_lag(
            body_momentum(vehicle, inner.u + attitude.feed_forward), believed_now.torque_B, estimate.omega_B, w0
        )
        wrench = Wrench(vehicle.mass * force_W.z / maximum(R_WB.zz, parameters.cos_min), torque_B)
        relaxed_memory = memory.relaxed
        if spinning is not None:
            relaxed_memory, wrench = spinning.steer(wrench, believed_now, R_WB, inner.switching)

        own = CascadeSignals(
            attitude_demand=turn.demand,
            attitude_command=turn.command,
            virtual_position=given,
            virtual_attitude=inner.u,
            gain_position=outer.gain_e.diag,
            gain_velocity=outer.gain_rate.diag,
            gain_angle=inner.gain_e,
            gain_rate=inner.gain_rate,
        )
        output = ControlOutput(wrench, direct)
        recorded = [part for kind in self.law.records for part in _law_signals(kind, outer, inner)]
        after = CascadeMemory(position_memory, attitude_memory, turn.after, relaxed_memory)
        return after, output, self._record(*own, *recorded)


def _law_signals(kind: type[Record], position: LawOutput, attitude: LawOutput) -> Record:
    """What a law has of one sort of signals."""
    if kind is SlidingSignals:
        sigma, turn = position.sigma, attitude.sigma
        outside = [*position.outside, *attitude.outside]
        return SlidingSignals(
            sigma_position=sigma,
            sigma_attitude=turn,
            outside_layer_position=position.outside,
            outside_layer_attitude=attitude.outside,
            outside_layer=any_of(outside),
            lyapunov=(sigma.dot(sigma) + turn.dot(turn)) * 0.5,
        )
    return RiccatiSignals(attitude.riccati_residual, attitude.riccati_guarded)


def _position_error(
    estimate: Estimate, reference: Reference, prediction: Prediction, actuator: Vec3
) -> TrackingError:
    return TrackingError(
        e=estimate.p_W - reference.p_W,
        e_dot=estimate.v_W - reference.v_W,
        rate=estimate.v_W,
        predicted=prediction.delta_v_W,
        feed_forward=reference.a_W,
        drift=Mat3.diagonal(zeros()),
        actuator=actuator,
    )


def _attitude_error(
    e: Vec3,
    omega_B: Vec3,
    rate: Vec3,
    acceleration: Vec3,
    prediction: Prediction,
    drift: Mat3,
    actuator: Vec3,
) -> TrackingError:
    return TrackingError(
        e=e,
        e_dot=omega_B - rate,
        rate=omega_B,
        predicted=prediction.delta_omega_B,
        feed_forward=acceleration - drift @ rate,
        drift=drift,
        actuator=actuator,
    )


class CascadeKind:
    """A registered law with the cascade around it: call it with its settings to get the controller.

    Parameters
    ----------
    name : str
        Of the law.
    law : type of Law
    """

    def __init__(self, name: str, law: type[Law[Any]]) -> None:
        self.law = law
        self.__doc__ = law.__doc__
        self.slot = CONTROLLER
        self._settings: type[Strict] = create_model(
            f"{name.capitalize()}Controller",
            __base__=Strict,
            __doc__=f"Settings of the controller {name}.",
            law=(law.Settings, Field(default=law.Settings(), description="the control law")),
            cascade=(CascadeSettings, Field(default=CascadeSettings(), description=CascadeSettings.__doc__)),
        )
        self.Telemetry: type[Record] = joined(f"{name.capitalize()}Signals", CascadeSignals, *law.records)

    @property
    def Settings(self) -> type[Strict]:
        """Of the law and of the cascade."""
        return self._settings

    def __call__(self, settings: Any, /) -> Cascade:
        """Make the controller."""
        return Cascade(self.law(settings.law), settings.cascade, self.Telemetry)


def register_law(name: str, law: type[Law[Any]]) -> None:
    """Make a law available as a controller under a name, with the cascade around it."""
    CONTROLLER.registry.add(name, CascadeKind(name, law))
