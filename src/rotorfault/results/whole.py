"""Whether a flight that was read has all that its numbers and figures are made of, in the right form.

A file may have been edited, or made by something else. What is wrong is said in one line, before anything is
computed.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from rotorfault.base.errors import InputError
from rotorfault.base.plain_text import one_line
from rotorfault.loop.recorded import LoopSignals
from rotorfault.loop.scores import ENDS, INTERRUPTED, SURVIVED
from rotorfault.maths.arrays import ANGLES, AXES
from rotorfault.model.telemetry import RPY, signals_of
from rotorfault.model.vehicle import MOST_ROTORS
from rotorfault.results.flight_data import FlightData, shape_of
from rotorfault.results.score_table import FEWEST, LANDING, rotors_of

HINT = "fly it again with 'rotorfault fly --repeat'"
TEXTS = ("scenario", "controller", "plant", "engine", "version", "outcome", "scores")
NUMBERS = ("seed", "end_time")
"""Attributes that the summary of a flight needs."""
_OUTCOMES = (*SURVIVED, *ENDS[1:], INTERRUPTED)
PER_ROTOR = ("onset", "detected", "loss_true", "loss_believed", "loss_error")
COUNTED = (
    *(f"settle_time.{name}" for name in (*AXES, "overall")),
    *(f"{group}.{axis}" for group in ("position_mse", "position_error_end") for axis in AXES),
    *(f"{group}.{angle}" for group in ("attitude_mse", "attitude_end") for angle in ANGLES),
    "end_time", "cost", "tilt_max", "command_rate", "command_step", "saturated_fraction", "recovery_time",
    "excursion", "altitude_lost", "reference_step", "false_alarms",
)  # fmt: skip


def require_whole(data: FlightData, path: str | Path) -> dict[str, Any]:
    """The scores of a flight, if everything that is read of it is there and in the right form.

    Raises
    ------
    InputError
        If something is missing, or is not of its type or shape.
    """
    for wrong in (*_signals(data), *_attributes(data.attrs)):
        raise InputError(f"{path}: {wrong}; {HINT}")
    return scores(data.attrs, path)


def _signals(data: FlightData) -> Iterator[str]:
    if "time" not in data:
        yield "signal 'time' is missing"
        return
    times = np.asarray(data["time"].values)
    if times.dtype.kind != "f" or times.ndim != 1 or not len(times) or not np.isfinite(times).all():
        yield "signal 'time' holds no times"
        return
    if (np.diff(times) <= 0.0).any():
        yield "signal 'time' does not rise"
    known = {signal.name for signal in signals_of(LoopSignals)}
    rotors = np.shape(data["rotor"].values)[0] if "rotor" in data else FEWEST
    for signal in signals_of(LoopSignals):
        if signal.name not in data.variables:
            yield f"signal '{signal.name}' is missing"
            return
        dims, shape = shape_of(signal.kind, signal.quantity.frame == RPY, rotors)
        here, wanted = data[signal.name], (len(times), *shape)
        if here.dims != ("time", *dims) or np.shape(here.values) != wanted:
            yield f"signal '{signal.name}' has the shape {np.shape(here.values)} along {here.dims}; allowed: {wanted}"
    for name, variable in data.variables.items():
        if variable.dims[:1] != ("time",) or np.asarray(variable.values).dtype.kind != "f":
            yield f"signal '{one_line(name)}' holds no numbers over time"
        for attribute in ("units", "long_name"):
            # A signal that somebody added need not say what it means.
            missing = "" if name not in known else None
            if not isinstance(variable.attrs.get(attribute, missing), str):
                yield f"signal '{one_line(name)}' has no attribute '{attribute}'"


def _attributes(attributes: Mapping[str, Any]) -> Iterator[str]:
    for name in (*TEXTS, *NUMBERS):
        if name not in attributes:
            yield f"attribute '{name}' is missing"
    for name in (*TEXTS, "preset", "vehicle", "title", "own_controller", "configuration"):
        value = attributes.get(name, "")
        if not isinstance(value, str) or one_line(value) != value:
            yield f"attribute '{name}' is {value!r}; allowed: a text without control characters"
    for name in (*NUMBERS, "thrust_min", "thrust_max", "threshold"):
        if not _is_number(attributes.get(name, 0)):
            yield f"attribute '{name}' is {attributes[name]!r}; allowed: a number"
    if attributes.get("outcome") not in _OUTCOMES:
        yield f"attribute 'outcome' is {attributes.get('outcome')!r}; allowed: {', '.join(_OUTCOMES)}"


def _is_number(value: Any) -> bool:
    found = np.asarray(value)
    return found.size == 1 and found.dtype.kind in "iuf" and bool(np.isfinite(found).all())


def scores(attributes: Mapping[str, Any], path: str | Path) -> dict[str, Any]:
    """The numbers that were counted in flight, as a file holds them; NaN for what has none.

    Raises
    ------
    InputError
        If one is missing or no number.
    """
    found = json_table(attributes, "scores", path)
    landing = [f"landing.{name}" for name in LANDING] if "landing.confirmed_time" in found else []
    rotors = range(1, max([FEWEST, *rotors_of(found)]) + 1)
    each = [f"{name}.{rotor}" for name in PER_ROTOR for rotor in rotors] if len(rotors) <= MOST_ROTORS else []
    for name in ("outcome", "survived", *COUNTED, *each, *landing):
        if name not in found:
            raise InputError(f"{path}: attribute 'scores' lacks '{name}'; {HINT}")
    for name, value in found.items():
        kinds = (str,) if name == "outcome" else (bool,) if name == "survived" else (int, float, type(None))
        if not isinstance(value, kinds) or (isinstance(value, bool) and name != "survived"):
            raise InputError(f"{path}: attribute 'scores' has {value!r} for '{one_line(name)}'; {HINT}")
    if found["outcome"] != attributes["outcome"]:
        raise InputError(
            f"{path}: attribute 'scores' has the outcome {found['outcome']!r}, the flight "
            f"{attributes['outcome']!r}; {HINT}"
        )
    return {name: math.nan if value is None else value for name, value in found.items()}


def json_table(attributes: Mapping[str, Any], name: str, path: str | Path) -> dict[str, Any]:
    """A table that an attribute holds as JSON.

    Raises
    ------
    InputError
        If it is missing or damaged.
    """
    try:
        table = json.loads(attributes[name])
    except (KeyError, ValueError, TypeError, RecursionError) as error:
        raise InputError(f"{path}: attribute '{name}' is missing or damaged ({str(error)[:80]})") from None
    if not isinstance(table, dict):
        raise InputError(f"{path}: attribute '{name}' is missing or damaged (it is no table)")
    return table
