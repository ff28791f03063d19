"""Long computations that may be interrupted: only what is missing is computed, and each result is kept at once.

What a task is, where results are kept and where the work is done is the caller's; see `Store` and `Executor`, and for
executors that are there `rotorfault.base.executors`.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Generator, Hashable, Iterable, Sequence
from contextlib import closing
from typing import Generic, NamedTuple, Protocol, TypeVar

from rotorfault.base.progress import Bar

KeyT = TypeVar("KeyT", bound=Hashable)
InputT = TypeVar("InputT")
ResultT = TypeVar("ResultT")
ResultT_contra = TypeVar("ResultT_contra", contravariant=True)


class Task(NamedTuple, Generic[KeyT, InputT]):
    """A piece of work.

    Attributes
    ----------
    key
        Names its result in the store.
    input
        What the work is done on.
    size : int
        In the unit of the progress bar.
    duration : float
        Expected, in any unit that all tasks share. The longest start first: no core must wait for a last long one.
    """

    key: KeyT
    input: InputT
    size: int = 1
    duration: float = 0.0


class Store(Protocol[KeyT, ResultT_contra]):
    """Where results are kept."""

    def done(self) -> Collection[KeyT]:
        """Keys of the tasks whose results are there."""

    def keep(self, key: KeyT, result: ResultT_contra) -> None:
        """Keep a result: when this returns, no interruption can lose it."""


class Executor(Protocol):
    """Where work is done."""

    @property
    def threads(self) -> int | None:
        """Threads that a single task may use; None for one per processor."""

    def map(
        self, work: Callable[[InputT], ResultT], tasks: Sequence[Task[KeyT, InputT]]
    ) -> Generator[tuple[KeyT, ResultT], None, None]:
        """Do all tasks; give each result with its key as soon as it is there, in whatever order."""


def run_missing(
    tasks: Iterable[Task[KeyT, InputT]],
    work: Callable[[InputT], ResultT],
    store: Store[KeyT, ResultT],
    executor: Executor,
    title: str,
    unit: str,
    note: Callable[[], str] = lambda: "",
) -> int:
    """Do the tasks that the store has no result of.

    Parameters
    ----------
    tasks : iterable of Task
        Of several with the same key one is done.
    work : callable
        Turns the input of a task into its result. Must allow pickling where the executor is not this process.
    store : Store
    executor : Executor
    title, unit : str
        Of the progress bar.
    note : callable, optional
        What the bar says beside its numbers, asked after each result has been kept.

    Returns
    -------
    int
        Size of all tasks that were done.

    Raises
    ------
    KeyboardInterrupt
        On Ctrl-C. What was done is kept; the same call does the rest.
    """
    done = store.done()
    missing = {task.key: task for task in tasks if task.key not in done}
    queue = sorted(missing.values(), key=lambda task: -task.duration)
    total, finished = sum(task.size for task in queue), 0
    with Bar(title, total, unit) as bar, closing(executor.map(work, queue)) as results:
        for key, result in results:
            store.keep(key, result)
            finished += missing[key].size
            bar.update(finished, note())
    return finished
