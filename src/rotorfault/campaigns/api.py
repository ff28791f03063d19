"""Campaigns from Python: `campaign`, and the `Campaign` that it gives back."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Collection, Mapping, Sequence
from pathlib import Path
from typing import Any, final

import pyarrow.compute as pc

from rotorfault.base.bounds import require, whole_number
from rotorfault.base.errors import InputError, SensorWarning, short
from rotorfault.base.executors import executor_of
from rotorfault.base.html import html_note, html_table
from rotorfault.base.one_line import LONGEST, cut
from rotorfault.base.plain_text import file_name
from rotorfault.campaigns import run
from rotorfault.campaigns.changes import KIND, changed, with_files
from rotorfault.campaigns.check import out_of_reach
from rotorfault.campaigns.flight_table import FlightTable
from rotorfault.campaigns.load import load_study
from rotorfault.campaigns.replay import differences, is_changed, replay
from rotorfault.campaigns.report.answer import Answer, answer
from rotorfault.campaigns.report.maps import Maps, maps
from rotorfault.campaigns.store.folder import FLIGHTS, PAGE, STUDY
from rotorfault.campaigns.store.identity import read_identity
from rotorfault.campaigns.store.store import Store
from rotorfault.campaigns.study import Study, sources_of, study_from
from rotorfault.campaigns.summaries import summary_of
from rotorfault.campaigns.summaries.parts import Summary
from rotorfault.flight import doubts
from rotorfault.flight.flight import Flight
from rotorfault.scenario.library import with_whole_paths

Say = Callable[[str], None]


class ReplayWarning(UserWarning):
    """A flight that was flown once more has other numbers than its row in the table."""


@final
class Campaign:
    """A campaign in its folder, complete or not.

    Parameters
    ----------
    folder : str or Path
        Of the campaign.
    allow_code : bool or collection of str
        Whether code that its study names may run, to replay flights, or which of it (``FILE.py:NAME``).

    Attributes
    ----------
    folder : Path
    study : Study
    """

    def __init__(self, folder: str | Path, *, allow_code: bool | Collection[str] = False) -> None:
        require(folder, (str, Path), "folder", "the path of a campaign's folder")
        require(allow_code, (bool, Collection), "allow_code", "True, False, or places such as 'mine.py:Mine'")
        if not isinstance(allow_code, bool):
            allow_code = with_whole_paths([allow_code] if isinstance(allow_code, str) else list(allow_code))
        self.folder = Path(folder)
        self._store = Store.open(self.folder)
        self.study: Study = study_from(self._store.study, str(self.folder / "study.json"), allow_code)
        self._summaries: dict[int, Summary | None] = {}  # by flights: one takes a minute where detectors are many

    def __repr__(self) -> str:
        return cut(f"<campaign {cut(self.study.name)} in {self.folder}>", LONGEST)

    def _repr_html_(self) -> str:
        """Flights and successes of each variant so far, as a table for notebooks."""
        table = self._store.table()
        rows = []
        for variant in self.study.variant:
            flown = table.filter(pc.equal(table["variant"], variant.label))
            first = flown.filter(pc.less(flown["number"], self.study.refine.initial))
            good = int(pc.sum(first["success"]).as_py() or 0)
            # Of the first round, as in the report: how many follow is decided by results.
            rate = f"{good:,} of {first.num_rows:,}" + (
                f" ({100.0 * good / first.num_rows:.3g} %)" if len(first) else ""
            )
            rows.append((variant.label, f"{flown.num_rows:,}", rate))
        axes = ", ".join(part.name for part in self.study.axis)
        title = f"campaign {self.study.name}: {self.study.cells:,} cells ({axes})"
        note = f"{self.study.description or self.study.scenario_name}; in {self.folder}"
        return html_table(rows, ("variant", "flights", "successes of the first round"), title) + html_note(note)

    def table(self) -> FlightTable:
        """One row per flight that has been flown."""
        return FlightTable(self._store.table())

    def maps(self) -> Maps:
        """Success rates, intervals, grades, differences by cell; see `rotorfault.campaigns.report.maps`."""
        return maps(self.study, self._store.table())

    def answer(self) -> Answer:
        """What was found: shares of the map, boundaries, differences; as text what the terminal ends with."""
        return answer(self.maps())

    @property
    def page(self) -> Path | None:
        """The page of the report, if it is there and no older than the table of all flights."""
        page, table = self.folder / PAGE, self.folder / FLIGHTS
        if not (page.is_file() and table.is_file()):
            return None
        return page if page.stat().st_mtime_ns >= table.stat().st_mtime_ns else None

    def summary(self) -> Summary | None:
        """What its study writes besides table and maps, from the flights there are; None where it writes nothing."""
        table = self._store.table()
        if table.num_rows not in self._summaries:
            self._summaries = {table.num_rows: summary_of(self.study, table)}
        return self._summaries[table.num_rows]

    def report(self) -> list[Path]:
        """Write pictures and page, and what its study writes besides; the page's path first."""
        # Loads Matplotlib and Plotly, which a campaign does not need.
        from rotorfault.campaigns.report.report import write

        made_by = {**self._store.identity.versions, "source": self._store.identity.program}
        self.write_summary()
        return write(self.study, self._store.table(), self.folder, made_by, self.summary())

    def write_summary(self) -> list[Path]:
        """Write the files of the study's summary anew, if it has one; their paths."""
        summary = self.summary()
        return [] if summary is None else summary.write(self.folder)

    def keep_flights(self, cells: int) -> list[Path]:
        """Keep pages of flights in the folder, in the cells whose success is nearest to one half; their paths.

        Each is flown again, and stands on its page beside the same flight of the other variants. The page of the
        campaign opens them, once `report` has made it anew.

        Parameters
        ----------
        cells : int

        Raises
        ------
        InputError
            If it is no whole number from 1 to the cells that there are, or a flight needs code that is not allowed.
        """
        from rotorfault.campaigns.report.kept import keep

        return keep(self.study, self.maps(), self.folder, whole_number(cells, "cells", 1, self.study.cells))

    def replay(
        self, identifier: int, *, controller: str | None = None, settings: Mapping[str, Any] | None = None
    ) -> Flight:
        """Fly one of the flights once more, with everything recorded, or with something else in it.

        Warns (`ReplayWarning`) where its numbers are not those of the table, unless something else was asked for.

        Parameters
        ----------
        identifier : int
            Column ``id`` of the table.
        controller : str, optional
            Name or place in code (``FILE.py:NAME``) in place of the flight's controller; the same place names it
            again, and so allows it to run.
        settings : mapping, optional
            Dotted keys and values in place of the flight's.

        Raises
        ------
        InputError
            If there is no such flight, a value is not allowed, or it needs code that is not allowed.
        """
        self.require_flown(identifier)
        changes = replay_changes(controller, settings)
        flight = replay(self.study, identifier, changes)
        if not changes or not is_changed(self.study, identifier, changes):
            for line in self.differences(identifier, flight):
                warnings.warn(line, ReplayWarning, stacklevel=2)
        return flight

    def require_flown(self, identifier: int) -> None:
        """Refuse what is no flight of the table.

        Parameters
        ----------
        identifier : int
            Column ``id`` of the table.

        Raises
        ------
        InputError
            If no flight that was flown has it.
        """
        found = self._store.table()["id"]
        if not pc.any(pc.equal(found, identifier)).as_py():
            span = pc.min_max(found).as_py()
            there = f", {span['min']} to {span['max']}" if len(found) else ""
            raise InputError(
                f"{self.study.name} has flown no flight {short(identifier)}; allowed: the {len(found):,} of column "
                f"'id' of its table{there}"
            )

    def is_changed(self, identifier: int, changes: Mapping[str, Any]) -> bool:
        """Whether changes, as `replay_changes` gives them, make another flight of one of the table."""
        return is_changed(self.study, identifier, changes)

    def differences(self, identifier: int, flight: Flight) -> list[str]:
        """What of a replayed flight is not as in the table; empty where all agrees.

        Parameters
        ----------
        identifier : int
            Column ``id`` of the table.
        flight : Flight
            Flown once more.
        """
        table = self._store.table()
        rows = table.filter(pc.equal(table["id"], identifier)).to_pylist()
        lines = differences(rows[0], flight.scores)
        there, here = self._store.identity.own, {} if flight.scenario is None else sources_of(flight.scenario)
        other = [place for place, digest in here.items() if digest != there.get(place)]
        return [*(f"source of {place} has changed since the campaign was flown" for place in other), *lines]


