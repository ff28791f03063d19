"""Flights as they are given to what looks at several: in memory or as paths, with labels or without."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from rotorfault.base.errors import InputError, short
from rotorfault.flight.flight import Flight, load

Given = Flight | str | Path


def labelled(verb: str, flights: Sequence[Any], least: int, most: int | None = None) -> dict[str, Flight]:
    """The flights by a label that tells each from the others; those given as paths are read.

    Parameters
    ----------
    verb : str
        What is done with them, for messages.
    flights : sequence
        The arguments of the verb: flights or paths, or one list of them, or one mapping with labels. Without labels
        they are called by their controller, with folder or scenario, and at last a number, where that does not tell
        them apart.
    least, most : int
        How many there may be; no bound above if `most` is not given.

    Raises
    ------
    InputError
        If they are no flights, too few or too many, or a file cannot be read.
    """
    allowed = (
        f"{_count(least, most)} flights or paths of flight files, in a list or, with labels, as {{'label': flight}}"
    )
    given: Any = flights[0] if len(flights) == 1 and not isinstance(flights[0], (str, Path, Flight)) else flights
    if isinstance(given, Mapping):
        if not all(isinstance(label, str) for label in given):
            raise InputError(f"{verb}: got {short(list(given))} as labels; allowed: texts")
        labels, items = list(given), list(given.values())
    elif isinstance(given, (list, tuple)):
        labels, items = [], list(given)
    else:
        raise InputError(f"{verb}: got {short(given)}; allowed: {allowed}")
    for one in items:
        if not isinstance(one, (Flight, str, Path)):
            raise InputError(f"{verb}: got {short(one)}; allowed: {allowed}")
    if len(items) < least or (most is not None and len(items) > most):
        raise InputError(f"{verb}: got {len(items)} flight{'s' if len(items) != 1 else ''}; allowed: {allowed}")
    loaded = [one if isinstance(one, Flight) else load(one) for one in items]
    return dict(zip(labels or _labels(items, loaded), loaded, strict=True))


def _count(least: int, most: int | None) -> str:
    words = {1: "one", 2: "two", 6: "six"}
    return f"{words[least]} or more" if most is None else f"{words[least]} to {words[most]}"


def _labels(given: Sequence[Given], flights: Sequence[Flight]) -> list[str]:
    """Labels that tell flights apart: the controller, with folder or scenario where that is not enough."""
    labels = [flight.label for flight in flights]
    if len(set(labels)) < len(labels):
        places = [
            flight.scenario_name if isinstance(one, Flight) else Path(one).resolve().parent.name
            for one, flight in zip(given, flights, strict=True)
        ]
        labels = [f"{label} ({place})" for label, place in zip(labels, places, strict=True)]
    if len(set(labels)) < len(labels):
        labels = [f"{label} {number}" for number, label in enumerate(labels, start=1)]
    return labels
