"""A fault of your own: a rotor that wears out, its loss approaching a limit exponentially."""

from typing import Annotated, NamedTuple

from pydantic import Field

import rotorfault as rf
from rotorfault.maths.scalar import Scalar, exp, maximum


class Wear(NamedTuple):
    start: Scalar  # s
    time_constant: Scalar  # s
    loss: Scalar  # 1


class Signals(NamedTuple):
    worn: Annotated[Scalar, rf.Quantity("1", "", "share of the final loss that has come")]


class WornRotor(rf.Fault[rf.Nothing, Wear]):
    """Loss of thrust of one rotor that grows as 1 - exp(-t / time_constant)."""

    class Settings(rf.OneRotor):
        start: float = Field(1.0, ge=0.0, description="when it begins [s]")
        time_constant: float = Field(0.5, gt=0.0, description="of the growth [s]")
        loss: float = Field(0.4, ge=0.0, le=1.0, description="share of the thrust lost at last [-]")

    Telemetry = Signals

    def parameters(self, context):
        return Wear(self.settings.start, self.settings.time_constant, self.settings.loss)

    def onset(self, wear):
        return wear.start

    def final_loss(self, wear):
        return wear.loss

    def worn(self, time, wear):
        return 1.0 - exp(-maximum(time - wear.start, 0.0) / wear.time_constant)

    def at(self, time, memory, wear):
        return rf.Effect(effectiveness=1.0 - wear.loss * self.worn(time, wear))

    def step(self, memory, inputs, wear, dt):
        return memory, self.at(inputs.time, memory, wear), Signals(self.worn(inputs.time, wear))
