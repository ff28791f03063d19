"""Flying many flights of one scenario: `fly_many` and the `Flights` that it gives back.

All flights are assembled, and so checked, before the first is flown. They are flown and scored some thousands at a
time: what grows with their number is the numbers in which they differ and the table of their scores, about a kilobyte
each, and what is recorded where recording is asked for.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, final

import numpy as np
from numpy.typing import NDArray

from rotorfault.base.bounds import positive, require, thread_count
from rotorfault.base.errors import InputError, SensorWarning, unknown
from rotorfault.base.html import html_note, html_table
from rotorfault.base.one_line import LONGEST, brief, cut
from rotorfault.base.progress import Bar
from rotorfault.engine import default_engine, load_engine
from rotorfault.engine.batch import Batch
from rotorfault.flight import doubts
from rotorfault.flight.assembly import Group, assemble_group, build
from rotorfault.flight.flight import Flight
from rotorfault.flight.fly import fly, prepare
from rotorfault.flight.sensing_lines import sensing_lines
from rotorfault.flight.sweep import checked_columns, groups_of
from rotorfault.maths.arrays import Array
from rotorfault.maths.geometry import Vec3
from rotorfault.model.telemetry import Layout
from rotorfault.results.score_table import ScoreTable, score_table
from rotorfault.scenario.scenario import Scenario

if TYPE_CHECKING:
    import xarray as xr

AT_ONCE = 8192  # flights that are assembled together: some 30 MB
MOST_NUMBERS = 2.5e8  # recorded numbers that are held in memory: 2 GB


@final
class Flights:
    """Many flights: what was varied, and what came of each.

    Attributes
    ----------
    scenario : Scenario
        What they have in common.
    varied : dict of ndarray, shape (N,)
        Values by dotted key.
    table : ScoreTable
        Outcome and numbers of each flight.
    signals : ndarray, shape (records, rows, N)
        What was recorded; no records if nothing was asked for. NaN where a flight was over.
    names : tuple of str
        Of the rows, such as ``position.x``.
    units : tuple of str
        Of the rows.
    times : ndarray, shape (records,)
        In s.
    flown : int
        Flight-steps that were computed.
    """

    def __init__(
        self, scenario: Scenario, varied: dict[str, NDArray[Any]], table: ScoreTable, signals: Array,
        names: tuple[str, ...], units: tuple[str, ...], times: Array, flown: int,
    ) -> None:  # fmt: skip
        self.scenario, self.varied, self.table = scenario, varied, table
        self.signals, self.names, self.units, self.times, self.flown = signals, names, units, times, flown

    def __len__(self) -> int:
        return len(self.table)

    def __repr__(self) -> str:
        counted = ", ".join(f"{count} {kind}" for kind, count in self.table.count().items())
        return cut(f"<{len(self)} flights of {cut(self.scenario.name)}: {counted}>", LONGEST)

    def _repr_html_(self) -> str:
        """How many ended how, and what was varied, as a table for notebooks."""
        share = [
            (kind, f"{count:,}", f"{100.0 * count / len(self):.3g} %") for kind, count in self.table.count().items()
        ]
        varied = "; ".join(f"{key} {_range(column)}" for key, column in self.varied.items())
        title = f"{len(self):,} flights of {self.scenario.name}"
        return html_table(share, ("outcome", "flights", "share"), title) + html_note(f"varied: {varied}")

    def settings(self, index: int) -> dict[str, Any]:
        """What one of the flights had in place of the scenario's values."""
        return {key: column[index].item() for key, column in self.varied.items()}

    def replay(self, index: int, engine: str | None = None) -> Flight:
        """One of the flights once more, with all its records; its numbers are the same.

        Raises
        ------
        InputError
            If there is no flight of this number.
        """
        if not -len(self) <= index < len(self):
            raise InputError(f"there is no flight {index}; allowed: 0 to {len(self) - 1}")
        return fly(self.scenario, settings=self.settings(index), engine=engine)

    def to_xarray(self) -> xr.Dataset:
        """All of it as a dataset over ``flight`` and, for recorded signals, ``time`` [s]."""
        # xarray takes longer to load than many flights take to fly.
        import xarray as xr

        variables: dict[str, Any] = {name: ("flight", column) for name, column in self.table.columns.items()}
        variables |= {f"vary.{key}": ("flight", column) for key, column in self.varied.items()}
        for row, (name, unit) in enumerate(zip(self.names, self.units, strict=True)):
            about = {"units": unit}
            variables[f"signal.{name}"] = (("time", "flight"), self.signals[:, row], about)
        return xr.Dataset(variables, coords={"time": ("time", self.times, {"units": "s"})})


