r"""Hover where yaw cannot be held: a spinning body whose thrust axis the same SDRE law steers.

**The axis.** Upright, with the body's z axis along the wanted thrust, a quadrotor without one rotor leaves the rotor
opposite nothing to do: it stands still and can push one way only. Turning steadily about an axis n that is fixed in
the body but not z, its rotors have thrusts of our choice (relaxed hover, `rotorfault.analysis.relaxed_hover`). At a
yaw rate r that axis follows from the torque that is wanted in balance, without a search: with
:math:`\omega = (p, q, r)` parallel to n,

.. math:: \tau_x + ((J_y - J_z)r - J_r\Omega)\,q - d_xp = 0, \qquad
          \tau_y + ((J_z - J_x)r + J_r\Omega)\,p - d_yq = 0

with d the damping of roll and pitch, and tau the tilt torque of the thrusts wanted in balance: between those without
any tilt torque, which may be below zero, and those of all believed rotors at the same share of what they can give,
the first at which each living rotor keeps a reserve (`relaxed_reserve`). Products of inertia and tilted rotors add to
tau and d what is linear in p and q. r is the measured yaw rate: it finds its own balance between the rotors' drag
torque and the air.

**The law.** Error, rates and torque are seen in a frame whose z axis is n, roll and pitch of it as one complex
number. Its gains solve the Riccati equation of `rotorfault.autopilot.control.spin_riccati`, whose states are error,
rate and the angular acceleration that the lagging rotors give, with the weights (35) of roll and pitch, their means.
What it leaves to feed-forward is the balance of the turning itself, with the believed inertia as it is; the switching
input of the sliding surface is added as elsewhere.

Rotors that are stuck give what they give: the others carry the rest of the weight and balance their tilt torque.

**When.** How much of yaw is given up goes from 0 to 1 as the thrust that believed rotors have with yaw in balance
falls from the weight to `YAW_LOST` of it, or the least that they have so, with a rotor stuck high, rises as far
above it. The torque is shared between the law that holds yaw and this one in that
ratio, and the axis moves from z to n with the time constant `relaxed_time`, so nothing jumps.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from rotorfault.autopilot.control.lean import lean_in_balance
from rotorfault.autopilot.control.rollout import Round, no_round
from rotorfault.autopilot.control.spin_riccati import (
    Complex,
    Poles,
    SpinProblem,
    improve,
    optimal,
    spin_gain,
)
from rotorfault.autopilot.control.steady_force import SteadyForce
from rotorfault.maths.geometry import Mat3, PerRotor, Vec3, zeros
from rotorfault.maths.rotation import Quat
from rotorfault.maths.scalar import Scalar, clip, greater, maximum, minimum, select, sqrt
from rotorfault.model.effectiveness import effectiveness
from rotorfault.model.motion import effect_of, mean_bandwidth, torque_of_motion
from rotorfault.model.signals import Diagnosis, Wrench
from rotorfault.model.vehicle import Vehicle, body_momentum, over_inertia, rotor_momentum, wrench_of

YAW_LOST = 0.95  # of the weight. Our choice: a twentieth below, hover that holds yaw loses a metre in two seconds
# Of the weight: a rotor that can give less bounds nothing. Diagnosis says of a dead one that a few percent are left,
# and its share of a balance would be the most that there is. Our choice: a fifth or less of what a sound one gives.
LEAST_LIVING = 0.1
RIDGE = 1e-6  # relative
MOST = 10.0  # of the weight: more thrust than is ever asked for
LEAST_CARRIED = 0.1  # of the weight
# Rounds of one rotor after the other: those of a quadrotor hardly push alike, and are settled after a few.
ROUNDS = 8
# What thrust is worth beside the torque of as much at a mean arm, squared, where a body cannot have both. Less does
# not spin up what is in balance only while it spins, more leaves it no torque to turn. Our choice: with 3 and with 10
# deadcat flies on without a front rotor, with 0.1 and 1 it falls; others differ between 1 and 3 by 2 in 100 at most.
THRUST_WORTH = 3.0


class SpinWeights(NamedTuple):
    """Weights of roll and pitch, their means."""

    angle: Scalar  # 1/s^4: q of the angle over r
    rate: Scalar  # 1/s^2: q of the rate over r


def weights_of_gains(angle: Vec3, rate: Vec3) -> SpinWeights:
    """Weights of a law that has gains and no weights: those for which its gains are optimal.

    Of a double integrator u = -k1 e - k2 w is optimal for :math:`q_e = k_1^2` and :math:`q_w = k_2^2 - 2k_1` over r
    (Kalman, "When is a linear control system optimal?", J. Basic Eng. 86, 1964). A damping ratio below 0.71 is
    optimal for no weights; it is taken for 0.71 at the same natural frequency.

    Parameters
    ----------
    angle : Vec3, 1/s^2
        k1 of roll, pitch, yaw.
    rate : Vec3, 1/s
        k2 of the same.
    """
    k1, square = angle.times(angle), rate.times(rate) - angle * 2.0
    return SpinWeights((k1.x + k1.y) * 0.5, (maximum(square.x, 0.0) + maximum(square.y, 0.0)) * 0.5)


class ThrustRange(NamedTuple):
    """Least and largest total thrust."""

    least: Scalar  # N
    most: Scalar  # N


class RelaxedParameters(NamedTuple):
    """Numbers of relaxed hover."""

    reserve: Scalar
    lean: Scalar  # tangent
    time: Scalar  # s
    weights: SpinWeights


class RelaxedMemory(NamedTuple):
    """Axis and gain of relaxed hover."""

    lean: Vec3  # (n_x, n_y)/n_z, and 0
    poles: Poles  # of the closed loop
    steady: SteadyForce
    crossover: Scalar  # rad/s: of the position loop, as it was last
    rounds: Round  # of what is tried while it tumbles


class RelaxedAxis(NamedTuple):
    """The axis at one sampling instant."""

    memory: RelaxedMemory
    given_up: Scalar  # 0 to 1: share of yaw
    free: Scalar  # 0 to 1: share of it that is not even braked
    thrust: Scalar  # N: most that the believed rotors give together in the balance of the axis
    spins_up: Scalar  # N m: yaw torque of the rotors then
    to_B: Mat3  # from the frame with n for its z axis to the body's
    turn: Quat  # the same


class TurningError(NamedTuple):
    """What relaxed hover corrects, in the frame with n for its z axis."""

    e: Vec3  # rad: of the thrust axis
    omega: Vec3  # rad/s: of the body
    rate: Vec3  # rad/s: wanted about x and y
    acceleration: Vec3  # rad/s^2: derivative of the wanted rate, as seen from the world


def relaxed_parameters(reserve: float, lean: float, time: float, weights: SpinWeights) -> RelaxedParameters:
    """Numbers of relaxed hover as a record.

    Parameters
    ----------
    reserve : float
        Least thrust of a living rotor, as a share of equal ones.
    lean : float, rad
        Largest angle of the axis to body z.
    time : float, s
        Time constant with which the axis moves.
    weights : SpinWeights
    """
    return RelaxedParameters(reserve, math.tan(lean), time, weights)


def at_rest(parameters: RelaxedParameters, vehicle: Vehicle, v_W: Vec3) -> RelaxedMemory:
    """The body's z axis, the gain of a body that does not spin, and no steady force at a velocity in m/s."""
    weights = parameters.weights
    poles = optimal(SpinProblem(0.0, 0.0, mean_bandwidth(vehicle), weights.angle, weights.rate))
    return RelaxedMemory(zeros(), poles, SteadyForce(v_W), 0.0, no_round())


