"""A wind of your own: a front that rises like half a cosine, the discrete gust of MIL-F-8785C, 3.7.1.3."""

import math
from typing import Annotated, NamedTuple

from pydantic import Field

import rotorfault as rf
from rotorfault.maths.scalar import Scalar, clip, cos


class Front(NamedTuple):
    velocity_W: rf.Vec3  # m/s
    start: Scalar  # s
    rise: Scalar  # s


class Signals(NamedTuple):
    share: Annotated[Scalar, rf.Quantity("1", "", "share of the front that has come")]


class GustFront(rf.Wind[rf.Nothing, Front]):
    """Still air, then a wind that rises smoothly and stays."""

    class Settings(rf.Settings):
        velocity_W: tuple[float, float, float] = Field(
            (5.0, 0.0, 0.0), description="velocity of the air at last [m/s]"
        )
        start: float = Field(0.5, ge=0.0, description="when it begins to rise [s]")
        rise: float = Field(1.0, gt=0.0, description="how long it rises [s]")

    Telemetry = Signals

    def parameters(self, context):
        return Front(rf.Vec3.of(self.settings.velocity_W), self.settings.start, self.settings.rise)

    def share(self, time, front):
        return 0.5 - 0.5 * cos(math.pi * clip((time - front.start) / front.rise, 0.0, 1.0))

    def at(self, time, memory, front):
        return rf.Air(front.velocity_W * self.share(time, front), rf.Vec3(0.0, 0.0, 0.0))

    def step(self, memory, inputs, front, dt):
        return memory, self.at(inputs.time, memory, front), Signals(self.share(inputs.time, front))
