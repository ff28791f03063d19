r"""Rotors: first-order lag from commanded to delivered thrust, and what a fault does to it.

.. math:: \dot v_i = w_0(u_i - v_i), \qquad F_i = (1 - loss_i)\,k\,v_i

Equations (7), (8) of the paper; u_i is the command within the rotor limits. Readings (docs/paper.md): a loss acts
*after* the lag, at once; and what is lost is thrust, not speed: a rotor with a loss still spins as fast as a sound
one with the same lag output, so rotor speeds, and with them the gyroscopic torque, belong to the sound thrust k v.
A stuck rotor spins at the speed that gives its fixed thrust.
"""

from __future__ import annotations

from rotorfault.maths.geometry import PerRotor
from rotorfault.maths.scalar import clip, maximum, select
from rotorfault.model.vehicle import Vehicle, rotor_speeds
from rotorfault.plant.faults import RotorFault

# Below this share of the greatest thrust no share of it can be named.
_LEAST_SHARE = 0.05


def lag_derivative(vehicle: Vehicle, output: PerRotor, limited: PerRotor) -> PerRotor:
    """Time derivative in N/s of the lag outputs v in N, for commands in N that are within the limits."""
    rate: PerRotor = (limited - output) * vehicle.rotor_bandwidth
    return rate


def delivered_thrust(vehicle: Vehicle, output: PerRotor, fault: RotorFault) -> PerRotor:
    """Thrusts in N that act on the body, for lag outputs in N."""
    followed = output * (fault.effectiveness * vehicle.rotor_gain)
    return fault.stuck.map(select, fault.stuck_thrust, followed)


def true_rotor_speeds(vehicle: Vehicle, output: PerRotor, fault: RotorFault) -> PerRotor:
    """Rotor speeds in rad/s, without sign, for lag outputs in N."""
    sound = output * vehicle.rotor_gain
    return rotor_speeds(vehicle, fault.stuck.map(select, fault.stuck_thrust, sound))


def true_loss(vehicle: Vehicle, output: PerRotor, fault: RotorFault) -> PerRotor:
    """Lost share of the thrust per rotor.

    For a stuck rotor it is the share by which its thrust falls short of the sound one, between 0 and 1; this
    depends on what is commanded.
    """
    sound = output * vehicle.rotor_gain
    least = _LEAST_SHARE * vehicle.rotor_gain * vehicle.thrust_max
    short = fault.stuck_thrust.map(lambda held, f: clip(1.0 - held / maximum(f, least), 0.0, 1.0), sound)
    return fault.stuck.map(select, short, 1.0 - fault.effectiveness)
