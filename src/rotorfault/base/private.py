"""Folders and files that nobody but the user can have written: for what is run once it is read.

Whoever may write into a folder, or into one above it, may put another folder in its place; whoever owns a file may
change it. So each folder on the way must belong to the user or to the administrator, and be writable by them alone,
or, as ``/tmp`` is, be one in which everybody may only move what is his own. Where a system has no such owners and
modes, only what lies below the user's home counts.
"""

from __future__ import annotations

import os
import stat
import tempfile
from pathlib import Path

_OTHERS = stat.S_IWGRP | stat.S_IWOTH
_LINKS = 40  # that may follow each other, as in Linux
MEND = "take write permission from others (chmod go-w), or name another folder"


class NotPrivateError(Exception):
    """Somebody else could have written here; the message says why."""


def cache_folder() -> Path | None:
    """Where the user wants what can be made anew, from ``ROTORFAULT_CACHE``; None where he wants it nowhere.

    Nobody has looked yet whether it is private, or there at all.

    Raises
    ------
    NotPrivateError
        If there is neither such a variable nor a home.
    """
    named = os.environ.get("ROTORFAULT_CACHE")
    if named is not None:
        return Path(named) if named else None
    base = Path(os.environ.get("XDG_CACHE_HOME") or "")
    if base.is_absolute():  # a relative one is to be ignored, as the specification of these folders says
        return base / "rotorfault"
    try:
        return Path.home() / ".cache" / "rotorfault"
    except RuntimeError:
        raise NotPrivateError("this user has no home folder; name a folder") from None


def private_folder(path: Path) -> Path:
    """A folder that is the user's alone, made with those above it where it is not there.

    Parameters
    ----------
    path : Path
        Absolute: what a relative path means changes with the folder that a program is started in.

    Returns
    -------
    Path
        The same folder without links.

    Raises
    ------
    NotPrivateError
        If somebody else could have written into it.
    OSError
        If it is not there and cannot be made.
    """
    if not path.is_absolute():
        raise NotPrivateError(f"{path} is a relative path; name the whole path")
    if not hasattr(os, "geteuid"):
        return _below_home(path)
    place = _walked(path)  # before anything is made in a place that is not to be trusted
    missing = [folder for folder in (place, *place.parents) if not folder.exists()]
    for folder in reversed(missing):
        folder.mkdir(mode=0o700, exist_ok=True)
    place = _walked(place)
    about = os.lstat(place)
    if not stat.S_ISDIR(about.st_mode):
        raise NotADirectoryError(f"{place} is no folder")
    if about.st_uid != os.geteuid() or about.st_mode & _OTHERS:
        raise NotPrivateError(f"{place} {_reason(about)}; {MEND}")
    return place


def _below_home(path: Path) -> Path:
    place = path.resolve()
    if not place.is_relative_to(Path.home().resolve()):
        raise NotPrivateError(f"{place} is not below your home {Path.home()}; name a folder there")
    place.mkdir(parents=True, exist_ok=True)
    return place


def _walked(path: Path) -> Path:
    """A path with its links resolved, if each folder on the way is to be trusted; the last may not be there yet."""
    place, todo, links = Path(path.anchor), list(path.parts[1:]), 0
    _require_trusted(place, os.lstat(place))
    while todo:
        name = todo.pop(0)
        if name == "..":
            place = place.parent
            continue
        step = place / name
        try:
            about = os.lstat(step)
        except FileNotFoundError:
            return step.joinpath(*todo)
        if stat.S_ISLNK(about.st_mode):
            links += 1
            if links > _LINKS:
                raise NotPrivateError(f"{path} is a link that leads to itself; name another folder")
            if about.st_uid not in (0, os.geteuid()):
                raise NotPrivateError(f"the link {step} belongs to user {about.st_uid}; name another folder")
            target = Path(os.readlink(step))
            place = Path(target.anchor) if target.is_absolute() else place
            todo = [*(target.parts[1:] if target.is_absolute() else target.parts), *todo]
            continue
        _require_trusted(step, about)
        place = step
    return place


def _require_trusted(place: Path, about: os.stat_result) -> None:
    free = bool(about.st_mode & _OTHERS) and not about.st_mode & stat.S_ISVTX
    if about.st_uid not in (0, os.geteuid()) or free:
        raise NotPrivateError(f"{place} {_reason(about)}; {MEND}")


def _reason(about: os.stat_result) -> str:
    if about.st_mode & _OTHERS:
        return "can be written by other users"
    return f"belongs to user {about.st_uid}, and this is user {os.geteuid()}"


def read_private(path: Path) -> bytes:
    """The content of a file that nobody else can have written.

    Parameters
    ----------
    path : Path
        In a folder that `private_folder` has returned.

    Raises
    ------
    NotPrivateError
        If it is a link, no plain file, another user's, has another name somewhere, or others may write it.
    OSError
        If it cannot be read.
    """
    # Never opened by name twice: what is checked is what is read.
    handle = os.open(path, os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0) | _binary())
    with os.fdopen(handle, "rb") as file:
        about = os.fstat(handle)
        if not stat.S_ISREG(about.st_mode):
            raise NotPrivateError(f"{path} is no plain file; remove it")
        if hasattr(os, "geteuid"):
            if about.st_uid != os.geteuid() or about.st_mode & _OTHERS:
                raise NotPrivateError(f"{path} {_reason(about)}; remove it")
            if about.st_nlink > 1:
                raise NotPrivateError(f"{path} has another name elsewhere; remove it")
        return file.read()


def write_private(path: Path, content: bytes) -> None:
    """Write a file that only the user may read and write, whole or not at all.

    Parameters
    ----------
    path : Path
        In a folder that `private_folder` has returned.
    content : bytes

    Raises
    ------
    OSError
        If it cannot be written; nothing is left behind.
    """
    handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")  # 0600, and follows no link
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(content)
        os.replace(name, path)
    except BaseException:
        Path(name).unlink(missing_ok=True)
        raise


def _binary() -> int:
    return getattr(os, "O_BINARY", 0)
