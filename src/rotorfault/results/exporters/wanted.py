"""What is asked of an export besides its format, and what exports share."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from rotorfault.base.plain_text import one_line
from rotorfault.maths.arrays import Array
from rotorfault.results.events import Event
from rotorfault.results.flight_data import FlightData


class Wanted(NamedTuple):
    """What is asked of an export."""

    units: bool  # whether names of columns end in their units, where the format is one table
    path: Path  # where the file will be, once it is whole
    companions: list[Path]  # files that come with it are added here
    events: list[Event]  # of all records, however few of them are written


Writer = Callable[[FlightData, Path, Wanted], object]
"""Writes the records of a flight to a path."""


class Signal(NamedTuple):
    """A signal as exports have it."""

    slot: str  # of the part that recorded it; empty for what every loop records
    name: str
    unit: str
    meaning: str
    frame: str
    columns: tuple[str, ...]  # names of its components; one empty name for a number
    values: Array  # (records, columns)


def signals(data: FlightData) -> Iterator[Signal]:
    """The signals of a flight that are over time.

    Parameters
    ----------
    data : FlightData
    """
    for full, variable in data.variables.items():
        values = np.asarray(variable.values)
        if variable.dims[:1] != ("time",) or values.dtype.kind not in "fiub":
            continue
        slot, _, name = full.rpartition(".")
        labels = [[one_line(str(value)) for value in data.coordinates[dim].values] for dim in variable.dims[1:]]
        columns = tuple("_".join(labels[d][i] for d, i in enumerate(at)) for at in np.ndindex(*values.shape[1:]))
        about = variable.attrs
        yield Signal(
            slot, name, str(about.get("units", "1")), str(about.get("long_name", "")), str(about.get("frame", "")),
            columns, values.reshape(len(values), -1).astype(float),
        )  # fmt: skip


class Names:
    """Names that a format allows, each once: letters of English, digits, underscores, a letter first."""

    def __init__(self, most: int = 60) -> None:
        self._most = most
        self._taken: set[str] = set()

    def __call__(self, text: str) -> str:
        """A name for a text, the same for no other."""
        plain = re.sub(r"\W+", "_", text, flags=re.ASCII).strip("_") or "unnamed"
        plain = (plain if plain[0].isalpha() else f"n_{plain}")[: self._most]
        name, number = plain, 2
        while name in self._taken:
            ending = f"_{number}"
            name, number = plain[: self._most - len(ending)] + ending, number + 1
        self._taken.add(name)
        return name


def texts(data: FlightData) -> dict[str, str]:
    """The attributes of a flight as texts."""
    return {str(name): str(value) for name, value in data.attrs.items()}
