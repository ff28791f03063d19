r"""What a wrong model, and noise, show as lost thrust: thresholds are raised by as much.

An observer blames the rotors for whatever its model gets wrong. How much that is follows from the flight: to first
order, moments of inertia and a rotor bandwidth that are wrong by the shares :math:`e_J, e_w` misstate the thrusts by

.. math:: \Delta F_J = B^{-1}\left(e_J J\dot\omega + \omega\times e_J J\omega\right), \qquad
          \Delta F_w = e_w\,\frac{\partial F}{\partial\ln w} = e_w\,s, \qquad \dot s = w\,(c - F - s)

with the body's rates and their derivative. Of the gyroscopic torque, that about the yaw axis matters most: two fast
rates meet the axis about which rotors can do least. The observer shows all of it as it shows lost thrust, late: it
passes through the error dynamics,

.. math:: \nu_{k+1} = (1 - L_1)\,\nu_k + T(a_k - \hat\delta_k), \qquad
          \hat\delta_{k+1} = \hat\delta_k + L_2\,\nu_{k+1}

so the same filter runs on what a share of 1 would show. In steady flight, with the torque of a lost rotor balanced,
no body accelerates and no rotor lags: then a wrong inertia or bandwidth explains nothing, and a small loss is seen.

Where rotors react on the body, a wrong bandwidth misstates their change of speed too, and with it the yaw rate; and a
rotor that is flagged may be stuck, so that the reaction that the model lays to it never comes.

A torque about the yaw axis weighs on two opposite rotors alike. So a rotor is also compared with its partner, where
errors about yaw, which are the largest by far in a hard turn, explain nothing.

Noise is no model; it is estimated from the innovations of each channel, weighted with what the channel makes of
rotor thrusts: yaw most of all, by :math:`J_z/(4\kappa)` against :math:`J_x/(2l)`.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

from rotorfault.autopilot.prediction import Expectation
from rotorfault.maths.geometry import PerRotor, Vec3, zeros
from rotorfault.maths.scalar import Scalar, absolute, less, maximum, minimum, sqrt
from rotorfault.model.mixer import PairDemand, from_pairs, pair_demand
from rotorfault.model.motion import lag_bandwidth, limited
from rotorfault.model.signals import Wrench
from rotorfault.model.vehicle import Vehicle, rate_against_rotors, residual_speed, rotor_speeds, wrench_of

SPEED_SHARE = -0.3  # of the bandwidth, for rotor speeds: slower rotors, for there the root is steeper
NOISE_MEMORY = 0.5  # s: long beside a fault's onset, which is no noise; short beside a change of the weather


class Shares(NamedTuple):
    """By which shares the believed model may be wrong."""

    inertia: Scalar
    bandwidth: Scalar


class Dynamics(NamedTuple):
    """How the observer shows what is not in its model."""

    gain_rate: Scalar  # L_1
    gain_deviation: Scalar  # 1/s: L_2
    noise_gain: Scalar  # 1/s: standard deviation of a deviation over that of the innovation, for white noise
    lag_decay: Scalar  # what remains of a rotor's lag over one period


class ModelErrorMemory(NamedTuple):
    """What shares of 1 would show now, behind the observer's error dynamics, and the noise."""

    lag: PerRotor  # N: sensitivity of the thrusts to the logarithm of the bandwidth
    lag_innovation: PerRotor  # N s
    lagging: PerRotor  # N: the sensitivity, late
    turn_innovation: Vec3  # rad/s
    turning: Vec3  # rad/s^2: angular acceleration, late
    product_innovation: Vec3  # rad^2/s
    product: Vec3  # rad^2/s^2: products of the rates about the two other axes, late
    reaction: Scalar  # rad/s: sensitivity of the yaw rate to the logarithm of the bandwidth, by the rotors' reaction
    reaction_innovation: Scalar  # rad/s
    reacting: Scalar  # rad/s^2: its derivative, late
    spin_innovation: PerRotor  # rad/s
    spinning: PerRotor  # rad/s^2: derivative of the rotors' speeds, as believed, late
    time: Scalar  # s: that the noise has been looked at, `NOISE_MEMORY` at most
    noise: Vec3  # rad^2/s^2: mean square of the innovations of the body rates


