"""What is exported of a flight, whatever the format: its columns by topic, its events, its vehicle.

A topic is a slot, such as ``controller``, and the signals that every loop has are the topic ``flight``.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rotorfault.base.errors import InputError
from rotorfault.base.plain_text import one_line
from rotorfault.maths.arrays import Array
from rotorfault.results.airframe import Airframe, airframe_of
from rotorfault.results.events import Event, events
from rotorfault.results.flight_data import FlightData, Variable

LOOP = "flight"
"""Topic of the signals that every loop has."""
SERIOUS = ("false_alarm", "fault", "given_up", "saturation")
"""Kinds of events that are warnings."""


class Column(NamedTuple):
    """One component of a signal over time."""

    variable: str  # name of the signal, as recorded
    topic: str
    signal: str  # its name without its slot
    component: str  # "x", "roll_pitch", "4"; empty for a scalar
    unit: str
    meaning: str
    frame: str  # empty for none
    values: Array  # (records,)

    @property
    def field(self) -> str:
        """Its name within the topic, such as ``thrust_1``."""
        return f"{self.signal}_{self.component}" if self.component else self.signal

    @property
    def name(self) -> str:
        """Its name within the flight, such as ``thrust_1`` or ``controller.sigma_position_x``."""
        return f"{self.variable}_{self.component}" if self.component else self.variable

    def label(self, units: bool) -> str:
        """Its name, and the unit in brackets if that is wanted; pure numbers have ``[1]``."""
        return f"{self.name} [{self.unit}]" if units else self.name

    def about(self, units: bool) -> str:
        """What it means, in one line, with its unit if that is wanted."""
        said = "; ".join(filter(None, (self.meaning, self.frame)))
        return one_line(f"{said} [{self.unit}]" if units else said)


class Content(NamedTuple):
    """What is exported of a flight."""

    data: FlightData  # the records that are wanted
    events: list[Event]  # of all records
    units: bool  # whether names and descriptions have units

    @property
    def time(self) -> Array:
        """Times of the records in s."""
        return np.asarray(self.data["time"].values, dtype=float)

    @property
    def airframe(self) -> Airframe:
        """The vehicle that flew."""
        return airframe_of(self.data)

    @property
    def title(self) -> str:
        """What flew, in one line of limited length."""
        text = one_line(str(self.data.attrs.get("title", "flight")))
        return text if len(text) <= 200 else f"{text[:199]}…"

    def attributes(self) -> dict[str, str]:
        """What the file says of the flight as a whole, as texts."""
        return {str(key): str(value) for key, value in self.data.attrs.items() if key != "digests"}

    def values(self, signal: str) -> Array:
        """A signal, shape (records, ...).

        Raises
        ------
        InputError
            If the flight has no such signal, and without it nothing can be shown.
        """
        if signal not in self.data:
            raise InputError(f"the flight has no signal '{signal}'; export it as csv, or fly it again")
        return np.asarray(self.data[signal].values, dtype=float)


def content_of(data: FlightData, every: int = 1, units: bool = True) -> Content:
    """What is exported.

    Parameters
    ----------
    data : FlightData
    every : int
        Of so many records one is taken, from the first on.
    units : bool
        Whether names or descriptions of columns have units.

    Raises
    ------
    InputError
        If `every` is no whole number from 1 on.
    """
    if isinstance(every, bool) or not isinstance(every, int) or every < 1:
        raise InputError(f"every: got {every!r}; allowed: a whole number of records, 1 or more")
    return Content(data.isel(time=slice(None, None, every)), events(data), units)


def columns(data: FlightData) -> list[Column]:
    """All signals but the time, a column for each component.

    Parameters
    ----------
    data : FlightData

    Raises
    ------
    InputError
        If something in the flight is not over time.
    """
    found = []
    for name, variable in data.variables.items():
        _require_over_time(name, variable)
        topic, dot, signal = name.partition(".")
        topic, signal = (topic, signal) if dot and topic and signal else (LOOP, name)
        for at in np.ndindex(variable.values.shape[1:]):
            parts = (str(data[dim].values[i]) for dim, i in zip(variable.dims[1:], at, strict=True))
            about = variable.attrs
            found.append(
                Column(
                    variable=name,
                    topic=topic,
                    signal=signal,
                    component="_".join(parts),
                    unit=about.get("units", "1"),
                    meaning=about.get("long_name", ""),
                    frame=about.get("frame", ""),
                    values=variable.values[(slice(None), *at)],
                )
            )
    return found


def number_columns(data: FlightData) -> list[Column]:
    """All signals but the time, for formats that have numbers alone; see `columns`.

    Raises
    ------
    InputError
        If something in the flight is not over time, or no number.
    """
    found = columns(data)
    for column in found:
        if column.values.dtype.kind not in "fiub":
            raise InputError(f"'{column.name}' holds no numbers; drop it from the data, or export to csv or parquet")
    return found


def _require_over_time(name: str, variable: Variable) -> None:
    if variable.dims[:1] != ("time",):
        dims = ", ".join(variable.dims) or "no dimension"
        raise InputError(f"'{name}' has {dims}; allowed in a table: what is over time; drop it from the data")


def by_topic(found: Iterable[Column]) -> dict[str, list[Column]]:
    """Columns by their topic, in order."""
    topics: dict[str, list[Column]] = {}
    for column in found:
        topics.setdefault(column.topic, []).append(column)
    return topics


def table(data: FlightData, units: bool) -> dict[str, Array]:
    """Time and all signals by label, on the same memory: what a table has.

    Parameters
    ----------
    data : FlightData
    units : bool
        Whether a label ends in its unit, as in ``velocity_x [m/s]``.
    """
    time = data["time"]
    _require_over_time("time", time)
    label = f"time [{time.attrs.get('units', '1')}]" if units else "time"
    found = {label: time.values}
    for column in columns(data):
        label, number = column.label(units), 1
        while label in found:  # as component x of 'a' and a signal 'a_x' would share one
            number += 1
            label = f"{column.label(units)} ({number})"
        found[label] = column.values
    return found


def identifiers(names: Iterable[str], longest: int, lower: bool = False) -> list[str]:
    """Names as other tools allow them, each different from the others.

    Parameters
    ----------
    names : iterable of str
        Anybody's.
    longest : int
        Characters that are allowed.
    lower : bool
        Whether capitals are not.

    Returns
    -------
    list of str
        Letters without accents, digits and underscores, the first one a letter. What two names would share is told
        apart by a number.
    """
    taken: set[str] = set()
    found = []
    for name in names:
        plain = re.sub(r"[^A-Za-z0-9]+", "_", name.lower() if lower else name).strip("_")
        plain = plain if plain[:1].isalpha() else f"x_{plain}".rstrip("_")
        word, number = plain[:longest], 1
        while word.lower() in taken:
            number += 1
            word = f"{plain[: longest - 1 - len(str(number))]}_{number}"
        taken.add(word.lower())
        found.append(word)
    return found


def losses(content: Content) -> Array:
    """True loss of each rotor, shape (records, rotors), between 0 and 1."""
    return np.clip(np.nan_to_num(content.values("loss_true")), 0.0, 1.0)


def colours(loss: Array) -> NDArray[np.uint8]:
    """Colours of rotors by their true loss: blue for none, then from yellow to vermilion, where all is lost.

    A small loss stands out: yellow is reached at 15 %.

    Parameters
    ----------
    loss : ndarray
        From 0 to 1.

    Returns
    -------
    ndarray, shape (..., 3)
        Red, green, blue. The ends are those of Okabe and Ito, which colour-blind readers can tell apart.
    """
    stops = np.array([(0x00, 0x72, 0xB2), (0xF0, 0xE4, 0x42), (0xD5, 0x5E, 0x00)], dtype=float)
    mixed = [np.interp(loss, (0.0, 0.15, 1.0), stops[:, k]) for k in range(3)]
    return np.stack(mixed, axis=-1).round().astype(np.uint8)


def moments(time: Array, rate: float) -> NDArray[np.intp]:
    """Records of which pictures are made: not more than so many a second, the first and the last among them.

    Parameters
    ----------
    time : ndarray, shape (records,), s
    rate : float
        Pictures a second.
    """
    wanted = np.arange(time[0], time[-1], 1.0 / rate)
    kept = np.minimum(np.searchsorted(time, wanted - 1e-9), len(time) - 1)
    return np.unique(np.append(kept, len(time) - 1)).astype(np.intp)
