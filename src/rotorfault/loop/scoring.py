r"""What a flight is worth, counted while it flies: every number of a flight comes from here and from nowhere else.

Pure functions on scalars, so that every engine counts alike, a batch of a hundred thousand flights needs no records,
and a flight has one set of numbers whatever of it is recorded and how finely.

- *Outcome*: ``diverged`` (a number of the true state, of the commands, of the cost or of what parts record of
  themselves is not finite, or it is further than 10 km away), ``tumbled`` (tilt beyond 90 degrees for half a second
  on end; at once in a model of the body that fails there) or ``ground``
  (crash: touched the ground faster than 1 m/s down or 0.5 m/s sideways, or tilted beyond 15 degrees, or sank into it
  by the length of its legs) end a flight; so does ``landed`` (touched it more gently than that in a landing, and
  stood there with rotors stopped for 0.5 s). It touches where the ground pushes it up with 1 % of its weight or more.
  A flight that lasts to its end is ``settled`` (constant reference, within 2 % of the step and 0.1 rad of yaw at the
  end), ``tracked`` (a reference that moves or turns, root mean square errors over the last half within 5 % of the
  reference's span on every axis and 0.1 rad of yaw) or ``offset`` (neither). It has *survived* unless it diverged,
  tumbled or crashed. A flight that somebody ended before is ``interrupted``.
- *Settling time* of an axis: from when on the error stays within 2 % of the step on this axis (of the largest step
  where an axis has none; of the span for a moving reference) to the end.
- *Recovery time*: from the first onset of a fault until the error stays within 0.25 m on each axis to the end.
- *Excursion*: largest distance from the reference from the first onset on; *altitude lost*: largest depth below it.
- *Command rate*: change of the commands in a sampling period, mean over rotors and flight, as a share of the thrust
  of a rotor in hover.
- *Attitude error*: rotation vector from the attitude that is level at the reference's yaw to the true one, in rad
  about body x, y, z; to first order these are roll, pitch and yaw error, and there is no angle at which it fails.
- *Yaw error*: angle from the reference's yaw to where the body x axis points, seen from above, the short way round.
- *Cost*: J = 1/2 int (e'Qe + u'Ru) dt with the printed weights (35), \|e\| floored at 0.01 m in both, e against the
  reference, u the torque given [N m] and the commanded acceleration less gravity and feed-forward [m/s^2], after
  limits. The same for every law and preset; a controller that does not record ``virtual_position`` has none.
- *Detection* of a rotor: from the onset of its first fault, which the scenario knows, to the first time from then on
  that its flag rises. Its losses are read 150 ms after the onset. A flag that rises on a rotor without a fault that
  has begun is a false alarm.
- *Landing*: speeds and tilt at the last instant in the air, and the horizontal distance from where the fault struck
  (after a false alarm: where the landing began) to where it touched down.

Nothing is counted once a flight is over, nor after a touch-down (but for numbers at the end), nor at an instant whose
numbers are not finite.
"""

from __future__ import annotations

import math
from typing import Any, final

from rotorfault.loop.cost import attitude_error, cost_rate, each, heading_error
from rotorfault.loop.landing import horizontal, landing_after, touching_now
from rotorfault.loop.scores import (
    COST_INPUT,
    FAR,
    READ_AFTER,
    RECOVERED,
    REST,
    SLIDE_MAX,
    SPEED_MAX,
    TILT_MAX,
    Detection,
    Landing,
    Scores,
    ScoringParameters,
)
from rotorfault.maths.geometry import PerRotor, Vec3, per_rotor, zeros
from rotorfault.maths.records import flatten, record_type, select_record
from rotorfault.maths.rotation import Quat
from rotorfault.maths.scalar import (
    Scalar,
    absolute,
    any_of,
    both,
    either,
    greater,
    greater_equal,
    is_condition,
    is_finite,
    less,
    less_equal,
    maximum,
    minimum,
    negated,
    select,
)
from rotorfault.model.telemetry import Signal
from rotorfault.plant.faults import since


