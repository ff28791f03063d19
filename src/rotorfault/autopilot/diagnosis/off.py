"""No diagnosis."""

from __future__ import annotations

from typing import final

from rotorfault.autopilot.diagnosis.protocol import Diagnoser, DiagnosisInputs
from rotorfault.maths.scalar import Scalar
from rotorfault.model.block import Nothing, Record
from rotorfault.model.signals import Diagnosis, healthy
from rotorfault.model.slot import register


@final
@register("off")
class Off(Diagnoser[Nothing, Nothing]):
    """No diagnosis: every rotor is believed sound."""

    def step(
        self, memory: Nothing, inputs: DiagnosisInputs, parameters: Nothing, dt: Scalar
    ) -> tuple[Nothing, Diagnosis, Record]:
        """Blame nobody."""
        return memory, healthy(inputs.vehicle.rotors), Nothing()
