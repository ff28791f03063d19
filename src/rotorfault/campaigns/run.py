"""Flying a campaign: round after round, block after block, and always able to resume.

Blocks are flown one after the other, each on all cores, or by the workers of a Dask cluster. What a round has follows
from the results of the rounds before, so that interrupted or not, on any number of workers, the table is the same.
"""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pyarrow as pa

from rotorfault.base.resumable import Executor, Task, run_missing
from rotorfault.base.versions import source_digest
from rotorfault.campaigns.block import fly_block
from rotorfault.campaigns.flight_set import FlightSet, alike, columns_of, values_of
from rotorfault.campaigns.rounds import Tally, blocks, next_round
from rotorfault.campaigns.store.folder import FLIGHTS, STUDY
from rotorfault.campaigns.store.identity import read_identity
from rotorfault.campaigns.store.store import Key, Store
from rotorfault.campaigns.study import Study
from rotorfault.flight.assembly import assemble_group
from rotorfault.flight.sweep import checked_columns, groups_of

BYTES_PER_FLIGHT = 400
ROOMS = (
    "campaigns/sampling", "campaigns/axes.py", "campaigns/block.py", "campaigns/flight_set.py", "campaigns/grades.py",
    "campaigns/grading.py", "campaigns/rounds.py", "campaigns/detections.py", "campaigns/study.py",
    "campaigns/varied.py",
)  # fmt: skip
"""Of the campaigns' source, what decides which flights there are and what their rows say."""
Say = Callable[[str], None]


class Progress(NamedTuple):
    """How far a campaign is."""

    rounds: int
    flights: int  # flown now
    total: int
    successes: int
    seconds: float


def open_store(study: Study, folder: Path, resume: bool, repair: bool = False) -> Store:
    """The folder of a campaign, new or resumed.

    Raises
    ------
    InputError
        See `rotorfault.campaigns.store.store.Store`.
    """
    tables, digest, own = study.as_tables(), source_digest(*ROOMS), study.own_sources
    if resume or repair:
        return Store.open(folder, study=tables, digest=digest, own=own, write=True, repair=repair)
    return Store.create(folder, tables, digest, space=int(study.most_flights * BYTES_PER_FLIGHT), own=own)


def is_complete(study: Study, folder: Path) -> bool:
    """Whether a folder holds this very campaign with all its flights, so that nothing is left to fly.

    Parameters
    ----------
    study : Study
    folder : Path
    """
    if not ((folder / STUDY).is_file() and (folder / FLIGHTS).is_file()):
        return False
    return not read_identity(folder / STUDY).unlike(study.as_tables(), source_digest(*ROOMS), study.own_sources)


def check(study: Study) -> None:
    """See that everything in a study can be flown, before anything is.

    Raises
    ------
    InputError
        If a scenario, a key or a value is not allowed.
    """
    cells = np.arange(study.cells)
    for variant in range(len(study.variant)):
        one_each = FlightSet(np.full(len(cells), variant), cells, np.zeros(len(cells), dtype=np.int64))
        values = values_of(study, one_each)
        for which, _, cases in alike(study, one_each):
            scenario = study.scenario_of(variant, cases)
            own = columns_of(study, {name: column[which] for name, column in values.items()}, cases)
            for group in groups_of(scenario, checked_columns(scenario, {**own, "seed": np.zeros(len(which), int)})):
                assemble_group(group)


def fly(study: Study, store: Store, executor: Executor, say: Say = lambda _: None) -> Progress:
    """Fly what is missing of a campaign.

    Parameters
    ----------
    study : Study
    store : Store
        Held for writing.
    executor : Executor
    say : callable
        Is given a line after each round of which something was flown.

    Raises
    ------
    KeyboardInterrupt
        On Ctrl-C; the blocks that are done are kept.
    """
    start, flown = time.monotonic(), 0
    tally = Tally(study)
    work = partial(fly_block, study, threads=executor.threads)
    keys: list[Key] = []
    for round in itertools.count():
        flights = next_round(study, tally.successes, tally.trials)
        if not flights.size:
            break
        tasks = [Task((round, block), part, part.size) for block, part in enumerate(blocks(flights))]
        parts = _Parts(store)
        new = run_missing(tasks, work, parts, executor, f"round {round + 1}", "flights", parts.note)
        keys += [task.key for task in tasks]
        for task in tasks:
            tally.add(store.get(*task.key))
        flown += new
        if new:
            say(_summary(study, round, flights.size, int(tally.trials.sum())))
    store.finish(keys)
    return Progress(round, flown, int(tally.trials.sum()), int(tally.successes.sum()), time.monotonic() - start)


class _Parts:
    """A campaign's store for the blocks of a round."""

    def __init__(self, store: Store) -> None:
        self._store = store
        self._flights = self._successes = 0  # of those that were kept now

    def done(self) -> set[Key]:
        """Rounds and blocks that are there."""
        return self._store.done()

    def keep(self, key: Key, table: pa.Table) -> None:
        """Keep a block."""
        self._store.put(*key, table)
        self._flights += table.num_rows
        self._successes += int(np.count_nonzero(table["success"].to_numpy(zero_copy_only=False)))

    def note(self) -> str:
        """What the progress bar says."""
        return f"{100.0 * self._successes / self._flights:.0f} % of them successful"


def _summary(study: Study, round: int, new: int, flights: int) -> str:
    """A line after each round.

    What was found stands at the end alone (`rotorfault.campaigns.report.answer`): by more flights where results ask
    for more, a share of all flights so far would be of no map.
    """
    if not round:
        return f"round 1: {new:,} flights, {study.refine.initial} of each variant in each cell"
    return f"round {round + 1}: {new:,} flights more where success is uncertain, {flights:,} so far"
