"""An allocator of your own: the inverse for sound rotors, each command raised by what its rotor has lost."""

from typing import Annotated, NamedTuple

from pydantic import Field

import rotorfault as rf
from rotorfault.autopilot.allocation.accounting import account
from rotorfault.maths.scalar import Scalar, maximum
from rotorfault.model.mixer import nominal_inverse
from rotorfault.model.motion import limited


class Numbers(NamedTuple):
    least: Scalar  # 1


class Signals(NamedTuple):
    boost: Annotated[rf.PerRotor, rf.Quantity("1", "", "factor on the command of each rotor")]


class Boost(rf.Allocator[rf.Nothing, Numbers]):
    """Commands of sound rotors, each divided by the effectiveness that is believed to be left."""

    class Settings(rf.Settings):
        least: float = Field(0.3, gt=0.0, le=1.0, description="effectiveness below which no more is asked for [-]")

    Telemetry = Signals

    def parameters(self, context):
        return Numbers(self.settings.least)

    def step(self, memory, inputs, numbers, dt):
        wrench, diagnosis, vehicle, *_ = inputs
        boost = diagnosis.loss.map(lambda loss: 1.0 / maximum(1.0 - loss, numbers.least))
        thrust = nominal_inverse(vehicle, wrench)
        command = limited(vehicle, thrust.map(lambda f, b: f * b, boost) / vehicle.rotor_gain)
        return memory, account(vehicle, wrench, diagnosis, command), Signals(boost)
