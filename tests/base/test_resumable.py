"""The runner of resumable computations: what is done, in which order, and what an interruption leaves."""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from typing import Any

import pytest

from rotorfault.base.errors import InputError
from rotorfault.base.executors import InProcess, Processes
from rotorfault.base.resumable import Task, run_missing


class Memory:
    """A store in memory."""

    def __init__(self, **results: int) -> None:
        self.results = results

    def done(self) -> set[str]:
        return set(self.results)

    def keep(self, key: str, result: int) -> None:
        self.results[key] = result


def square(number: int) -> int:
    if number < 0:
        raise InputError(f"got {number}")
    return number * number


def test_only_what_is_missing_is_done_and_the_longest_first() -> None:
    order: list[int] = []

    def work(number: int) -> int:
        order.append(number)
        return square(number)

    store = Memory(two=-1)
    tasks = [Task("one", 1, 10, 1.0), Task("two", 2), Task("three", 3, 5, 7.0), Task("one", 1, 10, 1.0)]
    assert run_missing(tasks, work, store, InProcess(), "title", "units") == 15
    assert order == [3, 1]
    assert store.results == {"one": 1, "two": -1, "three": 9}
    assert run_missing(tasks, work, store, InProcess(), "title", "units") == 0


@pytest.mark.parametrize("workers", [1, 2])
def test_processes_give_the_same_and_pass_errors_on(workers: int) -> None:
    store = Memory()
    assert run_missing([Task(str(n), n) for n in range(5)], square, store, Processes(workers), "", "") == 5
    assert store.results == {str(n): n * n for n in range(5)}
    with pytest.raises(InputError, match="got -1"):
        run_missing([Task("good", 3), Task("bad", -1)], square, store, Processes(workers), "", "")


def test_an_interruption_keeps_what_is_done_and_closes_the_executor() -> None:
    closed: list[bool] = []

    class Watched:
        threads = None

        def map(self, work: Callable[[Any], Any], tasks: Sequence[Task[Any, Any]]) -> Generator[Any, None, None]:
            try:
                yield from InProcess().map(work, tasks)
            finally:
                closed.append(True)

    class Full(Memory):
        def keep(self, key: str, result: int) -> None:
            if self.results:
                raise KeyboardInterrupt
            super().keep(key, result)

    store = Full()
    with pytest.raises(KeyboardInterrupt):
        run_missing([Task("one", 1), Task("two", 2)], square, store, Watched(), "", "")
    assert store.results == {"one": 1}
    assert closed == [True]