@final
class Scoring:
    """Counts the scores of a flight.

    Parameters
    ----------
    ground : bool
        Whether there is ground, below which a flight is lost.
    lands : bool
        Whether the response to a fault may land.
    faulty : tuple of int
        Rotor of each fault, from 1.
    signals : tuple of Signal
        What is recorded; those with a score are counted.
    rotors : int
        Of the vehicle.
    upside_down : float
        For how long it may be tilted beyond 90 degrees in s, before it has tumbled.
    """

    def __init__(
        self,
        ground: bool,
        lands: bool = False,
        faulty: tuple[int, ...] = (),
        signals: tuple[Signal, ...] = (),
        rotors: int = 4,
        upside_down: float = 0.0,
    ) -> None:
        self.ground, self.lands, self.faulty, self.count_of_rotors = ground, lands, faulty, rotors
        self.upside_down = upside_down
        self.rotors = tuple(sorted(set(faulty)))
        self.counted = tuple(signal for signal in signals if signal.quantity.score is not None)
        self.has_cost = any(signal.name == COST_INPUT for signal in signals)
        self._counts = record_type("Counts", tuple(signal.name.replace(".", "_") for signal in self.counted))

    def initial(self) -> Scores:
        """Nothing counted."""
        none, never, each_rotor = zeros(), Vec3(-1.0, -1.0, -1.0), PerRotor.all(0.0, self.count_of_rotors)
        landing = Landing(-1.0, -1.0, -1.0, none, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0) if self.lands else ()
        return Scores(
            over=0.0, end=0.0, seen=0.0, last_outside=never, last_away=-1.0, late_square=none, late_yaw_square=0.0,
            yaw_error=0.0, position_square=none, attitude_square=none, position_error=none,
            attitude=Quat.identity(), velocity=none,
            cost=0.0, cost_first=0.0, cost_last=0.0, cosine_least=1.0, lowest=FAR, away=0.0, drop=0.0,
            variation=0.0, command=each_rotor, saturated=0.0, given_up=none, flags=each_rotor,
            false_alarms=0.0,
            touched=0.0, gentle=1.0, rest=0.0, inverted=0.0 if self.upside_down > 0.0 else (),
            detections=tuple(Detection(-1.0, 0.0, 0.0, 0.0, 0.0) for _ in self.rotors),
            landing=landing,
            signals=self._counts(*(0.0 for _ in self.counted)),
        )  # fmt: skip

    def step(
        self,
        scores: Scores,
        signals: Any,
        parameters: ScoringParameters,
        onsets: tuple[Scalar, ...],
        step: Scalar,
        time: Scalar,
        dt: Scalar,
    ) -> Scores:
        """Count one sampling instant.

        Parameters
        ----------
        scores : Scores
            Before it.
        signals : record
            Of this instant.
        parameters : ScoringParameters
            Numbers of the flight.
        onsets : tuple of scalar, s
            Time of the first effect of each fault.
        step : scalar
            Number of the instant, from 0.
        time : scalar, s
            Of the instant, since the start of the flight.
        dt : scalar, s
            Sampling period.
        """
        flying = less(scores.over, 0.5)
        cosine, begun = signals.quaternion.z_axis().z, self._begun(onsets, time)
        new = self._count(scores, signals, parameters, cosine, begun, onsets, step, time)
        numbers = _is_finite(signals, new)
        gentle, touched, rest = 1.0, 0.0, 0.0
        # Written as "not inside", so that NaN counts as outside.
        upright, inverted = greater(cosine, 0.0), scores.inverted
        if not isinstance(inverted, tuple):
            inverted = select(upright, 0.0, inverted + dt)
            upright = less(inverted, self.upside_down)
        standing: Scalar = 1.0
        if self.ground:
            stage = signals.landing_stage if self.lands else 0.0
            touching = touching_now(signals, parameters)
            descends = greater(stage, 0.5)
            gentle = both(
                less_equal(-signals.velocity.z, SPEED_MAX), less_equal(horizontal(signals.velocity), SLIDE_MAX)
            )
            # Contact may have braked it already: the instant before counts as well.
            soft = both(both(gentle, scores.gentle), greater_equal(cosine, math.cos(TILT_MAX)))
            above = greater_equal(signals.position.z, parameters.bottom)
            standing = both(above, negated(both(touching, negated(soft))))
            touched = either(scores.touched, both(descends, touching))
            resting = both(touching, greater(stage, 1.5))
            # Counted from the first instant at rest, which itself adds nothing.
            rest = select(resting, scores.rest + dt, 0.0)
        near = both(numbers, _within(signals.position, FAR))
        code = select(near, select(upright, select(standing, 0.0, 3.0), 2.0), 1.0)
        if self.ground:
            code = select(both(less(code, 0.5), greater_equal(rest, REST + dt - 1e-9)), 4.0, code)

        counted = both(flying, numbers)
        after = select_record(both(counted, negated(touched)), new, scores)
        if self.ground:
            # The end is told of all instants, also of those on the ground.
            error = signals.position - signals.position_reference
            ending = after._replace(
                position_error=error,
                yaw_error=heading_error(signals.quaternion, signals.yaw_reference),
                attitude=signals.quaternion,
                velocity=signals.velocity,
            )
            if self.lands:
                landing = landing_after(scores, signals, parameters, any_of(begun.values()), time)
                ending = ending._replace(landing=landing)
            after = select_record(counted, ending, after)
        return after._replace(
            over=select(flying, code, scores.over),
            end=select(both(flying, greater(code, 0.5)), step, scores.end),
            touched=select(flying, touched, scores.touched),
            gentle=gentle,
            rest=rest,
            inverted=inverted,
        )

    def _begun(self, onsets: tuple[Scalar, ...], time: Scalar) -> dict[int, Scalar]:
        """Whether a fault of each rotor that is hit has begun."""
        started = [since(time, onset) for onset in onsets]
        return {
            rotor: any_of(s for s, hit in zip(started, self.faulty, strict=True) if hit == rotor)
            for rotor in self.rotors
        }

    def onset(self, rotor: int, onsets: tuple[Scalar, ...]) -> Scalar:
        """Time of the first fault of a rotor in s."""
        first, *others = (onset for onset, hit in zip(onsets, self.faulty, strict=True) if hit == rotor)
        for other in others:
            first = minimum(first, other)
        return first

    def _count(
        self,
        scores: Scores,
        signals: Any,
        parameters: ScoringParameters,
        cosine: Scalar,
        begun: dict[int, Scalar],
        onsets: tuple[Scalar, ...],
        step: Scalar,
        time: Scalar,
    ) -> Scores:
        """The scores with this instant in them."""
        error = signals.position - signals.position_reference
        square = error.times(error)
        turn = attitude_error(signals.quaternion, signals.yaw_reference)
        yaw = heading_error(signals.quaternion, signals.yaw_reference)
        late = greater_equal(step, parameters.half)
        first = less(step, 0.5)
        command = signals.thrust_command
        changes = command.map(lambda new, old: absolute(new - old), scores.command)
        low, high = parameters.command_low, parameters.command_high
        at_limit = per_rotor(lambda c, a, b: either(less_equal(c, a), greater_equal(c, b)), command, low, high)
        raised = signals.fault_flag.map(lambda now, before: both(greater(now, 0.5), less(before, 0.5)), scores.flags)
        false = [
            both(rises, negated(begun[rotor])) if rotor in begun else rises
            for rotor, rises in enumerate(raised, start=1)
        ]
        rate = self._cost_rate(signals, error, turn) if self.has_cost else 0.0
        struck = any_of(begun.values())
        return scores._replace(
            seen=scores.seen + 1.0,
            last_outside=each(
                lambda old, e, band: select(less_equal(absolute(e), band), old, step),
                scores.last_outside, error, parameters.settle_band,
            ),
            last_away=select(_inside(error, RECOVERED), scores.last_away, step),
            late_square=each(lambda old, e: select(late, old + e, old), scores.late_square, square),
            late_yaw_square=select(late, scores.late_yaw_square + yaw * yaw, scores.late_yaw_square),
            yaw_error=yaw,
            position_square=scores.position_square + square,
            attitude_square=scores.attitude_square + turn.times(turn),
            position_error=error,
            attitude=signals.quaternion,
            velocity=signals.velocity,
            cost=scores.cost + rate,
            cost_first=select(first, rate, scores.cost_first),
            cost_last=rate,
            cosine_least=minimum(scores.cosine_least, cosine),
            lowest=minimum(scores.lowest, signals.position.z),
            away=select(struck, maximum(scores.away, square.sum()), scores.away),
            drop=select(struck, maximum(scores.drop, -error.z), scores.drop),
            variation=select(first, 0.0, scores.variation + changes.sum()),
            command=command,
            saturated=scores.saturated + at_limit.reduce(either),
            given_up=scores.given_up + signals.given_up,
            flags=signals.fault_flag,
            false_alarms=scores.false_alarms + sum(false[1:], false[0]),
            detections=tuple(
                self._detect(detection, rotor, signals, raised, begun, onsets, time)
                for detection, rotor in zip(scores.detections, self.rotors, strict=True)
            ),
            signals=self._counts(
                *(
                    self._signal(signal, old, signals, first)
                    for signal, old in zip(self.counted, scores.signals, strict=True)
                )
            ),
        )  # fmt: skip

    def _detect(
        self,
        detection: Detection,
        rotor: int,
        signals: Any,
        raised: PerRotor,
        begun: dict[int, Scalar],
        onsets: tuple[Scalar, ...],
        time: Scalar,
    ) -> Detection:
        """What is known of one rotor's detection after this instant."""
        rises, true, believed = ([*part][rotor - 1] for part in (raised, signals.loss_true, signals.loss_believed))
        d = detection
        reading = since(time, self.onset(rotor, onsets) + READ_AFTER)
        return Detection(
            time=select(both(both(rises, begun[rotor]), less(d.time, -0.5)), time, d.time),
            read=reading,
            loss_true=select(d.read, d.loss_true, true),
            loss_believed=select(d.read, d.loss_believed, believed),
            loss_error=maximum(d.loss_error, select(reading, absolute(believed - true), 0.0)),
        )

    @staticmethod
    def _cost_rate(signals: Any, error: Vec3, turn: Vec3) -> Scalar:
        """The cost's integrand at this instant."""
        return cost_rate(
            error,
            signals.velocity - signals.velocity_reference,
            turn,
            signals.body_rates,
            signals.parts.controller.virtual_position,
            signals.torque_demand - signals.torque_unallocated,
        )

    @staticmethod
    def _signal(signal: Signal, old: Scalar, signals: Any, first: Scalar) -> Scalar:
        """What is counted of one signal after this instant."""
        value = signals.parts if "." in signal.name else signals
        for name in signal.name.split("."):
            value = getattr(value, name)
        leaves = flatten(value)
        if signal.quantity.score == "fraction":
            return old + any_of(greater(leaf, 0.5) for leaf in leaves)
        largest = leaves[0]
        for leaf in leaves[1:]:
            largest = maximum(largest, leaf)
        return select(first, largest, maximum(old, largest))


def _is_finite(signals: Any, new: Scores) -> Scalar:
    """1 where every number of the true state, of commands, of the cost and of what parts tell of themselves is."""
    rows = flatten((signals.position, signals.velocity, signals.quaternion, signals.body_rates, signals.thrust))
    rows += flatten((signals.thrust_command, new.cost, signals.parts))
    # Of a condition it is known before the flight that it is.
    first, *others = [row for row in rows if not is_condition(row)]
    total = first
    for row in others:
        total = total + row  # infinite or NaN where any is
    return is_finite(total)


def _inside(v: Vec3, limit: float) -> Scalar:
    """1 where every component is within a limit, which counts as inside."""
    x, y, z = (less_equal(absolute(component), limit) for component in v)
    return both(both(x, y), z)


def _within(v: Vec3, limit: float) -> Scalar:
    return both(both(less(absolute(v.x), limit), less(absolute(v.y), limit)), less(absolute(v.z), limit))
