"""One writer per campaign.

The operating system holds the lock for as long as the process lives, so that none is left over when it is killed. The
file itself stays; only what it says is for people.
"""

from __future__ import annotations

import errno
import os
import platform
import re
import stat
import sys
import weakref
from pathlib import Path
from typing import final

from rotorfault.base.errors import InputError

if sys.platform == "win32":
    import msvcrt
else:
    import fcntl

_BEYOND = 1 << 30  # Windows forbids others to read the byte that is locked: so, one after all text
_HELD = (errno.EAGAIN, errno.EACCES, errno.EDEADLK)


@final
class Lock:
    """Holds a file until it is released or the process ends.

    Parameters
    ----------
    path : Path
        Made if it is not there.

    Raises
    ------
    InputError
        If another one holds it, or if it cannot be locked here.
    """

    def __init__(self, path: Path) -> None:
        self._handle: int | None = None
        handle = _opened(path)
        try:
            _take(handle)
        except OSError as error:
            holder = _text(handle)
            os.close(handle)
            if error.errno in _HELD:
                raise InputError(
                    f"{path.parent}: {holder or 'another process'} is writing this campaign; wait for it or end it"
                ) from None
            raise InputError(
                f"{path}: cannot be locked ({error.strerror}); give an --out on a disk of this computer"
            ) from None
        if not re.fullmatch(r"(process \d+ on .*)?", _text(handle)):
            os.close(handle)
            raise InputError(f"{path}: holds something else than a lock; move it away or give another --out")
        os.ftruncate(handle, 0)
        os.lseek(handle, 0, os.SEEK_SET)
        os.write(handle, f"process {os.getpid()} on {platform.node()}".encode())
        self._handle = handle
        _OPEN.add(self)

    @property
    def held(self) -> bool:
        """Whether this process still holds it."""
        return self._handle is not None

    def release(self) -> None:
        """Let others have it; nothing if it is not held."""
        if self._handle is not None:
            os.ftruncate(self._handle, 0)
            self.forget()

    def forget(self) -> None:
        """Close the file in this process and leave the lock to the one that shares it."""
        if self._handle is not None:
            handle, self._handle = self._handle, None
            os.close(handle)
            _OPEN.discard(self)

    def __del__(self) -> None:
        self.forget()


_OPEN: weakref.WeakSet[Lock] = weakref.WeakSet()


def _forget_all() -> None:
    for lock in list(_OPEN):
        lock.forget()


# A forked worker shares its parent's lock, and would hold it after the parent was killed.
if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_forget_all)


def _opened(path: Path) -> int:
    """The file of a lock, made if it is not there; only a plain file that has no other name, for it is emptied."""
    plain = "remove it or give another --out"
    try:
        flags = getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)
        handle = os.open(path, os.O_RDWR | os.O_CREAT | flags, 0o666)
    except OSError as error:
        if path.is_symlink():
            raise InputError(f"{path}: is a link, and what it leads to would be emptied; {plain}") from None
        raise InputError(
            f"{path}: cannot be written ({error.strerror}); fix its permissions or give another --out"
        ) from None
    about = os.fstat(handle)
    if not stat.S_ISREG(about.st_mode) or about.st_nlink != 1:
        os.close(handle)
        what = "has another name elsewhere" if stat.S_ISREG(about.st_mode) else "is no plain file"
        raise InputError(f"{path}: {what}; {plain}")
    return handle


def _take(handle: int) -> None:
    if sys.platform == "win32":
        os.lseek(handle, _BEYOND, os.SEEK_SET)
        msvcrt.locking(handle, msvcrt.LK_NBLCK, 1)
        os.lseek(handle, 0, os.SEEK_SET)
    else:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)


def _text(handle: int) -> str:
    os.lseek(handle, 0, os.SEEK_SET)
    return os.read(handle, 200).decode(errors="replace").strip()
