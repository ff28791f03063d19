"""The cascade's attitude loop seen from the axis of relaxed hover: what it tracks, and the torque it asks for."""

from __future__ import annotations

from typing import final

from rotorfault.autopilot.control.attitude import AttitudeReference, AttitudeTracking, Wanted
from rotorfault.autopilot.control.protocol import ControlInputs
from rotorfault.autopilot.control.relaxed import (
    RelaxedMemory,
    RelaxedParameters,
    TurningError,
    relaxed_axis,
    relaxed_torque,
)
from rotorfault.maths.geometry import Mat3, Vec3
from rotorfault.maths.scalar import Scalar


@final
class Spinning:
    """One sampling instant of an attitude loop that may give yaw up.

    Parameters
    ----------
    memory : RelaxedMemory
    parameters : RelaxedParameters
    inputs : ControlInputs
    dt : scalar, s
        Sampling period.
    """

    def __init__(
        self, memory: RelaxedMemory, parameters: RelaxedParameters, inputs: ControlInputs, dt: Scalar
    ) -> None:
        self.inputs, self.parameters, self.dt = inputs, parameters, dt
        estimate = inputs.estimate
        self.axis = relaxed_axis(
            memory,
            inputs.vehicle,
            inputs.diagnosis,
            inputs.thrust_with_yaw,
            estimate.omega_B,
            inputs.residual_speed,
            parameters,
            dt,
        )
        self.omega = self.axis.to_B.T @ estimate.omega_B

    def track(
        self, tracking: AttitudeTracking, state: AttitudeReference, R_WB: Mat3, f_W: Vec3, bandwidth: Scalar
    ) -> Wanted:
        """What the law tracks, in body axes; of yaw so much as is held. See `AttitudeTracking.track`."""
        axis, inputs = self.axis, self.inputs
        seen = inputs.estimate._replace(q_WB=inputs.estimate.q_WB @ axis.turn, omega_B=self.omega)
        turn = tracking.track(state, seen, R_WB @ axis.to_B, f_W, inputs.reference, bandwidth, self.dt)
        fixed = turn.acceleration + self.omega.cross(turn.rate)
        self._error = TurningError(
            turn.e, self.omega, Vec3(turn.rate.x, turn.rate.y, 0.0), Vec3(fixed.x, fixed.y, 0.0)
        )
        held = 1.0 - axis.given_up

        def in_body(v: Vec3, free: Scalar) -> Vec3:
            return axis.to_B @ Vec3(v.x, v.y, v.z * held + free * axis.given_up)

        return turn._replace(
            e=in_body(turn.e, 0.0),
            rate=in_body(turn.rate, self.omega.z),
            acceleration=in_body(turn.acceleration, 0.0),
        )

    def steer(self, upright_B: Vec3, given_B: Vec3, switching_B: Vec3) -> tuple[RelaxedMemory, Vec3]:
        """The memory of the next instant, and the torque to ask for in N m.

        Parameters
        ----------
        upright_B : Vec3, N m
            Torque of the law that holds yaw.
        given_B : Vec3, N m
            Torque that the believed rotors give now.
        switching_B : Vec3, rad/s^2
            Switching input of the law.
        """
        after, relaxed_B = relaxed_torque(
            self.axis,
            self._error,
            given_B,
            switching_B,
            self.inputs.vehicle,
            self.inputs.residual_speed,
            self.parameters,
        )
        given_up = self.axis.given_up
        return after, upright_B * (1.0 - given_up) + relaxed_B * given_up