def relaxed_axis(
    memory: RelaxedMemory,
    vehicle: Vehicle,
    believed: Diagnosis,
    with_yaw: ThrustRange,
    omega_B: Vec3,
    residual_speed: Scalar | Vec3,
    parameters: RelaxedParameters,
    dt: Scalar,
) -> RelaxedAxis:
    """The axis that is to point along the wanted thrust.

    Parameters
    ----------
    memory : RelaxedMemory
    vehicle : Vehicle
        As believed.
    believed : Diagnosis
        Of its rotors.
    with_yaw : ThrustRange, N
        Thrusts that the believed rotors have with yaw in balance.
    omega_B : Vec3, rad/s
        Body rates.
    residual_speed : scalar, rad/s
        Believed Omega of (4); of tilted rotors its vector.
    parameters : RelaxedParameters
    dt : scalar, s
        Sampling period.
    """
    weight = vehicle.mass * vehicle.gravity
    # As far above the weight as below it.
    free = yaw_given_up(vehicle, with_yaw.most)
    given_up = maximum(free, yaw_given_up(vehicle, 2.0 * weight - with_yaw.least))
    most, balance = spinning_thrust(vehicle, believed, parameters.reserve)
    tau = wrench_of(vehicle, balance).torque_B
    spins_up = tau.z * (most / weight)
    wanted = lean_in_balance(vehicle, tau, omega_B.z, residual_speed, parameters.lean) * given_up
    size = sqrt(wanted.x * wanted.x + wanted.y * wanted.y + 1e-18)
    wanted = wanted * minimum(parameters.lean / size, 1.0)
    lean = memory.lean + (wanted - memory.lean) * (dt / (parameters.time + dt))
    # The shortest turn from z to n.
    z = 1.0 / sqrt(1.0 + lean.x * lean.x + lean.y * lean.y)
    x, y = lean.x * z, lean.y * z
    k = 1.0 / (1.0 + z)
    w = sqrt(0.5 * (1.0 + z))
    half = 0.5 / w
    to_B = Mat3(
        1.0 - x * x * k, -x * y * k, x,
        -x * y * k, 1.0 - y * y * k, y,
        -x, -y, z,
    )  # fmt: skip
    turn = Quat(w, -y * half, x * half, 0.0)
    return RelaxedAxis(memory._replace(lean=lean), given_up, free, most, spins_up, to_B, turn)


