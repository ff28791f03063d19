"""What may lie in a campaign's folder, and the ways in which it is changed."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

from rotorfault.base.errors import InputError
from rotorfault.base.files import is_leftover, read_plain, write_durably
from rotorfault.campaigns.store.identity import Identity, read_identity
from rotorfault.campaigns.store.parquet import DamagedError

STUDY, PARTS, DAMAGED, LOCK, FLIGHTS = "study.json", "parts", "damaged", "lock", "flights.parquet"
PAGE = "report.html"


def require_vacant(folder: Path, campaign: Identity) -> None:
    """Refuse a folder in which a campaign cannot start; what a kill at its very start leaves is no hindrance.

    Parameters
    ----------
    folder : Path
    campaign : Identity
        Of the one that is to start.

    Raises
    ------
    InputError
        If the folder is a file, or holds a campaign or anything else.
    """
    if not folder.exists():
        return
    if not folder.is_dir():
        raise InputError(f"{folder}: is a file; give another --out")
    try:
        names = sorted(path.name for path in folder.iterdir())
        if STUDY in names:
            difference = read_identity(folder / STUDY).unlike(campaign.study, campaign.program, campaign.own)
            same = "holds this campaign already; complete it with --resume, or give another --out"
            raise InputError(f"{folder}: {difference or same}")
        ours = [name for name in names if name in (LOCK, PARTS) or is_leftover(name)]
        foreign = [name for name in names if name not in ours]
        if PARTS in names:
            parts = folder / PARTS
            inside = sorted(path.name for path in parts.iterdir()) if parts.is_dir() else [""]
            foreign += [f"{PARTS}/{name}".rstrip("/") for name in inside if not is_leftover(name)]
    except OSError as error:
        raise InputError(f"{folder}: cannot be read ({error.strerror}); give another --out") from None
    if foreign:
        more = f" and {len(foreign) - 1} more" if len(foreign) > 1 else ""
        raise InputError(f"{folder}: holds files that are not of a campaign ({foreign[0]}{more}); give another --out")


def require_space(folder: Path, needed: int) -> None:
    """Refuse a folder whose disk is too full.

    Parameters
    ----------
    folder : Path
        May not be there yet.
    needed : int
        Bytes.

    Raises
    ------
    InputError
        If less is free.
    """
    place = next(place for place in (folder, *folder.absolute().parents) if place.exists())
    free = shutil.disk_usage(place).free
    if free < needed:
        raise InputError(
            f"{folder}: the results take about {_size(needed)}, but only {_size(free)} are free; "
            "make room or give another --out"
        )


def _size(count: int) -> str:
    return f"{count / 1e9:.1f} GB" if count >= 1e8 else f"{count / 1e6:.1f} MB"


def parts_in(folder: Path) -> list[Path]:
    """All Parquet files among a campaign's parts, whatever their names, in order.

    Raises
    ------
    InputError
        If they cannot be listed: that is not the same as that there are none.
    """
    try:
        names = os.listdir(folder / PARTS)
    except FileNotFoundError:
        return []
    except OSError as error:
        raise InputError(
            f"{folder / PARTS}: cannot be read ({error.strerror}); fix its permissions, or restore it from a copy"
        ) from None
    return sorted(folder / PARTS / name for name in names if name.endswith(".parquet"))


def part_content(path: Path) -> bytes:
    """The bytes of a part.

    Raises
    ------
    DamagedError
        If what is there is no file, or a link to none: a repair moves it aside.
    InputError
        If it cannot be read for another reason, which a repair does not mend.
    """
    try:
        return read_plain(path)
    except OSError as error:
        if path.is_dir() or (path.exists() and not path.is_file()):
            raise DamagedError("is a folder" if path.is_dir() else "is no plain file") from None
        if path.is_symlink():
            raise DamagedError(f"is a link to what cannot be read ({error.strerror})") from None
        raise InputError(f"{path}: cannot be read ({error.strerror}); fix its permissions and retry") from None


def remove_leftovers(folder: Path) -> None:
    """Remove the unfinished files of a killed run; only for the holder of the lock."""
    for path in [*folder.glob(".*.tmp"), *(folder / PARTS).glob(".*.tmp")]:
        if is_leftover(path.name):
            path.unlink(missing_ok=True)


def move_aside(folder: Path, name: str) -> None:
    """Move a part to ``damaged/``, beside others of its name."""
    place = folder / DAMAGED
    place.mkdir(exist_ok=True)
    target, number = place / name, 1
    while os.path.lexists(target):  # a link to nothing is there too
        target, number = place / f"{name}.{number}", number + 1
    (folder / PARTS / name).rename(target)


def write_whole(path: Path, content: bytes) -> None:
    """Write a file of a campaign, whole or not at all.

    Parameters
    ----------
    path : Path
    content : bytes

    Raises
    ------
    InputError
        If it cannot be written.
    """
    try:
        write_durably(path, content)
    except OSError as error:
        raise InputError(
            f"{path}: cannot be written ({error.strerror}); make it writable, or make room, and go on with --resume; "
            "what was flown is kept"
        ) from None
