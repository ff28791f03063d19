"""Dotted keys and values in place of what a scenario's tables say."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from typing import Any

from rotorfault.base.bounds import require_shallow
from rotorfault.base.config import is_index
from rotorfault.base.errors import InputError, short
from rotorfault.model.vehicle import ROTOR_NUMBERS
from rotorfault.model.vehicle_file import load_vehicle
from rotorfault.scenario.mismatch import ROTOR_FACTORS, Mismatch
from rotorfault.scenario.part import change_kind, change_preset
from rotorfault.scenario.sensed import forget_what_sensors_asked_for
from rotorfault.scenario.slots import SLOTS

VECTORS = {name: field.default for name, field in Mismatch.model_fields.items() if isinstance(field.default, tuple)}
"""Numbers of a mismatch of which there is one for each axis, as they are where they are not given."""

LISTED = (*ROTOR_NUMBERS, "rotor_bandwidth_down")
"""Numbers of a vehicle file of which rotors may have one each."""


def override_all(tables: dict[str, Any], changes: Mapping[str, Any]) -> None:
    """Set several dotted keys in tables, in place: tables, kinds and presets first, for they drop what was there."""

    if not isinstance(changes, Mapping) or not all(isinstance(key, str) for key in changes):
        raise InputError(
            f"settings: got {short(changes)}; allowed: dotted keys and values, such as {{'duration': 5.0}}"
        )
    require_shallow(changes, "settings")

    def outermost_first(key: str) -> tuple[int, bool]:
        *path, last = key.split(".")
        return (len(path), False) if last == "kind" else (len(path) + 1, last != "preset")

    forget_what_sensors_asked_for(tables, changes)
    for key in sorted(changes, key=outermost_first):
        override(tables, key, changes[key])


def override(tables: dict[str, Any], key: str, value: Any) -> None:
    """Set a dotted key in tables, in place.

    Numbers in the key index lists (``fault.0.loss``). A vehicle given by name is laid out as its table when a key
    below it is set (``vehicle.rotor_bandwidth.value``). A number that may be one for each rotor becomes such a list
    when one of it is set (``mismatch.rotor_gain.2`` is that of rotor 3), and so does one for each axis that is not
    given (``mismatch.centre_of_mass.0``). The number after the last of a list of parts adds one to it
    (``fault.1.kind=total`` beside one fault). Setting ``kind``, or a table that has one to
    a bare name, drops the other settings of that table: they belonged to another kind
    (`rotorfault.scenario.part.change_kind`). Setting ``preset`` drops those that the former preset gave
    (`rotorfault.scenario.part.change_preset`).

    Raises
    ------
    InputError
        If the key leads into something that is not a table or a list, or past the end of a list.
    """
    *path, last = key.split(".")
    here: Any = tables
    for depth, part in enumerate(path):
        if isinstance(here, list):
            if part == str(len(here)) and last == "kind" and depth == 1 and path[0] in SLOTS:
                here.append({})  # one more
            here = here[_index(here, part, key)]
        elif isinstance(here, dict):
            inner = here.get(part)
            if here is tables and part == "vehicle" and isinstance(inner, str):
                # A vehicle's name stands for its file: laid out here, so that single numbers of it can be set.
                inner = here[part] = load_vehicle(inner).model_dump(mode="json")
            if part in VECTORS and path[:depth] == ["mismatch"] and inner is None:
                inner = here[part] = list(VECTORS[part])
            if here is tables and part in SLOTS and SLOTS[part].many and inner is None:
                inner = here[part] = []
            if depth == len(path) - 1 and for_rotors(path) and (is_number(inner) or inner is None):
                inner = here[part] = [1.0 if inner is None else float(inner)] * _rotors(tables)
            if here is tables and part in SLOTS and (shorthand := SLOTS[part].shorthand) is not None:
                # What stands for a table, such as the ground's height alone, is laid out likewise.
                inner = here[part] = shorthand(inner)
            named = isinstance(inner, str) and (depth == len(path) - 1 or (here is tables and part in SLOTS))
            if named or inner is None:
                # A bare name stands for a table with that kind.
                inner = here[part] = {} if inner is None else {"kind": inner}
            here = inner
        else:
            raise InputError(f"{key}: '{'.'.join(path[:depth])}' is a single value; it has no key '{part}'")
    if isinstance(here, list):
        here[_index(here, last, key)] = value
    elif not isinstance(here, dict):
        raise InputError(f"{key}: '{'.'.join(path)}' is a single value; it has no key '{last}'")
    elif last == "kind" and here.get("kind") != value:
        if len(path) == 1 and path[0] in SLOTS:
            change_kind(SLOTS[path[0]], here, value)
        else:
            here.clear()
            here["kind"] = value
    elif last == "preset" and path and path[0] in SLOTS:
        change_preset(SLOTS[path[0]], here, value)
    else:
        if key == "reference.file":
            # The text that a checked scenario holds is that of the former file.
            here.pop("text", None)
        here[last] = value


def for_rotors(path: Sequence[str]) -> bool:
    """Whether a number of a scenario may be a list with one for each rotor.

    Parameters
    ----------
    path : sequence of str
        Its dotted key, in parts.
    """
    if len(path) == 2:
        return path[0] == "mismatch" and path[1] in ROTOR_FACTORS
    return len(path) == 3 and path[0] == "vehicle" and path[1] in LISTED and path[2] == "value"


def is_number(value: object) -> bool:
    """Whether a value of a table is a number."""
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def _rotors(tables: Mapping[str, Any]) -> int:
    """Number of rotors of the vehicle in the tables of a scenario; 0 where they do not tell."""
    vehicle = tables.get("vehicle")
    if isinstance(vehicle, str):
        return len(load_vehicle(vehicle).rotor)
    rotors = vehicle.get("rotor", ()) if isinstance(vehicle, Mapping) else getattr(vehicle, "rotor", ())
    return len(rotors) if isinstance(rotors, (list, tuple)) else 0


def _index(items: list[Any], part: str, key: str) -> int:
    if not is_index(part) or int(part) >= len(items):
        allowed = f"0 to {len(items) - 1} (0 is the first)" if items else "none, for the list is empty"
        if key.partition(".")[0] in SLOTS and items:
            allowed += f"; {key.partition('.')[0]}.{len(items)}.kind adds one"
        raise InputError(f"{key}: '{part}' is no index into a list of {len(items)}; allowed: {allowed}")
    return int(part)


def parse_overrides(pairs: list[str]) -> dict[str, Any]:
    """Overrides from ``key=value`` texts; a value is read as TOML, or taken as text where it is none.

    Raises
    ------
    InputError
        If a text has no '=' or no key, or if its value begins a list or a table of TOML and is none.
    """
    found: dict[str, Any] = {}
    for pair in pairs:
        key, equals, text = pair.partition("=")
        if not equals or not key.strip() or not all(key.strip().split(".")):
            raise InputError(f"--set {pair}: allowed: key=value with a dotted key, such as fault.0.loss=0.3")
        try:
            found[key.strip()] = tomllib.loads(f"value = {text}")["value"]
        except tomllib.TOMLDecodeError as error:
            if text.lstrip()[:1] in ("[", "{"):  # no name begins so: quotes or brackets are missing
                wrong = str(error).partition(" (at")[0]
                raise InputError(
                    f"--set {short(pair)}: not valid TOML: {wrong}; allowed: a list or table, texts in it in double "
                    """quotes, the whole in single ones, such as --set 'fault=[{kind="total",rotor=1,time=1}]'"""
                ) from None
            found[key.strip()] = text.strip()
        except (ValueError, RecursionError):
            found[key.strip()] = text.strip()  # digits or brackets without end: no value of any key
    return found
