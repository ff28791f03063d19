"""Numbers on their way into a vehicle file: with the unit of their key, finite, one for all rotors or for each."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import NamedTuple

from pydantic_core import PydanticCustomError

from rotorfault.base.errors import InputError, short
from rotorfault.base.number_rule import plain_number, real
from rotorfault.model.quantities import Quantity, RotorQuantity

UNITS = {
    "mass": "kg",
    "inertia_x": "kg m^2",
    "inertia_y": "kg m^2",
    "inertia_z": "kg m^2",
    "rotor_inertia": "kg m^2",
    "thrust_coefficient": "N/(rad/s)^2",
    "torque_ratio": "m",
    "thrust_min": "N",
    "thrust_max": "N",
    "rotor_bandwidth": "rad/s",
    "rotor_gain": "1",
    "linear_drag": "N s/m",
    "gravity": "m/s^2",
    "rotor_reaction": "1",
}
"""Numbers that each vehicle has, in the order of its file, with their units."""
OPTIONAL = {
    "inertia_xy": "kg m^2",
    "inertia_xz": "kg m^2",
    "inertia_yz": "kg m^2",
    "rotor_bandwidth_down": "rad/s",
    "thrust_curve": "1",
    "rotor_radius": "m",
}
"""Numbers that it may have; nobody is asked for them."""
AFTER = {
    "inertia_z": ("inertia_xy", "inertia_xz", "inertia_yz"),
    "rotor_bandwidth": ("rotor_bandwidth_down",),
    "rotor_reaction": ("thrust_curve", "rotor_radius"),
}
ORDER = [key for required in UNITS for key in (required, *AFTER.get(required, ()))]
"""All of them in the order of the file."""

GRAVITY = 9.81


class Given(NamedTuple):
    """Numbers that the user gives, SI units; None where not."""

    mass: float | None = None  # kg
    inertia: tuple[float, float, float] | None = None  # kg m^2, about forward, left and upward axis
    arm: float | None = None  # m, the longest
    rotor_inertia: float | None = None  # kg m^2
    thrust_coefficient: float | None = None  # N/(rad/s)^2
    torque_ratio: float | None = None  # m
    thrust_min: float | None = None  # N
    thrust_max: float | None = None  # N
    rotor_bandwidth: float | None = None  # rad/s
    linear_drag: float | None = None  # N s/m


def quantity(key: str, value: float, source: str) -> Quantity:
    """A number of the vehicle file with the unit of its key.

    Parameters
    ----------
    key : str
        Such as ``"mass"``.
    value : float
        In the unit of the key.
    source : str

    Raises
    ------
    InputError
        If it is not finite.
    """
    _require_finite(key, (value,), source)
    return Quantity(value=value, unit=_UNIT[key], source=source)


def rotor_quantity(key: str, values: Iterable[float], source: str) -> RotorQuantity:
    """A number of the rotors with the unit of its key: one where all have the same, to a part in a thousand.

    Parameters
    ----------
    key : str
        Such as ``"thrust_max"``.
    values : iterable of float
        Of each rotor, in the unit of the key.
    source : str

    Raises
    ------
    InputError
        If one is not finite.
    """
    found = tuple(values)
    _require_finite(key, found, source)
    one = max(found) - min(found) <= SAME * max(map(abs, found))
    return RotorQuantity(value=found[0] if one else found, unit=_UNIT[key], source=source)


def _require_finite(key: str, values: tuple[float, ...], source: str) -> None:
    for value in values:
        if not math.isfinite(value):
            raise InputError(f"{source}: {key} is {value}; allowed: a finite number")


_UNIT = UNITS | OPTIONAL
SAME = 1e-3  # relative: by as much numbers of rotors may differ and count as one


def same(values: Iterable[float], what: str, where: str, hint: str) -> float:
    """The value that all have, to a part in a thousand.

    Parameters
    ----------
    values : iterable of float
    what : str
        For the message.
    where : str
        The source.
    hint : str
        How to mend it.

    Raises
    ------
    InputError
        If they differ.
    """
    found = list(values)
    if max(found) - min(found) > SAME * max(map(abs, found)):
        raise InputError(
            f"{where}: {what} differs between rotors ({min(found):g} to {max(found):g}); a vehicle has one: {hint}"
        )
    return found[0]


def finite(text: str, what: str, where: str) -> float:
    """A finite number that a source writes.

    Parameters
    ----------
    text : str
    what : str
        What it is, for the message.
    where : str
        The source.

    Raises
    ------
    InputError
        If it is none.
    """
    number = plain_number(text.strip())
    if math.isnan(number):
        short = text.strip()[:40]
        raise InputError(f"{where}: {what} is {short!r}; allowed: a finite number, such as 0.5 or 1e-3")
    return number


def real_or_nan(value: object) -> float:
    """A number as a finite float; NaN if it is none.

    Parameters
    ----------
    value : object
    """
    try:
        number = real(value)
    except PydanticCustomError:
        return math.nan
    return number if math.isfinite(number) else math.nan


_UNIT_OF = {**UNITS, "inertia": "kg m^2", "arm": "m"}


def checked(given: Given) -> Given:
    """The numbers of the user as floats, each of which can be one of a vehicle.

    Parameters
    ----------
    given : Given

    Raises
    ------
    InputError
        If one is none, or not finite, or negative.
    """
    found: dict[str, float] = {}
    for key, value in given._asdict().items():
        if value is None:
            continue
        parts = value if key == "inertia" and isinstance(value, (tuple, list)) else (value,)
        numbers = [real_or_nan(part) for part in parts]
        low = "0 or more" if key in ("thrust_min", "rotor_inertia", "linear_drag") else "greater than 0"
        good = all(number > 0.0 or (number == 0.0 and low == "0 or more") for number in numbers)
        if not good or len(numbers) != (3 if key == "inertia" else 1):
            what = "three finite numbers" if key == "inertia" else "a finite number"
            raise InputError(f"{key}: got {short(value)}; allowed: {what}, {low}, in {_UNIT_OF[key]}")
        found[key] = tuple(numbers) if key == "inertia" else numbers[0]  # type: ignore[assignment]
    return Given(**found)  # type: ignore[arg-type]