def noise_gain(gain_rate: float, gain_deviation: float, period: float) -> float:
    """Standard deviation of a channel's deviation over that of its innovation, in 1/s.

    Parameters
    ----------
    gain_rate, gain_deviation : float
        Of the observer.
    period : float, s
        Of sampling; what is measured has white noise.
    """
    innovations, deviations = noise_energies(gain_rate, gain_deviation, period)
    return math.sqrt(deviations / innovations)


@lru_cache(maxsize=64)
def noise_energies(gain_rate: float, gain_deviation: float, period: float) -> tuple[float, float]:
    """Variances of a channel's innovation, and of its deviation in 1/s^2, over that of white noise measured.

    Parameters
    ----------
    gain_rate, gain_deviation : float
        Of the observer.
    period : float, s
        Of sampling.
    """
    # Responses to a single error of measurement, until nothing of it is left.
    rate = deviation = innovations = deviations = 0.0
    for k in range(100_000):
        innovation = (1.0 if k == 0 else 0.0) - rate - period * deviation
        rate += period * deviation + gain_rate * innovation
        deviation += gain_deviation * innovation
        innovations += innovation * innovation
        deviations += deviation * deviation
        if k > 10 and abs(innovation) < 1e-9 and abs(deviation) < 1e-9 * gain_deviation:
            break
    return innovations, deviations


def nothing_shown(rotors: int = 4) -> ModelErrorMemory:
    """Before the first instant, of so many rotors."""
    none, still = PerRotor.all(0.0, rotors), zeros()
    return ModelErrorMemory(none, none, none, still, still, still, still, 0.0, 0.0, 0.0, none, none, 0.0, still)


def follow(
    memory: ModelErrorMemory,
    expectation: Expectation,
    command: PerRotor,
    innovation: Vec3,
    vehicle: Vehicle,
    dynamics: Dynamics,
) -> ModelErrorMemory:
    """One period further.

    Parameters
    ----------
    memory : ModelErrorMemory
    expectation : Expectation
        Of the period.
    command : PerRotor, N
        Held over it.
    innovation : Vec3, rad/s
        Of the observer's body rates.
    vehicle : Vehicle
        As believed.
    dynamics : Dynamics
    """
    elapsed, kept = expectation.elapsed, 1.0 - dynamics.gain_rate
    lag = lag_sensitivity(memory.lag, expectation, command, vehicle, dynamics.lag_decay)

    lag_innovation = memory.lag_innovation * kept + (lag - memory.lagging) * elapsed
    turned = expectation.now.omega_B - expectation.previous.omega_B
    turn_innovation = memory.turn_innovation * kept + turned - memory.turning * elapsed
    x, y, z = expectation.now.omega_B
    product_innovation = memory.product_innovation * kept + (Vec3(y * z, z * x, x * y) - memory.product) * elapsed
    reaction = reaction_sensitivity(lag, expectation, vehicle)
    # On a vehicle without a reaction, which is known before the flight, nothing is remembered of it, and it is free.
    there = less(0.0, vehicle.rotor_reaction)
    before, reacting = memory.reaction * there, memory.reacting * there
    reaction_innovation = (memory.reaction_innovation * there) * kept + reaction - before - reacting * elapsed
    spinning = memory.spinning * there
    spin_innovation = (memory.spin_innovation * there) * kept + expectation.sped * there - spinning * elapsed
    time = minimum(memory.time + elapsed, NOISE_MEMORY)
    # The mean at first, and later with an exponential window.
    share = elapsed / maximum(time, 1e-9)
    squared = Vec3(*(x * x for x in innovation))
    return ModelErrorMemory(
        lag=lag,
        lag_innovation=lag_innovation,
        lagging=memory.lagging + lag_innovation * dynamics.gain_deviation,
        turn_innovation=turn_innovation,
        turning=memory.turning + turn_innovation * dynamics.gain_deviation,
        product_innovation=product_innovation,
        product=memory.product + product_innovation * dynamics.gain_deviation,
        reaction=reaction,
        reaction_innovation=reaction_innovation,
        reacting=reacting + reaction_innovation * dynamics.gain_deviation,
        spin_innovation=spin_innovation,
        spinning=spinning + spin_innovation * dynamics.gain_deviation,
        time=time,
        noise=memory.noise + (squared - memory.noise) * share,
    )


