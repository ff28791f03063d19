"""A controller of your own as any Python object: one method, floats in, a wrench out.

It may keep state, call NumPy, an optimiser or a neural network; in exchange it flies on the python engine only.
This one adds an integral of the height error, kept as a plain attribute.
"""

import rotorfault as rf


class PdWithIntegral:
    """PD on position and on the direction of the thrust, with an integral on height, in plain Python."""

    def __init__(self):
        self.height_error_sum, self.last_time = 0.0, 0.0

    def update(self, time, estimate, reference, vehicle):
        """Demanded thrust [N] and torque [N m, body axes] at a time [s]."""
        error, velocity = estimate.p_W - reference.p_W, estimate.v_W - reference.v_W
        self.height_error_sum += error.z * (time - self.last_time)
        self.last_time = time

        lift = reference.a_W - error.map(lambda e: max(-1.0, min(1.0, e))) * 4.0 - velocity * 3.0
        up = max(vehicle.gravity + lift.z - 0.5 * self.height_error_sum, 3.0)
        lift = rf.Vec3(max(-5.0, min(5.0, lift.x)), max(-5.0, min(5.0, lift.y)), up)

        axis_B = estimate.q_WB.matrix().T @ (lift / lift.norm())
        yaw = estimate.q_WB.turned(-reference.yaw).heading()
        bandwidth = vehicle.rotor_bandwidth / 3.0
        turn = rf.Vec3(-axis_B.y, axis_B.x, -0.2 * yaw) * bandwidth**2 - estimate.omega_B * (1.6 * bandwidth)
        return rf.Wrench(vehicle.mass * lift.dot(estimate.q_WB.z_axis()), turn.times(vehicle.inertia))
