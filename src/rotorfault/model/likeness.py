"""Vehicles of the same shape: flights of a batch share one loop, so what any of them has all are given."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from rotorfault.maths.geometry import PerRotor, spread, zeros
from rotorfault.model.aerodynamics import still_air
from rotorfault.model.tilt import upright
from rotorfault.model.vehicle import ROTOR_NUMBERS, Reversible, Vehicle


def in_air(vehicle: Vehicle) -> Vehicle:
    """The same vehicle with coefficients of the air, all 0 if it has none."""
    return vehicle if vehicle.air != () else vehicle._replace(air=still_air(vehicle.rotors))


def alike(vehicles: Sequence[Vehicle]) -> list[Vehicle]:
    """The same vehicles, each with all that any of them has, at the numbers that make no difference.

    What has a closed form for some of them only is used for none.

    Parameters
    ----------
    vehicles : sequence of Vehicle
        With equally many rotors.
    """
    made = list(vehicles)
    if any(one.air != () for one in made):
        made = [in_air(one) for one in made]
    if any(one.pairs != made[0].pairs for one in made):
        made = [one._replace(pairs=()) for one in made]
    if any(one.inertia_products != () for one in made):
        made = [one if one.inertia_products != () else one._replace(inertia_products=zeros()) for one in made]
    if any(one.tilt != () for one in made):
        made = [one if one.tilt != () else one._replace(tilt=upright(one.rotors)) for one in made]
    if any(one.reversible != () for one in made):
        made = [one._replace(reversible=Reversible()) for one in made]
    if not all(isinstance(one.rotor_bandwidth_down, tuple) for one in made):
        made = [
            one
            if not isinstance(one.rotor_bandwidth_down, tuple)
            else one._replace(rotor_bandwidth_down=one.rotor_bandwidth)
            for one in made
        ]
    for key in (*ROTOR_NUMBERS, "rotor_bandwidth_down"):
        if any(isinstance(getattr(one, key), PerRotor) for one in made):
            made = [_with(one, key, spread(getattr(one, key), one.rotors)) for one in made]
    return made


def _with(vehicle: Vehicle, key: str, value: PerRotor) -> Vehicle:
    numbers: Any = {key: value}
    return vehicle._replace(**numbers)