def lag_sensitivity(
    lag: PerRotor, expectation: Expectation, command: PerRotor, vehicle: Vehicle, decay: Scalar
) -> PerRotor:
    """Sensitivity in N of the thrusts to the logarithm of the bandwidth, one period later.

    Parameters
    ----------
    lag : PerRotor, N
        Of the instant before.
    expectation : Expectation
        Of the period.
    command : PerRotor, N
        Held over it.
    vehicle : Vehicle
        As believed.
    decay : scalar
        What remains of a rotor's lag over one period.
    """
    entering = limited(vehicle, command)
    ahead = entering * vehicle.rotor_gain - expectation.thrust
    bandwidth = vehicle.rotor_bandwidth
    if not isinstance(vehicle.rotor_bandwidth_down, tuple):
        bandwidth = lag_bandwidth(vehicle, expectation.thrust / vehicle.rotor_gain, entering)
    after: PerRotor = lag * decay + ahead * (bandwidth * expectation.elapsed)
    return after


def reaction_sensitivity(lag: PerRotor, expectation: Expectation, vehicle: Vehicle) -> Scalar:
    """Sensitivity in rad/s of the yaw rate to the logarithm of the bandwidth, by the rotors' reaction.

    A rotor that runs ahead of its model has also turned the body further the other way. Its speed is a root of its
    thrust, so the difference is that of a share as large as bandwidths are wrong by.

    Parameters
    ----------
    lag : PerRotor, N
        From `lag_sensitivity`.
    expectation : Expectation
        Of the period.
    vehicle : Vehicle
        As believed.
    """
    ahead_of_model = rotor_speeds(vehicle, expectation.thrust + lag * SPEED_SHARE)
    ran_ahead = _about_z(residual_speed(vehicle, ahead_of_model) - expectation.residual_speed)
    return -rate_against_rotors(vehicle, ran_ahead) / SPEED_SHARE


def _about_z(residual: Scalar | Vec3) -> Scalar:
    """Of a residual speed what lies along body z, where one torque matters most."""
    return residual.z if isinstance(residual, Vec3) else residual


class Misstated(NamedTuple):
    """Squares of the thrust by which a sound rotor may seem to fall behind others because the model is wrong."""

    any: PerRotor  # N^2: behind any other
    partner: PerRotor  # N^2: behind the one opposite, which a torque about the yaw axis cannot tell from it
    drag: PerRotor | tuple[()] = ()  # N: behind any other, by the drag of each rotor; empty where none has any


def misstated(
    memory: ModelErrorMemory,
    flagged: PerRotor,
    shares: Shares,
    vehicle: Vehicle,
    drag: PerRotor | tuple[()] = (),
) -> Misstated:
    """How much less thrust than another a sound rotor may seem to give by a wrong model.

    The errors are taken as independent, so their squares add.

    Parameters
    ----------
    memory : ModelErrorMemory
    flagged : PerRotor
        1 for a rotor that may be at fault: it may be stuck, and then turns nothing where its model changes its speed.
    shares : Shares
    vehicle : Vehicle
        As believed.
    drag : PerRotor, N m, optional
        Most torque about yaw by the drag of each rotor; empty where none has any.
    """
    inertia = vehicle.inertia
    torque = _by_inertia(memory, shares, vehicle)
    roll, pitch, yaw = _unit_torques(vehicle)
    arm_12 = absolute(roll.D12) * torque.x + absolute(pitch.D12) * torque.y
    arm_34 = absolute(roll.D34) * torque.x + absolute(pitch.D34) * torque.y
    about_yaw = absolute(yaw.S12 - yaw.S34)
    unlike = absolute(rate_against_rotors(vehicle, _about_z(residual_speed(vehicle, memory.spinning * flagged))))
    turned = 0.5 * (arm_12 + arm_34 + about_yaw * (torque.z + inertia.z * unlike))
    reacted = 0.5 * about_yaw * inertia.z * absolute(memory.reacting)
    least, most = memory.lagging.reduce(minimum), memory.lagging.reduce(maximum)

    def square(lagging: Scalar, reacted: Scalar) -> Scalar:
        # Beside the rotor whose lag is least like its own; the reaction comes from the same error, so sizes add.
        error = shares.bandwidth * (maximum(most - lagging, lagging - least) + reacted)
        return error * error

    any_other = memory.lagging.map(lambda lagging: square(lagging, reacted) + turned * turned)
    lagged = memory.lagging.map(lambda lagging: square(lagging, 0.0))
    first, second = arm_12 * arm_12, arm_34 * arm_34
    beside = from_pairs(vehicle, PerRotor(first, first, second, second))
    blown = () if isinstance(drag, tuple) else drag * (0.5 * about_yaw)
    return Misstated(any_other, lagged + beside, blown)


