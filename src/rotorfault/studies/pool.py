"""Fly the missing runs of a study on all cores, with progress, and keep what is done when interrupted."""

from __future__ import annotations

from collections.abc import Iterable

from rotorfault.base.executors import Processes
from rotorfault.base.resumable import Task, run_missing
from rotorfault.scenario.scenario import Scenario
from rotorfault.studies.runs import Result, Run, RunStore


def fly_missing(store: RunStore, runs: Iterable[Run], title: str, workers: int | None = None) -> int:
    """Fly every run that the store has no result of; the number flown.

    Parameters
    ----------
    store : RunStore
    runs : iterable of Run
    title : str
        Of the progress bar.
    workers : int, optional
        Processes; one per core if not given. With 1 everything is flown in this process.

    Raises
    ------
    KeyboardInterrupt
        On Ctrl-C; runs that were done are kept, the next call goes on with the rest.
    """
    loaded = {run.id: (run, run.load()) for run in runs}
    # The time that a flight takes is about proportional to its integration steps.
    tasks = [
        Task(run.id, run, duration=float(scenario.steps * scenario.substeps)) for run, scenario in loaded.values()
    ]
    return run_missing(tasks, store.get, _Runs(store, loaded), Processes(workers), title, "flights")


class _Runs:
    """Some runs of a store, by their ids."""

    def __init__(self, store: RunStore, loaded: dict[str, tuple[Run, Scenario]]) -> None:
        self._store, self._loaded = store, loaded

    def done(self) -> set[str]:
        """Ids of the runs whose results are there."""
        return {key for key, (run, scenario) in self._loaded.items() if self._store.find(run, scenario) is not None}

    def keep(self, key: str, result: Result) -> None:
        """Nothing: `RunStore.get` has kept it where it was flown, for a flight is too large to be sent."""
