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
from rotorfault.campaigns.axes import columns
from rotorfault.campaigns.block import fly_block
from rotorfault.campaigns.flight_set import FlightSet, values_of
from rotorfault.campaigns.rounds import Tally, blocks, next_round
from rotorfault.campaigns.store.store import Key, Store
from rotorfault.campaigns.study import Study
from rotorfault.flight.assembly import assemble_group
from rotorfault.flight.sweep import checked_columns, groups_of
from rotorfault.maths.arrays import Array

BYTES_PER_FLIGHT = 400
ROOMS = (
    "campaigns/sampling", "campaigns/axes.py", "campaigns/block.py", "campaigns/flight_set.py", "campaigns/grades.py",
    "campaigns/rounds.py", "campaigns/study.py", "campaigns/varied.py",
)  # fmt: skip
"""Of the campaigns' source, what decides which flights there are and what their rows say."""
Say = Callable[[str], None]


class Progress(NamedTuple):
    """How far a campaign is."""

    rounds: int
    flights: int
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


def check(study: Study) -> None:
    """See that everything in a study can be flown, before anything is.

    Raises
    ------
    InputError
        If a scenario, a key or a value is not allowed.
    """
    cells = np.arange(study.cells)
    for variant, scenario in enumerate(study.scenarios):
        one_each = FlightSet(np.full(len(cells), variant), cells, np.zeros(len(cells), dtype=np.int64))
        settings = checked_columns(scenario, dict(columns(values_of(study, one_each))))
        for group in groups_of(scenario, settings):
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
        Is given a line after each round.

    Raises
    ------
    KeyboardInterrupt
        On Ctrl-C; the blocks that are done are kept.
    """
    start, flown = time.monotonic(), 0
    tally = Tally(study)
    work = partial(fly_block, study, threads=executor.threads)
    keys: list[Key] = []
    rates = np.zeros(len(study.variant))
    for round in itertools.count():
        flights = next_round(study, tally.successes, tally.trials)
        if not flights.size:
            break
        tasks = [Task((round, block), part, part.size) for block, part in enumerate(blocks(flights))]
        parts = _Parts(store)
        flown += run_missing(tasks, work, parts, executor, f"round {round + 1}", "flights", parts.note)
        keys += [task.key for task in tasks]
        for task in tasks:
            tally.add(store.get(*task.key))
        if not round:
            rates = (tally.successes / tally.trials).mean(axis=1)
        say(_summary(study, round, int(tally.trials.sum()), rates))
    store.finish(keys)
    return Progress(round, flown, int(tally.successes.sum()), time.monotonic() - start)


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


def _summary(study: Study, round: int, flights: int, rates: Array) -> str:
    """A line after each round.

    The success rates are the report's: of the first round, each cell counting alike. How many flights a cell has in
    later rounds is decided by results, and rates of all flights would be other numbers.
    """
    each = ", ".join(
        f"{variant.label} {100.0 * rate:.1f} %" for variant, rate in zip(study.variant, rates, strict=True)
    )
    return f"round {round + 1}: {flights:,} flights so far; success over the map, by round 1: {each}"
