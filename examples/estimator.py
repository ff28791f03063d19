"""An estimator of your own: velocity from the accelerometer, corrected by its reading."""

from typing import Annotated, NamedTuple

from pydantic import Field

import rotorfault as rf
from rotorfault.autopilot.estimation.protocol import required
from rotorfault.maths.scalar import Scalar, exp

READ = "position", "velocity", "attitude", "rates", "specific_force"


class Bandwidth(NamedTuple):
    velocity: Scalar  # rad/s


class Memory(NamedTuple):
    v_W: rf.Vec3  # m/s


class Signals(NamedTuple):
    innovation: Annotated[
        rf.Vec3, rf.Quantity("m/s", "world: x forward, y left, z up", "velocity read less predicted")
    ]


class VelocityFilter(rf.Estimator[Memory, Bandwidth]):
    """Velocity predicted from specific force and corrected by its reading; all else as read."""

    class Settings(rf.Settings):
        bandwidth: float = Field(
            20.0, gt=0.0, description="of the correction; above it the accelerometer rules [rad/s]"
        )

    Telemetry = Signals

    def parameters(self, context):
        return Bandwidth(self.settings.bandwidth)

    def initial(self, inputs, parameters):
        return Memory(inputs.readings.velocity.value)

    def step(self, memory, inputs, parameters, dt):
        readings = [required(inputs.readings, name, "velocity filter").value for name in READ]
        position, velocity, attitude, rates, force = readings
        acceleration = attitude.matrix() @ force - rf.Vec3(0.0, 0.0, inputs.vehicle.gravity)
        predicted = memory.v_W + acceleration * dt
        innovation = velocity - predicted
        v_W = predicted + innovation * (1.0 - exp(-parameters.velocity * dt))
        return Memory(v_W), rf.Estimate(position, v_W, attitude, rates, force), Signals(innovation)
