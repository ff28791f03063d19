"""Flying a campaign: round after round, block after block, and always able to go on where it was.

Blocks are flown one after the other, each on all cores, or by the workers of a Dask cluster. What a round has follows
from the results of the rounds before, so that interrupted or not, on any number of workers, the table is the same.
"""

from __future__ import annotations

import importlib
import importlib.util
import os
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple, Protocol

import numpy as np
import pyarrow as pa

from rotorfault.base.errors import InputError
from rotorfault.base.progress import Bar
from rotorfault.base.versions import source_digest
from rotorfault.campaigns.block import fly_block, vary
from rotorfault.campaigns.sampling.axes import columns
from rotorfault.campaigns.sampling.plan import Counts, Flights, blocks, next_round
from rotorfault.campaigns.store.store import Store
from rotorfault.campaigns.study import Study
from rotorfault.flight.assembly import assemble_group
from rotorfault.flight.sweep import checked_columns, groups_of

BYTES_PER_FLIGHT = 400
Say = Callable[[str], None]


class Progress(NamedTuple):
    """How far a campaign is."""

    rounds: int
    flights: int
    survived: int
    seconds: float


class Crew(Protocol):
    """Who flies blocks."""

    def fly(self, study: Study, work: list[tuple[int, Flights]]) -> Iterator[tuple[int, pa.Table]]:
        """Fly blocks, and give each back as soon as it is done, in whatever order."""


class Here:
    """This process, block after block, on all cores or on so many.

    Parameters
    ----------
    threads : int, optional
    """

    def __init__(self, threads: int | None = None) -> None:
        self._threads = threads

    def fly(self, study: Study, work: list[tuple[int, Flights]]) -> Iterator[tuple[int, pa.Table]]:
        """Fly blocks in order."""
        for number, flights in work:
            yield number, fly_block(study, flights, self._threads)


def open_store(study: Study, folder: Path, resume: bool, repair: bool = False) -> Store:
    """The folder of a campaign, new or to be gone on with.

    Raises
    ------
    InputError
        See `rotorfault.campaigns.store.store.Store`.
    """
    tables, digest = study.as_tables(), source_digest()
    if resume or repair:
        return Store.open(folder, study=tables, digest=digest, write=True, repair=repair)
    return Store.create(folder, tables, digest, space=int(study.most_flights * BYTES_PER_FLIGHT))


def check(study: Study) -> None:
    """See that everything in a study can be flown, before anything is.

    Raises
    ------
    InputError
        If a scenario, a key or a value is not allowed.
    """
    cells = np.arange(study.cells)
    for variant in range(len(study.variant)):
        scenario = study.scenario_of(variant)
        one_each = Flights(np.full(len(cells), variant), cells, np.zeros(len(cells), dtype=np.int64))
        given = checked_columns(scenario, dict(columns(vary(study, one_each))))
        for group in groups_of(scenario, given):
            assemble_group(group)


def fly(study: Study, store: Store, crew: Crew, say: Say = lambda _: None) -> Progress:
    """Fly what is missing of a campaign.

    Parameters
    ----------
    study : Study
    store : Store
        Held for writing.
    crew : Crew
    say : callable
        Is told after each round what it gave.

    Raises
    ------
    KeyboardInterrupt
        On Ctrl-C; the blocks that are done are kept.
    """
    start, flown = time.monotonic(), 0
    successes: Counts = np.zeros((len(study.variant), study.cells), dtype=np.int64)
    trials = successes.copy()
    labels = {variant.label: i for i, variant in enumerate(study.variant)}
    done = store.done()
    everything: list[tuple[int, int]] = []
    number = 0
    while True:
        flights = next_round(study, successes, trials)
        if not flights.size:
            break
        work = list(blocks(flights))
        everything += [(number, block) for block, _ in work]
        missing = [(block, part) for block, part in work if (number, block) not in done]
        title, total = f"round {number + 1}", sum(part.size for _, part in missing)
        sizes = {block: part.size for block, part in missing}
        with Bar(title, total, "flights") as bar:
            here = alive = 0
            for block, table in crew.fly(study, missing):
                store.put(number, block, table)
                here += sizes[block]
                alive += int(np.count_nonzero(table["survived"].to_numpy(zero_copy_only=False)))
                bar.update(here, f"{100.0 * alive / here:.0f} % of them survived")
        flown += total
        for block, _ in work:
            table = store.get(number, block)
            variant = np.array([labels[label] for label in table["variant"].to_pylist()])
            cell, survived = table["cell"].to_numpy(), table["survived"].to_numpy(zero_copy_only=False)
            np.add.at(trials, (variant, cell), 1)
            np.add.at(successes, (variant, cell), survived.astype(np.int64))
        number += 1
        say(_told(study, number, successes, trials))
    store.finish(everything)
    return Progress(number, flown, int(successes.sum()), time.monotonic() - start)


def _told(study: Study, number: int, successes: Counts, trials: Counts) -> str:
    # Every cell counts alike: later rounds fly where survival is uncertain, which says nothing about the map.
    shares = ", ".join(
        f"{variant.label} {100.0 * share:.1f} %"
        for variant, share in zip(study.variant, (successes / trials).mean(axis=1), strict=True)
    )
    return f"round {number}: {trials.sum():,} flights so far; survived over the map: {shares}"


def crew(threads: int | None, scheduler: str | None) -> Crew:
    """Who flies: this process, or the workers of a Dask scheduler.

    Raises
    ------
    InputError
        If Dask is not installed, or the scheduler cannot be reached.
    """
    if scheduler is None:
        return Here(threads or os.cpu_count())
    if importlib.util.find_spec("distributed") is None:
        raise InputError("--scheduler needs Dask, which is not installed; install rotorfault[cluster]")
    found: Any = importlib.import_module("rotorfault.campaigns.cluster").Cluster(scheduler)
    return found  # type: ignore[no-any-return]