def replay_changes(controller: str | None, settings: Mapping[str, Any] | None) -> dict[str, Any]:
    """What a replay has in place of the flight's, as dotted keys and values, with whole paths.

    Parameters
    ----------
    controller : str, optional
    settings : mapping, optional

    Raises
    ------
    InputError
        If they are no settings.
    """
    named = {} if controller is None else {KIND: with_whole_paths(controller)}
    return {**named, **with_files(settings)}


def campaign(
    study: str | Path | Mapping[str, Any] | Study,
    out: str | Path | None = None,
    *,
    resume: bool = False,
    repair: bool = False,
    controllers: str | Sequence[str] = (),
    settings: Mapping[str, Any] | None = None,
    vehicle: str | None = None,
    preset: str | Sequence[str] | None = None,
    seed: int | None = None,
    budget: int | None = None,
    quick: bool = False,
    flights: int | None = None,
    workers: int | None = None,
    scheduler: str | None = None,
    allow_code: bool = False,
    say: Say = lambda _: None,
) -> Campaign:
    """Fly a campaign; of one that is complete already, nothing is flown.

    Parameters
    ----------
    study : str, Path, mapping or Study
        Name of a built-in study, path of a TOML file or of the ``study.json`` of a campaign, tables as such a file
        holds, or a checked study.
    out : str or Path, optional
        Folder; ``campaigns/NAME`` if not given.
    resume : bool
        Resume the campaign in the folder.
    repair : bool
        Resume; move damaged parts aside and fly them anew.
    controllers : str or sequence of str, optional
        Names or places in code (``FILE.py:NAME``), compared in place of the study's controllers: each is a variant.
    settings : mapping, optional
        Dotted keys and values for all flights, over all that the study says.
    vehicle, preset, seed, budget, quick, flights : optional
        In place of the study's; see `rotorfault.campaigns.changes.changed`.
    workers : int, optional
        Threads; one per core if not given. Nothing in the table depends on it.
    scheduler : str, optional
        Address of a Dask scheduler, whose workers fly.
    allow_code : bool
        Whether code that the study names may run; code that is named here may.
    say : callable
        Is given, line by line, what was moved aside and the results of each round.

    Returns
    -------
    Campaign

    Raises
    ------
    InputError
        If an argument cannot be used; nothing has been flown then.
    KeyboardInterrupt
        On Ctrl-C. What is done is kept in the folder, which is its argument; it has none where there is no campaign
        to resume yet.
    """
    if isinstance(study, Study):
        checked = study
    elif isinstance(study, (str, Path)):
        checked = _study_at(study, allow_code)
    elif isinstance(study, Mapping):
        checked = study_from(dict(study), "study", allow_code)
    else:
        raise InputError(f"study: got {short(study)}; allowed: a name, a path, tables or a Study")
    require("" if vehicle is None else vehicle, str, "vehicle", "a name, or a path that ends in .toml")
    checked = changed(
        checked,
        controllers=controllers,
        settings=settings,
        vehicle=vehicle,
        preset=preset,
        seed=seed,
        budget=budget,
        quick=quick,
        flights=flights,
    ).resolved()
    require("" if out is None else out, (str, Path), "out", "the path of a folder")
    folder = Path("campaigns") / file_name(checked.name) if out is None else Path(out)
    run.check(checked)
    executor = executor_of(workers, scheduler)
    complete = not (resume or repair) and run.is_complete(checked, folder)
    try:
        with run.open_store(checked, folder, resume or complete, repair) as store:
            for damage in store.repaired:
                say(f"moved aside: {damage.name} ({damage.reason})")
            for scenario in () if complete else checked.scenarios:
                doubts.warn(scenario, varied=True)
            for line in () if complete else out_of_reach(checked):
                warnings.warn(line, SensorWarning, stacklevel=2)
            progress = run.fly(checked, store, executor, say)
    except KeyboardInterrupt:
        raise KeyboardInterrupt(*[str(folder)] * (folder / STUDY).is_file()) from None
    table = folder / FLIGHTS
    if progress.flights:
        say(f"{progress.flights:,} flights in {progress.rounds} rounds, {progress.seconds:.0f} s; table in {table}")
    else:
        say(f"{checked.name} is complete, nothing is left to fly: {progress.total:,} flights in {table}")
    done = Campaign(folder, allow_code=checked.allows_code)
    for path in done.write_summary():
        say(f"summary in {path}")
    return done


def _study_at(place: str | Path, allow_code: bool) -> Study:
    """A study by its name, from its file, or from the folder of a campaign that has flown it."""
    if Path(place).name == STUDY:
        return study_from(read_identity(Path(place)).study, str(place), allow_code)
    return load_study(place, allow_code=allow_code)
