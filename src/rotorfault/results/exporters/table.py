"""A flight as one table, a row per record and a column per component; and as CSV."""

from __future__ import annotations

import operator
from pathlib import Path
from typing import SupportsIndex

import numpy as np

from rotorfault.base.csv_text import write_columns
from rotorfault.base.errors import InputError, short
from rotorfault.base.progress import Bar
from rotorfault.maths.arrays import Array
from rotorfault.results.exporters.wanted import Wanted
from rotorfault.results.flight_data import FlightData


def whole_every(every: SupportsIndex, name: str = "every") -> int:
    """Of how many records one is written.

    Parameters
    ----------
    every : int
        Of Python or NumPy.
    name : str
        What it is called where it was given.

    Raises
    ------
    InputError
        If it is no whole number from 1 on.
    """
    try:
        found = 0 if isinstance(every, bool) else operator.index(every)
    except TypeError:
        found = 0
    if found < 1:
        raise InputError(f"{name}: got {short(every)}; allowed: a whole number of records, 1 or more")
    return found


def every_nth(data: FlightData, every: SupportsIndex) -> FlightData:
    """One of so many records, from the first on, on the same memory.

    Parameters
    ----------
    data : FlightData
    every : int

    Raises
    ------
    InputError
        If `every` is no whole number from 1 on.
    """
    step = whole_every(every)
    return data if step == 1 else data.isel(time=slice(None, None, step))


def columns_of(data: FlightData, units: bool = True) -> dict[str, Array]:
    """The records of a flight as named columns, on the same memory.

    Parameters
    ----------
    data : FlightData
    units : bool
        Whether a name ends in its unit, as in ``velocity_x [m/s]``; pure numbers have ``[1]``.

    Returns
    -------
    dict of str to ndarray, shape (records,)
        ``time``, then each signal; the component of a vector stands behind an underscore, as in ``thrust_1``.

    Raises
    ------
    InputError
        If something in the flight is not over time.
    """
    columns: dict[str, Array] = {}
    for name, variable in ({"time": data["time"]} | data.variables).items():
        if variable.dims[:1] != ("time",):
            dims = ", ".join(variable.dims) or "no dimension"
            raise InputError(f"'{name}' has {dims}; allowed in a table: what is over time; drop it from the data")
        unit = f" [{variable.attrs.get('units', '1')}]" if units else ""
        for at in np.ndindex(variable.values.shape[1:]):
            parts = (str(data[dim].values[i]) for dim, i in zip(variable.dims[1:], at, strict=True))
            columns["_".join((name, *parts)) + unit] = variable.values[(slice(None), *at)]
    return columns


def write_csv(data: FlightData, path: Path, wanted: Wanted) -> None:
    """Write a flight as one table of text.

    Parameters
    ----------
    data : FlightData
    path : Path
    wanted : Wanted

    Raises
    ------
    InputError
        As `columns_of`, or if the folder does not exist.
    """
    columns = columns_of(data, wanted.units)
    with Bar("writing", len(next(iter(columns.values()))), "records") as bar:
        write_columns(path, columns, bar.update)