def yaw_given_up(vehicle: Vehicle, with_yaw: Scalar) -> Scalar:
    """How much of yaw is given up, 0 to 1.

    Parameters
    ----------
    vehicle : Vehicle
        As believed.
    with_yaw : scalar, N
        Thrust that the believed rotors have with yaw in balance.
    """
    weight = vehicle.mass * vehicle.gravity
    return clip((1.0 - with_yaw / weight) * (1.0 / (1.0 - YAW_LOST)), 0.0, 1.0)


def spinning_thrust(vehicle: Vehicle, believed: Diagnosis, reserve: Scalar) -> tuple[Scalar, PerRotor]:
    """Most thrust in N that the believed rotors give together in the balance of the spin, and thrusts at the weight.

    Parameters
    ----------
    vehicle : Vehicle
        As believed.
    believed : Diagnosis
        Of its rotors.
    reserve : scalar
        Least thrust of a living rotor, as a share of equal ones.
    """
    weight = vehicle.mass * vehicle.gravity
    able = effect_of(vehicle, believed.loss, believed.stuck) * vehicle.thrust_max
    held = wrench_of(vehicle, believed.stuck.thrust)
    # A rotor that is stuck alone may carry more than the weight; the floor leaves the others something to share.
    carried = maximum(weight - held.thrust, LEAST_CARRIED * weight)
    balance = _balanced_thrust(vehicle, able, Wrench(carried, -held.torque_B), reserve)

    def room(most: Scalar, thrust: Scalar) -> Scalar:
        return select(greater(most, LEAST_LIVING * weight), most / maximum(thrust, 1e-3 * weight), MOST)

    most = held.thrust + able.map(room, balance).reduce(minimum) * carried
    return most, balance + believed.stuck.thrust


def _balanced_thrust(vehicle: Vehicle, able: PerRotor, left: Wrench, reserve: Scalar) -> PerRotor:
    """Thrusts in N with which the rotors that follow give what stuck ones leave, each living one with its reserve."""
    weight = vehicle.mass * vehicle.gravity
    # Where nothing lives the sum is 0; the floor keeps the quotient a number.
    most = able.sum() if vehicle.tilt == () else able.dot(effectiveness(vehicle).thrust)
    alike: PerRotor = able * (left.thrust / maximum(most, 1e-3 * weight))
    level = _thrusts_for(vehicle, able, left)
    short, room = alike * reserve - level, alike - level
    share = short.map(lambda lacks, r: select(greater(lacks, 0.0), lacks / maximum(r, 1e-9 * weight), 0.0), room)
    push = minimum(share.reduce(maximum), 1.0)
    balance: PerRotor = level + room * push
    return balance


def _thrusts_for(vehicle: Vehicle, able: PerRotor, wrench: Wrench) -> PerRotor:
    """Thrusts in N that give a thrust and tilt torque, least squares by what rotors can give, yaw left open."""
    rows = effectiveness(vehicle)[:3]
    xx, xy, xz, yy, yz, zz = ((rows[i] * rows[j]).dot(able) for i in range(3) for j in range(i, 3))
    # Of rotors in one line an axis is out of reach: a millionth of ridge, and nothing is asked of it. The floors keep
    # it a number where nothing lives.
    ridge = RIDGE * maximum(yy + zz, 1e-9)
    M = Mat3(xx, xy, xz, xy, yy + ridge, yz, xz, yz, zz + ridge)
    per = M.adjugate() @ Vec3(wrench.thrust, wrench.torque_B.x, wrench.torque_B.y)
    per = per * (1.0 / maximum(M.det(), 1e-9 * ridge * ridge))
    thrust: PerRotor = (rows[0] * per.x + rows[1] * per.y + rows[2] * per.z) * able
    return thrust


