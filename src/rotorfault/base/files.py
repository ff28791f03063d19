"""Writing files so that nobody ever sees half of one."""

from __future__ import annotations

import contextlib
import errno
import os
import re
import secrets
import stat
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from rotorfault.base.errors import InputError

if os.name != "nt":
    import fcntl


def write_atomically(path: Path, write: Callable[[Path], object]) -> None:
    """Write a file under a temporary name beside its place, then move it there in one step.

    Parameters
    ----------
    path : Path
        Its folder must exist.
    write : callable
        Writes the file at the path that it is given.

    Raises
    ------
    InputError
        If what stands there is no file: a folder, a device, a pipe.
    OSError
        If the folder cannot be written; nothing is left behind, and the error names the path that was given.
    """
    if path.exists() and not path.is_file():
        raise InputError(f"{path}: is {'a folder' if path.is_dir() else 'no regular file'}; give another file")
    # In a folder that only the user may enter, under a name that nobody can guess: whoever may write into the folder
    # of results cannot lay a link where the file will be written.
    try:
        private = Path(tempfile.mkdtemp(dir=path.parent, prefix=f".{path.name[:40]}."))
    except OSError as error:
        raise type(error)(error.errno, error.strerror, str(path)) from None
    temporary = private / f"{secrets.token_hex(8)}{path.suffix}"
    try:
        write(temporary)
        _share(temporary)
        temporary.replace(path)
    except OSError as error:
        if error.errno is None or error.filename not in (None, str(temporary)):
            raise
        raise type(error)(error.errno, error.strerror, str(path)) from error
    finally:
        with contextlib.suppress(OSError):
            temporary.unlink(missing_ok=True)
        with contextlib.suppress(OSError):
            private.rmdir()


def _share(path: Path) -> None:
    """What any other file would have: results are meant to be shared."""
    mask = os.umask(0)
    os.umask(mask)
    path.chmod(0o666 & ~mask)


def write_durably(path: Path, content: bytes) -> None:
    """Write a file that is there whole or not at all, even when the process is killed or the power fails.

    Raises
    ------
    OSError
        If it cannot be written; what was there before is still there, and nothing else.
    """
    # No pattern for finished files, such as *.parquet, may find it; nor does it follow a link that lies there.
    temporary = path.with_name(f".{path.name}.{secrets.token_hex(4)}.tmp")
    try:
        with temporary.open("xb") as file:
            file.write(content)
            file.flush()
            # Else the name could reach the disk before the content does.
            os.fsync(file.fileno())
        temporary.replace(path)
    except BaseException:
        with contextlib.suppress(OSError):
            temporary.unlink()
        raise
    _sync_folder(path.parent)


def is_leftover(name: str) -> bool:
    """Whether a file is one that `write_durably` was killed over."""
    return re.fullmatch(r"\..+\.[0-9a-f]{8}\.tmp", name) is not None


def _sync_folder(folder: Path) -> None:
    if os.name == "nt":  # folders cannot be opened there
        return
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def in_folder(path: Path) -> Path:
    """The same path of a file to be written, if the folder that it lies in exists.

    Raises
    ------
    InputError
        If it does not, or the path is a folder itself.
    """
    if not path.parent.is_dir():
        raise InputError(f"{path}: there is no folder {path.parent}; make it first")
    if path.is_dir():
        raise InputError(f"{path}: is a folder; give another file")
    return path


def output_folder(path: Path) -> Path:
    """Make a folder for results and see that it can be written, before anything is computed.

    Raises
    ------
    InputError
        If it cannot be made or written.
    """
    try:
        path.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(dir=path, prefix=".rotorfault-")
        os.close(handle)
        Path(name).unlink()
    except (FileExistsError, NotADirectoryError):
        raise InputError(f"{path}: is a file or lies below one; give a folder with --out") from None
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror}); give another folder with --out") from None
    return path


@contextmanager
def made_folder(path: Path) -> Iterator[Path]:
    """Make a folder for results that are still to be computed; what comes to nothing leaves none behind.

    Raises
    ------
    InputError
        If it cannot be made or written.
    """
    new = [place for place in (path, *path.parents) if not place.exists()]
    try:
        yield output_folder(path)
    except BaseException:
        for place in new:
            with contextlib.suppress(OSError):  # it holds something
                place.rmdir()
        raise


def instead_of_folder(folder: Path, ending: str) -> str:
    """What is said of a folder that was given for a file: which file in it may be meant.

    Parameters
    ----------
    folder : Path
    ending : str
        Of the file that is wanted.
    """
    names = sorted(path.name for path in folder.glob(f"*{ending}"))
    return f"is a folder; {f'give {folder / names[0]}' if names else f'give a {ending} file; there is none in it'}"


def read_plain(path: Path) -> bytes:
    """The content of a plain file; a pipe would be waited for, and a device may never end.

    Raises
    ------
    OSError
        If it cannot be read, or is no plain file.
    """
    handle = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0))
    if not stat.S_ISREG(os.fstat(handle).st_mode):
        os.close(handle)
        raise OSError(errno.EINVAL, "is a folder" if path.is_dir() else "is no plain file", str(path))
    with os.fdopen(handle, "rb") as file:
        return file.read()


@contextmanager
def alone_in(folder: Path) -> Iterator[None]:
    """Wait until nobody else writes a set of files into a folder, then keep others waiting.

    Files that belong together must be of one flight. Where the system has no such locks nobody waits.
    """
    if os.name == "nt":
        yield
        return
    handle = os.open(folder, os.O_RDONLY)
    try:
        with contextlib.suppress(OSError):  # such as on a network's disk
            fcntl.flock(handle, fcntl.LOCK_EX)
        yield
    finally:
        os.close(handle)
