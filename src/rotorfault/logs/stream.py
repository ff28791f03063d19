"""Rows of raw bytes from a long file in bounded memory: a topic that grows too long is thinned, and says so."""

from __future__ import annotations

import os
import stat
from collections.abc import Callable
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from rotorfault.base.errors import InputError
from rotorfault.base.progress import Bar

CHUNK = 1 << 20  # bytes that are read at once
ROOM = 12 << 20  # bytes of one topic, beyond which every second row is dropped
Step = Callable[[bytes, int, bool], int]
"""Takes bytes, where to begin and whether they are the last; says how far they were used."""


class Rows:
    """Rows of one topic, of equal length.

    Parameters
    ----------
    dtype : numpy dtype
        Of a row; a payload that is shorter is filled with zeros, and what goes beyond is dropped.
    """

    def __init__(self, dtype: np.dtype[Any]) -> None:
        self.dtype, self.width, self.every = dtype, dtype.itemsize, 1
        self._bytes, self._seen = bytearray(), 0

    def __len__(self) -> int:
        return len(self._bytes) // self.width

    def add(self, payload: bytes) -> None:
        """One row."""
        self._seen += 1
        if self.every > 1 and (self._seen - 1) % self.every:
            return
        if len(payload) != self.width:
            payload = payload[: self.width].ljust(self.width, b"\0")
        self._bytes += payload
        if len(self._bytes) > ROOM:
            self._bytes = bytearray(self.table()[::2].tobytes())
            self.every *= 2

    def table(self) -> NDArray[np.void]:
        """All rows as a structured array."""
        return np.frombuffer(bytes(self._bytes), dtype=self.dtype)


def opened(path: Path) -> BinaryIO:
    """A plain file for reading; a pipe or a device would be waited for without end.

    Raises
    ------
    InputError
        If it cannot be opened, or is no plain file.
    """
    try:
        handle = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0))
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or "no such file"
        raise InputError(f"{path}: cannot be read ({reason}); give a flight log") from None
    if not stat.S_ISREG(os.fstat(handle).st_mode):
        os.close(handle)
        raise InputError(f"{path}: is no plain file; give a flight log")
    return os.fdopen(handle, "rb")


def walk(path: Path, step: Step) -> int:
    """Hand a file on in chunks; what was not used comes again, in front of the next chunk.

    Parameters
    ----------
    path : Path
    step : callable
        See `Step`.

    Returns
    -------
    int
        Bytes at the end that were not used.
    """
    size = path.stat().st_size
    with opened(path) as file, Bar(f"reading {path.name}", size, "bytes") as bar:
        rest, done = b"", 0
        while True:
            fresh = file.read(CHUNK)
            done += len(fresh)
            chunk = rest + fresh
            used = step(chunk, 0, not fresh)
            rest = chunk[used:]
            bar.update(done)
            if not fresh:
                return len(rest)
