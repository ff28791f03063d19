r"""Generalised likelihood ratio: which rotor's loss, since when, beats wind and a wrong model.

The filter of `rotorfault.autopilot.diagnosis.fault_free` explains the motion by sound rotors, wind and a wrong model;
the windows of `rotorfault.autopilot.diagnosis.jumps` say how far the loss of a rotor stands out. A rotor is flagged
where that is by the threshold b for the wanted ``false_alarms`` per hour
(`rotorfault.autopilot.diagnosis.alarm_rate`), and no other rotor explains it nearly as well: with
:math:`\ln\Lambda_i = \tfrac12\max(z_i, 0)^2` and :math:`\ln A = \tfrac12b^2` in
`rotorfault.autopilot.diagnosis.verdict`.

A loss that is found becomes a state of the filter, which goes on to follow it. Windows go on to watch it: that it has
changed at once competes with new faults.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, NamedTuple, final

from pydantic import Field

from rotorfault.autopilot.diagnosis import (
    fault_free,
    following,
    jumps,
    slow_losses,
    standing,
    touch,
    turning_gusts,
    verdict,
)
from rotorfault.autopilot.diagnosis.alarm_rate import HOUR, windows_threshold
from rotorfault.autopilot.diagnosis.fault_free import LOSSES, ModelMemory, ModelParameters
from rotorfault.autopilot.diagnosis.following import FollowingMemory, FollowingParameters
from rotorfault.autopilot.diagnosis.kalman import Belief
from rotorfault.autopilot.diagnosis.model_settings import ModelSettings
from rotorfault.autopilot.diagnosis.protocol import Diagnoser, DiagnosisInputs
from rotorfault.base.config import Strict
from rotorfault.maths.geometry import PerRotor
from rotorfault.maths.scalar import Scalar, clip, maximum, select
from rotorfault.model.block import Context, Record
from rotorfault.model.signals import Diagnosis
from rotorfault.model.slot import register
from rotorfault.model.telemetry import NO_FRAME, Q


class GlrSettings(Strict):
    """What counts as a fault, how often a sound rotor may be blamed, and what is not known of the vehicle."""

    false_alarms: float = Field(default=0.1, gt=0.0, le=3600.0, description="false alarms per hour that are borne")
    least: float = Field(default=0.03, ge=0.0, lt=1.0, description="loss up to which a rotor counts as sound")
    drift: float = Field(
        default=0.5, ge=0.0, description="by which a believed loss may change, in a second [1/s^0.5]"
    )
    persistence: float = Field(
        default=0.008, ge=0.0, description="time at its threshold before a rotor is flagged [s]"
    )
    clear_persistence: float = Field(
        default=0.2, gt=0.0, description="time for which a flagged rotor must seem sound [s]"
    )
    model: ModelSettings = Field(default=ModelSettings(), description="what is not known of vehicle, air and sensors")

    @property
    def rates(self) -> tuple[float, float]:
        """Per hour: false alarms, and changes of a loss that is believed, one a second."""
        return self.false_alarms, HOUR


class GlrParameters(NamedTuple):
    """Numbers of the detector."""

    model: ModelParameters
    length: tuple[Scalar, ...]  # s: of the windows
    threshold: Scalar  # at which a rotor alone is flagged
    change: Scalar  # at which a believed loss is taken to have changed
    least: Scalar
    drift: Scalar  # 1/s
    persistence: Scalar  # s
    clear_persistence: Scalar  # s
    following: FollowingParameters


class GlrSignals(NamedTuple):
    """What the detector records."""

    probability: Annotated[PerRotor, Q("1", NO_FRAME, "probability that a rotor is at fault")]
    statistic: Annotated[PerRotor, Q("1", NO_FRAME, "standard deviations by which its loss stands out")]
    among: Annotated[PerRotor, Q("1", NO_FRAME, "1 for the fewest rotors of which one is surely at fault")]
    stuck: Annotated[PerRotor, Q("1", NO_FRAME, "probability that a flagged rotor does not follow its command")]
    stuck_thrust: Annotated[PerRotor, Q("N", NO_FRAME, "what a rotor gives that is believed not to follow; else 0")]
    level: Annotated[Scalar, Q("1", NO_FRAME, "standard deviations at which one rotor alone is flagged")]
    gusts: Annotated[Scalar, Q("1", NO_FRAME, "density of the torque by gusts, over that of the strongest expected")]


class GlrMemory(NamedTuple):
    """Filter, windows and flags."""

    model: ModelMemory
    windows: jumps.Windows
    slow: slow_losses.Slow
    verdict: verdict.VerdictMemory
    following: FollowingMemory


@final
@register("glr")
class Glr(Diagnoser[GlrMemory, GlrParameters]):
    """Likelihood ratios of losses against wind and model error, with a wanted rate of false alarms."""

    Settings = GlrSettings
    Telemetry = GlrSignals

    def parameters(self, context: Context) -> GlrParameters:
        """Spreads, windows and threshold."""
        s = self.settings
        length = jumps.lengths(context.period)
        rotors = context.vehicle.rotors
        threshold, change = (windows_threshold(rate, rotors, length, context.period) for rate in s.rates)
        return start(s, context, length, threshold, change)

    def initial(self, inputs: DiagnosisInputs, parameters: GlrParameters) -> GlrMemory:
        """Nothing is known yet."""
        return nothing_found(inputs, parameters)

    def step(
        self, memory: GlrMemory, inputs: DiagnosisInputs, parameters: GlrParameters, dt: Scalar
    ) -> tuple[GlrMemory, Diagnosis, Record]:
        """One sampling instant."""

        def evidence(windows: jumps.Windows, found: jumps.Best, flagged: PerRotor) -> PerRotor:
            return found.excess.map(lambda z: 0.5 * maximum(z, 0.0) * maximum(z, 0.0))

        level = parameters._replace(
            threshold=0.5 * parameters.threshold * parameters.threshold,
            change=0.5 * parameters.change * parameters.change,
        )
        after, diagnosis, signals = found_and_followed(memory, inputs, level, evidence, dt)
        return after, diagnosis, signals._replace(level=parameters.threshold)


def nothing_found(inputs: DiagnosisInputs, parameters: GlrParameters) -> GlrMemory:
    """Before the first instant.

    Parameters
    ----------
    inputs : DiagnosisInputs
    parameters : GlrParameters
    """
    model, rotors = fault_free.at_start(inputs, parameters.model), inputs.vehicle.rotors
    windows, slow = jumps.nothing_seen(len(model.belief.mean), rotors), slow_losses.at_start(model.belief)
    return GlrMemory(model, windows, slow, verdict.nobody(rotors), following.all_follow(inputs.vehicle))


def start(
    settings: GlrSettings, context: Context, length: tuple[float, ...], threshold: float, change: float
) -> GlrParameters:
    """Numbers of the settings.

    Parameters
    ----------
    settings : GlrSettings
    context : Context
        With the believed vehicle and sensors.
    length : tuple of float, s
        Of the windows.
    threshold : float
        At which a rotor alone is flagged.
    change : float
        At which a believed loss is taken to have changed.
    """
    s, model = settings, fault_free.model_parameters(settings.model, context)
    shares = (s.model.mass, s.model.bandwidth)
    read = standing.standing_parameters(context, s.false_alarms, shares, s.persistence, s.clear_persistence)
    model = model._replace(standing=read)
    stuck = following.following_parameters(context, model, s.drift**2)
    times = s.persistence, s.clear_persistence
    return GlrParameters(model, length, threshold, change, s.least, s.drift**2, *times, stuck)


def found_and_followed(
    memory: GlrMemory,
    inputs: DiagnosisInputs,
    parameters: GlrParameters,
    evidence: Callable[[jumps.Windows, jumps.Best, PerRotor], PerRotor],
    dt: Scalar,
) -> tuple[GlrMemory, Diagnosis, GlrSignals]:
    """One sampling instant of a detector that watches windows.

    Parameters
    ----------
    memory : GlrMemory
    inputs : DiagnosisInputs
    parameters : GlrParameters
        With the evidence at which a rotor alone is flagged as the threshold.
    evidence : callable
        Logarithm of the likelihood ratio of a fault of each rotor, from what windows say; of a change, where it is
        flagged.
    dt : scalar, s
        Sampling period.
    """
    p, flagged = parameters, memory.verdict.flagged
    model, step = fault_free.advance(memory.model, inputs, p.model, flagged * p.drift, memory.following.stands, dt)
    windows = jumps.watch(memory.windows, p.length, step, dt)
    slow = slow_losses.watch(memory.slow, model.belief, p.model, dt)
    looked = windows + slow_losses.windows(slow, model.belief, p.model, inputs.vehicle)
    found = jumps.best(looked, p.least, flagged)
    fresh = verdict.probabilities(evidence(looked, found, flagged), p.threshold, flagged, p.change)
    fresh = fresh * touch.rather_lost(found.loss, found.felt)
    turns = model.standing if isinstance(model.standing, standing.Standing) else None
    if turns is not None:
        fresh = fresh * (1.0 - turns.doubt)
    flags, new = verdict.newly(memory.verdict, fresh, p.persistence, dt)
    fresh = fresh.map(lambda x, on: select(on, 0.0, x), flagged)
    new = new * (1.0 - flagged)  # the filter follows a change by itself
    belief = jumps.believe(model.belief, looked, found, new)
    windows = jumps.begun_anew(windows, 1.0 - (new.sum() if turns is None else maximum(new.sum(), step.begun)))
    flags, diagnosis, belief = conclude(flags, belief, new, fresh, found, inputs, p, dt)
    any_flag = flags.flagged.reduce(maximum)
    slow = slow_losses.begun_anew(slow, belief, any_flag)
    model = model._replace(gusts=turning_gusts.beside_a_loss(model.gusts, any_flag))
    judged, stuck, stands = following.follows(memory.following, belief, flags.flagged, inputs, p.following, dt)
    diagnosis = diagnosis._replace(stuck=stuck)
    if turns is not None:
        diagnosis = standing.told(diagnosis, turns, inputs.expectation.thrust, inputs.vehicle)
        stands = standing.stands(stands, turns)
    after = GlrMemory(model._replace(belief=belief), windows, slow, flags, judged)
    among = verdict.fewest(fresh).map(maximum, flags.flagged)
    held = diagnosis.stuck.thrust
    shown = diagnosis.probability, found.excess, among, stands, held, p.threshold, model.gusts.share
    return after, diagnosis, GlrSignals(*shown)


def conclude(
    memory: verdict.VerdictMemory,
    belief: Belief,
    new: PerRotor,
    fresh: PerRotor,
    found: jumps.Best,
    inputs: DiagnosisInputs,
    parameters: GlrParameters,
    dt: Scalar,
) -> tuple[verdict.VerdictMemory, Diagnosis, Belief]:
    """Flags, the diagnosis that they make, and the filter's state without the losses of those taken back.

    Parameters
    ----------
    memory : VerdictMemory
    belief : Belief
        With new losses in it.
    new : PerRotor
        1 where a flag is raised now.
    fresh : PerRotor
        Probability of a new fault.
    found : Best
        What windows say of rotors that are not flagged.
    inputs : DiagnosisInputs
    parameters : GlrParameters
    dt : scalar, s
        Sampling period.
    """
    p, rotors = parameters, inputs.vehicle.rotors
    mean = PerRotor.of(belief.mean[LOSSES : LOSSES + rotors])
    variance = PerRotor.of(belief.of(LOSSES + i, LOSSES + i) for i in range(rotors))
    still = verdict.still_faulty(mean, variance, p.least)
    flags, cleared = verdict.held(memory, new, still, p.clear_persistence, dt)
    belief = forgotten(belief, cleared)
    flagged = flags.flagged
    estimate = flagged.map(lambda on, a, b: clip(on * a + (1.0 - on) * b, 0.0, 1.0), mean, found.loss)
    probability = flagged.map(lambda on, a, b: on * a + (1.0 - on) * b, still, fresh)
    residual = -(estimate * inputs.expectation.thrust)
    return flags, Diagnosis(estimate * flagged, flagged, estimate, residual, probability=probability), belief


def forgotten(belief: Belief, cleared: PerRotor) -> Belief:
    """A state without the losses of rotors that are sound again.

    Parameters
    ----------
    belief : Belief
    cleared : PerRotor
        1 for those.
    """
    n, count = len(belief.mean), len(cleared)
    kept: list[Scalar] = [1.0] * n
    for i, off in enumerate(cleared):
        kept[LOSSES + i] = 1.0 - off
    first = n - count
    mean = tuple(x * kept[i] if i >= first else x for i, x in enumerate(belief.mean))
    rows = []
    for i, row in enumerate(belief.covariance):
        line = []
        for k, value in enumerate(row):
            # The last states alone can be forgotten.
            both = [kept[j] for j in {i, i + k} if j >= first]
            for factor in both:
                value = value * factor
            line.append(value)
        rows.append(tuple(line))
    return Belief(mean, tuple(rows))
