"""What a flight is worth, counted while it flies: outcome and numbers of `rotorfault.results.metrics` without its records.

A block like the others: pure functions on scalars, so that every engine counts alike and a batch of a hundred
thousand flights needs no records. The definitions are those of `rotorfault.results.metrics`, at every sampling instant; what
is not here (chattering, landings, the believed loss) needs the records.

Nothing is counted once a flight is over, nor after a touch-down, nor at an instant whose numbers are not finite.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple, final

import numpy as np
from numpy.typing import NDArray

from rotorfault.maths.geometry import PerRotor, Vec3, zeros
from rotorfault.maths.records import flatten, select_record
from rotorfault.maths.scalar import (
    Scalar,
    absolute,
    both,
    cos,
    either,
    greater,
    greater_equal,
    is_finite,
    less,
    less_equal,
    maximum,
    minimum,
    negated,
    select,
    sqrt,
    wrap_angle,
)
from rotorfault.model.telemetry import Signals

SETTLED = 0.02  # of the step
TRACKED = 0.05  # of the span
ERROR_FLOOR = 0.01  # m, in the cost's Q and R
FAR = 1e4  # m
SPEED_MAX = 1.0  # m/s, downwards at touch-down: as after a fall from 5 cm
SLIDE_MAX = 0.5  # m/s, horizontal
TILT_MAX = math.radians(15.0)
REST = 0.5  # s that a landed vehicle must stand with rotors stopped; then the flight is over
AT_LIMIT = 1e-9  # of the largest command: below it a difference from a limit is rounding

KINDS = ("flying", "diverged", "tumbled", "ground", "landed")
"""What the number `Scores.over` stands for."""


class ScoringParameters(NamedTuple):
    """Numbers that scoring needs of a flight."""

    settle_band: Vec3  # m: error within which an axis counts as settled
    track_band: Vec3  # m: root mean square error within which it counts as tracked
    half: Scalar  # number of the step with which the last half begins
    command_low: Scalar  # N: commands at or below count as saturated
    command_high: Scalar  # N: commands at or above do
    ground: Scalar  # m; unread without ground


def unjudged() -> ScoringParameters:
    """For a loop whose scores nobody reads."""
    return ScoringParameters(zeros(), zeros(), 0.0, 0.0, math.inf, 0.0)


class Scores(NamedTuple):
    """What has been counted so far."""

    over: Scalar  # index into `KINDS`; 0 while it flies
    end: Scalar  # number of the step at which it was over
    seen: Scalar  # instants counted
    last_outside: Vec3  # number of the last step outside the settling band, -1 before any
    late_square: Vec3  # m^2: sum of squared errors over the last half
    late_yaw_square: Scalar  # rad^2: the same of yaw
    position_square: Vec3  # m^2: sum of squared errors
    attitude_square: Vec3  # rad^2: the same against (0, 0, yaw reference)
    position_error: Vec3  # m, at the last instant
    attitude: Vec3  # rad, at the last instant
    velocity: Vec3  # m/s, at the last instant
    cost: Scalar  # sum of the cost's rate
    cost_first: Scalar  # its rate at the first instant
    cost_last: Scalar  # and at the last
    cosine_least: Scalar  # of the tilt
    attitude_most: Vec3  # rad, magnitudes
    lowest: Scalar  # m
    lowest_after: Scalar  # m: from the first true loss on
    variation: Scalar  # N: sum of changes of the commands
    command: PerRotor  # N, at the last instant
    saturated: Scalar  # instants with a command at a limit
    outside_layer: Scalar  # instants with an axis outside its boundary layer
    given_up: Vec3  # instants with tilt, thrust, yaw cut
    onset: PerRotor  # number of the step of the first true loss, -1 before
    detected: PerRotor  # number of the step of the first flag raised from then on, -1 before
    flags: PerRotor  # at the last instant
    false_alarms: Scalar
    riccati_residual: Scalar  # largest
    riccati_guarded: Scalar  # instants
    touched: Scalar  # 1 from the touch-down on
    gentle: Scalar  # whether the last instant was gentle enough for a touch-down
    rest: Scalar  # s at rest with rotors stopped


@final
class Scoring:
    """Counts the scores of a flight.

    Parameters
    ----------
    ground : bool
        Whether there is ground, below which a flight is lost.
    """

    def __init__(self, ground: bool) -> None:
        self.ground = ground

    def initial(self) -> Scores:
        """Nothing counted."""
        none, never = zeros(), Vec3(-1.0, -1.0, -1.0)
        return Scores(
            over=0.0, end=0.0, seen=0.0, last_outside=never, late_square=none, late_yaw_square=0.0,
            position_square=none, attitude_square=none, position_error=none, attitude=none, velocity=none, cost=0.0,
            cost_first=0.0, cost_last=0.0, cosine_least=1.0, attitude_most=none, lowest=FAR, lowest_after=FAR,
            variation=0.0, command=PerRotor.all(0.0), saturated=0.0, outside_layer=0.0, given_up=none,
            onset=PerRotor.all(-1.0), detected=PerRotor.all(-1.0), flags=PerRotor.all(0.0), false_alarms=0.0,
            riccati_residual=0.0, riccati_guarded=0.0, touched=0.0, gentle=1.0, rest=0.0,
        )  # fmt: skip

    def step(
        self, scores: Scores, signals: Signals, parameters: ScoringParameters, step: Scalar, dt: Scalar
    ) -> Scores:
        """Count one sampling instant.

        Parameters
        ----------
        scores : Scores
            Before it.
        signals : Signals
        parameters : ScoringParameters
        step : scalar
            Its number, from 0.
        dt : scalar, s
            The sampling period.
        """
        flying = less(scores.over, 0.5)
        numbers = _true_state_is_finite(signals)
        cosine = cos(signals.attitude.x) * cos(signals.attitude.y)
        gentle, touched, rest = 1.0, 0.0, 0.0
        # Written as "not inside", so that NaN counts as outside.
        upright = greater(cosine, 0.0)
        standing: Scalar = 1.0
        if self.ground:
            touching = negated(less_equal(signals.ground_force, 0.0))
            landing = greater(signals.landing_stage, 0.5)
            gentle = both(
                less_equal(-signals.velocity.z, SPEED_MAX), less_equal(_horizontal(signals.velocity), SLIDE_MAX)
            )
            # Contact may have braked it already: the instant before counts as well.
            soft = both(both(gentle, scores.gentle), greater_equal(cosine, math.cos(TILT_MAX)))
            above = greater_equal(signals.position.z, parameters.ground)
            standing = select(landing, negated(both(touching, negated(soft))), above)
            touched = either(scores.touched, both(landing, touching))
            resting = both(touching, greater(signals.landing_stage, 1.5))
            # Counted from the first instant at rest, which itself adds nothing.
            rest = select(resting, scores.rest + dt, 0.0)
        near = both(numbers, _within(signals.position, FAR))
        code = select(near, select(upright, select(standing, 0.0, 3.0), 2.0), 1.0)
        if self.ground:
            code = select(both(less(code, 0.5), greater_equal(rest, REST + dt - 1e-9)), 4.0, code)

        counted = both(flying, numbers)
        after = select_record(
            both(counted, negated(touched)), self._counted(scores, signals, parameters, cosine, step), scores
        )
        if self.ground:
            # The end is told of all instants, also of those on the ground.
            error = signals.position - signals.position_reference
            ending = after._replace(position_error=error, attitude=signals.attitude, velocity=signals.velocity)
            after = select_record(counted, ending, after)
        return after._replace(
            over=select(flying, code, scores.over),
            end=select(both(flying, greater(code, 0.5)), step, scores.end),
            touched=select(flying, touched, scores.touched),
            gentle=gentle,
            rest=rest,
        )

    def _counted(
        self, scores: Scores, signals: Signals, parameters: ScoringParameters, cosine: Scalar, step: Scalar
    ) -> Scores:
        """The scores with this instant in them."""
        error = signals.position - signals.position_reference
        square = error.times(error)
        turn = Vec3(signals.attitude.x, signals.attitude.y, signals.attitude.z - signals.yaw_reference).map(
            wrap_angle
        )
        late = greater_equal(step, parameters.half)
        rate = cost_rate(signals, error, turn)
        first = less(step, 0.5)
        command = signals.thrust_command
        changes = command.map(lambda new, old: absolute(new - old), scores.command)
        at_limit = command.map(
            lambda c: either(less_equal(c, parameters.command_low), greater_equal(c, parameters.command_high))
        )
        raised = signals.fault_flag.map(lambda now, before: both(greater(now, 0.5), less(before, 0.5)), scores.flags)
        hit = signals.loss_true.map(lambda loss: greater(loss, 0.0))
        onset = scores.onset.map(lambda old, now: select(both(now, less(old, -0.5)), step, old), hit)
        detected = scores.detected.map(
            lambda old, rises, began: select(both(both(rises, greater(began, -0.5)), less(old, -0.5)), step, old),
            raised,
            onset,
        )
        false = raised.map(lambda rises, loss: both(rises, negated(loss)), hit)
        outside = [*signals.outside_layer_position, *signals.outside_layer_attitude]
        return scores._replace(
            seen=scores.seen + 1.0,
            last_outside=_each(
                lambda old, e, band: select(less_equal(absolute(e), band), old, step),
                scores.last_outside, error, parameters.settle_band,
            ),
            late_square=_each(lambda old, e: select(late, old + e, old), scores.late_square, square),
            late_yaw_square=select(late, scores.late_yaw_square + turn.z * turn.z, scores.late_yaw_square),
            position_square=scores.position_square + square,
            attitude_square=scores.attitude_square + turn.times(turn),
            position_error=error,
            attitude=signals.attitude,
            velocity=signals.velocity,
            cost=scores.cost + rate,
            cost_first=select(first, rate, scores.cost_first),
            cost_last=rate,
            cosine_least=minimum(scores.cosine_least, cosine),
            attitude_most=_each(lambda old, a: maximum(old, absolute(a)), scores.attitude_most, signals.attitude),
            lowest=minimum(scores.lowest, signals.position.z),
            lowest_after=select(
                onset.map(lambda began: greater(began, -0.5)).reduce(either),
                minimum(scores.lowest_after, signals.position.z), scores.lowest_after,
            ),
            variation=select(first, 0.0, scores.variation + changes.sum()),
            command=command,
            saturated=scores.saturated + at_limit.reduce(either),
            outside_layer=scores.outside_layer + _any(outside),
            given_up=scores.given_up + signals.given_up,
            onset=onset,
            detected=detected,
            flags=signals.fault_flag,
            false_alarms=scores.false_alarms + false.sum(),
            riccati_residual=maximum(scores.riccati_residual, signals.riccati_residual),
            riccati_guarded=scores.riccati_guarded + signals.riccati_guarded,
        )  # fmt: skip


def cost_rate(signals: Signals, error: Vec3, turn: Vec3) -> Scalar:
    """e'Qe + u'Ru of (19) with the printed weights (35), as `rotorfault.results.metrics` defines it.

    Parameters
    ----------
    signals : Signals
    error : Vec3, m
        Position less reference.
    turn : Vec3, rad
        Attitude less (0, 0, yaw reference), wrapped.
    """
    slope = signals.velocity - signals.velocity_reference
    torque = signals.torque_demand - signals.torque_unallocated
    size = error.map(lambda e: maximum(absolute(e), ERROR_FLOOR))
    # e^2 / max(|e|, floor), without the division.
    share = _each(
        lambda e, most: select(less_equal(absolute(e), ERROR_FLOOR), e * e * (1.0 / ERROR_FLOOR), most), error, size
    )
    push = size.times(signals.virtual_position)
    rates = signals.body_rates
    state = turn.dot(turn) + rates.dot(rates) + 0.3 * (share.x + share.y + share.z) + 0.005 * slope.dot(slope)
    effort = 0.0088 * torque.dot(torque) + push.dot(Vec3(0.2, 0.2, 0.4).times(push))
    return state + effort


def _true_state_is_finite(signals: Signals) -> Scalar:
    """1 where every number of the true state is finite."""
    rows = flatten((signals.position, signals.velocity, signals.attitude, signals.body_rates, signals.thrust))
    total = rows[0]
    for row in rows[1:]:
        total = total + row  # infinite or NaN where any is
    return is_finite(total)


def _within(v: Vec3, limit: float) -> Scalar:
    return both(both(less(absolute(v.x), limit), less(absolute(v.y), limit)), less(absolute(v.z), limit))


def _horizontal(v: Vec3) -> Scalar:
    return sqrt(v.x * v.x + v.y * v.y)


def _each(function: Any, *vectors: Vec3) -> Vec3:
    return Vec3.of(function(*components) for components in zip(*vectors, strict=True))


def _any(conditions: list[Scalar]) -> Scalar:
    found = conditions[0]
    for condition in conditions[1:]:
        found = either(found, condition)
    return found


def bands(reference: NDArray[np.float64], start: NDArray[np.float64], share: float) -> NDArray[np.float64]:
    """Half width per axis [m] within which an error counts as small.

    Parameters
    ----------
    reference : ndarray, shape (n, 3)
        Positions in m.
    start : ndarray, shape (..., 3)
        Where the flight begins, in m.
    share : float
        Of the step on this axis (of the largest where it has none), or of the span of a reference that moves.

    Returns
    -------
    ndarray, of the shape of `start`
    """
    span = np.ptp(reference, axis=0)
    size = np.abs(reference[0] - start) if (span == 0.0).all() else np.broadcast_to(span, np.shape(start))
    largest = size.max(axis=-1, keepdims=True)
    return np.asarray(share * np.where(size > 1e-9, size, np.where(largest > 1e-9, largest, 1.0)))
