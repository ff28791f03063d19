r"""Landing as the response to a confirmed fault.

``land`` replaces the scenario's reference, from the sampling instant at which a declared fault has stood for
``confirmation``, by one that starts at the measured position p, velocity v and yaw, so that nothing jumps, and obeys

.. math:: \dot p = v, \qquad \dot v = \frac{v_{goal} - v}{\max(T,\ |v_{goal} - v| / a_{max})}

with the horizontal goal 0: it brakes, exponentially once slow, and then holds that point. The vertical goal is
:math:`-w\,\max(0, 1 - |v_{xy}| / w)`: it sinks at the rate w as soon as the braking is over. The controller gets p, v
and this acceleration as reference.

A body that spins because its rotors cannot hold yaw sinks in the same way; its controller knows how. What it feels of
its own wobble and of noise is more, so there contact is suspected above ``spin_contact_share``.

The ground's height is not used; both signs of it come from measurements and from what the believed rotors give.

*Contact* is suspected while the reference sinks at w/2 or faster and an upward force that nothing explains,
low-passed over ``contact_filter``, exceeds ``contact_share`` of the weight: lost thrust cannot look like that. It is
answered in a way that a gust can undo. All thrusts are scaled by 1 - r, where the relief r goes to 1 with the time
constant ``relief`` while contact is suspected, and back to 0 otherwise: a vehicle that stands on one foot must not be
tilted by its own controller. And the belief about the rotors is held, for a diagnosis takes forces at the feet for
faults.

*Touch-down* is recognised when for ``persistence`` on end the reference sinks so, the measured vertical speed stays
within ``still_speed`` and the believed thrust below ``thrust_share`` of the weight. A vehicle in the air cannot do
both for long: without lift it falls. The rotors are then stopped for good.

Nothing here sees the plant: a false alarm lands the vehicle too, and a fault that is not diagnosed does not.
"""

from __future__ import annotations

from typing import Annotated, ClassVar, NamedTuple, final

from pydantic import Field

from rotorfault.autopilot.allocation.available import thrusts_in_balance
from rotorfault.autopilot.control.relaxed import yaw_given_up
from rotorfault.autopilot.instant import Decision
from rotorfault.autopilot.prediction import predict
from rotorfault.autopilot.response.protocol import Response, ResponseInputs
from rotorfault.base.config import Strict
from rotorfault.maths.geometry import PerRotor, Vec3, zeros
from rotorfault.maths.records import select_record
from rotorfault.maths.scalar import (
    Scalar,
    absolute,
    both,
    either,
    greater,
    greater_equal,
    less,
    maximum,
    negated,
    select,
    sqrt,
)
from rotorfault.model.block import Context, Record
from rotorfault.model.signals import Diagnosis, Reference, Stuck, following
from rotorfault.model.telemetry import NO_FRAME, Q

HOLD = 0.1  # relief above which the belief about the rotors is held: suspicion has then lasted a tenth of `relief`


class LandParameters(NamedTuple):
    """Numbers of a landing."""

    descent_rate: Scalar  # m/s
    braking: Scalar  # m/s^2
    time_constant: Scalar  # s
    confirmation: Scalar  # s
    contact_share: Scalar  # 1
    spin_contact_share: Scalar  # 1
    contact_filter: Scalar  # s
    relief: Scalar  # s
    still_speed: Scalar  # m/s
    thrust_share: Scalar  # 1
    persistence: Scalar  # s


class LandMemory(NamedTuple):
    """How far the landing is, and its reference."""

    flagged: Scalar  # s: for how long a fault has been declared
    landing: Scalar  # 1 from the confirmation on
    lift: Scalar  # m/s^2: unexplained upward acceleration, low-passed
    relief: Scalar  # 0 to 1
    loss: PerRotor  # believed last
    fault: PerRotor  # 1 where a fault was believed last
    stuck: Stuck  # believed last
    still: Scalar  # s: for how long it has looked like standing on the ground
    down: Scalar  # 1 from the touch-down on
    p_W: Vec3  # m
    v_W: Vec3  # m/s
    yaw: Scalar  # rad


