"""Sensors of your own: motion capture with a rate of its own, all else ideal."""

from typing import Annotated, NamedTuple

from pydantic import Field

import rotorfault as rf
from rotorfault.maths.records import select_record
from rotorfault.maths.scalar import Scalar, greater_equal


class Numbers(NamedTuple):
    interval: Scalar  # s
    noise: Scalar  # m


class Memory(NamedTuple):
    p_W: rf.Vec3  # m, measured last
    age: Scalar  # s since then


class Signals(NamedTuple):
    age: Annotated[Scalar, rf.Quantity("s", "", "time since the position was measured")]


class MotionCapture(rf.Sensors[Memory, Numbers]):
    """Position at a rate of its own, held in between; velocity, attitude and rates as they are."""

    normals = 3

    class Settings(rf.Settings):
        rate: float = Field(100.0, gt=0.0, description="measurements of position per second [Hz]")
        noise: float = Field(0.001, ge=0.0, description="standard deviation of position [m]")

    Telemetry = Signals

    def parameters(self, context):
        return Numbers(1.0 / self.settings.rate, self.settings.noise)

    def initial(self, inputs, numbers):
        return Memory(inputs.state.p_W, numbers.interval)

    def step(self, memory, inputs, numbers, dt):
        state, age = inputs.state, memory.age + dt
        measured = Memory(state.p_W + rf.Vec3.of(inputs.normals) * numbers.noise, 0.0)
        due = greater_equal(age, numbers.interval - 1e-9)  # a sum of periods may fall short by rounding
        now = select_record(due, measured, Memory(memory.p_W, age))
        others = (state.v_W, state.q_WB, state.omega_B, inputs.specific_force_B)
        readings = rf.Readings(rf.Reading(now.p_W, age=now.age), *map(rf.Reading, others))
        return now, readings, Signals(now.age)