def fly_many(
    scenario: str | Path | Mapping[str, Any] | Scenario,
    vary: Mapping[str, Sequence[Any] | NDArray[Any] | range],
    *,
    settings: Mapping[str, Any] | None = None,
    record: Sequence[str] = (),
    record_period: float | None = None,
    within: float | None = None,
    engine: str | None = None,
    threads: int | None = None,
    allow_code: bool = False,
    warn: bool = True,
) -> Flights:
    """Fly a scenario many times, with any of its values different in each flight.

    Parameters
    ----------
    scenario : str, Path, mapping or Scenario
        As `rotorfault.fly` takes it.
    vary : mapping
        Dotted keys with one value per flight, such as ``{"fault.0.loss": losses, "seed": range(1000)}``. Numbers
        vary within one compiled loop; each different set of any other values makes a loop of its own.
    settings : mapping, optional
        Dotted keys and values for all flights.
    record : sequence of str, optional
        Signals to be recorded, whole (``position``) or by component (``position.z``).
    record_period : float, optional
        Time between two records in s; the scenario's if not given.
    within : float, optional
        Error in m within which an axis counts as settled; 2 % of the step or span if not given.
    engine : str, optional
        simd or numpy or python; the fastest that is installed if not given.
    threads : int, optional
        One per processor if not given. Nothing in the numbers depends on it.
    allow_code : bool
        Whether code that the scenario names may run; code that is named here may.
    warn : bool
        Whether to warn of what is hardly meant; see `rotorfault.flight.doubts`.

    Returns
    -------
    Flights

    Raises
    ------
    InputError
        If anything that was given cannot be used; names the flight where one value is at fault.
    KeyboardInterrupt
        On Ctrl-C.
    """
    require(settings or {}, Mapping, "settings", "dotted keys and values, such as {'duration': 5.0}")
    common = dict(settings or {})
    if record_period is not None:
        common["record_period"] = record_period
    checked = prepare(scenario, None, common, allow_code=allow_code)
    columns = checked_columns(checked, vary)
    count = len(next(iter(columns.values())))
    groups = groups_of(checked, columns)
    for group in groups if warn else ():
        doubts.warn(group.scenario, varied=True)
        if not any(key.startswith(("start", "reference", "ground")) for key in columns):
            for line in sensing_lines(group.scenario):
                warnings.warn(line, SensorWarning, stacklevel=2)
    layouts = [build(group.scenario).layout for group in groups] if record else []
    rows = [_rows(record, layout) for layout in layouts] or [()] * len(groups)
    width = len(rows[0])
    within = None if within is None else positive(within, "within", "m")
    threads = thread_count(threads)
    one = groups[0].scenario  # for all, where signals are recorded
    if width and len({(group.scenario.steps, group.scenario.every, group.scenario.period) for group in groups}) > 1:
        raise InputError("recorded flights must have one length and one recording period; fly them apart")
    records = -(-one.steps // one.every) if width else 0
    if records * width * count > MOST_NUMBERS:
        raise InputError(
            f"record: {records} records of {width} signals of {count} flights take more memory than there is; "
            f"allowed: {MOST_NUMBERS:.1e} numbers; record less, or seldom (record_period)"
        )
    signals = np.full((records, width, count), np.nan)
    python_only = any(part.make().python_only for group in groups for _, part in group.scenario.parts())
    name, flown, done = ("python" if python_only else default_engine(count)) if engine is None else engine, 0, 0.0
    tables: list[ScoreTable] = []
    order: list[NDArray[np.intp]] = []
    total = float(sum(len(group.flights) * group.scenario.duration for group in groups))
    work = _assembled(groups, rows, within)
    with Bar(f"flying {count}", total, "s of flight") as bar:
        for flights, duration, batch in work:
            recording = load_engine(name)(batch, _watch(bar, done, batch, duration), threads)
            if recording.interrupted:
                raise KeyboardInterrupt
            signals[: len(recording.signals), :, flights] = recording.signals
            tables.append(score_table(batch, recording.state))
            order.append(flights)
            flown += recording.flown
            done += batch.flights * duration
            bar.update(done)
    place = np.argsort(np.concatenate(order))
    table = ScoreTable({key: column[place] for key, column in ScoreTable.joined(tables).columns.items()})
    times: Array = np.arange(records, dtype=np.float64) * (one.every * one.period)
    names, units = _described(rows[0], layouts[0]) if width else ((), ())
    return Flights(checked, columns, table, signals, names, units, times, flown)


def _assembled(
    groups: list[Group], rows: list[tuple[int, ...]], within: float | None
) -> list[tuple[NDArray[np.intp], float, Batch]]:
    """Which flights, how long, and their batch, some thousands at a time."""
    found = []
    count = sum(len(group.flights) for group in groups)
    with Bar(f"preparing {count}", count, "flights") as bar:
        for group, wanted in zip(groups, rows, strict=True):
            for first in range(0, len(group.flights), AT_ONCE):
                part = slice(first, first + AT_ONCE)
                batch = assemble_group(group, part)._replace(
                    every=group.scenario.every if wanted else 0, wanted=wanted
                )
                batch = batch if within is None else _settling_within(batch, within)
                found.append((group.flights[part], group.scenario.duration, batch))
                bar.update(sum(len(flights) for flights, _, _ in found))
    return found


def _settling_within(batch: Batch, within: float) -> Batch:
    band = Vec3(within, within, within)
    scoring = batch.parameters.scoring._replace(settle_band=band)
    return batch._replace(parameters=batch.parameters._replace(scoring=scoring))


def _range(column: NDArray[Any]) -> str:
    """Values of a column in a few words."""
    if column.dtype.kind in "iuf" and len(column):
        return f"{column.min():g} to {column.max():g}"
    return brief(list(dict.fromkeys(map(str, column.tolist()))))


def _watch(bar: Bar, before: float, batch: Batch, duration: float) -> Any:
    def watch(steps: int) -> bool:
        bar.update(before + batch.flights * duration * steps / batch.steps)
        return False

    return watch


def _rows(record: Sequence[str], layout: Layout) -> tuple[int, ...]:
    """Rows of a layout by names of signals or of components."""
    if isinstance(record, str):
        raise InputError(f"record: got {record!r}; allowed: a list of names, such as ['{record}']")
    require(record, (Sequence, set), "record", "a list of names, such as ['position']")
    rows: list[int] = []
    for name in record:
        matching = layout.matching(str(name))
        if not matching:
            raise InputError(f"record: {unknown('signal', str(name), [signal.name for signal in layout.signals])}")
        rows += [row for row in matching if row not in rows]
    return tuple(rows)


def _described(rows: tuple[int, ...], layout: Layout) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Names and units of rows."""
    units = {row: signal.quantity.unit for signal in layout.signals for row in layout.rows[layout.place(signal.name)]}
    names = tuple(layout.rows[row] for row in rows)
    return names, tuple(units[name] for name in names)