def attainable(vehicle: Vehicle, believed: Diagnosis, wrench: Wrench, fades: Scalar = 0.0) -> Wrench:
    """The wrench that comes of a thrust and tilt torque when each rotor is put within its limits.

    An allocation that serves tilt before thrust would stop all rotors for a torque that they can only work against.

    Parameters
    ----------
    vehicle : Vehicle
        As believed.
    believed : Diagnosis
        Of its rotors.
    wrench : Wrench
        Wanted; its yaw torque is not looked at.
    fades : scalar, optional
        0 to 1: how little thrust beyond the wanted one is worth.
    """
    effect = effect_of(vehicle, believed.loss, believed.stuck)
    low, high = effect * vehicle.thrust_min, effect * vehicle.thrust_max
    held = believed.stuck.thrust
    moving = wrench_of(vehicle, held)
    left = Wrench(wrench.thrust - moving.thrust, wrench.torque_B - moving.torque_B)
    # Cut one by one, a rotor that would have to pull down leaves the others with more than the wanted thrust. Upright
    # that carries, and spins the body up, which is what it lacks.
    cut: PerRotor = _thrusts_for(vehicle, high, left).map(clip, low, high)
    chosen = cut + (_nearest(vehicle, cut, (low, high), left) - cut) * fades
    return wrench_of(vehicle, chosen + held)


def _nearest(vehicle: Vehicle, thrust: PerRotor, limits: tuple[PerRotor, PerRotor], wrench: Wrench) -> PerRotor:
    """Thrusts in N within limits whose thrust and tilt torque miss those that are wanted by least squares.

    One rotor after the other is put where it is best with the others as they are, within its limits; so it is
    continuous in all that goes in, and a rotor that can give nothing changes nothing, however many others there are.
    """
    low, high = limits
    rows = effectiveness(vehicle)[:3]
    up, roll, pitch = rows
    squared = (roll.dot(roll) + pitch.dot(pitch)) * (THRUST_WORTH / vehicle.rotors)
    found = [*thrust]
    lacks = wrench.thrust - up.dot(thrust)
    x, y = wrench.torque_B.x - roll.dot(thrust), wrench.torque_B.y - pitch.dot(thrust)
    for _ in range(ROUNDS):
        for i in range(vehicle.rotors):
            a, b, c = up[i], roll[i], pitch[i]
            worth = a * squared
            best = found[i] + (worth * lacks + b * x + c * y) / (worth * a + b * b + c * c)
            moved = clip(best, low[i], high[i])
            more = moved - found[i]
            found[i] = moved
            lacks, x, y = lacks - a * more, x - b * more, y - c * more
    return PerRotor.of(found)


def relaxed_torque(
    axis: RelaxedAxis,
    error: TurningError,
    given_B: Vec3,
    switching_B: Vec3,
    vehicle: Vehicle,
    residual_speed: Scalar | Vec3,
    parameters: RelaxedParameters,
) -> tuple[RelaxedMemory, Vec3]:
    """Torque that steers the axis, and the memory of the next instant.

    Parameters
    ----------
    axis : RelaxedAxis
    error : TurningError
    given_B : Vec3, N m
        Torque that the believed rotors give now.
    switching_B : Vec3, rad/s^2
        Switching input of the law.
    vehicle : Vehicle
        As believed.
    residual_speed : scalar, rad/s
        Believed Omega of (4); of tilted rotors its vector.
    parameters : RelaxedParameters

    Returns
    -------
    memory : RelaxedMemory
    torque_B : Vec3
        In N m, body axes.
    """
    J, spin, to_B = vehicle.inertia, error.omega.z, axis.to_B
    across = 0.5 * (J.x + J.y)
    momentum = rotor_momentum(vehicle, residual_speed)
    precession = (J.z * spin + (momentum.z if isinstance(momentum, Vec3) else momentum)) / across
    weights = parameters.weights
    problem = SpinProblem(spin, precession, mean_bandwidth(vehicle), weights.angle, weights.rate)
    poles = improve(problem, axis.memory.poles)
    gain = spin_gain(problem, poles)
    # What keeps the error at zero: a wanted axis that moves in the world turns backwards in the body.
    turning = Vec3(error.rate.x, error.rate.y, spin)
    ahead = error.acceleration - Vec3(0.0, 0.0, spin).cross(error.rate)
    balance_B = body_momentum(vehicle, to_B @ ahead) - torque_of_motion(vehicle, to_B @ turning, residual_speed)
    # Of yaw nothing is lacking: what the air takes there is no error.
    over = given_B - balance_B
    turned = over_inertia(vehicle, Vec3(over.x, over.y, 0.0))
    lacking = to_B.T @ Vec3(turned.x, turned.y, 0.0)
    rate = error.omega - turning
    fed_back = [
        factor.times(Complex(state.x, state.y)) for factor, state in zip(gain, (error.e, rate, lacking), strict=True)
    ]
    u = Vec3(-sum(term.re for term in fed_back), -sum(term.im for term in fed_back), 0.0)
    return axis.memory._replace(poles=poles), balance_B + body_momentum(vehicle, to_B @ u + switching_B)
