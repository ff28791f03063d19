"""Flights as they are drawn: each with its look, up to its end, and the windows of time that show them.

The end of a flight is the last record at which it is finite, or its attribute ``end_time``.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from itertools import cycle, islice, product
from typing import NamedTuple

import numpy as np
import xarray as xr

from rotorfault.base.errors import InputError
from rotorfault.maths.arrays import Array
from rotorfault.model.vehicle import Vehicle
from rotorfault.report.style import COLOURS, LINES, shown, unit
from rotorfault.results.flown import vehicle_file_of
from rotorfault.results.outcome import Outcome

WIDE, THIN, ALONE = 1.5, 0.9, 1.1  # line widths in points: first and last of several flights, a single one
BEFORE, AFTER = 1.0, 2.2  # s around fault onsets that the detail shows
DETAIL = 0.6  # a detail must be shorter than this share of the flight


class Drawn(NamedTuple):
    """A flight as it is drawn."""

    label: str
    data: xr.Dataset  # cut at its end
    time: Array  # s
    fate: str  # how it ended before it was meant to, in a word; empty for a flight that did not
    colour: str
    line: str
    width: float  # earlier flights are wider, so that both of two equal curves are seen

    def values(self, signal: str, column: int | None = None) -> Array:
        """Samples of one column of a signal; NaN where the flight has no such signal."""
        if not self.has(signal):
            return np.full(len(self.time), np.nan)
        values = np.asarray(self.data[signal].values, dtype=float)
        return values if column is None else values[:, column]

    def has(self, signal: str) -> bool:
        """Whether the flight recorded a signal: a controller records what it has."""
        return signal in self.data

    def unit_of(self, signal: str) -> str:
        """Unit of a signal in brackets, as it stands on an axis."""
        return f"({unit(str(self.data[signal].attrs.get('units', '1')))})"

    @property
    def end(self) -> float:
        """Time of the last record, in s."""
        return float(self.time[-1]) if len(self.time) else 0.0

    @property
    def onsets(self) -> dict[int, float]:
        """Time in s at which the first fault of each rotor begins, as the scenario has it."""
        scores = json.loads(self.data.attrs.get("scores", "{}"))
        rotors = (int(rotor) for rotor in self.data["rotor"].values)
        onsets = {rotor: scores.get(f"onset.{rotor}") for rotor in rotors}
        return {rotor: float(onset) for rotor, onset in onsets.items() if onset is not None}

    @property
    def vehicle(self) -> Vehicle | None:
        """The vehicle that flew, in numbers; None where the records do not tell."""
        file = vehicle_file_of(self.data)
        return None if file is None else file.vehicle

    def shows(self, signal: str, column: int | None = None) -> bool:
        """Whether there is a finite value of a signal, or of one column of it."""
        return self.has(signal) and bool(np.isfinite(self.values(signal, column)).any())

    def moves(self, signal: str) -> bool:
        """Whether a signal is anything but zero at any time."""
        return self.has(signal) and bool((np.nan_to_num(self.values(signal)) != 0.0).any())

    def adding(self, signals: Mapping[str, Array], like: str) -> Drawn:
        """The same flight with signals that follow from what it recorded, in the unit of another one."""
        other = self.data[like]
        attributes = {"units": other.attrs["units"]}
        new = {name: (other.dims[: np.ndim(values)], values, attributes) for name, values in signals.items()}
        return self._replace(data=self.data.assign(new))


def flights(data: xr.Dataset | Mapping[str, xr.Dataset]) -> list[Drawn]:
    """Flights with their looks, in the order given.

    Raises
    ------
    InputError
        If there is none.
    """
    if isinstance(data, xr.Dataset):
        data = {str(data.attrs.get("controller", "flight")): data}
    if not data:
        raise InputError("no flight to draw; give at least one")
    looks = islice(cycle((colour, line) for line, colour in product(LINES, COLOURS)), len(data))
    widths = np.linspace(WIDE, THIN, len(data)) if len(data) > 1 else [ALONE]
    return [
        _drawn(label, flight, colour, line, float(width))
        for (label, flight), (colour, line), width in zip(data.items(), looks, widths, strict=True)
    ]


def _drawn(label: str, data: xr.Dataset, colour: str, line: str, width: float) -> Drawn:
    if not data.sizes["time"]:
        data = data.reindex(time=[0.0])  # lost before its first record: one record of NaN
    time = np.asarray(data["time"].values, dtype=float)
    finite = np.isfinite(data["position"].values).all(axis=1) & np.isfinite(data["attitude"].values).all(axis=1)
    # Up to the first gap: what comes after it is no flight. The first record stays, so that there is one.
    records = len(time) if finite.all() else max(int(np.argmin(finite)), 1)
    outcome = Outcome(str(data.attrs.get("outcome", "")), float(data.attrs.get("end_time", time[-1])))
    kept = int((time[:records] <= outcome.time * (1.0 + 1e-9)).sum())
    fate = "lost" if records < len(time) else ""
    if outcome.kind and not outcome.survived:
        fate = outcome.kind
    records = max(kept, 1)
    return Drawn(shown(label), data.isel(time=slice(records)), time[:records], fate, colour, line, width)


def whole(drawn: Sequence[Drawn]) -> tuple[float, float]:
    """The window that shows the longest flight."""
    longest = max(drawn, key=lambda flight: flight.end)
    if longest.end <= 0.0:
        return 0.0, 1.0
    # To the end of the last period, so that a flight of 20 s has its tick at 20 s.
    return 0.0, longest.end + float(longest.time[-1] - longest.time[-2])


def around_onsets(drawn: Sequence[Drawn], before: float, after: float) -> tuple[float, float] | None:
    """The window around all fault onsets, with so many seconds before the first and after the last.

    None without faults, or where it would show most of the flight again.
    """
    onsets = [time for flight in drawn for time in flight.onsets.values()]
    if not onsets:
        return None
    end = whole(drawn)[1]
    first, last = max(min(onsets) - before, 0.0), min(max(onsets) + after, end)
    return (first, last) if 0.0 < last - first < 0.5 * end else None


def detail(drawn: Sequence[Drawn]) -> tuple[float, float] | None:
    """The window of the first seconds and the faults; None where it would show most of the flight again."""
    times = [time for flight in drawn for time in flight.onsets.values()]
    first, last = (min(times), max(times)) if times else (0.0, 1.8)
    start = math.floor(first - BEFORE) if first > 3.0 else 0.0
    window = float(start), float(math.ceil(last + AFTER))
    end = whole(drawn)[1]
    return window if window[1] <= end and window[1] - window[0] < DETAIL * end else None
