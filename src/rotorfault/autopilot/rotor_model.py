"""The autopilot's model of its own rotors: what thrust a sound rotor gives for the commands that were sent.

First-order lag (7), (8) under zero-order hold, exact (`rotorfault.model.motion.lag_held`). Losses are not in it: it
says what healthy rotors would do, so that deviations from it are faults (or wind).
"""

from __future__ import annotations

from typing import NamedTuple

from rotorfault.maths.geometry import PerRotor
from rotorfault.maths.scalar import Scalar
from rotorfault.model.mixer import hover_thrust
from rotorfault.model.motion import lag_bandwidth, lag_held, limited
from rotorfault.model.vehicle import Vehicle


class RotorModel(NamedTuple):
    """Thrust of sound rotors, as believed."""

    lagged: PerRotor  # N: output of the lag now, before the gain
    mean: PerRotor  # N: thrust averaged over the last period, gain included


def rotors_at_hover(vehicle: Vehicle) -> RotorModel:
    """Rotors that carry the weight in level hover."""
    thrust = hover_thrust(vehicle)
    return RotorModel(lagged=thrust / vehicle.rotor_gain, mean=thrust)


def expected_thrust(model: RotorModel, vehicle: Vehicle) -> PerRotor:
    """Thrust of sound rotors now, in N."""
    thrust: PerRotor = model.lagged * vehicle.rotor_gain
    return thrust


def follow(model: RotorModel, command: PerRotor, vehicle: Vehicle, dt: Scalar) -> RotorModel:
    """Hold commands [N] for a period; they are limited as the rotors limit them."""
    entering = limited(vehicle, command)
    end, mean = lag_held(model.lagged, entering, lag_bandwidth(vehicle, model.lagged, entering), dt)
    return RotorModel(lagged=end, mean=mean * vehicle.rotor_gain)
