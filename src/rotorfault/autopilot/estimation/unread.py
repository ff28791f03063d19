r"""Body rates that the gyro does not tell: beyond the end of its range, or while it is silent.

A reading at the end of its range says "at least so much" and no more; one that is not valid says nothing. The rate of
such an axis becomes a state of the filter. The believed motion carries it on,

.. math:: \omega \leftarrow \omega + \tfrac{T}{2}(3\,\alpha_k - \alpha_{k-1}) - J^{-1}J_r\Delta\Omega\,e_z, \qquad
          J\alpha = \tau - d(\omega) - \omega\times(J\omega + J_r\Omega e_z)

(Adams and Bashforth, second order), with the torque :math:`\tau` of the believed rotors, the air's damping :math:`d`,
and the change of the rotors' momentum, which matters where thrusts change with each turn of the body. What measures
the attitude corrects it, for an error of the rate turns the body. At the end of the range it is kept from falling
below what is read.

Its error takes the place of that of the axis' bias: either is by how much the rate that the filter goes by is too
high, so nothing has to be done when an axis is lost but to add the noise of a reading. Meanwhile the bias stays what
it was, and its variance is kept aside and grows by its walk. When the gyro reads again, the state is the bias again,
with that variance, and independent of all others: of what had linked them most is gone by then.

The noise of the rate is that of an angular acceleration :math:`\alpha` that is wrong by the share `unknown_torque`,
of what the rotors' torques give about an axis in hover and of what their change of momentum gives now; it lasts as
long as rotors lag (bandwidth :math:`w_0`), which makes a density of :math:`\alpha\sqrt{2/w_0}`. Left out: that an
error of one such rate changes another by gyroscopic torques, and that the air damps it.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from rotorfault.autopilot.estimation.covariance import Filter
from rotorfault.autopilot.estimation.states import GYRO_BIAS
from rotorfault.base.one_line import record_line
from rotorfault.maths.geometry import PerRotor, Vec3, spread, zeros
from rotorfault.maths.scalar import Scalar, absolute, greater, greater_equal, less, maximum, minimum, select, sqrt
from rotorfault.model.mixer import hover_thrust
from rotorfault.model.motion import angular_acceleration, mean_bandwidth, torque_of_turning
from rotorfault.model.sensor_model import SensorNoise, Timing
from rotorfault.model.signals import Reading
from rotorfault.model.vehicle import (
    Vehicle,
    over_inertia,
    residual_speed,
    rotor_speeds,
    turn_against_rotors,
    wrench_of,
)

AT_END = 1.0 - 1e-9  # of the range: from here on a reading is cut


class Unread(NamedTuple):
    """What the filter carries on for rates that are not read."""

    axes: Vec3  # 1 for each axis that was not read at the last instant
    bias_variance: Vec3  # (rad/s)^2: of the gyro's biases
    turning: Vec3  # rad/s^2: believed angular acceleration at the last instant
    against: Scalar | Vec3  # rad/s: by which the body turns slower for the momentum of the believed rotors
    waited: Scalar | tuple[()] = ()  # instants since the last reading; empty of a gyro that measures at every one


def all_read(gyro: SensorNoise, thrust: PerRotor, vehicle: Vehicle) -> Unread:
    """Before the first instant.

    Parameters
    ----------
    gyro : SensorNoise
        As believed.
    thrust : PerRotor, N
        Of the believed rotors.
    vehicle : Vehicle
        As believed.
    """
    variance = gyro.bias * gyro.bias
    against = turn_against_rotors(vehicle, residual_speed(vehicle, rotor_speeds(vehicle, thrust)))
    return Unread(zeros(), Vec3(variance, variance, variance), zeros(), against, none_awaited(gyro.timing))


class TurningNoise(NamedTuple):
    """How wrong the believed angular acceleration may be: densities in units of 1/sqrt(Hz)."""

    hover: Vec3  # rad/s^2/sqrt(Hz): of the torques that rotors give in hover, about each axis
    share: Scalar  # 1/sqrt(Hz): of the angular acceleration by which the rotors' momentum changes

    def __repr__(self) -> str:
        return record_line(self)

    def drift(self, slower: Vec3, dt: Scalar) -> Vec3:
        """Variance in (rad/s)^2/s that a rate gains which is carried on.

        Parameters
        ----------
        slower : Vec3, rad/s
            By which the rotors' change of momentum has turned the body slower over the last period.
        dt : scalar, s
        """
        change = self.share / dt
        gained: Vec3 = self.hover.times(self.hover) + slower.times(slower) * (change * change)
        return gained


def turning_noise(vehicle: Vehicle, share: Scalar) -> TurningNoise:
    """Noise of the believed angular acceleration.

    Parameters
    ----------
    vehicle : Vehicle
        As believed.
    share : scalar
        Of torques and of changes of momentum: unknown.
    """
    hover = spread(hover_thrust(vehicle), vehicle.rotors)
    size = zeros()
    for i in range(vehicle.rotors):
        alone = PerRotor.of(thrust if i == k else 0.0 for k, thrust in enumerate(hover))
        size = size + over_inertia(vehicle, wrench_of(vehicle, alone).torque_B).map(absolute)
    lasting = share * sqrt(2.0 / mean_bandwidth(vehicle))
    return TurningNoise(size * lasting, lasting)


def none_awaited(timing: Timing) -> Scalar | tuple[()]:
    """What `spoken` needs to remember before the first instant: nothing of a sensor that measures at every one."""
    return 0.0 if timing.every > 1 else ()


def spoken(reading: Reading[Any], waited: Scalar | tuple[()], timing: Timing) -> tuple[Scalar, Scalar | tuple[()]]:
    """1 unless a sensor is silent, whose last reading stands until the next is due; and how long it has stood.

    Parameters
    ----------
    reading : Reading
    waited : scalar, or empty
        Instants since the last reading, before this one.
    timing : Timing
        Of the sensor.
    """
    if isinstance(waited, tuple):
        return reading.valid, ()
    waits = (waited + 1.0) * (1.0 - reading.valid)
    return less(waits, timing.every - 0.5), waits


def not_read(gyro: Reading[Vec3], there: Scalar, noise: SensorNoise) -> tuple[Vec3, Vec3]:
    """For each axis 1 if its reading is at the end of the range, and 1 if it tells no rate.

    Parameters
    ----------
    gyro : Reading of Vec3, rad/s
    there : scalar
        Of `spoken`.
    noise : SensorNoise
        Of the gyro, as believed.
    """
    limit = noise.limit * AT_END
    at_end = gyro.value.map(lambda one: greater_equal(absolute(one), limit) * there)
    return at_end, at_end.map(lambda one: 1.0 - (1.0 - one) * there)


def carried_on(
    unread: Unread, rates: Vec3, thrust: PerRotor, vehicle: Vehicle, spell: Scalar
) -> tuple[Vec3, Vec3, Unread]:
    """Rates of the last instant a period later by the believed motion; what rotors took of them; for the next one.

    Parameters
    ----------
    unread : Unread
    rates : Vec3, rad/s
        Of the last instant.
    thrust : PerRotor, N
        Of the believed rotors over the period.
    vehicle : Vehicle
        As believed.
    spell : scalar, s
    """
    speeds = rotor_speeds(vehicle, thrust)
    torque = wrench_of(vehicle, thrust).torque_B
    if vehicle.air != ():
        torque = torque + torque_of_turning(vehicle, rates, speeds)
    residual = residual_speed(vehicle, speeds)
    turning = angular_acceleration(vehicle, torque, rates, residual)
    against = turn_against_rotors(vehicle, residual)
    gap = against - unread.against
    slower = gap if isinstance(gap, Vec3) else Vec3(0.0, 0.0, gap)
    carried = rates + (turning * 1.5 - unread.turning * 0.5) * spell - slower
    return carried, slower, unread._replace(turning=turning, against=against)


def rate_of(read: Vec3, carried: Vec3, gyro: Vec3, at_end: Vec3, axes: Vec3) -> Vec3:
    """Rates in rad/s to go by: as read, or where they are not, as carried on.

    Parameters
    ----------
    read : Vec3, rad/s
        The reading less the bias.
    carried : Vec3, rad/s
        Of `carried_on`.
    gyro : Vec3, rad/s
        The reading.
    at_end, axes : Vec3
        Of `not_read`.
    """

    def one(read: Scalar, carried: Scalar, gyro: Scalar, at_end: Scalar, unread: Scalar) -> Scalar:
        beyond = select(greater(gyro, 0.0), maximum(carried, read), minimum(carried, read))
        return select(unread, select(at_end, beyond, carried), read)

    return Vec3.of(map(one, read, carried, gyro, at_end, axes))


def handed_over(filter_: Filter, unread: Unread, axes: Vec3, gyro: SensorNoise) -> None:
    """What a state of the filter stands for, where that has changed since the last instant.

    Parameters
    ----------
    filter_ : Filter
    unread : Unread
        Of the last instant.
    axes : Vec3
        Of `not_read`.
    gyro : SensorNoise
        As believed.
    """
    reading = gyro.std * gyro.std + 0.5 * gyro.vibration * gyro.vibration
    for i, (was, now, variance) in enumerate(zip(unread.axes, axes, unread.bias_variance, strict=True)):
        again, lost = was * (1.0 - now), now * (1.0 - was)
        filter_.scale(GYRO_BIAS + i, 1.0 - again)
        filter_.blur(GYRO_BIAS + i, again * variance + lost * reading)


def kept(filter_: Filter, unread: Unread, axes: Vec3, walk: Scalar, spell: Scalar) -> Unread:
    """For the next instant.

    Parameters
    ----------
    filter_ : Filter
        After all corrections.
    unread : Unread
        Of `carried_on`.
    axes : Vec3
        Of `not_read`.
    walk : scalar, rad/s/sqrt(s)
        Of the gyro's bias.
    spell : scalar, s
    """
    variance = [
        select(now, before + walk * walk * spell, filter_[GYRO_BIAS + i, GYRO_BIAS + i])
        for i, (now, before) in enumerate(zip(axes, unread.bias_variance, strict=True))
    ]
    return unread._replace(axes=axes, bias_variance=Vec3.of(variance))
