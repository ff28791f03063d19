"""Table 1 as ranges: what the ratio of the two laws owes to how their gains were searched.

A single pair of gains gives a single ratio, and another search gives another one. So both laws are searched again, by
the same optimiser with the same budget, for each of three objectives (`SEARCHED_FOR`), in
two boxes and from several seeds; every pair flies the paper's three cases, and what is said of the ratio is its least
and its largest value. Searches are independent of each other and kept one by one, so that an interrupted run goes on.

The gains that the package's own tables are made of are kept beside this file, with what they flew: `kept`. They can
be flown again in a minute (`again`), where the program has changed and a new search is not wanted.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Sequence
from importlib import resources
from pathlib import Path
from typing import Any, NamedTuple

from rotorfault._version import __version__
from rotorfault.autopilot.control import CONTROLLER
from rotorfault.autopilot.presets import presets
from rotorfault.base.errors import InputError
from rotorfault.base.executors import Processes
from rotorfault.base.files import output_folder, write_atomically
from rotorfault.base.resumable import Task, run_missing
from rotorfault.base.versions import source_digest
from rotorfault.engine import default_engine, load_engine
from rotorfault.engine.batch import no_watch
from rotorfault.flight.candidates import assemble_with
from rotorfault.results.score_table import score_table
from rotorfault.scenario.library import load_scenario
from rotorfault.studies.paper.cases import CASES
from rotorfault.tuning.search import tune
from rotorfault.tuning.space import BOXES, candidate
from rotorfault.tuning.training import GROUPS

LAWS = ("roismc", "smc")
SEARCHED_FOR = ("balanced", "cost", "without-cost")  # `quiet` asks for noise, which the paper's cases have not
KEPT = "ranges.json"


class Budget(NamedTuple):
    """How long each search is; the same for both laws."""

    seeds: tuple[int, ...]
    generations: int
    population: int
    neighbours: int  # training flights in each group, at most

    @property
    def flights(self) -> int:
        """Training flights of one search."""
        return self.generations * self.population * sum(min(count, self.neighbours) for _, _, count in GROUPS)


FULL = Budget((1, 2, 3), 24, 14, 2)
QUICK = Budget((1,), 3, 8, 1)


class Cell(NamedTuple):
    """How a pair of gains was searched."""

    objective: str
    box: str
    seed: int


class Flown(NamedTuple):
    """What a law's gains gave in one case."""

    outcome: str
    survived: bool
    cost: float
    settle_time: float | None  # s; None where it never settled
    position_mse: float  # m^2, sum of the axes


class Gains(NamedTuple):
    """Gains of one law, from one search, and what they flew."""

    cell: Cell
    law: str
    settings: dict[str, Any]
    objective: float  # what the search came to
    at_bounds: tuple[str, ...]
    cases: dict[str, Flown]


def cells(seeds: Iterable[int]) -> list[Cell]:
    """All ways in which pairs are searched."""
    return [Cell(objective, box, seed) for seed in seeds for box in BOXES for objective in SEARCHED_FOR]


# ------------------------------------------------------------------------------------------------------- searches


class _Search(NamedTuple):
    cell: Cell
    law: str
    budget: Budget

    @property
    def key(self) -> str:
        return f"{self.cell.objective}-{self.cell.box}-{self.cell.seed}-{self.law}"


def _searched(search: _Search) -> dict[str, Any]:
    """Gains of one search; in a worker process."""
    cell, budget = search.cell, search.budget
    found = tune(
        search.law, generations=budget.generations, population=budget.population, seed=cell.seed,
        objective=cell.objective, box=cell.box, neighbours=budget.neighbours,
    )  # fmt: skip
    if found.record["generations"] < budget.generations:
        raise KeyboardInterrupt  # a search that was cut short is not kept
    return {"settings": found.settings, "record": found.record}


class _Searches:
    """Finished searches, one file each."""

    def __init__(self, folder: Path, searches: Sequence[_Search]) -> None:
        self._folder, self._searches = folder, {search.key: search for search in searches}

    def find(self, key: str) -> dict[str, Any] | None:
        """A search that is there, unless program or budget have changed since."""
        try:
            content: dict[str, Any] = json.loads((self._folder / f"{key}.json").read_text(encoding="utf-8"))
            return content if content["digest"] == self._digest(key) else None
        except (OSError, ValueError, KeyError, TypeError):
            return None  # missing or damaged: searched anew

    def done(self) -> set[str]:
        """Keys of the searches that are there."""
        return {key for key in self._searches if self.find(key) is not None}

    def keep(self, key: str, result: dict[str, Any]) -> None:
        """Keep a search."""
        text = json.dumps({"digest": self._digest(key), **result}, indent=1)
        write_atomically(self._folder / f"{key}.json", lambda temporary: temporary.write_text(text, encoding="utf-8"))

    def _digest(self, key: str) -> str:
        budget = self._searches[key].budget._replace(seeds=())  # more seeds leave those that are there as they are
        words = [source_digest(), key, json.dumps(budget)]
        return hashlib.sha256("\n".join(words).encode()).hexdigest()


