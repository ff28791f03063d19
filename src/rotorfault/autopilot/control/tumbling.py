r"""What a body without some rotors must not do while it tumbles: speed up what it cannot brake, or hold it there.

**Tilt rate.** A quadrotor without rotor 1 has torque in one direction only about the arm of rotor 1: nothing lifts
that arm. Once it falls, nothing takes the rate back but the gyroscopic torque of a spin that the body has not got
yet: it tumbles until it has. The directions b in which rotors are weak are the normals of the facets of all tilt
torques that they give, and each lies across a rotor's torque. In neither sense of any of them does torque speed the
body up beyond

.. math:: \omega_{most} = \sqrt{2\theta B/J_t} + \frac{\theta}{T}, \qquad
          B = \sum_i \max(0, -\tau_i\cdot b)\,F_{i,max}

with :math:`\theta` the angle `STOPS_WITHIN` and :math:`\tau_i` the tilt torque of rotor i per thrust. The first part
is what the rotors stop within it, the second what may last. A rate that lasts for a time t, and is then left to a
body whose momentum :math:`H(t) = H_0 + \tau_Zt` the drag torque of its rotors raises, turns it by t and by the
nutation :math:`J_t/H`, together. The least of that is

.. math:: T = \frac{\max(H_s - H_0, 0)}{\tau_Z} + \frac{J_t}{\max(H_0, H_s)}, \qquad H_s = \sqrt{J_t\tau_Z} .

H, :math:`J_zr + J_r\Omega`, counts in the sense in which the rotors raise it: a spin the other way passes through
zero before it brakes anything for good. The rate is that which comes of a command to give no torque from now on, for
rotors lag. Where all rotors live B is as large one way as the other, and the bound is far from what is asked for.

**What brakes it.** A rate that is beyond the bound is left to the gyroscopic torque. That does no work: it turns the
rate about in the body, to where a rotor can brake it, and a law that holds the other axis at rest works against just
that. The further the rate is beyond, the less of the torque across it is the law's, and the more turns the body the
way in which the gyroscopic torque takes the rate back.

Which way a body that tumbles is turned is chosen elsewhere: `rotorfault.autopilot.control.rollout`.
"""

from __future__ import annotations

from typing import NamedTuple

from rotorfault.maths.geometry import PerRotor, Vec3
from rotorfault.maths.scalar import Scalar, absolute, maximum, minimum, select, sqrt
from rotorfault.maths.scalar import less as is_less
from rotorfault.model.effectiveness import effectiveness
from rotorfault.model.motion import effect_of, mean_bandwidth, torque_of_motion
from rotorfault.model.signals import Diagnosis
from rotorfault.model.vehicle import Vehicle, rotor_momentum

# rad. Our choice: a body that comes upright at that rate stops while half of its thrust still carries.
STOPS_WITHIN = 1.0
# Of the rotors' bandwidth: how fast the bound on the rate is approached. Faster, lagging rotors overshoot it.
APPROACH = 0.5
# Share of the torque across the rate that gives way, per share by which it is too fast: all of it at twice the bound.
GIVES_WAY = 2.0
# Of the weight at a metre: less torque than that spins nothing up. It keeps a quotient a number.
LEAST_TORQUE = 1e-6


class Tumble(NamedTuple):
    """How a body tumbles."""

    omega_B: Vec3  # rad/s: body rates
    up_B: Vec3  # upwards, in body axes
    given_B: Vec3  # N m: torque that the rotors give now
    spins_up: Scalar  # N m: yaw torque of the rotors while they give what thrust they have in balance
    residual_speed: Scalar | Vec3  # rad/s: Omega of (4); of tilted rotors its vector


def without_haste(torque_B: Vec3, tumble: Tumble, vehicle: Vehicle, believed: Diagnosis) -> Vec3:
    """The torque in N m, less what would speed up a tilt rate that cannot be braked, or would hold it where it is.

    Parameters
    ----------
    torque_B : Vec3, N m
        Wanted, body axes.
    tumble : Tumble
    vehicle : Vehicle
        As believed.
    believed : Diagnosis
        Of its rotors.
    """
    _, roll, pitch, _ = effectiveness(vehicle)
    able = effect_of(vehicle, believed.loss, believed.stuck) * vehicle.thrust_max
    across, w0 = 0.5 * (vehicle.inertia.x + vehicle.inertia.y), mean_bandwidth(vehicle)
    pace = across * APPROACH * w0
    moved_B = tumble.given_B + torque_of_motion(vehicle, tumble.omega_B, tumble.residual_speed)
    coming_B: Vec3 = tumble.omega_B + moved_B * (1.0 / (across * w0))
    steers = maximum(1.0 - absolute(tumble.omega_B.z) / w0, 0.0)
    lasts = STOPS_WITHIN / time_of_lasting(tumble, vehicle)
    for x, y in zip(roll, pitch, strict=True):
        # The small term keeps a direction a number where a rotor has no arm.
        arm = 1.0 / sqrt(x * x + y * y + 1e-12)
        b = Vec3(-y * arm, x * arm, 0.0)
        for d in (b, -b):
            most = _stopped(roll, pitch, able, d) * (1.0 / sqrt(across)) + lasts
            hasty = maximum(torque_B.dot(d) - maximum(most - coming_B.dot(d), 0.0) * pace, 0.0)
            torque_B = torque_B - d * (hasty * steers)
    # A rate beyond the bound gives way, wherever it points.
    size = sqrt(tumble.omega_B.x * tumble.omega_B.x + tumble.omega_B.y * tumble.omega_B.y + 1e-9)
    d = Vec3(tumble.omega_B.x / size, tumble.omega_B.y / size, 0.0)
    beside = Vec3(-d.y, d.x, 0.0)
    bound = _stopped(roll, pitch, able, d) * (1.0 / sqrt(across)) + lasts
    excess = maximum(size - bound, 0.0)
    turns = torque_of_motion(vehicle, tumble.omega_B, tumble.residual_speed).dot(beside)
    wanted = excess * select(is_less(turns, 0.0), -pace, pace)
    share = minimum(excess / size * GIVES_WAY, 1.0)
    given: Vec3 = torque_B + beside * ((wanted - torque_B.dot(beside)) * share)
    return given


def _stopped(roll: PerRotor, pitch: PerRotor, able: PerRotor, d: Vec3) -> Scalar:
    """Rate in a direction that rotors stop within the angle, times the root of the inertia."""
    against = (roll * (-d.x) + pitch * (-d.y)).map(lambda arm: maximum(arm, 0.0))
    return sqrt(against.dot(able) * (2.0 * STOPS_WITHIN))


def time_of_lasting(tumble: Tumble, vehicle: Vehicle) -> Scalar:
    """T in s: how long a tilt rate that no rotor brakes goes on turning the body before its spin takes it back.

    Parameters
    ----------
    tumble : Tumble
    vehicle : Vehicle
        As believed.
    """
    across = 0.5 * (vehicle.inertia.x + vehicle.inertia.y)
    momentum = rotor_momentum(vehicle, tumble.residual_speed)
    whole = vehicle.inertia.z * tumble.omega_B.z + (momentum.z if isinstance(momentum, Vec3) else momentum)
    torque = maximum(absolute(tumble.spins_up), LEAST_TORQUE * vehicle.mass * vehicle.gravity)
    has = whole * select(is_less(tumble.spins_up, 0.0), -1.0, 1.0)
    enough = sqrt(across * torque)
    return maximum(enough - has, 0.0) / torque + across / maximum(has, enough)
