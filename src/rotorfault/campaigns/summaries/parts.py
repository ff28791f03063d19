"""What summaries are made of: files, tables for the page, figures; and what is said of flights."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from rotorfault.autopilot.control import CONTROLLER
from rotorfault.autopilot.diagnosis import DIAGNOSIS
from rotorfault.base.files import write_durably
from rotorfault.campaigns.flight_set import FlightSet, alike
from rotorfault.campaigns.sampling.statistics import Array, clopper_pearson
from rotorfault.campaigns.study import Cases, Study
from rotorfault.model.vehicle_file import VehicleFile
from rotorfault.plant.sensors import SENSORS
from rotorfault.scenario.scenario import Scenario

Row = dict[str, Any]
Column = NDArray[Any]
Which = NDArray[np.intp]


class PageTable(NamedTuple):
    """A table of the page."""

    title: str
    about: str
    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


class Shares(NamedTuple):
    """A figure of shares: panels beside each other, rows and columns by name, NaN where nothing was flown."""

    name: str  # of the file
    title: str  # of the scale
    panels: tuple[str, ...]
    rows: tuple[str, ...]
    columns: tuple[str, ...]
    across: str  # what columns are
    share: Array  # (panels, rows, columns)


class Curves(NamedTuple):
    """A figure of lines with intervals: one for each label."""

    name: str  # of the file
    title: str
    x_title: str
    y_title: str
    lines: dict[str, tuple[Array, Array, Array, Array]]  # x, y, lower and upper end of the interval of y
    x_log: bool
    ideal: tuple[str, Array] | None = None  # what y would be at best: its label, and the x at which it is x itself


class Rates(NamedTuple):
    """A figure of rates per hour with intervals, one under the other, beside those that were asked for."""

    name: str  # of the file
    title: str  # of the axis
    labels: tuple[str, ...]
    rate: Array  # per hour
    low: Array
    high: Array
    wanted: Array  # per hour, NaN where none was asked for


class Kind(NamedTuple):
    """What is said of flights of one scenario that judge a detector."""

    vehicle: str
    sensors: str
    detector: str
    variant: str
    fault: str
    manoeuvre: str
    rotors: int
    wanted: float | None  # false alarms per hour, where a detector is asked for them
    speeds: bool  # whether rotor speeds are measured


class Flights(NamedTuple):
    """Flights of a campaign that judges detectors, one element for each, in the order of the table."""

    kind: list[Kind]
    columns: Mapping[str, Column]
    loss: Column  # 0 in healthy flights
    level: float
    vehicles: Mapping[str, VehicleFile]
    scenarios: Mapping[int, Scenario]  # of each flight, before anything is drawn

    def some(self, *names: str) -> dict[Any, Which]:
        """Flights by some of what is said of them."""
        return grouped([tuple(getattr(one, name) for name in names) for one in self.kind])


NAMED = ("right rotor", "others too")
"""Grades of flights in which the right rotor was named first."""


class Summary(NamedTuple):
    """What a campaign writes at its end."""

    files: dict[str, Any]  # JSON, by name
    lines: tuple[str, ...]  # for the terminal
    tables: tuple[PageTable, ...]
    figures: tuple[Shares | Curves | Rates, ...]

    def write(self, folder: Path) -> list[Path]:
        """Write the files into the campaign's folder; their paths."""
        for name, content in self.files.items():
            write_durably(folder / name, (json.dumps(content, indent=1, allow_nan=False) + "\n").encode())
        return [folder / name for name in self.files]


class Told(NamedTuple):
    """Flights that have one scenario before anything varies, and what is said of them."""

    which: Which  # rows of the table
    variant: int
    cases: Cases
    scenario: Scenario
    labels: dict[str, str]  # of the cases, by axis

    @property
    def vehicle(self) -> str:
        """Name of the vehicle."""
        return str(self.scenario.vehicle.name)

    def kind(self, axis: str, slot: Any) -> str:
        """The case on an axis of that name, where there is one, else the kind of a part."""
        return self.labels.get(axis) or str(self.scenario[slot].kind)


