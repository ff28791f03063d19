"""A controller of your own: PD on the direction of the thrust. Flies on every engine."""

from typing import Annotated, NamedTuple

from pydantic import Field

import rotorfault as rf
from rotorfault.maths.scalar import Scalar, clip, maximum


class Gains(NamedTuple):
    position: Scalar  # 1/s^2
    velocity: Scalar  # 1/s
    angle: Scalar  # 1/s^2
    rate: Scalar  # 1/s


class Signals(NamedTuple):
    thrust_axis: Annotated[rf.Vec3, rf.Quantity("1", "world: x forward, y left, z up", "demanded thrust direction")]


class PdController(rf.Controller[rf.Nothing, Gains]):
    """PD on position and on the direction of the thrust; of faults only its allocation knows."""

    class Settings(rf.Settings):
        stiffness: float = Field(4.0, gt=0.0, description="acceleration per position error [1/s^2]")
        damping: float = Field(3.0, gt=0.0, description="acceleration per velocity error [1/s]")

    Telemetry = Signals
    search = {"stiffness": (1.0, 4.0, 20.0), "damping": (1.0, 3.0, 10.0)}

    def parameters(self, context):
        bandwidth = context.vehicle.rotor_bandwidth / 3.0  # of attitude; the rotors lag behind
        return Gains(self.settings.stiffness, self.settings.damping, bandwidth * bandwidth, 1.6 * bandwidth)

    def step(self, memory, inputs, gains, dt):
        now, target, vehicle = inputs.estimate, inputs.reference, inputs.vehicle
        error = (now.p_W - target.p_W).map(lambda e: clip(e, -1.0, 1.0))
        lift = target.a_W - error * gains.position - (now.v_W - target.v_W) * gains.velocity
        lift = rf.Vec3(clip(lift.x, -5.0, 5.0), clip(lift.y, -5.0, 5.0), maximum(lift.z + vehicle.gravity, 3.0))
        axis_B = now.q_WB.matrix().T @ (lift / lift.norm())  # (0, 0, 1) where the thrust points as it should
        tilt, yaw = rf.Vec3(-axis_B.y, axis_B.x, 0.0), now.q_WB.turned(-target.yaw).heading()
        turn = tilt * gains.angle - rf.Vec3(0.0, 0.0, yaw * 0.2 * gains.angle) - now.omega_B * gains.rate
        wrench = rf.Wrench(vehicle.mass * lift.dot(now.q_WB.z_axis()), turn.times(vehicle.inertia))
        return memory, rf.ControlOutput(wrench), Signals(lift / lift.norm())
