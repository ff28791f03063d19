"""A reference of your own: a circle, tabulated before the flight, so that NumPy may be used."""

import math
from typing import Annotated, NamedTuple

import numpy as np
from pydantic import Field

import rotorfault as rf
from rotorfault.maths.scalar import Scalar


class Signals(NamedTuple):
    angle: Annotated[Scalar, rf.Quantity("rad", "", "angle travelled on the circle")]


class Circle(rf.ReferenceSource):
    """A level circle at constant speed, looking along x."""

    class Settings(rf.Settings):
        radius: float = Field(1.0, ge=0.0, description="of the circle [m]")
        period: float = Field(6.0, gt=0.0, description="of a turn [s]")
        centre: tuple[float, float, float] = Field((0.0, 0.0, 5.0), description="x, y, z of its centre [m]")

    Telemetry = Signals

    def angle(self, times):
        return 2.0 * math.pi * times / self.settings.period

    def table(self, times):
        angle, rate = self.angle(times), 2.0 * math.pi / self.settings.period
        out = self.settings.radius * np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=-1)
        along = self.settings.radius * rate * np.stack([-np.sin(angle), np.cos(angle), 0.0 * angle], axis=-1)
        level = np.zeros_like(times)
        return rf.ReferenceTable(out + np.array(self.settings.centre), along, -rate * rate * out, level, level, level)

    def signals(self, times):
        return Signals(self.angle(times))
