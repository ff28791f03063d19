r"""A rotor whose speed is not as commanded: is it the rotor that stands still, or its sensor?

`rotorfault.autopilot.diagnosis.speeds` gives the probability p that a rotor does not turn as commanded. If its speed
is right, it gives the thrust of that speed, :math:`\delta` beyond that of its command; if the sensor has failed, it
gives what it was told. The motion knows: the filter of the detector takes :math:`a\delta` into account, and its
innovations have then the mean of the input :math:`(p - a)\delta` if the speeds are right and :math:`-a\delta` if they
are not. With score d and information C of both (`rotorfault.autopilot.diagnosis.kalman.follow_hypothesis`)

.. math:: \ln\frac{P(speeds)}{P(commands)} = \big(d - \tfrac12C\big)_{speeds} - \big(d - \tfrac12C\big)_{commands},
          \qquad a = p\,P(speeds)

both equally probable before. So a frozen speed blames no rotor, and while it cannot be told, for the rotor gives much
the same either way, none has to be. A rotor for which :math:`p\,P(speeds)` has the level of
`rotorfault.autopilot.diagnosis.verdict` for ``persistence`` is flagged, and stuck at the thrust of its speed, low or
high; until then no other is flagged by the motion, which may show the same. What the filter has made of the thrust
that it did not know of is then taken back, :math:`\hat x \leftarrow \hat x + e`, with e of "speeds".

A rotor that has lost thrust turns as commanded: nothing here blames it, and it is not stuck, whatever the motion
makes of a thrust that hardly moves. Where no speeds come, or their sensor has failed, the motion alone decides that.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from rotorfault.autopilot.diagnosis import speeds, verdict
from rotorfault.autopilot.diagnosis.kalman import (
    Belief,
    Hypothesis,
    Innovation,
    Sparse,
    follow_hypothesis,
    learned_elsewhere,
)
from rotorfault.autopilot.diagnosis.protocol import DiagnosisInputs
from rotorfault.autopilot.diagnosis.speeds import SHARE, SpeedMemory, SpeedParameters
from rotorfault.autopilot.diagnosis.verdict import MOST, VerdictMemory
from rotorfault.autopilot.prediction import Expectation
from rotorfault.maths.geometry import PerRotor, per_rotor
from rotorfault.maths.scalar import Scalar, absolute, clip, exp, less, maximum, select
from rotorfault.model.block import Context
from rotorfault.model.signals import Diagnosis, Stuck
from rotorfault.model.vehicle import Vehicle, residual_speed

SMALL = 0.05  # of the greatest thrust: below it a share that is missing says nothing


class StandingParameters(NamedTuple):
    """Numbers of the sensor and of the verdict."""

    speeds: SpeedParameters
    persistence: Scalar  # s: time at its level before a rotor is flagged
    clear_persistence: Scalar  # s: time for which a flagged rotor must seem to follow


class Standing(NamedTuple):
    """What is remembered."""

    speeds: SpeedMemory
    measured: Hypothesis  # that rotors turn as measured
    commanded: Hypothesis  # that they turn as commanded, and their sensor has failed
    believed: Scalar  # probability of the former, where both differ
    verdict: VerdictMemory
    probability: PerRotor  # that a rotor stands still
    thrust: PerRotor  # N: what it gives then
    read: Scalar  # probability that speeds come, and are the rotors': then they alone say who stands still

    @property
    def doubt(self) -> Scalar:
        """Probability that a rotor stands still that is not flagged yet."""
        open_ = self.probability * (1.0 - self.verdict.flagged)
        return open_.reduce(maximum)


class Turning(NamedTuple):
    """The last period with the rotors as they are seen to turn."""

    expectation: Expectation
    beyond: PerRotor  # N: thrust of the measured speed beyond that of the command, where it is not as commanded
    used: PerRotor  # N: of it in the expectation
    away: PerRotor  # 1 where a rotor does not follow, nor change its speed
    noise: PerRotor  # N^2 s: density of the error of what is used

    def shaken(self, torque: Sequence[Scalar]) -> Scalar:
        """Variance of a rate times the period by that error, in rad^2/s.

        Parameters
        ----------
        torque : sequence of scalar, rad/s/N
            By which the rate changes over the period for a newton of each rotor.
        """
        return _weighted([x * x for x in torque], self.noise)


def standing_parameters(
    context: Context,
    false_alarms: float,
    shares: tuple[float, float],
    persistence: float,
    clear_persistence: float,
) -> StandingParameters | tuple[()]:
    """Numbers for a vehicle and its sensors; empty where no speeds are measured.

    Parameters
    ----------
    context : Context
        With the believed vehicle and sensors.
    false_alarms : float
        Per hour, that are borne.
    shares : (2,) float
        By which mass or battery, and a bandwidth, may be wrong.
    persistence, clear_persistence : float, s
        Before a rotor is flagged, and before a flag is taken back.
    """
    read = speeds.speed_parameters(context, false_alarms, *shares)
    return StandingParameters(read, persistence, clear_persistence) if isinstance(read, SpeedParameters) else ()


def all_turn(
    inputs: DiagnosisInputs, states: int, parameters: StandingParameters | tuple[()]
) -> Standing | tuple[()]:
    """Before the first instant; empty where no speeds are measured.

    Parameters
    ----------
    inputs : DiagnosisInputs
        Of the first instant.
    states : int
        Of the filter that knows the motion.
    parameters : StandingParameters
    """
    if not isinstance(parameters, StandingParameters):
        return ()
    read, n = speeds.unread(inputs, parameters.speeds), inputs.vehicle.rotors
    if not isinstance(read, SpeedMemory):
        return ()
    nothing, none = Hypothesis((0.0,) * states, 0.0, 0.0), PerRotor.all(0.0, n)
    return Standing(read, nothing, nothing, 0.5, verdict.nobody(n), none, none, 0.0)


def read(
    memory: Standing, inputs: DiagnosisInputs, belief: Belief, place: int, parameters: StandingParameters, dt: Scalar
) -> tuple[Standing, PerRotor, PerRotor, Belief]:
    """Read the speeds, for a filter that learns the bandwidth as well.

    Its state has the logarithm that is unknown to the speeds, over their standard deviation of it; what they tell is
    told to all of its states.

    Parameters
    ----------
    memory : Standing
    inputs : DiagnosisInputs
    belief : Belief
        Of the filter.
    place : int
        Of that logarithm in it.
    parameters : StandingParameters
    dt : scalar, s
        Sampling period.

    Returns
    -------
    memory : Standing
    unknown : PerRotor
        Share of what was not known of each lag at the start that still is not.
    told : PerRotor
        By how much the logarithm of each bandwidth has changed, with the filter's share of what is unknown.
    belief : Belief
        After what speeds tell.
    """
    was, p = memory.speeds, parameters.speeds
    seen, _ = speeds.read(was, inputs, p, dt)
    before, unknown = was.unknown_lag(p), seen.unknown_lag(p)
    over = 1.0 / before.sum()
    after = learned_elsewhere(belief, place, (seen.lag - was.lag).sum() * over, unknown.sum() * over, p.lag)
    told = seen.lag - was.lag + unknown * after.mean[place] - before * belief.mean[place]
    return memory._replace(speeds=seen), unknown, told, after


def turning(
    memory: Standing, expectation: Expectation, vehicle: Vehicle, parameters: StandingParameters
) -> tuple[Standing, Turning]:
    """What the speeds that were read say, before the motion is looked at.

    Parameters
    ----------
    memory : Standing
        With the speeds of this instant.
    expectation : Expectation
        Of sound rotors, with the lag that is learned.
    vehicle : Vehicle
        As believed.
    parameters : StandingParameters
    """
    e, p, seen = expectation, parameters.speeds, memory.speeds
    sound = PerRotor.of(y / (1.0 + r.mean[SHARE]) for y, r in zip(seen.still, seen.rotors, strict=True))
    given = per_rotor(lambda x, k: k * x * absolute(x), sound, vehicle.thrust_coefficient)
    away = seen.apart * memory.believed
    beyond = (given - e.thrust) * seen.apart
    used = beyond * memory.believed
    speed = e.speed + (sound - e.speed) * away
    turned = e._replace(
        thrust=e.thrust + used,
        mean_thrust=e.mean_thrust + used,
        speed=speed,
        residual_speed=residual_speed(vehicle, speed),
        sped=e.sped * (1.0 - away),
    )
    slope = per_rotor(lambda x, k: 2.0 * k * x, sound, vehicle.thrust_coefficient) * away
    noise = slope * slope * (p.variance * p.every) / seen.readings
    return memory._replace(thrust=given), Turning(turned, beyond, used, away, noise)


def decided(
    memory: Standing,
    turned: Turning,
    rows: Mapping[int, Sparse],
    seen: Sequence[tuple[Sparse, Innovation]],
    torque: Sequence[Sequence[Scalar]],
    force: Sequence[Scalar],
    parameters: StandingParameters,
    dt: Scalar,
) -> tuple[Standing, tuple[Scalar, ...], Scalar]:
    """After the motion was looked at.

    Parameters
    ----------
    memory : Standing
        From `turning`.
    turned : Turning
        Likewise.
    rows, seen
        What the filter did, as `follow_hypothesis` wants it; the rates are its first three states.
    torque : sequence of (3,) scalars, rad/s/N
        By which the rates change over the period for a newton of each rotor.
    force : sequence of scalar, 1/kg
        What a newton of each adds to the last of the measured numbers.
    parameters : StandingParameters
    dt : scalar, s
        Sampling period.

    Returns
    -------
    memory : Standing
    correction : tuple of scalar
        What the filter's state lacks; 0 but at the instant at which a rotor is flagged.
    begun : scalar
        1 at that instant.
    """

    def follow(hypothesis: Hypothesis, thrust: PerRotor) -> Hypothesis:
        added = {k: _weighted([column[k] for column in torque], thrust) for k in range(3)}
        return follow_hypothesis(hypothesis, rows, added, seen, _weighted(force, thrust))

    measured = follow(memory.measured, turned.beyond - turned.used)
    commanded = follow(memory.commanded, -turned.used)
    odds = (measured.score - 0.5 * measured.information) - (commanded.score - 0.5 * commanded.information)
    believed = 1.0 / (1.0 + exp(-clip(odds, -MOST, MOST)))
    probability = memory.speeds.apart * believed
    flags, new = verdict.newly(memory.verdict, probability, parameters.persistence, dt)
    begun = (new * (1.0 - memory.verdict.flagged)).reduce(maximum)
    flags, _ = verdict.held(flags, new, probability, parameters.clear_persistence, dt)
    correction = tuple(x * begun for x in measured.error)
    # Where all turn as commanded both say the same, and begin anew.
    kept = memory.speeds.apart.reduce(maximum)
    comes = less(memory.speeds.silent, parameters.speeds.every + 0.5 * dt)
    after = memory._replace(
        measured=_kept(measured, correction, kept),
        commanded=_kept(commanded, correction, kept),
        believed=believed,
        verdict=flags,
        probability=probability,
        read=comes * (1.0 - kept * (1.0 - believed)),
    )
    return after, correction, begun


def _weighted(factors: Sequence[Scalar], thrust: PerRotor) -> Scalar:
    total: Scalar = 0.0
    for factor, f in zip(factors, thrust, strict=True):
        total = total + factor * f
    return total


def _kept(hypothesis: Hypothesis, corrected: Sequence[Scalar], kept: Scalar) -> Hypothesis:
    """A hypothesis beside a state that has been corrected, or begun anew."""
    error = tuple((x - y) * kept for x, y in zip(hypothesis.error, corrected, strict=True))
    return Hypothesis(error, hypothesis.score * kept, hypothesis.information * kept)


def corrected(belief: Belief, correction: Sequence[Scalar]) -> Belief:
    """A state with what it lacks.

    Parameters
    ----------
    belief : Belief
    correction : sequence of scalar
        From `decided`.
    """
    return belief._replace(mean=tuple(x + y for x, y in zip(belief.mean, correction, strict=True)))


def told(diagnosis: Diagnosis, memory: Standing, thrust: PerRotor, vehicle: Vehicle) -> Diagnosis:
    """A diagnosis with the rotors that stand still in it.

    Parameters
    ----------
    diagnosis : Diagnosis
        Of the motion alone.
    memory : Standing
    thrust : PerRotor, N
        Of sound rotors, by their commands.
    vehicle : Vehicle
        As believed.
    """
    on = memory.verdict.flagged
    least = per_rotor(lambda gain, most: SMALL * gain * most, vehicle.rotor_gain, vehicle.thrust_max)
    missing = per_rotor(
        lambda given, f, low: clip(1.0 - given / maximum(f, low), 0.0, 1.0), memory.thrust, thrust, least
    )

    def of_it(mine: PerRotor, other: PerRotor) -> PerRotor:
        return on.map(select, mine, other)

    # The motion takes a rotor that has lost nearly all for one that gives nothing at any command.
    unread = less(memory.read, 0.5)
    moved = Stuck(diagnosis.stuck.rotor * unread, diagnosis.stuck.thrust * unread)
    stuck = Stuck(moved.rotor.map(maximum, on), of_it(memory.thrust, moved.thrust))
    return diagnosis._replace(
        loss=of_it(missing, diagnosis.loss),
        flagged=diagnosis.flagged.map(maximum, on),
        estimate=of_it(missing, diagnosis.estimate),
        stuck=stuck,
        probability=diagnosis.probability.map(maximum, memory.probability),
    )


def stands(probability: PerRotor, memory: Standing) -> PerRotor:
    """Probability that a rotor does not follow its command, by the motion and by speeds.

    Parameters
    ----------
    probability : PerRotor
        By the motion alone.
    memory : Standing
    """
    both: PerRotor = (probability * less(memory.read, 0.5)).map(maximum, memory.probability)
    return both
