"""Your own controller as a block: written on scalars once, it flies in every engine.

    rotorfault fly paper-set-point --controller examples/block_controller.py:PdBlock

A block has three methods. `parameters` collects its numbers, `initial` its memory, `step` is one sampling instant:
pure, without `if` on values (use `rotorfault.maths.scalar.select`) and without state of its own. So the same source runs
on floats, on arrays and compiled. This one is a PD cascade: position error to tilt, tilt error to torque.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from rotorfault import ControlInputs, ControlOutput, Measurement, Reference, Vec3, Vehicle, Wrench, no_telemetry
from rotorfault.maths.scalar import Scalar, atan2, clip, cos, maximum, sin, wrap_angle


class Gains(NamedTuple):
    """Numbers of the controller; each may differ between the flights of a batch."""

    position: Scalar  # 1/s^2
    velocity: Scalar  # 1/s
    angle: Scalar  # 1/s^2
    rate: Scalar  # 1/s
    tilt_max: Scalar  # rad


class PdBlock:
    """A PD cascade without any answer to faults but the allocation's."""

    def parameters(self, vehicle: Vehicle, period: float) -> Gains:
        """Gains for a believed vehicle: the attitude loop takes a quarter of what the rotors can follow."""
        w = vehicle.rotor_bandwidth / 4.0
        return Gains(position=3.0, velocity=3.0, angle=w * w, rate=1.8 * w, tilt_max=0.6)

    def initial(self, measurement: Measurement, reference: Reference, parameters: Gains) -> tuple[()]:
        """No memory."""
        return ()

    def step(
        self, memory: tuple[()], inputs: ControlInputs, parameters: Gains, dt: Scalar
    ) -> tuple[Any, ControlOutput]:
        """Wrench for one sampling period."""
        g, seen, wanted, vehicle = parameters, inputs.measurement, inputs.reference, inputs.vehicle
        a_W = (
            wanted.a_W
            - (seen.p_W - wanted.p_W).map(lambda e: clip(e, -1.0, 1.0)) * g.position
            - (seen.v_W - wanted.v_W) * g.velocity
        )
        roll, pitch, yaw = seen.attitude
        lift = maximum(vehicle.gravity + a_W.z, 0.3 * vehicle.gravity)
        forward, left = cos(yaw) * a_W.x + sin(yaw) * a_W.y, cos(yaw) * a_W.y - sin(yaw) * a_W.x
        pitch_cmd = clip(atan2(forward, lift), -g.tilt_max, g.tilt_max)
        roll_cmd = clip(atan2(-left, lift), -g.tilt_max, g.tilt_max)
        gap = Vec3(roll - roll_cmd, pitch - pitch_cmd, wrap_angle(yaw - wanted.yaw))
        torque_B = (-(gap * g.angle) - seen.omega_B * g.rate).times(vehicle.inertia)
        thrust = vehicle.mass * lift / maximum(cos(roll) * cos(pitch), 0.3)
        nothing_direct = Vec3(0.0, 0.0, 0.0)
        return memory, ControlOutput(Wrench(thrust, torque_B), nothing_direct, no_telemetry())
