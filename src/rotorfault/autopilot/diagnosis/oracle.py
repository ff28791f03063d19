"""Sources of diagnosis for studies: the truth, at once or some time ago.

They bound what any diagnosis can be worth. The closed loop tells them the true losses; nothing else in the autopilot
can see those.
"""

from __future__ import annotations

from typing import NamedTuple, final

from pydantic import Field

from rotorfault.autopilot.diagnosis.protocol import DiagnosisInputs, Oracle
from rotorfault.base.config import Strict
from rotorfault.maths.geometry import PerRotor
from rotorfault.maths.scalar import Scalar, greater
from rotorfault.model.block import Context, Nothing
from rotorfault.model.signals import Diagnosis
from rotorfault.model.slot import register


class PresentSettings(Strict):
    """The truth at once."""

    threshold: float = Field(default=0.001, ge=0.0, lt=1.0, description="loss above which a rotor is flagged")


class DelayedSettings(PresentSettings):
    """The truth some time ago."""

    delay: float = Field(default=0.1, ge=0.0, description="age of the truth [s]")


class PresentParameters(NamedTuple):
    """Numbers of the oracle."""

    threshold: Scalar


class DelayedParameters(NamedTuple):
    """Numbers of the late oracle."""

    threshold: Scalar
    delay: Scalar  # s


def believed(true_loss: PerRotor, thrust: PerRotor, threshold: Scalar) -> Diagnosis:
    """True losses above a threshold, taken as they are.

    Parameters
    ----------
    true_loss : PerRotor
        0 to 1.
    thrust : PerRotor, N
        Of sound rotors now.
    threshold : scalar
        Loss above which a rotor is flagged.
    """
    flagged = true_loss.map(lambda x: greater(x, threshold))
    return Diagnosis(loss=true_loss * flagged, flagged=flagged, estimate=true_loss, residual=-(true_loss * thrust))


@final
@register("oracle")
class Present(Oracle[Nothing, PresentParameters]):
    """The true losses at once: the best that any diagnosis could do."""

    Settings = PresentSettings

    def parameters(self, context: Context) -> PresentParameters:
        """The threshold."""
        return PresentParameters(self.settings.threshold)

    def age(self, parameters: PresentParameters) -> Scalar:
        """None."""
        return 0.0

    def told(self, true_loss: PerRotor, inputs: DiagnosisInputs, parameters: PresentParameters) -> Diagnosis:
        """The truth."""
        return believed(true_loss, inputs.expectation.thrust, parameters.threshold)


@final
@register("delayed")
class Delayed(Oracle[Nothing, DelayedParameters]):
    """The true losses some time ago: what a diagnosis of that delay would be worth."""

    Settings = DelayedSettings

    def parameters(self, context: Context) -> DelayedParameters:
        """Threshold and age of the truth."""
        return DelayedParameters(self.settings.threshold, self.settings.delay)

    def age(self, parameters: DelayedParameters) -> Scalar:
        """As set."""
        return parameters.delay

    def told(self, true_loss: PerRotor, inputs: DiagnosisInputs, parameters: DelayedParameters) -> Diagnosis:
        """What was true then."""
        return believed(true_loss, inputs.expectation.thrust, parameters.threshold)
