"""Rows of raw bytes from a long file in bounded memory: a topic that grows too long is thinned, and says so.

A gzipped file is unpacked while it is read, whatever its name. What unpacks to far more than a log could is refused:
a few megabytes would else keep a reader busy for hours.
"""

from __future__ import annotations

import gzip
import io
import os
import stat
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rotorfault.base.errors import InputError
from rotorfault.base.progress import Bar

CHUNK = 1 << 20  # bytes that are read at once
ROOM = 12 << 20  # bytes of one topic, beyond which every second row is dropped
GZIP = b"\x1f\x8b"
MOST_PACKED, ALWAYS = 100, 64 << 20  # by how much a log may unpack, and bytes that any may unpack to
CUT = "the gzipped file is damaged or cut off"
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


class Unpacked(io.RawIOBase):
    """A gzipped file as what it holds, as far as it goes.

    Parameters
    ----------
    file : binary file
    path : Path
        For messages.

    Attributes
    ----------
    cut : bool
        Whether it ended before its end, or was damaged there.
    """

    def __init__(self, file: BinaryIO, path: Path) -> None:
        super().__init__()
        self._file, self._path, self._given, self.cut = file, path, 0, False
        self._most = max(ALWAYS, MOST_PACKED * os.fstat(file.fileno()).st_size)
        self._inside = gzip.GzipFile(fileobj=file)

    def readable(self) -> bool:
        """It is."""
        return True

    def readinto(self, room: Any) -> int:
        """Fill some bytes; 0 at the end.

        Raises
        ------
        InputError
            If it unpacks to more than a log of its size could.
        """
        try:
            piece = b"" if self.cut else self._inside.read1(len(room))
        except (OSError, EOFError, zlib.error):
            self.cut, piece = True, b""
        self._given += len(piece)
        if self._given > self._most:
            raise InputError(
                f"{self._path}: unpacks to more than {self._most >> 20:,} MB, {MOST_PACKED} times its size or more, "
                "as no flight log does; if it is one, unpack it yourself and give that"
            )
        room[: len(piece)] = piece
        return len(piece)

    def at(self) -> int:
        """Bytes of the gzipped file that were read so far."""
        return self._file.tell()

    def close(self) -> None:
        """Close the file too."""
        self._file.close()
        super().close()


class Content(NamedTuple):
    """A log that was opened."""

    file: BinaryIO
    packed: Unpacked | None  # where it is gzipped

    def said(self) -> str:
        """What is wrong with the gzipped file, as far as it was read; empty if nothing is."""
        return CUT if self.packed is not None and self.packed.cut else ""


def inner_suffix(path: Path) -> str:
    """How a name ends in lower case, without the ``.gz`` behind it.

    Parameters
    ----------
    path : Path
    """
    suffix = path.suffix.lower()
    return Path(path.stem).suffix.lower() if suffix == ".gz" else suffix


@contextmanager
def content(path: Path) -> Iterator[Content]:
    """What a log holds, gzipped or not.

    Parameters
    ----------
    path : Path

    Raises
    ------
    InputError
        If it cannot be opened, is no plain file, or unpacks to more than a log could.
    """
    with opened(path) as file:
        head = file.read(len(GZIP))
        file.seek(0)
        if head != GZIP:
            yield Content(file, None)
            return
        packed = Unpacked(file, path)
        with io.BufferedReader(packed, CHUNK) as inside:
            yield Content(inside, packed)


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


def walk(path: Path, step: Step) -> tuple[int, str]:
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
    str
        What is wrong with the file that it is packed in; empty if nothing is.

    Raises
    ------
    InputError
        If it cannot be opened or read.
    """
    try:
        return _walk(path, step)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from None


def _walk(path: Path, step: Step) -> tuple[int, str]:
    size = path.stat().st_size
    with content(path) as log, Bar(f"reading {path.name}", size, "bytes") as bar:
        rest, done = b"", 0
        while True:
            fresh = log.file.read(CHUNK)
            done += len(fresh)
            chunk = rest + fresh
            used = step(chunk, 0, not fresh)
            rest = chunk[used:]
            bar.update(done if log.packed is None else log.packed.at())
            if not fresh:
                return len(rest), log.said()