class LandTelemetry(NamedTuple):
    """What a landing records of itself."""

    lift: Annotated[Scalar, Q("m/s^2", NO_FRAME, "upward acceleration that the believed model misses, low-passed")]
    relief: Annotated[Scalar, Q("1", NO_FRAME, "share of every thrust that is taken back")]


@final
class Land(Response[LandMemory, LandParameters]):
    """Brake, descend level to the ground at a gentle rate, recognise touch-down, stop the rotors."""

    lands: ClassVar[bool] = True

    class Settings(Strict):
        """How to come down, and when it counts as down."""

        descent_rate: float = Field(default=0.5, gt=0.0, description="speed of the descent w [m/s]")
        braking: float = Field(default=2.0, gt=0.0, description="largest acceleration of the reference [m/s^2]")
        time_constant: float = Field(default=0.5, gt=0.0, description="of the approach to the wanted velocity [s]")
        confirmation: float = Field(
            default=0.05, ge=0.0, description="time that a declared fault must stand before the landing begins [s]"
        )
        contact_share: float = Field(
            default=0.2, gt=0.0, description="upward force, as share of the weight, that is taken for the ground"
        )
        # Noise of 0.01 m/s is 1 m/s^2 behind this filter, and the wobble of a spin as much again: with a gust on top
        # they stay below it; a touch at 0.5 m/s gives 25 m/s^2 and more.
        spin_contact_share: float = Field(
            default=0.6, gt=0.0, description="the same of a body that spins, because yaw cannot be held"
        )
        contact_filter: float = Field(default=0.01, gt=0.0, description="time constant of its low-pass [s]")
        relief: float = Field(
            default=0.06, gt=0.0, description="time constant with which thrust is taken back on contact [s]"
        )
        still_speed: float = Field(
            default=0.1, gt=0.0, description="vertical speed below which it may stand on the ground [m/s]"
        )
        thrust_share: float = Field(
            default=0.7, gt=0.0, lt=1.0, description="share of the weight below which thrust does not carry it"
        )
        persistence: float = Field(default=0.3, gt=0.0, description="time that both must hold [s]")

    Telemetry = LandTelemetry

    def parameters(self, context: Context) -> LandParameters:
        """The settings as a record."""
        return LandParameters(*(getattr(self.settings, name) for name in LandParameters._fields))

    def initial(self, inputs: ResponseInputs, parameters: LandParameters) -> LandMemory:
        """No fault seen yet."""
        rotors = inputs.vehicle.rotors
        none = PerRotor.all(0.0, rotors)
        return LandMemory(
            0.0, 0.0, 0.0, 0.0, none, none, following(rotors), 0.0, 0.0, inputs.estimate.p_W, zeros(), 0.0
        )

    def _believed(self, memory: LandMemory, diagnosis: Diagnosis) -> Diagnosis:
        """The last belief on the ground, or on what may be the ground; else the new one."""
        hold = greater(memory.relief, HOLD)
        before = (memory.loss, memory.fault, memory.stuck)
        loss, flagged, stuck = select_record(hold, before, (diagnosis.loss, diagnosis.flagged, diagnosis.stuck))
        return diagnosis._replace(loss=loss, flagged=flagged, stuck=stuck)

    def step(
        self, memory: LandMemory, inputs: ResponseInputs, parameters: LandParameters, dt: Scalar
    ) -> tuple[LandMemory, Decision, Record]:
        """One sampling instant."""
        return self.decide(memory, inputs, parameters, 1.0, dt)

    def decide(
        self, memory: LandMemory, inputs: ResponseInputs, parameters: LandParameters, may: Scalar, dt: Scalar
    ) -> tuple[LandMemory, Decision, LandTelemetry]:
        """One sampling instant of a landing that only begins where it may.

        Parameters
        ----------
        memory : LandMemory
        inputs : ResponseInputs
        parameters : LandParameters
        may : scalar, 1 or 0
            Whether a landing may begin now; one that has begun goes on.
        dt : scalar, s
            Sampling period.
        """
        diagnosis = self._believed(memory, inputs.diagnosis)
        prediction = predict(inputs.expectation, diagnosis.loss, inputs.vehicle, diagnosis.stuck)
        unexplained = inputs.estimate.v_W.z - inputs.expectation.previous.v_W.z - prediction.delta_v_W.z
        thrust_now = diagnosis.stuck.thrust_of(inputs.expectation.thrust, diagnosis.loss).sum()
        p, seen = parameters, inputs.estimate
        # Times are compared with half a period to spare, so that rounding of the sums cannot cost a period.
        half = 0.5 * dt
        none = either(diagnosis.flagged.map(negated).reduce(both), negated(may))
        flagged = select(none, 0.0, memory.flagged + dt)
        begun = both(negated(memory.landing), both(negated(none), greater_equal(flagged, p.confirmation - half)))
        landing = either(memory.landing, begun)

        p_W, v_W = select_record(begun, (seen.p_W, seen.v_W), (memory.p_W, memory.v_W))
        yaw = select(begun, seen.q_WB.heading(), memory.yaw)

        # Contact: suspected, and answered.
        sinking = both(landing, less(v_W.z, -0.5 * p.descent_rate))
        lift = memory.lift + (unexplained - memory.lift * dt) / (p.contact_filter + dt)
        with_yaw, _ = thrusts_in_balance(inputs.vehicle, diagnosis.loss, diagnosis.stuck)
        spins = yaw_given_up(inputs.vehicle, with_yaw)
        share = p.contact_share + (p.spin_contact_share - p.contact_share) * spins
        contact = both(sinking, greater(lift, share * inputs.vehicle.gravity))
        relief = memory.relief + (contact - memory.relief) * (dt / (p.relief + dt))

        # Touch-down.
        weight = inputs.vehicle.mass * inputs.vehicle.gravity
        standing = both(less(absolute(seen.v_W.z), p.still_speed), less(thrust_now, p.thrust_share * weight))
        still = select(both(sinking, standing), memory.still + dt, 0.0)
        touched = both(negated(memory.down), greater_equal(still, p.persistence - half))
        down = either(memory.down, touched)

        # Reference. The small speed keeps the goal's slope finite at rest.
        drift = sqrt(v_W.x * v_W.x + v_W.y * v_W.y + 1e-18)
        goal_W = Vec3(0.0, 0.0, -p.descent_rate * maximum(1.0 - drift / p.descent_rate, 0.0))
        gap_W = goal_W - v_W
        a_W = gap_W / maximum(p.time_constant, gap_W.norm() / p.braking)
        # On the ground the reference stays where the vehicle stands.
        p_W, v_W, a_W = select_record(
            down,
            (select_record(touched, seen.p_W, p_W), zeros(), zeros()),
            (p_W, v_W, a_W),
        )
        wanted = Reference(p_W, v_W, a_W, yaw, 0.0, 0.0)
        p_next_W, v_next_W = select_record(
            landing, (p_W + v_W * dt + a_W * (0.5 * dt * dt), v_W + a_W * dt), (memory.p_W, memory.v_W)
        )
        relief = select(down, 1.0, relief)
        after = LandMemory(
            flagged,
            landing,
            lift,
            relief,
            diagnosis.loss,
            diagnosis.flagged,
            diagnosis.stuck,
            still,
            down,
            p_next_W,
            v_next_W,
            yaw,
        )
        reference = select_record(landing, wanted, inputs.reference)
        return after, Decision(reference, diagnosis, landing + down, relief), LandTelemetry(lift, relief)