def _by_inertia(memory: ModelErrorMemory, shares: Shares, vehicle: Vehicle) -> Vec3:
    """Torque in N m about each axis that a wrong inertia may show."""
    inertia = vehicle.inertia
    others = Vec3(inertia.y + inertia.z, inertia.z + inertia.x, inertia.x + inertia.y)
    turning, product = inertia.times(memory.turning), others.times(memory.product)
    # Errors of the axes are independent: their sizes add, however they share out over the arms.
    return Vec3(*(shares.inertia * (absolute(a) + absolute(b)) for a, b in zip(turning, product, strict=True)))


def torque_variances(
    memory: ModelErrorMemory, flagged: PerRotor, shares: Shares, vehicle: Vehicle, dynamics: Dynamics
) -> tuple[Vec3, Vec3]:
    """Variances in (N m)^2 of the observed torque about the body axes: by noise, and by a wrong model.

    Parameters
    ----------
    memory : ModelErrorMemory
    flagged : PerRotor
        1 for a rotor that may be at fault; see `misstated`.
    shares : Shares
    vehicle : Vehicle
        As believed.
    dynamics : Dynamics
    """
    inertia = vehicle.inertia
    squared = inertia.times(inertia) * (dynamics.noise_gain * dynamics.noise_gain)
    lagging = wrench_of(vehicle, memory.lagging).torque_B
    unlike = absolute(rate_against_rotors(vehicle, _about_z(residual_speed(vehicle, memory.spinning * flagged))))
    own = Vec3(0.0, 0.0, inertia.z * unlike)
    reacted = Vec3(0.0, 0.0, inertia.z * absolute(memory.reacting))
    wrong = [
        a + b + shares.bandwidth * (absolute(c) + d)
        for a, b, c, d in zip(_by_inertia(memory, shares, vehicle), own, lagging, reacted, strict=True)
    ]
    noise = memory.noise.map(lambda x: maximum(x, 0.0))
    return squared.times(noise), Vec3(*(x * x for x in wrong))


def noise_of(memory: ModelErrorMemory, vehicle: Vehicle, dynamics: Dynamics) -> Scalar:
    """Standard deviation by noise of the difference of two rotors' residuals, in N.

    Parameters
    ----------
    memory : ModelErrorMemory
    vehicle : Vehicle
        As believed.
    dynamics : Dynamics
    """
    roll, pitch, yaw = _unit_torques(vehicle)
    # Rotors of different pairs differ by half of each arm's difference and half of that of the sums.
    weights = Vec3(
        roll.D12 * roll.D12 + roll.D34 * roll.D34,
        pitch.D12 * pitch.D12 + pitch.D34 * pitch.D34,
        (yaw.S12 - yaw.S34) * (yaw.S12 - yaw.S34),
    )
    squared = vehicle.inertia.times(vehicle.inertia)
    return 0.5 * dynamics.noise_gain * sqrt(maximum(weights.times(squared).dot(memory.noise), 0.0))


def _unit_torques(vehicle: Vehicle) -> tuple[PairDemand, PairDemand, PairDemand]:
    """Pair sums and differences in N that give 1 N m about each axis."""
    x, y, z = (
        pair_demand(vehicle, Wrench(0.0, axis))
        for axis in (Vec3(1.0, 0.0, 0.0), Vec3(0.0, 1.0, 0.0), Vec3(0.0, 0.0, 1.0))
    )
    return x, y, z
