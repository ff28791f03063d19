"""Your own controller as any Python object: one method, floats in, a wrench out.

    rotorfault fly paper-set-point --controller examples/python_controller.py:PdController

It may keep state, call NumPy, an optimiser or a neural network; in exchange it runs in the python engine only.
This one adds an integral of the height error, kept as plain attributes.
"""

from __future__ import annotations

import math

from rotorfault import Measurement, Reference, Vec3, Vehicle, Wrench


class PdController:
    """PD cascade with an integrator on height, in plain Python."""

    def __init__(self) -> None:
        self.height_error_sum = 0.0
        self.last_time = 0.0

    def update(self, time: float, measurement: Measurement, reference: Reference, vehicle: Vehicle) -> Wrench:
        """Demanded thrust [N] and torque [N m, body axes] at a time [s]."""
        roll, pitch, yaw = measurement.attitude
        e, v = measurement.p_W - reference.p_W, measurement.v_W - reference.v_W
        self.height_error_sum += e.z * (time - self.last_time)
        self.last_time = time

        acceleration = [reference_a - 3.0 * max(-1.0, min(1.0, e_i)) - 3.0 * v_i
                        for reference_a, e_i, v_i in zip(reference.a_W, e, v, strict=True)]  # fmt: skip
        lift = max(vehicle.gravity + acceleration[2] - 0.5 * self.height_error_sum, 3.0)
        forward = math.cos(yaw) * acceleration[0] + math.sin(yaw) * acceleration[1]
        left = math.cos(yaw) * acceleration[1] - math.sin(yaw) * acceleration[0]
        pitch_cmd = max(-0.6, min(0.6, math.atan2(forward, lift)))
        roll_cmd = max(-0.6, min(0.6, math.atan2(-left, lift)))

        w = vehicle.rotor_bandwidth / 4.0
        yaw_gap = math.remainder(yaw - reference.yaw, 2.0 * math.pi)
        gap = Vec3(roll - roll_cmd, pitch - pitch_cmd, yaw_gap)
        torque = (-(gap * w * w) - measurement.omega_B * (1.8 * w)).times(vehicle.inertia)
        return Wrench(vehicle.mass * lift / max(math.cos(roll) * math.cos(pitch), 0.3), torque)
