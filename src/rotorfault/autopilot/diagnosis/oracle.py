"""Sources of diagnosis for studies: the truth, the truth some time ago, and none.

They bound what any diagnosis can be worth. The closed loop hands them the true losses; nothing else in the
autopilot can see those.
"""

from __future__ import annotations

from typing import NamedTuple, final

from pydantic import Field

from rotorfault.autopilot.diagnosis.protocol import DIAGNOSES, DiagnosisInputs
from rotorfault.base.config import Strict
from rotorfault.maths.scalar import Scalar, greater
from rotorfault.model.signals import Diagnosis, Measurement, healthy
from rotorfault.model.vehicle import Vehicle


class OracleSettings(Strict):
    """The truth at once."""

    threshold: float = Field(default=0.001, ge=0.0, lt=1.0, description="loss above which a rotor is flagged")


class DelayedSettings(OracleSettings):
    """The truth some time ago."""

    delay: float = Field(default=0.1, ge=0.0, description="age of the truth [s]")


class OracleParameters(NamedTuple):
    """Numbers of the oracle."""

    threshold: Scalar


class _Truth:
    """Shared by `Oracle` and `Delayed`: true losses above a threshold are believed."""

    settings: OracleSettings

    def parameters(self, vehicle: Vehicle, period: float) -> OracleParameters:
        """Numbers of the settings."""
        return OracleParameters(self.settings.threshold)

    def initial(self, measurement: Measurement, parameters: OracleParameters) -> tuple[()]:
        """Nothing to remember."""
        return ()

    def step(
        self, memory: tuple[()], inputs: DiagnosisInputs, parameters: OracleParameters
    ) -> tuple[tuple[()], Diagnosis]:
        """Believe what the closed loop says."""
        loss = inputs.true_loss
        flagged = loss.map(lambda x: greater(x, parameters.threshold))
        return memory, Diagnosis(
            loss=loss * flagged, flagged=flagged, estimate=loss, residual=-(loss * inputs.thrust)
        )


@DIAGNOSES.register("oracle")
@final
class Oracle(_Truth):
    """The true losses at once: the best that any diagnosis could do."""

    Settings = OracleSettings
    oracle_delay = 0.0

    def __init__(self, settings: OracleSettings) -> None:
        self.settings = settings


@DIAGNOSES.register("delayed")
@final
class Delayed(_Truth):
    """The true losses some time ago: what a diagnosis of that delay would be worth."""

    Settings = DelayedSettings

    def __init__(self, settings: DelayedSettings) -> None:
        self.settings = settings
        self.oracle_delay = settings.delay


@DIAGNOSES.register("off")
@final
class Off:
    """No diagnosis: every rotor is believed sound."""

    class Settings(Strict):
        """Nothing to set."""

    oracle_delay = None

    def __init__(self, settings: Strict) -> None:
        self.settings = settings

    def parameters(self, vehicle: Vehicle, period: float) -> tuple[()]:
        """None."""
        return ()

    def initial(self, measurement: Measurement, parameters: tuple[()]) -> tuple[()]:
        """Nothing to remember."""
        return ()

    def step(self, memory: tuple[()], inputs: DiagnosisInputs, parameters: tuple[()]) -> tuple[tuple[()], Diagnosis]:
        """Blame nobody."""
        return memory, healthy()
