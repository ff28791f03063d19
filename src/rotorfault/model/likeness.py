"""Vehicles of the same shape: flights of a batch share one loop, so what any of them has all are given."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from rotorfault.maths.geometry import PerRotor, spread, zeros
from rotorfault.model.aerodynamics import still_air
from rotorfault.model.battery import no_battery
from rotorfault.model.thrust_curve import ThrustCurve
from rotorfault.model.tilt import upright
from rotorfault.model.vehicle import ROTOR_NUMBERS, Discs, Reversible, Vehicle, rotor_heights

PARTS = (
    "air", "curve", "discs", "battery", "rotor_z", "rotor_bandwidth_down", "inertia_products", "tilt", "reversible",
)  # fmt: skip
"""What a vehicle may have and most have not."""
MAY_DIFFER = (*ROTOR_NUMBERS, "rotor_bandwidth_down")


def in_air(vehicle: Vehicle) -> Vehicle:
    """The same vehicle with coefficients of the air, all 0 if it has none."""
    return vehicle if vehicle.air != () else vehicle._replace(air=still_air())


def has(vehicle: Vehicle) -> tuple[bool, ...]:
    """What a vehicle has of what not every one has, and which numbers it has for each rotor.

    Both decide what is computed.

    Parameters
    ----------
    vehicle : Vehicle
    """
    return (
        *(_is_there(getattr(vehicle, part)) for part in PARTS),
        *(isinstance(getattr(vehicle, key), PerRotor) for key in MAY_DIFFER),
    )


def bare(vehicle: Vehicle) -> Vehicle:
    """The same vehicle without what makes no difference to a hover that is steady and far from the ground.

    That is what the air does, the curve, the discs, the battery, the lag of falling thrust, and products of inertia.
    Tilted rotors stay tilted.
    """
    return vehicle._replace(air=(), curve=(), discs=(), battery=(), rotor_bandwidth_down=(), inertia_products=())


def alike(vehicles: Sequence[Vehicle]) -> list[Vehicle]:
    """The same vehicles, each with all that any of them has, at the numbers that make no difference.

    What has a closed form for some of them only is used for none.

    Parameters
    ----------
    vehicles : sequence of Vehicle
        With equally many rotors.
    """
    made = list(vehicles)
    for part in PARTS:
        there = [_is_there(getattr(one, part)) for one in made]
        if any(there):
            made = [
                one if has_it else _with(one, part, _without_effect(one, part))
                for one, has_it in zip(made, there, strict=True)
            ]
    if any(one.pairs != made[0].pairs for one in made):
        made = [one._replace(pairs=()) for one in made]
    for key in MAY_DIFFER:
        if any(isinstance(getattr(one, key), PerRotor) for one in made):
            made = [_with(one, key, spread(getattr(one, key), one.rotors)) for one in made]
    return made


def _is_there(part: object) -> bool:
    return not (isinstance(part, tuple) and part == ())


def _without_effect(vehicle: Vehicle, part: str) -> object:
    """What a vehicle that lacks a part is given in its place; a battery that no flight of its uses."""
    return {
        "air": still_air(),
        "curve": ThrustCurve(0.0, 0.0),
        "discs": Discs(0.0),
        "battery": no_battery(),
        "rotor_z": rotor_heights(vehicle),
        "rotor_bandwidth_down": vehicle.rotor_bandwidth,
        "inertia_products": zeros(),
        "tilt": upright(vehicle.rotors),
        "reversible": Reversible(),
    }[part]


def _with(vehicle: Vehicle, key: str, value: object) -> Vehicle:
    numbers: Any = {key: value}
    return vehicle._replace(**numbers)
