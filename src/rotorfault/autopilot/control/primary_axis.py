r"""The axis, fixed in the body, that laws of others point along the wanted thrust once yaw is lost.

With h the wanted direction of thrust in body coordinates and n the primary axis, a body that spins about n holds its
place while h = n, whatever its yaw (M. W. Mueller and R. D'Andrea, ICRA 2014; S. Sun and others, "High-speed flight
of quadrotor despite loss of single rotor", RA-L 3(4), 2018). Before a loss n is the body's z axis. After one it leans
away from the lost rotors by a fixed angle, 0.15 in S. Sun, G. Cioffi and others, "Autonomous quadrotor flight despite
rotor failure with onboard vision sensors", RA-L 6(2), 2021:

.. math:: n \parallel e_z - c\,s\,\frac{\sum_i\lambda_i (x_i, y_i, 0)}{|\sum_i\lambda_i (x_i, y_i, 0)|}

with the believed losses and the share s of yaw that is given up, through a first-order lag. Two opposite losses leave
it at z. The direction follows from precession for a body whose inertia about z is the largest, as of nearly all
multirotors; of one with a smaller one it leans the wrong way, which is a limit of the rule. (Our own law computes the
axis anew at every instant instead: `rotorfault.autopilot.control.relaxed`.)

How much of yaw is given up is shared with our own law, so that all switch by the same rule: with the diagnosis.
"""

from __future__ import annotations

from typing import NamedTuple

from pydantic import Field

from rotorfault.autopilot.allocation.available import HOVER_RESERVE, thrusts_in_balance
from rotorfault.autopilot.control.force_limits import direction_of
from rotorfault.autopilot.control.protocol import ControlInputs
from rotorfault.autopilot.control.relaxed import attainable, yaw_given_up
from rotorfault.base.config import Strict
from rotorfault.maths.geometry import Mat3, Vec3
from rotorfault.maths.scalar import Scalar, atan2, maximum, minimum, sqrt
from rotorfault.model.signals import Wrench


class AxisSettings(Strict):
    """Where the axis of the spin lies."""

    lean: float = Field(default=0.15, ge=0.0, lt=1.0, description="tangent of its angle to body z")
    time: float = Field(default=0.5, gt=0.0, description="time constant with which it moves [s]")


class AxisParameters(NamedTuple):
    """Numbers of the axis."""

    lean: Scalar
    time: Scalar  # s


class PrimaryAxis(NamedTuple):
    """The axis at one sampling instant."""

    lean: Vec3  # (n_x, n_y)/n_z, and 0; remembered
    n_B: Vec3  # unit vector
    given_up: Scalar  # 0 to 1: share of yaw
    available: Scalar  # N: largest thrust that position control should ask for


def primary_axis(lean: Vec3, inputs: ControlInputs, parameters: AxisParameters, dt: Scalar) -> PrimaryAxis:
    """The axis that is to point along the wanted thrust.

    Parameters
    ----------
    lean : Vec3
        (n_x, n_y)/n_z of the instant before, and 0.
    inputs : ControlInputs
    parameters : AxisParameters
    dt : scalar, s
        Sampling period.
    """
    vehicle, believed = inputs.vehicle, inputs.diagnosis
    given_up = yaw_given_up(vehicle, inputs.thrust_with_yaw)
    lost = 1.0 - believed.stuck.effectiveness(believed.loss)
    x, y = lost.dot(vehicle.rotor_x), lost.dot(vehicle.rotor_y)
    arm = sqrt((vehicle.rotor_x.dot(vehicle.rotor_x) + vehicle.rotor_y.dot(vehicle.rotor_y)) / vehicle.rotors)
    # Losses that all but cancel, by less than a tenth of an arm, have no direction.
    size = parameters.lean * given_up / maximum(sqrt(x * x + y * y), 0.1 * arm)
    after = lean + (Vec3(-x * size, -y * size, 0.0) - lean) * (dt / (parameters.time + dt))
    n_z = 1.0 / sqrt(1.0 + after.x * after.x + after.y * after.y)
    n_B = Vec3(after.x * n_z, after.y * n_z, n_z)
    _, without_yaw = thrusts_in_balance(vehicle, believed.loss, believed.stuck)
    most = minimum(without_yaw, HOVER_RESERVE * vehicle.mass * vehicle.gravity)
    # Two rotors side by side balance no torque; what they carry is then asked for all the same, spinning.
    least = minimum(vehicle.mass * vehicle.gravity, most)
    return PrimaryAxis(after, n_B, given_up, maximum(inputs.thrust_available, least * given_up))


def turn_to(axis: Vec3, wanted: Vec3) -> Vec3:
    """The shortest turn in rad that takes one unit vector to another, as a rotation vector; 0 for opposite ones.

    Parameters
    ----------
    axis, wanted : Vec3
        Of one frame.
    """
    across = axis.cross(wanted)
    # The small term is lost in rounding but where there is no error; there it keeps the quotient at 1.
    sine = sqrt(across.dot(across) + 1e-40)
    turn: Vec3 = across * (atan2(sine, axis.dot(wanted)) / sine)
    return turn


def heading_error(inputs: ControlInputs) -> Scalar:
    """By how much the heading is beyond its reference, in rad, the short way."""
    return inputs.estimate.q_WB.turned(-inputs.reference.yaw).heading()


def direction_in_body(force_W: Vec3, R_WB: Mat3) -> Vec3:
    """The unit vector along a specific force, in body coordinates."""
    d: Vec3 = R_WB.T @ direction_of(force_W)
    return d


def handed_over(inputs: ControlInputs, wrench: Wrench, given_up: Scalar) -> Wrench:
    """The wrench to ask for: as wanted while yaw is held, and what the living rotors can give of it once it is lost.

    Thrust and tilt torque fix the thrusts of three living rotors; their yaw torque is what it comes to.

    Parameters
    ----------
    inputs : ControlInputs
    wrench : Wrench
        Wanted.
    given_up : scalar
        Share of yaw, 0 to 1.
    """
    spun = attainable(inputs.vehicle, inputs.diagnosis, wrench)
    held = 1.0 - given_up
    return Wrench(wrench.thrust * held + spun.thrust * given_up, wrench.torque_B * held + spun.torque_B * given_up)