def told(study: Study, columns: Mapping[str, Column]) -> Iterator[Told]:
    """Flights of a table by what they fly.

    Parameters
    ----------
    study : Study
    columns : mapping of str to ndarray, shape (N,)
        ``variant``, ``cell`` and ``number`` at least.
    """
    place = {variant.label: k for k, variant in enumerate(study.variant)}
    variant = np.array([place[label] for label in columns["variant"].tolist()], dtype=np.int64)
    flights = FlightSet(variant, columns["cell"].astype(np.int64), columns["number"].astype(np.int64))
    for one in alike(study, flights):
        labels = {part.name: case.label for part, case in zip(study.case_axes, one.cases, strict=True)}
        yield Told(one.which, one.variant, one.cases, study.scenario_of(one.variant, one.cases), labels)


def columns_of_table(table: pa.Table) -> dict[str, Column]:
    """Columns of a table of flights as arrays."""
    return {name: table[name].to_numpy(zero_copy_only=False) for name in table.column_names}


def grouped(keys: Sequence[Any]) -> dict[Any, Which]:
    """Which places have each key, in the order in which keys come first.

    Parameters
    ----------
    keys : sequence
        Hashable.
    """
    found: dict[Any, list[int]] = {}
    for place, key in enumerate(keys):
        found.setdefault(key, []).append(place)
    return {key: np.array(places) for key, places in found.items()}


def counted(count: int, of: int, level: float) -> tuple[float, float]:
    """Interval of a share by Clopper and Pearson, as numbers.

    Parameters
    ----------
    count, of : int
    level : float
    """
    low, high = clopper_pearson(count, of, level)
    return float(low), float(high)


def percent(count: int, of: int) -> str:
    """A share in words."""
    return f"{100.0 * count / of:.1f} %" if of else "–"


def shares(
    name: str, title: str, across: str, keys: tuple[Sequence[str], Sequence[str], Sequence[str]], good: Column
) -> Shares:
    """A figure of shares of flights.

    Parameters
    ----------
    name : str
        Of the file.
    title : str
        Of the scale.
    across : str
        What columns are.
    keys : tuple of sequences of str
        Panel, row and column of each flight.
    good : ndarray of bool, shape (N,)
        What the share is of.
    """
    names = [tuple(dict.fromkeys(key)) for key in keys]
    at = np.array([[one.index(value) for value in key] for one, key in zip(names, keys, strict=True)])
    shape = tuple(len(one) for one in names)
    flat = np.ravel_multi_index(tuple(at), shape)
    flown = np.bincount(flat, minlength=int(np.prod(shape)))
    with np.errstate(invalid="ignore"):
        share = np.where(flown > 0, np.bincount(flat[good], minlength=len(flown)) / np.maximum(flown, 1), np.nan)
    return Shares(name, title, names[0], names[1], names[2], across, share.reshape(shape))


def controller_of(study: Study, one: Told) -> str:
    """What a controller is called: its kind, or of several of one kind the label of the variant."""
    kinds = [study.scenario_of(k, one.cases)[CONTROLLER].kind for k in range(len(study.variant))]
    own = str(one.scenario[CONTROLLER].kind)
    return own if kinds.count(own) == 1 else study.variant[one.variant].label


def sensors_of(one: Told) -> str:
    """The set of sensors."""
    return one.kind("sensors", SENSORS)


def speeds_of(one: Told) -> bool:
    """Whether rotor speeds are measured."""
    return bool(getattr(getattr(one.scenario[SENSORS].settings, "rotor_speeds", None), "on", False))


def diagnosis_of(one: Told) -> str:
    """The source of diagnosis."""
    return one.kind("diagnosis", DIAGNOSIS)


def joined(words: Iterable[object]) -> str:
    """Words with commas."""
    return ", ".join(map(str, words))


def milliseconds(row: Row) -> str:
    """Delays of a row in words, median and 95 %."""
    if row["median_delay_ms"] is None:
        return "–"
    return f"{row['median_delay_ms']:.0f}, {row['p95_delay_ms']:.0f} ms"
