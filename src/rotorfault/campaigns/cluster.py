"""Flying blocks on a Dask cluster: each block is one task, flown anew where a worker dies."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any, final

import pyarrow as pa
from distributed import Client, as_completed

from rotorfault.base.errors import InputError
from rotorfault.base.versions import source_digest
from rotorfault.campaigns.block import fly_block
from rotorfault.campaigns.sampling.plan import Flights
from rotorfault.campaigns.study import Study, study_from

PATIENCE = 10.0  # s to reach the scheduler


@final
class Cluster:
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

    def __init__(self, address: str) -> None:
        if not re.fullmatch(r"\w+://[^\s/]+:\d+", address):
            raise InputError(f"--scheduler {address}: allowed: an address such as tcp://localhost:8786")
        try:
            self._client: Any = Client(address, timeout=PATIENCE, set_as_default=False)  # type: ignore[no-untyped-call]
        except (OSError, ValueError, TimeoutError) as error:
            told = " ".join(str(error).split()) or type(error).__name__
            raise InputError(
                f"--scheduler {address}: cannot be reached ({told[:120]}); start one with 'dask scheduler', workers "
                "with 'dask worker', and give its address"
            ) from None

    def fly(self, study: Study, work: list[tuple[int, Flights]]) -> Iterator[tuple[int, pa.Table]]:
        """Fly blocks on all workers."""
        same = study.as_tables(), source_digest()
        futures = {self._client.submit(_fly, *same, *part, pure=False): number for number, part in work}
        try:
            for future, table in as_completed(list(futures), loop=self._client.loop, with_results=True):  # type: ignore[no-untyped-call]
                yield futures[future], table
        finally:
            self._client.cancel(list(futures))


def _fly(tables: dict[str, Any], program: str, *part: Any) -> pa.Table:
    """One block, on one thread: a worker has as many as it was given."""
    if source_digest() != program:
        raise InputError("a worker has another version of rotorfault; install the same everywhere")
    return fly_block(study_from(tables, "study"), Flights(*part), threads=1)
