"""Processes of one's own that a test may kill: started from one that has loaded what they need."""

from __future__ import annotations

import functools
import multiprocessing
import os
from collections.abc import Callable
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from typing import Any

import pytest
from places import HELPERS, SOURCE

# The last two because pyarrow loads pandas for its first table, and every process the main module, pytest.
LOADED = ["rotorfault.campaigns.run", "campaign_folder", "campaign_studies", "pandas", "pytest"]


@functools.cache
def _context() -> Any:
    """Children are forked from a process without threads that has loaded a campaign, where the system can do that."""
    methods = multiprocessing.get_all_start_methods()
    context: Any = multiprocessing.get_context("forkserver" if "forkserver" in methods else "spawn")
    if "forkserver" in methods:
        from multiprocessing.forkserver import ensure_running

        context.set_forkserver_preload(LOADED)
        with pytest.MonkeyPatch.context() as patch:
            patch.setenv("PYTHONPATH", os.pathsep.join(map(str, (SOURCE.parent, HELPERS))))
            ensure_running()
    return context


def start(target: Callable[..., None], *arguments: Any) -> tuple[BaseProcess, Connection]:
    """A process that does something, and what it says: `target` is given the end to say it into first."""
    ours, theirs = _context().Pipe(duplex=False)
    process = _context().Process(target=target, args=(theirs, *arguments), daemon=True)
    process.start()
    theirs.close()  # so that there is an end when the process is gone
    return process, ours


def rest(said: Connection) -> list[str]:
    """What a process has said and nobody has heard yet, up to its end."""
    words: list[str] = []
    try:
        while True:
            words.append(said.recv())
    except EOFError:
        return words
