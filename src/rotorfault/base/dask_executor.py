"""Tasks on a Dask cluster; one whose worker dies is done anew on another."""

from __future__ import annotations

import pickle
import re
from collections.abc import Callable, Generator, Sequence
from typing import Any, final

from distributed import Client, as_completed

from rotorfault.base.errors import InputError
from rotorfault.base.resumable import InputT, KeyT, ResultT, Task
from rotorfault.base.versions import source_digest

PATIENCE = 10.0  # s to reach the scheduler


@final
class Dask:
    """The workers of a running scheduler.

    Parameters
    ----------
    address : str
        Such as ``tcp://localhost:8786``.

    Raises
    ------
    InputError
        If it cannot be reached.
    """

    threads = 1  # a worker does as many tasks at once as it was given threads

    def __init__(self, address: str) -> None:
        if not re.fullmatch(r"\w+://[^\s/]+:\d+", address):
            raise InputError(f"--scheduler {address}: allowed: an address such as tcp://localhost:8786")
        try:
            self._client: Any = Client(address, timeout=PATIENCE, set_as_default=False)  # type: ignore[no-untyped-call]
        except (OSError, ValueError, TimeoutError) as error:
            reason = " ".join(str(error).split()) or type(error).__name__
            raise InputError(
                f"--scheduler {address}: cannot be reached ({reason[:120]}); start one with 'dask scheduler', "
                "workers with 'dask worker', and give its address"
            ) from None

    def map(
        self, work: Callable[[InputT], ResultT], tasks: Sequence[Task[KeyT, InputT]]
    ) -> Generator[tuple[KeyT, ResultT], None, None]:
        """Do all tasks on all workers.

        Raises
        ------
        InputError
            If a worker has another version of rotorfault.
        """
        program = source_digest()
        futures = {
            self._client.submit(_call, program, pickle.dumps((work, task.input)), pure=False): task.key
            for task in tasks
        }
        try:
            for future, result in as_completed(list(futures), loop=self._client.loop, with_results=True):  # type: ignore[no-untyped-call]
                yield futures[future], result
        finally:
            self._client.cancel(list(futures))


def _call(program: str, content: bytes) -> Any:
    # Unpickled here and not by Dask: another version might fail at it without saying why.
    if source_digest() != program:
        raise InputError("a worker has another version of rotorfault; install the same everywhere")
    work, task = pickle.loads(content)
    return work(task)
