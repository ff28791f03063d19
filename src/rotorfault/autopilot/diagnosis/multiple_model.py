r"""Multiple models: how probable the loss of each rotor is, whatever its size and its onset.

As `rotorfault.autopilot.diagnosis.glr`, with the same filter and the same onsets; but in place of the loss that
explains most, all losses count, by a normal distribution of the spread s about ``least``, and all onsets. With the
score
:math:`d' = d - least\,C` of an onset its likelihood ratio against a sound vehicle is

.. math:: \Lambda = \frac{1}{\sqrt{1 + s^2C}}\exp\frac{d'^2}{2(C + 1/s^2)} \quad\text{where } d' > 0, \text{ else }
          \frac{1}{\sqrt{1 + s^2C}}

and that of a rotor the sum over the onsets, each for as many as it stands for, :math:`R_i = \sum_k n_k\Lambda_{ik}`:
Shiryaev's and Roberts's statistic for each model "rotor i has been at fault since some time", all of which are
equally probable before. Wind, a shifted centre of mass, drag and a wrong model are states of every model.

Without a fault the sum of all R grows no faster than onsets do, on average, so the mean time to a false alarm at the
level A is at least A times that between two onsets, divided by the rotors
(`rotorfault.autopilot.diagnosis.alarm_rate.ratio_threshold`). That holds for whatever the filter's noise is, if it is
as believed.

Sources: A. N. Shiryaev, "On optimum methods in quickest detection problems", Theory Probab. Appl. 8, 1963;
S. W. Roberts, Technometrics 8, 1966; the models: H. A. P. Blom, Y. Bar-Shalom, IEEE Trans. Autom. Control 33, 1988,
here with one transition, from sound to faulty.
"""

from __future__ import annotations

from typing import NamedTuple, final

from pydantic import Field

from rotorfault.autopilot.diagnosis import jumps, verdict
from rotorfault.autopilot.diagnosis.alarm_rate import HOUR, ratio_threshold
from rotorfault.autopilot.diagnosis.glr import (
    GlrMemory,
    GlrParameters,
    GlrSettings,
    GlrSignals,
    found_and_followed,
    nothing_found,
    start,
)
from rotorfault.autopilot.diagnosis.kalman import Hypothesis
from rotorfault.autopilot.diagnosis.protocol import Diagnoser, DiagnosisInputs
from rotorfault.maths.geometry import PerRotor
from rotorfault.maths.scalar import Scalar, exp, log, maximum, select, sqrt
from rotorfault.model.block import Context, Record
from rotorfault.model.signals import Diagnosis
from rotorfault.model.slot import register


class MultipleModelSettings(GlrSettings):
    """As of `glr`, and how large losses are."""

    spread: float = Field(default=0.3, gt=0.0, description="standard deviation of losses, beyond `least`")


class MultipleModelParameters(NamedTuple):
    """Numbers of the detector."""

    common: GlrParameters
    precision: Scalar  # 1 over the variance of losses


@final
@register("multiple_model")
class MultipleModel(Diagnoser[GlrMemory, MultipleModelParameters]):
    """Posterior probabilities of each rotor's loss, of any size and onset, against wind and model error."""

    Settings = MultipleModelSettings
    Telemetry = GlrSignals

    def parameters(self, context: Context) -> MultipleModelParameters:
        """Spreads, windows and level."""
        s = self.settings
        length = jumps.lengths(context.period)
        level, change = (ratio_threshold(rate, context.vehicle.rotors * HOUR / length[0]) for rate in s.rates)
        return MultipleModelParameters(start(s, context, length, level, change), 1.0 / s.spread**2)

    def initial(self, inputs: DiagnosisInputs, parameters: MultipleModelParameters) -> GlrMemory:
        """Nothing is known yet."""
        return nothing_found(inputs, parameters.common)

    def step(
        self, memory: GlrMemory, inputs: DiagnosisInputs, parameters: MultipleModelParameters, dt: Scalar
    ) -> tuple[GlrMemory, Diagnosis, Record]:
        """One sampling instant."""
        p = parameters.common

        def evidence(windows: jumps.Windows, found: jumps.Best, flagged: PerRotor) -> PerRotor:
            return log_ratios(windows, p.least, parameters.precision, flagged)

        return found_and_followed(memory, inputs, p, evidence, dt)


def log_ratios(windows: jumps.Windows, least: Scalar, precision: Scalar, flagged: PerRotor | None = None) -> PerRotor:
    """Logarithm of R of each rotor.

    Parameters
    ----------
    windows : Windows
    least : scalar
        Loss that is nobody's fault.
    precision : scalar
        1 over the variance of losses.
    flagged : PerRotor, optional
        1 where a loss is believed already: the ratio is that of a change of it, of either sign; 0 if not given.
    """
    rotors = range(len(windows[0].rotors))
    found: list[Scalar] = []
    for i in rotors:
        on = 0.0 if flagged is None else flagged[i]
        terms = [_log_ratio(window.rotors[i], least, precision, on) for window in windows]
        most = terms[0][0]
        for size, _ in terms[1:]:
            most = maximum(most, size)
        total: Scalar = 0.0
        for k, (size, root) in enumerate(terms):
            onsets = 2.0 ** max(k - 1, 0)
            total = total + onsets * exp(maximum(size - most, -verdict.MOST)) * root
        found.append(most + log(total))
    return PerRotor.of(found)


def _log_ratio(hypothesis: Hypothesis, least: Scalar, precision: Scalar, flagged: Scalar) -> tuple[Scalar, Scalar]:
    """Exponent of the likelihood ratio, and the factor before it, squared below."""
    information = hypothesis.information
    score = select(flagged, hypothesis.score, maximum(hypothesis.score - least * information, 0.0))
    whole = information + precision
    return 0.5 * score * score / whole, root_of(precision / whole)


def root_of(x: Scalar) -> Scalar:
    """Square root of what is not below 0 but for rounding."""
    return sqrt(maximum(x, 0.0))
