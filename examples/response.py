"""A response of your own to faults: stay where the fault was confirmed, a little higher."""

from typing import Annotated, NamedTuple

from pydantic import Field

import rotorfault as rf
from rotorfault.maths.records import select_record
from rotorfault.maths.scalar import Scalar, either


class Climb(NamedTuple):
    height: Scalar  # m


class Memory(NamedTuple):
    p_W: rf.Vec3  # m, where to stay
    holding: Scalar  # 1 once a fault is confirmed


class Signals(NamedTuple):
    holding: Annotated[Scalar, rf.Quantity("1", "", "1 once a fault is confirmed, when the position is held")]


class Hold(rf.Response[Memory, Climb]):
    """Follow the reference until a fault is confirmed, then hold the position of that moment."""

    class Settings(rf.Settings):
        climb: float = Field(0.5, description="height above the position of that moment [m]")

    Telemetry = Signals

    def parameters(self, context):
        return Climb(self.settings.climb)

    def initial(self, inputs, climb):
        return Memory(inputs.estimate.p_W, 0.0)

    def step(self, memory, inputs, climb, dt):
        holding = either(memory.holding, inputs.diagnosis.flagged.reduce(either))
        here_W, still = inputs.estimate.p_W + rf.Vec3(0.0, 0.0, climb.height), rf.Vec3(0.0, 0.0, 0.0)
        p_W = select_record(memory.holding, memory.p_W, here_W)
        hold = rf.Reference(p_W, still, still, inputs.reference.yaw, 0.0, 0.0)
        flown = select_record(holding, hold, inputs.reference)
        return Memory(p_W, holding), rf.Decision(flown, inputs.diagnosis), Signals(holding)
