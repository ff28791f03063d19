"""Compiled loops, kept in the process and on disk so that each is compiled once on a machine.

The key names everything that the compiled code depends on: the source of this package, the compiler's version, the
processor, and the structure of the loop (classes and settings of its parts). Of a part from outside the package
nobody knows what it depends on: a loop with one is traced anew each time, and its key is the program itself.

On disk a compiled loop lies in the user's cache folder (``ROTORFAULT_CACHE`` names another one; empty turns it
off). What lies there is run, so only files count that nobody else can have written (`rotorfault.base.private`): the
folder, those above it and each file are looked at whenever one is opened, and where others could have written,
nothing is read or kept, which is said once. A file begins with the SHA-256 of its name and the rest: damaged code
would be loaded without complaint. One that is damaged or cannot be read is compiled anew and replaced.
"""

from __future__ import annotations

import hashlib
import json
import os
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

from rotorfault.base.private import NotPrivateError, cache_folder, private_folder, read_private, write_private
from rotorfault.base.versions import source_digest
from rotorfault.engine.program import Layout
from rotorfault.engine.structure import foreign, structure
from rotorfault.loop.closed_loop import ClosedLoop

KEEP = 200  # compiled loops on disk
_SUM_LENGTH = hashlib.sha256().digest_size


class Compiled(NamedTuple):
    """Object code of a loop, and what its caller must know."""

    code: bytes
    layout: Layout
    operations: dict[str, int]  # of one step, by sort


_KEPT: dict[str, Compiled] = {}


def key(loop: ClosedLoop, compiler: str, form: str) -> str | None:
    """Name of a compiled form of a loop; None where only its program can name it.

    Parameters
    ----------
    loop : ClosedLoop
    compiler : str
        Version of the compiler, and the processor that it compiles for.
    form : str
        Which of the programs of the loop.
    """
    if foreign(loop):
        return None
    return digest_of(source_digest(), compiler, form, *structure(loop))


def key_of_program(text: str, compiler: str) -> str:
    """Name of what a program is compiled to."""
    return digest_of("program", compiler, text)


def digest_of(*words: str) -> str:
    """A name that these words alone have."""
    return hashlib.sha256("\n".join(words).encode()).hexdigest()


def get(name: str, make: Callable[[], Compiled]) -> Compiled:
    """The compiled loop of this name, made if there is none."""
    if name not in _KEPT:
        path = _path(name)
        found = _load(path)
        if found is None:
            found = make()
            _store(path, found)
        _KEPT[name] = found
    return _KEPT[name]


def kept(name: str) -> bool:
    """Whether a compiled loop of this name is in the process or on disk."""
    if name in _KEPT:
        return True
    path = _path(name)
    return path is not None and path.exists()


class CacheWarning(UserWarning):
    """Compiled loops are not kept, because somebody else could have written where they lie."""


_DOUBTS: set[str] = set()  # that have been told


def folder() -> Path | None:
    """Where compiled loops lie; None where the user wants none, or where somebody else could have put some.

    Warns (`CacheWarning`) of the latter, once.
    """
    try:
        place = cache_folder()
        return None if place is None else private_folder(place)
    except OSError:
        return None  # a cache that cannot be made costs a second next time, nothing else
    except NotPrivateError as doubt:
        _tell(str(doubt))
        return None


def _tell(doubt: str) -> None:
    if doubt not in _DOUBTS:
        _DOUBTS.add(doubt)
        text = f"compiled loops are neither read nor kept: {doubt} with ROTORFAULT_CACHE (empty for none)"
        warnings.warn(text, CacheWarning, stacklevel=2)


def _path(name: str) -> Path | None:
    place = folder()
    return None if place is None else place / f"{name}.loop"


def _prune(place: Path) -> None:
    """Keep the newest compiled loops only: every change of the package leaves old ones behind."""
    old = sorted(place.glob("*.loop"), key=lambda file: file.lstat().st_mtime)[: -KEEP + 1]
    for file in old:
        file.unlink(missing_ok=True)


def _sum(name: str, made: bytes) -> bytes:
    # With the name, so that no file counts under that of another loop.
    return hashlib.sha256(name.encode() + b"\n" + made).digest()


def _load(path: Path | None) -> Compiled | None:
    if path is None:
        return None
    try:
        content = read_private(path)
        sum_, made = content[:_SUM_LENGTH], content[_SUM_LENGTH:]
        if _sum(path.stem, made) != sum_:
            return None
        os.utime(path)  # what is used stays: the oldest are removed
        head, _, code = made.partition(b"\n")
        about: dict[str, Any] = json.loads(head)
        return Compiled(code, Layout(**about["layout"]), about["operations"])
    except Exception:
        # Missing, of another version, or another user's: whatever it is, the loop can be compiled anew.
        return None


def _store(path: Path | None, made: Compiled) -> None:
    if path is None:
        return
    head = json.dumps({"layout": made.layout._asdict(), "operations": made.operations}).encode()
    content = head + b"\n" + made.code
    try:
        _prune(path.parent)
        write_private(path, _sum(path.stem, content) + content)
    except OSError:
        return  # a cache that cannot be written costs a second next time, nothing else
