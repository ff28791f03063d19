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

**Which way round.** Torque across b turns the body about the arm as it likes, and by an angle :math:`\phi` of that
the gyroscopic torque changes the rate along b by :math:`\lambda\phi`, whatever time it takes. So the rate that counts
is that on arrival upright. Where it is beyond the bound, and the other way round, by :math:`\phi\mp2\pi`, ends at one
that can be braked, the body is turned the other way, on through upside down if need be. All of this fades as the spin
nears the rotors' bandwidth: a body that spins by a radian while its rotors follow is not turned about an arm.

**What brakes it.** So it is too with a rate that is beyond the bound by itself. The gyroscopic torque does no work:
it turns the rate about in the body, to where a rotor can brake it, and a law that holds the other axis at rest works
against just that. The further the rate is beyond, the less of the torque across it is the law's, and the more turns
the body the way in which the gyroscopic torque takes the rate back.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from rotorfault.maths.geometry import PerRotor, Vec3
from rotorfault.maths.scalar import Scalar, absolute, atan2, maximum, minimum, select, sqrt
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
    upright_B = _turn_upright(tumble.up_B)
    lasts = STOPS_WITHIN / angle_of_lasting(tumble, vehicle)
    least: Scalar = 1.0
    for x, y in zip(roll, pitch, strict=True):
        # The small term keeps a direction a number where a rotor has no arm.
        arm = 1.0 / sqrt(x * x + y * y + 1e-12)
        b = Vec3(-y * arm, x * arm, 0.0)
        beside = Vec3(-b.y, b.x, 0.0)
        stops = [_stopped(roll, pitch, able, b * sense) * (1.0 / sqrt(across)) for sense in (1.0, -1.0)]
        most = [stop + lasts for stop in stops]
        # A rate of neither sense can be braked without two opposite rotors: no way round is the better one then.
        lost = [lasts / bound for bound in most]
        choice = (1.0 - minimum(*lost)) * steers
        least = minimum(least, choice)
        turning = Vec3(beside.x, beside.y, tumble.omega_B.z)
        per_turn = torque_of_motion(vehicle, turning, tumble.residual_speed).dot(b) / across
        turn = upright_B.dot(beside)
        rate = coming_B.dot(b)
        arrives = rate + per_turn * turn * choice
        around = rate + per_turn * (turn - select(is_less(turn, 0.0), -2.0, 2.0) * math.pi) * choice
        worse = maximum(maximum((around - most[0]) * lost[0], (-around - most[1]) * lost[1]), 0.0) * choice
        takes_back = select(is_less(per_turn, 0.0), pace, -pace)
        for sense, bound in zip((1.0, -1.0), most, strict=True):
            d = b * sense
            hasty = maximum(torque_B.dot(d) - maximum(bound - arrives * sense, 0.0) * pace, 0.0)
            torque_B = torque_B - d * (hasty * steers)
            excess = maximum(arrives * sense - bound - worse, 0.0)
            share = minimum(excess / (absolute(arrives) + 1e-9) * GIVES_WAY, 1.0) * choice
            torque_B = torque_B + beside * ((excess * takes_back * sense - torque_B.dot(beside)) * share)
    # Without two opposite rotors neither sense can be braked; then the rate as it is gives way, wherever it points.
    size = sqrt(tumble.omega_B.x * tumble.omega_B.x + tumble.omega_B.y * tumble.omega_B.y + 1e-9)
    d = Vec3(tumble.omega_B.x / size, tumble.omega_B.y / size, 0.0)
    beside = Vec3(-d.y, d.x, 0.0)
    bound = _stopped(roll, pitch, able, d) * (1.0 / sqrt(across)) + lasts
    excess = maximum(size - bound, 0.0)
    turns = torque_of_motion(vehicle, tumble.omega_B, tumble.residual_speed).dot(beside)
    wanted = excess * select(is_less(turns, 0.0), -pace, pace)
    share = minimum(excess / size * GIVES_WAY, 1.0) * (1.0 - least)
    given: Vec3 = torque_B + beside * ((wanted - torque_B.dot(beside)) * share)
    return given


def _turn_upright(up_B: Vec3) -> Vec3:
    """The shortest turn upright in rad, body axes."""
    # The small term keeps the quotient a number upright.
    size = sqrt(up_B.x * up_B.x + up_B.y * up_B.y + 1e-12)
    turn: Vec3 = Vec3(-up_B.y, up_B.x, 0.0) * (atan2(size, up_B.z) / size)
    return turn


def _stopped(roll: PerRotor, pitch: PerRotor, able: PerRotor, d: Vec3) -> Scalar:
    """Rate in a direction that rotors stop within the angle, times the root of the inertia."""
    against = (roll * (-d.x) + pitch * (-d.y)).map(lambda arm: maximum(arm, 0.0))
    return sqrt(against.dot(able) * (2.0 * STOPS_WITHIN))


def angle_of_lasting(tumble: Tumble, vehicle: Vehicle) -> Scalar:
    """T in s: the angle by which a tilt rate that no rotor brakes turns the body before its spin holds it, per rate.

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
