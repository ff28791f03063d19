"""Give yaw up at once: fly on, but spinning, from the first confirmed fault."""

from __future__ import annotations

from typing import NamedTuple, final

from pydantic import Field

from rotorfault.autopilot.instant import Decision
from rotorfault.autopilot.response.protocol import Response, ResponseInputs
from rotorfault.base.config import Strict
from rotorfault.maths.scalar import Scalar, both, either, greater_equal, negated, select
from rotorfault.model.block import Context, Nothing, Record


class SpinParameters(NamedTuple):
    """Numbers of the response."""

    confirmation: Scalar  # s


class SpinMemory(NamedTuple):
    """Whether it spins."""

    flagged: Scalar  # s: for how long a fault has been declared
    spinning: Scalar  # 1 from the confirmation on


@final
class Spin(Response[SpinMemory, SpinParameters]):
    """Fly on as the scenario says, with yaw given up as soon as a fault is confirmed."""

    class Settings(Strict):
        """When it begins."""

        confirmation: float = Field(
            default=0.05, ge=0.0, description="time that a declared fault must stand before yaw is given up [s]"
        )

    def parameters(self, context: Context) -> SpinParameters:
        """The settings as a record."""
        return SpinParameters(self.settings.confirmation)

    def initial(self, inputs: ResponseInputs, parameters: SpinParameters) -> SpinMemory:
        """No fault seen yet."""
        return SpinMemory(0.0, 0.0)

    def step(
        self, memory: SpinMemory, inputs: ResponseInputs, parameters: SpinParameters, dt: Scalar
    ) -> tuple[SpinMemory, Decision, Record]:
        """The scenario's reference as it is, and whether to spin."""
        none = inputs.diagnosis.flagged.map(negated).reduce(both)
        flagged = select(none, 0.0, memory.flagged + dt)
        # Half a period to spare, so that rounding of the sum cannot cost a period.
        confirmed = both(negated(none), greater_equal(flagged, parameters.confirmation - 0.5 * dt))
        spinning = either(memory.spinning, confirmed)
        decision = Decision(inputs.reference, inputs.diagnosis, spin=spinning)
        return SpinMemory(flagged, spinning), decision, Nothing()
