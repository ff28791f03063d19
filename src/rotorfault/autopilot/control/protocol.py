"""What a controller is: the interface that every control law and every user's controller keeps.

A *controller* turns estimate, reference and belief into a wrench, or into commands of the rotors. A *law* is smaller:
it turns the tracking error of three axes into three virtual accelerations; `rotorfault.autopilot.control.cascade`
makes a controller of it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Generic, NamedTuple

from rotorfault.autopilot.allocation.available import least_in_balance, thrust_available, thrusts_in_balance
from rotorfault.autopilot.control.relaxed import SpinWeights
from rotorfault.autopilot.instant import Instant
from rotorfault.autopilot.prediction import Prediction
from rotorfault.autopilot.presets import presets
from rotorfault.base.config import Strict
from rotorfault.base.one_line import record_line
from rotorfault.maths.geometry import Mat3, PerRotor, Vec3, zeros
from rotorfault.maths.scalar import Scalar
from rotorfault.model.block import Block, Context, MemoryT, Nothing, ParametersT, Record
from rotorfault.model.signals import Diagnosis, Estimate, Reference, Wrench
from rotorfault.model.slot import Slot
from rotorfault.model.telemetry import NO_FRAME, Q
from rotorfault.model.vehicle import Vehicle

Search = Mapping[str, tuple[float, float, float]]
"""Settings that may be searched, by dotted key: lowest, first and highest value, above 0."""


class ControlInputs(NamedTuple):
    """All that a controller may use at one sampling instant."""

    estimate: Estimate
    reference: Reference
    vehicle: Vehicle  # the autopilot's belief, not the truth
    diagnosis: Diagnosis  # what is believed of the rotors
    command: PerRotor  # N, sent at the last instant
    expected_thrust: PerRotor  # N: of sound rotors now; of the believed ones it is times 1 - loss
    prediction: Prediction
    residual_speed: Scalar | Vec3  # rad/s, believed overall residual rotor speed Omega of (4)
    thrust_available: Scalar  # N: largest total thrust of the believed rotors in balance
    thrust_with_yaw: Scalar = math.inf  # N: the same with yaw in balance, whatever the weight
    least_with_yaw: Scalar = 0.0  # N: the least total thrust with yaw in balance; more than 0 with a rotor stuck high

    def __repr__(self) -> str:
        return record_line(self)


class ControlOutput(NamedTuple):
    """What a controller asks for."""

    demand: Wrench | PerRotor  # a wrench for the allocation, or commands of the rotors in N
    # Unphysical: acts on x and y directly; zero but for the option `six_inputs`.
    direct_acceleration_W: Vec3 = zeros()  # m/s^2

    def __repr__(self) -> str:
        return record_line(self)


class Controller(Block[ControlInputs, ControlOutput, MemoryT, ParametersT]):
    """Turns estimate, reference and belief into a wrench, or into commands of the rotors.

    Signals named ``gain_position``, ``gain_velocity`` (Vec3), ``gain_angle`` and ``gain_rate`` (Mat3) are taken for
    the gains of u = -k1 e - k2 e_dot by the check of sampling; ``virtual_position`` (Vec3, m/s^2) is the commanded
    acceleration less gravity and feed-forward, without which a flight has no cost J.

    Attributes
    ----------
    search : mapping
        Settings that ``rotorfault tune`` may search, by dotted key: lowest, first and highest value, above 0.
    """

    search: ClassVar[Search] = {}


def _inputs(instant: Instant) -> ControlInputs:
    believed, spin = instant.decision.diagnosis, instant.decision.spin
    with_yaw = thrusts_in_balance(instant.vehicle, believed.loss, believed.stuck)[0]
    return ControlInputs(
        estimate=instant.estimate,
        reference=instant.decision.reference,
        vehicle=instant.vehicle,
        diagnosis=believed,
        command=instant.past.command.thrust,
        expected_thrust=instant.expectation.thrust,
        prediction=instant.prediction,
        residual_speed=instant.expectation.residual_speed,
        thrust_available=thrust_available(instant.vehicle, believed.loss, believed.stuck),
        # Who is to spin has none.
        thrust_with_yaw=with_yaw if isinstance(spin, tuple) else with_yaw * (1.0 - spin),
        least_with_yaw=least_in_balance(instant.vehicle, believed.loss, believed.stuck),
    )


CONTROLLER = Slot(
    "controller",
    Controller,
    "belief",
    "control law: from estimate and reference to a wrench",
    "controllers",
    default="roismc",
    presets=presets,
    inputs=_inputs,
)


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
    """Virtual accelerations of one group of axes, without feed-forward, and what a law has to say of them."""

    u: Vec3  # m/s^2 or rad/s^2
    gain_e: Mat3  # 1/s^2
    gain_rate: Mat3  # 1/s
    sigma: Vec3 = zeros()  # sliding variable; of laws that have one
    outside: Vec3 = zeros()  # 1 on axes outside the boundary layer
    riccati_residual: Scalar = 0.0  # of laws that solve a Riccati equation
    riccati_guarded: Scalar = 0.0  # 1 where the guaranteed gain was flown
    switching: Vec3 = zeros()  # m/s^2 or rad/s^2: the part of u that is not the nominal law's; of laws that have one


class SlidingSignals(NamedTuple):
    """What sliding mode laws record."""

    sigma_position: Annotated[Vec3, Q("m/s", "world: x forward, y left, z up", "sliding variable, times its weight")]
    sigma_attitude: Annotated[
        Vec3, Q("rad/s", "roll, pitch, yaw of body in world", "sliding variable, times its weight")
    ]
    outside_layer_position: Annotated[
        Vec3, Q("1", "world: x forward, y left, z up", "1 on axes outside the boundary layer")
    ]
    outside_layer_attitude: Annotated[
        Vec3, Q("1", "roll, pitch, yaw of body in world", "1 on axes outside the boundary layer")
    ]
    outside_layer: Annotated[Scalar, Q("1", NO_FRAME, "1 where any axis is outside its boundary layer", "fraction")]
    lyapunov: Annotated[Scalar, Q("1", NO_FRAME, "V = sigma^T sigma / 2 over all six axes")]


class RiccatiSignals(NamedTuple):
    """What laws record that solve a Riccati equation in flight."""

    riccati_residual: Annotated[
        Scalar, Q("1", NO_FRAME, "relative residual of the attitude Riccati equation", "largest")
    ]
    riccati_guarded: Annotated[Scalar, Q("1", NO_FRAME, "1 where the guaranteed gain was flown", "fraction")]


class LawMemory(NamedTuple):
    """Memory of a law: that of the position axes and that of the attitude axes."""

    position: Any
    attitude: Any


class Law(Generic[ParametersT]):
    """Six double integrators' control law, position and attitude axes as two groups of three.

    Attributes
    ----------
    Settings : type of Strict
        What a user may choose.
    records : tuple of types of NamedTuple
        `SlidingSignals` and `RiccatiSignals`, for laws that have such quantities.
    """

    Settings: ClassVar[type[Strict]]
    records: ClassVar[tuple[type[Record], ...]] = ()

    def __init__(self, settings: Any) -> None:
        self.settings = settings

    def parameters(self, context: Context) -> ParametersT:
        """Numbers of the law as a record."""
        raise NotImplementedError

    def initial(self, position: TrackingError, attitude: TrackingError, parameters: ParametersT) -> LawMemory:
        """Memory before the first step."""
        return LawMemory(Nothing(), Nothing())

    def spin_weights(self, parameters: ParametersT) -> SpinWeights | None:
        """Weights with which it steers a body that spins; None for a law that has none and stays upright."""
        return None

    def position(
        self, memory: Any, error: TrackingError, parameters: ParametersT, dt: Scalar
    ) -> tuple[Any, LawOutput]:
        """Virtual accelerations of x, y, z."""
        raise NotImplementedError

    def attitude(
        self, memory: Any, error: TrackingError, parameters: ParametersT, dt: Scalar
    ) -> tuple[Any, LawOutput]:
        """Virtual accelerations of roll, pitch, yaw."""
        raise NotImplementedError
