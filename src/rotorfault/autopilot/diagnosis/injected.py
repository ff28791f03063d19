"""A diagnosis that somebody makes up: what a wrong belief costs.

It sees nothing, and says from a time on what its settings say, be it true or not: a rotor that is sound, a loss of
another size, a rotor that is stuck where it is not. Beside `off` on the same flights it shows whether acting on a
belief is survived less often than acting on none.
"""

from __future__ import annotations

from typing import ClassVar, NamedTuple, final

from pydantic import Field

from rotorfault.autopilot.diagnosis.protocol import Diagnoser, DiagnosisInputs
from rotorfault.base.config import Strict
from rotorfault.maths.geometry import PerRotor
from rotorfault.maths.scalar import Scalar, both, greater_equal, less
from rotorfault.model.block import Context, Record
from rotorfault.model.signals import Diagnosis, Stuck
from rotorfault.model.slot import register


class InjectedSettings(Strict):
    """What is believed, and when."""

    rotor: int = Field(default=1, ge=1, le=16, description="rotor that is believed to be at fault, from 1")
    loss: float = Field(default=0.3, ge=0.0, le=1.0, description="believed loss, if it is not believed stuck")
    stuck: float = Field(
        default=0.0, ge=0.0, description="thrust at which it is believed stuck, over that of hover; 0 for not stuck"
    )
    time: float = Field(default=1.0, ge=0.0, description="time from which on that is believed [s]")
    end: float = Field(default=1e6, gt=0.0, description="time from which on all rotors are believed sound again [s]")


class InjectedParameters(NamedTuple):
    """Numbers of the belief."""

    rotor: Scalar
    loss: Scalar
    stuck: Scalar
    time: Scalar  # s
    end: Scalar  # s


class InjectedMemory(NamedTuple):
    """What time it is."""

    time: Scalar  # s


@final
@register("injected")
class Injected(Diagnoser[InjectedMemory, InjectedParameters]):
    """A belief that is made up, right or wrong."""

    looks: ClassVar[bool] = False
    Settings = InjectedSettings

    def parameters(self, context: Context) -> InjectedParameters:
        """The belief."""
        s = self.settings
        return InjectedParameters(float(s.rotor), s.loss, s.stuck, s.time, s.end)

    def initial(self, inputs: DiagnosisInputs, parameters: InjectedParameters) -> InjectedMemory:
        """The flight begins."""
        return InjectedMemory(0.0)

    def step(
        self, memory: InjectedMemory, inputs: DiagnosisInputs, parameters: InjectedParameters, dt: Scalar
    ) -> tuple[InjectedMemory, Diagnosis, Record]:
        """The belief, while it is time for it."""
        p, rotors, vehicle = parameters, inputs.vehicle.rotors, inputs.vehicle
        half = 0.5 * dt  # of a period: rounding of the sum must not cost one
        now = both(greater_equal(memory.time + half, p.time), less(memory.time + half, p.end))
        flagged = PerRotor.of(both(now, both(less(i + 0.5, p.rotor), less(p.rotor, i + 1.5))) for i in range(rotors))
        is_stuck = less(0.0, p.stuck)
        held = p.stuck * (vehicle.mass * vehicle.gravity / rotors)
        stuck = Stuck(flagged * is_stuck, flagged * (is_stuck * held))
        loss = flagged * (p.loss * (1.0 - is_stuck))
        diagnosis = Diagnosis(loss, flagged, loss, -(loss * inputs.expectation.thrust), stuck=stuck)
        return InjectedMemory(memory.time + dt), diagnosis, self.Telemetry()
