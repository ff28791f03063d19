"""Flights in files that other tools read: a module per format, and the table of formats."""

from __future__ import annotations

from pathlib import Path

from rotorfault.base.errors import InputError, unknown
from rotorfault.base.files import in_folder, write_atomically
from rotorfault.results.events import events
from rotorfault.results.exporters import mat, mcap, parquet, rrd, table, ulog
from rotorfault.results.exporters.table import every_nth, whole_every
from rotorfault.results.exporters.wanted import Wanted, Writer
from rotorfault.results.flight_data import FlightData

__all__ = ["ENDINGS", "FORMATS", "form_of", "format_of", "target_of", "whole_every", "write", "writer_of"]

FORMATS: dict[str, Writer] = {
    "csv": table.write_csv,
    "parquet": parquet.write,
    "mat": mat.write,
    "mcap": mcap.write,
    "rrd": rrd.write,
    "ulog": ulog.write,
}
"""By the name that ``rotorfault export --to`` takes."""
ENDINGS = {form: f".{'ulg' if form == 'ulog' else form}" for form in FORMATS}
"""Of files, by format."""


def write(data: FlightData, path: Path, form: str | None = None, every: int = 1, units: bool = True) -> list[Path]:
    """Write a flight for another tool.

    Parameters
    ----------
    data : FlightData
    path : Path
    form : str, optional
        One of `FORMATS`; by the ending of the path if not given.
    every : int
        One of so many records is written, from the first on.
    units : bool
        Whether the names of columns end in their units, in formats that are one table; others have units besides.

    Returns
    -------
    list of Path
        The file; then what comes with it, such as a layout for its viewer.

    Raises
    ------
    InputError
        If there is no such format or the path ends in that of another, `every` is no whole number from 1 on, the
        flight does not fit the format, the folder does not exist, or a library is missing.
    """
    writer = writer_of(format_of(path, form))
    some = every_nth(data, every)
    companions: list[Path] = []
    wanted = Wanted(units, path, companions, events(data))
    write_atomically(in_folder(path), lambda temporary: writer(some, temporary, wanted))
    return [path, *companions]


def format_of(path: Path, form: str | None) -> str:
    """The format of a file, if what was asked for and its ending do not say two things.

    Parameters
    ----------
    path : Path
    form : str, optional
        One of `FORMATS`; by the ending of the path if not given.

    Raises
    ------
    InputError
        If there is no such format, or the path ends in that of another.
    """
    if form is None:
        return form_of(path)
    writer_of(form)
    others = {ending for other, ending in ENDINGS.items() if other != form}
    if path.suffix.lower() in others:
        raise InputError(f"{path}: ends in {path.suffix}, and {form} was asked for; allowed: {ENDINGS[form]}")
    return form


def form_of(path: Path) -> str:
    """The format that a file's ending says.

    Raises
    ------
    InputError
        If it says none.
    """
    for form, ending in ENDINGS.items():
        if path.suffix.lower() == ending:
            return form
    raise InputError(f"{path}: {unknown('ending', path.suffix, list(ENDINGS.values()))}; or name the format")


def writer_of(form: str) -> Writer:
    """What writes a format.

    Raises
    ------
    InputError
        If there is no such format.
    """
    if form not in FORMATS:
        raise InputError(f"--to: {unknown('format', form, list(FORMATS))}")
    return FORMATS[form]


def target_of(form: str, source: Path, target: Path | None = None) -> Path:
    """The file to write a flight to.

    Parameters
    ----------
    form : str
        One of `FORMATS`.
    source : Path
        The file that the flight is from.
    target : Path, optional
        What the user asks for; else it lies beside the source and is named like it.

    Raises
    ------
    InputError
        If that is the source or a folder.
    """
    path = source.with_suffix(ENDINGS[form]) if target is None else target
    if path.is_dir():
        raise InputError(f"{path}: is a folder; give a file with --out, such as {path / source.stem}{ENDINGS[form]}")
    if path.exists() and path.samefile(source):
        raise InputError(f"{path}: is the flight itself; give another file with --out")
    return path
