"""Campaigns from Python: `campaign`, and the `Campaign` that it gives back."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, final

import pyarrow as pa
import pyarrow.compute as pc

from rotorfault.base.bounds import require
from rotorfault.base.errors import InputError, short
from rotorfault.base.executors import executor_of
from rotorfault.base.plain_text import file_name
from rotorfault.campaigns import run
from rotorfault.campaigns.replay import differences, replay
from rotorfault.campaigns.report.answer import Answer, answer
from rotorfault.campaigns.report.maps import Maps, maps
from rotorfault.campaigns.store.folder import FLIGHTS, PAGE, STUDY
from rotorfault.campaigns.store.identity import read_identity
from rotorfault.campaigns.store.store import Store
from rotorfault.campaigns.study import Study, changed, load_study, sources_of, study_from
from rotorfault.flight import doubts
from rotorfault.flight.flight import Flight

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
    allow_code : bool
        Whether code that its study names may run, to replay flights.

    Attributes
    ----------
    folder : Path
    study : Study
    """

    def __init__(self, folder: str | Path, *, allow_code: bool = False) -> None:
        require(folder, (str, Path), "folder", "the path of a campaign's folder")
        self.folder = Path(folder)
        self._store = Store.open(self.folder)
        self.study: Study = study_from(self._store.study, str(self.folder / "study.json"), allow_code)

    def __repr__(self) -> str:
        return f"<campaign {self.study.name} in {self.folder}>"

    def table(self) -> pa.Table:
        """One row per flight that has been flown."""
        return self._store.table()

    def maps(self) -> Maps:
        """Success rates, intervals, grades, differences by cell; see `rotorfault.campaigns.report.maps`."""
        return maps(self.study, self.table())

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

    def report(self) -> list[Path]:
        """Write pictures and page; the page's path first."""
        # Loads Matplotlib and Plotly, which a campaign does not need.
        from rotorfault.campaigns.report.report import write

        made_by = {**self._store.identity.versions, "source": self._store.identity.program}
        return write(self.study, self.table(), self.folder, made_by)

    def replay(self, identifier: int) -> Flight:
        """Fly one of the flights once more, with everything recorded.

        Warns (`ReplayWarning`) where its numbers are not those of the table.

        Parameters
        ----------
        identifier : int
            Column ``id`` of the table.

        Raises
        ------
        InputError
            If there is no such flight, or it needs code that is not allowed.
        """
        flight = replay(self.study, identifier)
        for line in self.differences(identifier, flight):
            warnings.warn(line, ReplayWarning, stacklevel=2)
        return flight

    def differences(self, identifier: int, flight: Flight) -> list[str]:
        """What of a replayed flight is not as in the table; empty where all agrees, or it was never flown.

        Parameters
        ----------
        identifier : int
            Column ``id`` of the table.
        flight : Flight
            Flown once more.
        """
        table = self.table()
        rows = table.filter(pc.equal(table["id"], identifier)).to_pylist()
        if not rows:
            return []
        lines = differences(rows[0], flight.scores)
        there, here = self._store.identity.own, {} if flight.scenario is None else sources_of(flight.scenario)
        other = [place for place, digest in here.items() if digest != there.get(place)]
        return [*(f"source of {place} has changed since the campaign was flown" for place in other), *lines]


def campaign(
    study: str | Path | Mapping[str, Any] | Study,
    out: str | Path | None = None,
    *,
    resume: bool = False,
    repair: bool = False,
    vehicle: str | None = None,
    preset: str | None = None,
    seed: int | None = None,
    budget: int | None = None,
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
    vehicle, preset, seed, budget : optional
        In place of the study's; see `rotorfault.campaigns.study.changed`.
    workers : int, optional
        Threads; one per core if not given. Nothing in the table depends on it.
    scheduler : str, optional
        Address of a Dask scheduler, whose workers fly.
    allow_code : bool
        Whether code that the study names may run.
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
        On Ctrl-C; what is done is kept in the folder.
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
    checked = changed(checked, vehicle, preset, seed, budget).resolved()
    require("" if out is None else out, (str, Path), "out", "the path of a folder")
    folder = Path("campaigns") / file_name(checked.name) if out is None else Path(out)
    run.check(checked)
    for scenario in checked.scenarios:
        doubts.warn(scenario, varied=True)
    executor = executor_of(workers, scheduler)
    complete = not (resume or repair) and run.is_complete(checked, folder)
    with run.open_store(checked, folder, resume or complete, repair) as store:
        for damage in store.repaired:
            say(f"moved aside: {damage.name} ({damage.reason})")
        progress = run.fly(checked, store, executor, say)
    table = folder / FLIGHTS
    if progress.flights:
        say(f"{progress.flights:,} flights in {progress.rounds} rounds, {progress.seconds:.0f} s; table in {table}")
    else:
        say(f"{checked.name} is complete, nothing is left to fly: {progress.total:,} flights in {table}")
    return Campaign(folder, allow_code=checked.allows_code)


def _study_at(place: str | Path, allow_code: bool) -> Study:
    """A study by its name, from its file, or from the folder of a campaign that has flown it."""
    if Path(place).name == STUDY:
        return study_from(read_identity(Path(place)).study, str(place), allow_code)
    return load_study(place, allow_code=allow_code)
