"""Fly the missing runs of a study on all cores, with progress, and keep what is done when interrupted."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterable
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import get_context

from rotorfault.base.errors import InputError
from rotorfault.base.progress import Bar
from rotorfault.studies.runs import Measure, Run, Store

_store: Store | None = None


def fly_missing(store: Store, runs: Iterable[Run], title: str, workers: int | None = None) -> int:
    """Fly every run that the store has no result of; the number flown.

    Parameters
    ----------
    store : Store
    runs : iterable of Run
    title : str
        For the progress bar.
    workers : int, optional
        Processes; one per core if not given. With 1 everything is flown in this process.

    Raises
    ------
    KeyboardInterrupt
        On Ctrl-C; runs that were done are kept, the next call goes on with the rest.
    """
    missing = list({run.id: run for run in store.missing(runs)}.values())
    workers = min(workers or os.cpu_count() or 1, len(missing))
    with Bar(title, len(missing), "flights") as bar:
        if workers <= 1:
            for done, run in enumerate(missing, start=1):
                store.get(run)
                bar.update(done)
            return len(missing)
        # Spawned, not forked: the compiled loops and threads of this process must not be copied half-way.
        with ProcessPoolExecutor(
            workers, mp_context=get_context("spawn"), initializer=_start, initargs=store.recipe
        ) as pool:
            futures: list[Future[None]] = [pool.submit(_fly, run) for run in _grouped(missing)]
            try:
                for done, future in enumerate(as_completed(futures), start=1):
                    future.result()
                    bar.update(done)
            except BrokenProcessPool:
                raise InputError("a worker process was killed; start again, what is done is kept") from None
            except BaseException:
                for future in futures:
                    future.cancel()
                raise
    return len(missing)


def _grouped(runs: list[Run]) -> list[Run]:
    """Longest first, so that no core waits for a last long flight."""
    return sorted(runs, key=lambda run: (run.scenario != "paper-square", run.id))


def _start(folder: str, measure: Measure | None, label: str) -> None:
    global _store
    # Ctrl-C reaches the whole process group; the parent decides what it means.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    _store = Store.from_recipe(folder, measure, label)


def _fly(run: Run) -> None:
    assert _store is not None
    _store.get(run)
