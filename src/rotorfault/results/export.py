"""Flights in files that other tools read: which formats there are, and what writes each."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from rotorfault.base.errors import InputError, choices, unknown
from rotorfault.results.exporters.content import Content, content_of
from rotorfault.results.exporters.csv_file import write_csv
from rotorfault.results.exporters.mat_file import write_mat
from rotorfault.results.exporters.mcap_file import layout, write_mcap
from rotorfault.results.exporters.parquet_file import write_parquet
from rotorfault.results.exporters.rrd_file import write_rrd
from rotorfault.results.exporters.ulog_file import write_ulog
from rotorfault.results.flight_data import FlightData


class Format(NamedTuple):
    """A format of files."""

    ending: str  # of its files, without a dot
    says: str  # one line
    write: Callable[[Content, Path], None]


FORMATS: dict[str, Format] = {
    "csv": Format("csv", "one table of text", write_csv),
    "parquet": Format("parquet", "one table of Arrow, with units", write_parquet),
    "mat": Format("mat", "structures of MATLAB", write_mat),
    "mcap": Format("mcap", "Foxglove and Lichtblick: scene in 3-D, plots", write_mcap),
    "rrd": Format("rrd", "Rerun: scene in 3-D, plots", write_rrd),
    "ulog": Format("ulg", "PX4: Flight Review, PlotJuggler", write_ulog),
}
"""By the name that ``rotorfault export --to`` takes."""


def export(data: FlightData, path: Path, to: str | None = None, every: int = 1, units: bool = True) -> Path:
    """Write a flight for another tool, whole or not at all.

    Parameters
    ----------
    data : FlightData
    path : Path
    to : str, optional
        One of `FORMATS`; told by the ending of the path if not given.
    every : int
        Of so many records one is written, from the first on.
    units : bool
        Whether names or descriptions of columns have units.

    Raises
    ------
    InputError
        If there is no such format, `every` is no whole number from 1 on, the folder does not exist, or the flight
        does not fit into the format.
    MissingExtraError
        If the format needs a library that is not installed.
    """
    form = named(format_of(path) if to is None else to)
    if not len(data["time"].values):
        raise InputError("the flight has no records; there is nothing to export")
    form.write(content_of(data, every, units), path)
    return path


def named(name: str) -> Format:
    """A format by its name.

    Raises
    ------
    InputError
        If there is no such format.
    """
    if not isinstance(name, str) or name not in FORMATS:
        raise InputError(f"--to: {unknown('format', name, list(FORMATS))}")
    return FORMATS[name]


def format_of(path: Path) -> str:
    """Name of the format that the ending of a path tells.

    Raises
    ------
    InputError
        If it is the ending of none.
    """
    ending = path.suffix.removeprefix(".").lower()
    for name, form in FORMATS.items():
        if ending in (form.ending, name):
            return name
    endings = choices(f".{form.ending}" for form in FORMATS.values())
    raise InputError(f"{path}: its ending tells no format ({endings}); give one of these, or the format with --to")


def foxglove_layout(data: FlightData) -> str:
    """A layout of Foxglove's for the MCAP file of a flight, as JSON.

    Parameters
    ----------
    data : FlightData
    """
    return layout(content_of(data))


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
        If there is no such format, or that is the source or a folder.
    """
    ending = named(form).ending
    path = source.with_suffix(f".{ending}") if target is None else target
    if path.is_dir():
        raise InputError(f"{path}: is a folder; give a file with --out, such as {path / f'{source.stem}.{ending}'}")
    if path.exists() and path.samefile(source):
        raise InputError(f"{path}: is the flight itself; give another file with --out")
    return path
