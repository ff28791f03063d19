"""Fly on as if nothing had been diagnosed; allocation and control know of it."""

from __future__ import annotations

from typing import final

from rotorfault.autopilot.instant import Decision
from rotorfault.autopilot.response.protocol import Response, ResponseInputs
from rotorfault.maths.scalar import Scalar
from rotorfault.model.block import Nothing, Record


@final
class FlyOn(Response[Nothing, Nothing]):
    """Fly on as the scenario says, whatever is diagnosed."""

    def step(
        self, memory: Nothing, inputs: ResponseInputs, parameters: Nothing, dt: Scalar
    ) -> tuple[Nothing, Decision, Record]:
        """The scenario's reference as it is."""
        return memory, Decision(inputs.reference, inputs.diagnosis), Nothing()
