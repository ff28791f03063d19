"""A vehicle with some numbers times factors, or its centre of mass elsewhere: what `mismatch` makes of a vehicle."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from pydantic import AfterValidator
from pydantic_core import PydanticCustomError

from rotorfault.base.config import refusal
from rotorfault.model.quantities import Quantity, Rotor, RotorQuantity
from rotorfault.model.vehicle_file import VehicleFile

Factor = float | Sequence[float]
"""On a number; on one of the rotors, also one for each of them."""
AT_THE_ORIGIN = (0.0, 0.0, 0.0)


def with_factors(
    file: VehicleFile, factors: Mapping[str, Factor], shift: Sequence[float] = AT_THE_ORIGIN
) -> VehicleFile:
    """The same vehicle with some numbers times factors; it keeps the rules of a file that say what can exist.

    One that is too heavy to hover exists: maps show where that begins. Products of inertia go with the roots of the
    factors on the moments about both axes, so that a matrix with positive moments stays one; the bandwidth of thrust
    that falls goes with that of thrust that rises.

    Parameters
    ----------
    file : VehicleFile
    factors : mapping
        By key, such as ``mass``; those that are 1 change nothing.
    shift : sequence of 3 floats, m
        By which the centre of mass is elsewhere: forward, left, up. The inertia is about it all the same.

    Raises
    ------
    PydanticCustomError
        If such a vehicle is none.
    """
    changed: dict[str, object] = {}
    for key, factor in {**factors, **_following(file, factors)}.items():
        if not isinstance(factor, Sequence) and factor == 1.0:
            continue
        changed[key] = made = _times(file, key, factor)
        try:
            for rule in type(file).model_fields[key].metadata:
                if isinstance(rule, AfterValidator):
                    rule.func(made)  # type: ignore[call-arg]
        except PydanticCustomError as error:
            raise refusal(key, error.message()) from None
    if any(shift):
        changed["rotor"] = tuple(_moved(rotor, shift) for rotor in file.rotor)
    if not changed:
        return file
    whole = file.model_copy(update=changed)
    wrong = whole.check_existence()
    if wrong is not None:
        raise wrong
    return whole


def _following(file: VehicleFile, factors: Mapping[str, Factor]) -> dict[str, Factor]:
    """Factors on what goes with other numbers."""
    found: dict[str, Factor] = {}
    for a, b in ("xy", "xz", "yz"):
        one, other = (factors.get(f"inertia_{axis}", 1.0) for axis in (a, b))
        if getattr(file, f"inertia_{a}{b}") is not None and isinstance(one, float) and isinstance(other, float):
            found[f"inertia_{a}{b}"] = math.sqrt(one) * math.sqrt(other)
    if file.rotor_bandwidth_down is not None and "rotor_bandwidth" in factors:
        found["rotor_bandwidth_down"] = factors["rotor_bandwidth"]
    return found


def _times(file: VehicleFile, key: str, factor: Factor) -> Quantity | RotorQuantity:
    """A number of the file times a factor, or one for each rotor."""
    old: Quantity | RotorQuantity = getattr(file, key)
    rotors = len(file.rotor)
    value: float | tuple[float, ...]
    if isinstance(factor, Sequence):
        if len(factor) != rotors:
            raise refusal(key, f"got {len(factor)} factors; allowed: one, or one for each of the {rotors} rotors")
        assert isinstance(old, RotorQuantity), f"{key} is no number of rotors"
        value = tuple(a * b for a, b in zip(old.of(rotors), factor, strict=True))
    else:
        value = tuple(a * factor for a in old.value) if isinstance(old.value, tuple) else old.value * factor
    for number in value if isinstance(value, tuple) else (value,):
        if not math.isfinite(number):
            raise refusal(key, f"got {number!r} {old.unit}; allowed: a finite number")
    return old.model_copy(update={"value": value})


def _moved(rotor: Rotor, shift: Sequence[float]) -> Rotor:
    """A rotor beside a centre of mass that is elsewhere by so much in m."""
    x, y, z = shift
    made = {"x": _less(rotor.x, x), "y": _less(rotor.y, y)}
    height = rotor.z if rotor.z is not None else Quantity(value=0.0, unit="m", source="our choice: not given")
    return rotor.model_copy(update=made | ({"z": _less(height, z)} if z else {}))


def _less(length: Quantity, by: float) -> Quantity:
    return length.model_copy(update={"value": length.value - by})
