"""Flights in files that other tools read."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from rotorfault.base.csv_text import write_columns
from rotorfault.base.errors import InputError, unknown
from rotorfault.base.progress import Bar
from rotorfault.maths.arrays import Array
from rotorfault.results.flight_data import FlightData

Writer = Callable[[FlightData, Path, int, bool], Path]
"""Writes every so many records of a flight to a path, with or without units in the names of its columns."""


def columns_of(data: FlightData, every: int = 1, units: bool = True) -> dict[str, Array]:
    """The records of a flight as named columns, on the same memory.

    Parameters
    ----------
    data : FlightData
    every : int
        Of so many records one is taken, from the first on.
    units : bool
        Whether a name ends in its unit, as in ``velocity_x [m/s]``; pure numbers have ``[1]``.

    Returns
    -------
    dict of str to ndarray, shape (records,)
        ``time``, then each signal; the component of a vector stands behind an underscore, as in ``thrust_1``.

    Raises
    ------
    InputError
        If `every` is no whole number from 1 on, or something in the flight is not over time.
    """
    if isinstance(every, bool) or not isinstance(every, int) or every < 1:
        raise InputError(f"every: got {every!r}; allowed: a whole number of records, 1 or more")
    columns: dict[str, Array] = {}
    for name, variable in ({"time": data["time"]} | data.variables).items():
        if variable.dims[:1] != ("time",):
            dims = ", ".join(variable.dims) or "no dimension"
            raise InputError(f"'{name}' has {dims}; allowed in a table: what is over time; drop it from the data")
        unit = f" [{variable.attrs.get('units', '1')}]" if units else ""
        for at in np.ndindex(variable.values.shape[1:]):
            parts = (str(data[dim].values[i]) for dim, i in zip(variable.dims[1:], at, strict=True))
            columns["_".join((name, *parts)) + unit] = variable.values[(slice(None, None, every), *at)]
    return columns


def write_csv(data: FlightData, path: Path, every: int = 1, units: bool = True) -> Path:
    """Write a flight as one table of text: a row per record, a column per component.

    Parameters
    ----------
    data : FlightData
    path : Path
    every, units
        As for `columns_of`.

    Raises
    ------
    InputError
        As `columns_of`, or if the folder does not exist.
    """
    columns = columns_of(data, every, units)
    with Bar("writing", len(next(iter(columns.values()))), "records") as bar:
        return write_columns(path, columns, bar.update)


FORMATS: dict[str, Writer] = {"csv": write_csv}
"""By the name that ``rotorfault export --to`` takes, which is the ending of the file as well."""


def writer(form: str) -> Writer:
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
    path = source.with_suffix(f".{form}") if target is None else target
    if path.is_dir():
        raise InputError(f"{path}: is a folder; give a file with --out, such as {path / f'{source.stem}.{form}'}")
    if path.exists() and path.samefile(source):
        raise InputError(f"{path}: is the flight itself; give another file with --out")
    return path