def search_all(folder: Path, budget: Budget, workers: int | None = None) -> list[Gains]:
    """Search what is not there yet, then fly all of it.

    Parameters
    ----------
    folder : Path
        Gets a file for each search.
    budget : Budget
    workers : int, optional
        Processes; one per core if not given.

    Raises
    ------
    KeyboardInterrupt
        On Ctrl-C; searches that were finished are kept.
    """
    searches = [_Search(cell, law, budget) for cell in cells(budget.seeds) for law in LAWS]
    store = _Searches(output_folder(folder / "searches"), searches)
    tasks = [Task(search.key, search) for search in searches]
    run_missing(tasks, _searched, store, Processes(workers), "searching gains", "searches")
    found = []
    for search in searches:
        content = store.find(search.key)
        assert content is not None
        record = content["record"]
        found.append(
            Gains(search.cell, search.law, content["settings"], record["objective"], tuple(record["at_bounds"]), {})
        )
    return flown(found)


# -------------------------------------------------------------------------------------------------------- flights


def flown(gains: Sequence[Gains], only: Sequence[str] = tuple(CASES)) -> list[Gains]:
    """The same gains with what they fly in the paper's cases, each as `rotorfault fly` flies it."""
    results: list[dict[str, Flown]] = [{} for _ in gains]
    for law in LAWS:
        places = [i for i, one in enumerate(gains) if one.law == law]
        if not places:
            continue
        for case in only:
            scenario = load_scenario(CASES[case].scenario, {"controller.kind": law})
            parts = [candidate(scenario, law, gains[i].settings) for i in places]
            batch = assemble_with([scenario], CONTROLLER, parts)._replace(every=0)
            recording = load_engine(default_engine(batch.flights))(batch, no_watch)
            if recording.interrupted:
                raise KeyboardInterrupt
            table = score_table(batch, recording.state)
            for row, place in enumerate(places):
                results[place][case] = _flown(table.row(row))
    return [one._replace(cases=cases) for one, cases in zip(gains, results, strict=True)]


def _flown(row: dict[str, Any]) -> Flown:
    settle = row["settle_time.overall"]
    return Flown(
        str(row["outcome"]), bool(row["survived"]), float(f"{row['cost']:.6g}"),
        None if settle != settle else float(f"{settle:.6g}"),
        float(f"{sum(row[f'position_mse.{axis}'] for axis in 'xyz'):.6g}"),
    )  # fmt: skip


def shipped() -> list[Gains]:
    """The `tuned` presets, flown."""
    return flown(
        [Gains(Cell("shipped", "standard", 1), law, dict(presets(law)["tuned"]), 0.0, (), {}) for law in LAWS]
    )


# ----------------------------------------------------------------------------------------------------- kept numbers


def as_json(gains: Sequence[Gains], budget: Budget, presets_flown: Sequence[Gains]) -> str:
    """Gains and flights as text; `read` reads it."""
    content = {
        "version": __version__,
        "budget": budget._asdict(),
        "shipped": [_plain(one) for one in presets_flown],
        "gains": [_plain(one) for one in gains],
    }
    return json.dumps(content, indent=1) + "\n"


def _plain(one: Gains) -> dict[str, Any]:
    cases = {name: flight._asdict() for name, flight in one.cases.items()}
    return {**one.cell._asdict(), **one._asdict(), "cell": None, "value": one.objective, "cases": cases} | {
        "objective": one.cell.objective
    }


class Kept(NamedTuple):
    """A file of gains."""

    version: str
    budget: Budget
    shipped: list[Gains]
    gains: list[Gains]


def read(text: str, where: str) -> Kept:
    """What `as_json` wrote.

    Raises
    ------
    InputError
        If it is not that.
    """
    try:
        content = json.loads(text)
        budget = Budget(**{**content["budget"], "seeds": tuple(content["budget"]["seeds"])})
        both = [[_gains(one) for one in content[part]] for part in ("shipped", "gains")]
        return Kept(str(content["version"]), budget, *both)
    except (ValueError, KeyError, TypeError) as error:
        raise InputError(f"{where}: is no file that `rotorfault ranges` wrote ({error!r})") from None


def _gains(one: dict[str, Any]) -> Gains:
    cell = Cell(str(one["objective"]), str(one["box"]), int(one["seed"]))
    cases = {name: Flown(**flight) for name, flight in one["cases"].items()}
    return Gains(cell, str(one["law"]), one["settings"], float(one["value"]), tuple(one["at_bounds"]), cases)


def kept() -> Kept:
    """The numbers that the package's own tables are made of."""
    text = (resources.files("rotorfault.studies.paper") / KEPT).read_text(encoding="utf-8")
    return read(text, KEPT)
