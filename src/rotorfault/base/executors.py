"""Where the tasks of a resumable computation are done: this process, several processes, or a Dask cluster."""

from __future__ import annotations

import importlib.util
import os
import signal
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import get_context, resource_tracker
from typing import Any, final

from rotorfault.base import interrupts
from rotorfault.base.bounds import thread_count
from rotorfault.base.errors import InputError, missing_extra
from rotorfault.base.resumable import Executor, InputT, KeyT, ResultT, Task


@final
class InProcess:
    """This process, one task after the other.

    Parameters
    ----------
    threads : int, optional
        That each task may use; one per processor if not given.
    """

    def __init__(self, threads: int | None = None) -> None:
        self.threads = threads

    def map(
        self, work: Callable[[InputT], ResultT], tasks: Sequence[Task[KeyT, InputT]]
    ) -> Generator[tuple[KeyT, ResultT], None, None]:
        """Do all tasks in the given order."""
        for task in tasks:
            yield task.key, work(task.input)


@final
class Processes:
    """Processes on this machine, with a thread each.

    Parameters
    ----------
    workers : int, optional
        One per processor if not given. With one worker, or one task, everything is done in this process.
    """

    threads = 1

    def __init__(self, workers: int | None = None) -> None:
        self._workers = thread_count(workers, "workers") or os.cpu_count() or 1

    def map(
        self, work: Callable[[InputT], ResultT], tasks: Sequence[Task[KeyT, InputT]]
    ) -> Generator[tuple[KeyT, ResultT], None, None]:
        """Do all tasks; they start in the given order.

        Raises
        ------
        InputError
            If a process is killed.
        """
        workers = min(self._workers, len(tasks))
        if workers <= 1:
            yield from InProcess().map(work, tasks)
            return
        # Spawned, not forked: the compiled loops and threads of this process must not be copied half-way.
        with ProcessPoolExecutor(
            workers, mp_context=get_context("spawn"), initializer=_start, initargs=(work,)
        ) as pool:
            # That process of Python's own would let Ctrl-C through again if it were started within.
            resource_tracker.ensure_running()
            with interrupts.held_back():
                futures = {pool.submit(_call, task.input): task.key for task in tasks}
            try:
                for future in as_completed(futures):
                    yield futures[future], future.result()
            except BrokenProcessPool:
                raise InputError("a worker process was killed; start again, what is done is kept") from None
            finally:
                for future in futures:
                    future.cancel()


_work: Callable[[Any], Any] | None = None  # of a worker process, which does nothing else


def _start(work: Callable[[Any], Any]) -> None:
    global _work
    # Ctrl-C reaches the whole process group; the parent decides what it means.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    _work = work


def _call(task: Any) -> Any:
    assert _work is not None
    return _work(task)


def executor_of(threads: int | None, scheduler: str | None) -> Executor:
    """This process, or the workers of a Dask scheduler.

    Parameters
    ----------
    threads : int or None
        Of this process; one per processor if None.
    scheduler : str or None
        Address, such as ``tcp://localhost:8786``.

    Raises
    ------
    InputError
        If there are too many threads, Dask is not installed, or the scheduler cannot be reached.
    """
    count = thread_count(threads, "workers")
    if scheduler is None:
        return InProcess(count or os.cpu_count())
    if importlib.util.find_spec("distributed") is None:
        raise missing_extra("--scheduler needs Dask", "cluster")
    from rotorfault.base.dask_executor import Dask  # loads Dask, which takes longer than most campaigns

    return Dask(scheduler)
