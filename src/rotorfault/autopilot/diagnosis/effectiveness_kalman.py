r"""A Kalman filter of the rotors' effectiveness, beside wind and a wrong model.

The states of `rotorfault.autopilot.diagnosis.fault_free`, with the losses among them from the start: random walks
by ``drift``, pulled back to 0 so that their spread stays ``spread`` where the motion says nothing of them
(:math:`\dot\lambda = -\frac{q}{2s^2}\lambda + \sqrt q\,n`). With more than four rotors the body shows no more than
four numbers at an instant; what it does not show stays at that spread, and a loss is shared out over the rotors that
may have it.

A rotor is flagged where :math:`z_i = (\hat\lambda_i - least)/\sqrt{P_{ii}}` crosses the threshold for the wanted
``false_alarms`` (`rotorfault.autopilot.diagnosis.alarm_rate.crossing_threshold`; the correlation time is taken as
`RESPONSE`, in which the filter follows a jump at the soonest), with the probabilities and the hysteresis of
`rotorfault.autopilot.diagnosis.verdict`.
"""

from __future__ import annotations

from typing import NamedTuple, final

from pydantic import Field

from rotorfault.autopilot.diagnosis import fault_free, following, standing, verdict
from rotorfault.autopilot.diagnosis.alarm_rate import crossing_threshold
from rotorfault.autopilot.diagnosis.fault_free import LOSSES, ModelMemory
from rotorfault.autopilot.diagnosis.following import FollowingMemory
from rotorfault.autopilot.diagnosis.glr import GlrParameters, GlrSettings, GlrSignals, start
from rotorfault.autopilot.diagnosis.protocol import Diagnoser, DiagnosisInputs
from rotorfault.maths.geometry import PerRotor
from rotorfault.maths.scalar import Scalar, clip, maximum, sqrt
from rotorfault.model.block import Context, Record
from rotorfault.model.signals import Diagnosis
from rotorfault.model.slot import register

RESPONSE = 0.01  # s: in which the filter follows a jump at the soonest: some instants of a fast gyroscope


class EffectivenessSettings(GlrSettings):
    """As of `glr`, and how far losses spread that nothing is known of."""

    drift: float = Field(default=0.05, gt=0.0, description="by which a loss may change, in a second [1/s^0.5]")
    spread: float = Field(
        default=0.3, gt=0.0, description="standard deviation of losses that the motion does not show"
    )


class EffectivenessParameters(NamedTuple):
    """Numbers of the detector."""

    common: GlrParameters
    pull: Scalar  # 1/s


class EffectivenessMemory(NamedTuple):
    """Filter and flags."""

    model: ModelMemory
    verdict: verdict.VerdictMemory
    following: FollowingMemory


@final
@register("effectiveness_kalman")
class EffectivenessKalman(Diagnoser[EffectivenessMemory, EffectivenessParameters]):
    """Kalman filter of losses, wind and model error, with a wanted rate of false alarms."""

    Settings = EffectivenessSettings
    Telemetry = GlrSignals

    def parameters(self, context: Context) -> EffectivenessParameters:
        """Spreads and threshold."""
        s = self.settings
        threshold = crossing_threshold(s.false_alarms, context.vehicle.rotors, max(RESPONSE, context.period))
        return EffectivenessParameters(start(s, context, (), threshold, threshold), 0.5 * s.drift**2 / s.spread**2)

    def initial(self, inputs: DiagnosisInputs, parameters: EffectivenessParameters) -> EffectivenessMemory:
        """Sound rotors, and nothing else known."""
        model = fault_free.at_start(inputs, parameters.common.model)
        rotors = inputs.vehicle.rotors
        return EffectivenessMemory(model, verdict.nobody(rotors), following.all_follow(inputs.vehicle))

    def step(
        self, memory: EffectivenessMemory, inputs: DiagnosisInputs, parameters: EffectivenessParameters, dt: Scalar
    ) -> tuple[EffectivenessMemory, Diagnosis, Record]:
        """One sampling instant."""
        p, rotors = parameters.common, inputs.vehicle.rotors
        none, flagged = PerRotor.all(0.0, rotors), memory.verdict.flagged
        drift = none + p.drift
        model, _ = fault_free.advance(
            memory.model, inputs, p.model, drift, memory.following.stands, dt, parameters.pull
        )
        mean = PerRotor.of(model.belief.mean[LOSSES : LOSSES + rotors])
        variance = PerRotor.of(model.belief.of(LOSSES + i, LOSSES + i) for i in range(rotors))
        excess = mean.map(lambda x, v: (x - p.least) / sqrt(maximum(v, fault_free.TINY)), variance)
        evidence = excess.map(lambda z: 0.5 * maximum(z, 0.0) * maximum(z, 0.0))
        fresh = verdict.probabilities(evidence, 0.5 * p.threshold * p.threshold, flagged)
        turns = model.standing if isinstance(model.standing, standing.Standing) else None
        if turns is not None:
            fresh = fresh * (1.0 - turns.doubt)
        flags, new = verdict.newly(memory.verdict, fresh, p.persistence, dt)
        still = verdict.still_faulty(mean, variance, p.least)
        flags, _ = verdict.held(flags, new, still, p.clear_persistence, dt)

        among = verdict.fewest(fresh).map(maximum, flags.flagged)
        estimate = mean.map(lambda x: clip(x, 0.0, 1.0))
        probability = flags.flagged.map(lambda on, a, b: on * a + (1.0 - on) * b, still, fresh)
        residual = -(estimate * inputs.expectation.thrust)
        judged, stuck, stands = following.follows(
            memory.following, model.belief, flags.flagged, inputs, p.following, dt
        )
        loss = estimate * flags.flagged
        diagnosis = Diagnosis(loss, flags.flagged, estimate, residual, stuck=stuck, probability=probability)
        if turns is not None:
            diagnosis = standing.told(diagnosis, turns, inputs.expectation.thrust, inputs.vehicle)
            stands = standing.stands(stands, turns)
        after, held = EffectivenessMemory(model, flags, judged), diagnosis.stuck.thrust
        shown = diagnosis.probability, excess, among, stands, held, p.threshold, model.gusts.share
        return after, diagnosis, GlrSignals(*shown)
