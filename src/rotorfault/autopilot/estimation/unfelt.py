r"""The specific force while the accelerometer is silent: what it was, and what the believed thrust has changed since.

.. math:: f \leftarrow f + e_z\,\Delta T/m

What it felt last holds the air's drag and all that is wrong of the believed thrust, so the change alone is taken from
belief. What is wrong of that is white noise of the velocity: the share `unknown_torque` of the weight's acceleration,
which lasts as long as rotors lag (as for a torque, `rotorfault.autopilot.estimation.unread`). The bias goes on being
corrected, and the force with it, for what it felt last was off by it.
"""

from __future__ import annotations

from typing import NamedTuple

from rotorfault.autopilot.estimation.unread import none_awaited, spoken
from rotorfault.maths.geometry import PerRotor, Vec3
from rotorfault.maths.records import select_record
from rotorfault.maths.scalar import Scalar, sqrt
from rotorfault.model.motion import mean_bandwidth
from rotorfault.model.sensor_model import Timing
from rotorfault.model.signals import Reading
from rotorfault.model.vehicle import Vehicle, wrench_of


class Unfelt(NamedTuple):
    """What the filter goes by while it feels nothing."""

    force_B: Vec3  # m/s^2: of the last instant, without bias
    lift: Scalar  # m/s^2: of the believed rotors then
    waited: Scalar | tuple[()]  # instants since the last reading; empty if it measures at every one


def all_felt(force_B: Vec3, timing: Timing, vehicle: Vehicle, thrust: PerRotor) -> Unfelt:
    """Before the first instant.

    Parameters
    ----------
    force_B : Vec3, m/s^2
        The first reading.
    timing : Timing
        Of the accelerometer.
    vehicle : Vehicle
        As believed.
    thrust : PerRotor, N
        Of the believed rotors.
    """
    return Unfelt(force_B, _lift(vehicle, thrust), none_awaited(timing))


def unfelt_noise(vehicle: Vehicle, share: Scalar) -> Scalar:
    """Density in m/s^2/sqrt(Hz) of a force that is carried on.

    Parameters
    ----------
    vehicle : Vehicle
        As believed.
    share : scalar
        Of the thrust in hover: unknown.
    """
    return share * vehicle.gravity * sqrt(2.0 / mean_bandwidth(vehicle))


def force_of(
    unfelt: Unfelt, read: Vec3, reading: Reading[Vec3], timing: Timing, vehicle: Vehicle, thrust: PerRotor
) -> tuple[Vec3, Scalar, Unfelt]:
    """The specific force to go by in m/s^2, 1 where it is carried on, and what to remember but the force.

    Parameters
    ----------
    unfelt : Unfelt
        Of the last instant.
    read : Vec3, m/s^2
        The reading, without bias and lever.
    reading : Reading of Vec3
    timing : Timing
        Of the accelerometer.
    vehicle : Vehicle
        As believed.
    thrust : PerRotor, N
        Of the believed rotors.
    """
    there, waited = spoken(reading, unfelt.waited, timing)
    lift = _lift(vehicle, thrust)
    carried = unfelt.force_B + Vec3(0.0, 0.0, lift - unfelt.lift)
    return select_record(there, read, carried), 1.0 - there, Unfelt(read, lift, waited)


def _lift(vehicle: Vehicle, thrust: PerRotor) -> Scalar:
    return wrench_of(vehicle, thrust).thrust / vehicle.mass
