"""Flights as xarray datasets and NetCDF files: one variable per signal, units and frames in attributes.

The attribute ``configuration`` of a file holds the whole scenario as JSON, ``versions`` those of the libraries, so
that a flight can be repeated from its file alone.
"""

from __future__ import annotations

import io
import json
from pathlib import Path
from typing import Any

import xarray as xr

from rotorfault.base.errors import InputError
from rotorfault.base.files import in_folder, write_atomically
from rotorfault.engine.batch import Array
from rotorfault.model.telemetry import quantities
from rotorfault.results.flight_data import FORMAT, FlightData, flight_data

ATTRIBUTES = (
    "scenario", "controller", "plant", "engine", "seed", "version", "outcome", "end_time", "thrust_min", "thrust_max",
)  # fmt: skip
"""Attributes that the summary of a flight needs."""


def dataset(signals: Array, times: Array, attributes: dict[str, Any]) -> xr.Dataset:
    """One flight's records as a dataset.

    Parameters
    ----------
    signals : ndarray, shape (records, rows of `Signals`)
    times : ndarray, shape (records,)
        In s.
    attributes : dict
        Attributes of the dataset.
    """
    return as_dataset(flight_data(signals, times, attributes))


def as_dataset(data: FlightData) -> xr.Dataset:
    """The same records as a dataset, on the same memory."""
    return xr.Dataset(
        {name: tuple(variable) for name, variable in data.variables.items()},
        coords={name: tuple(variable) for name, variable in data.coordinates.items()},
        attrs=data.attrs,
    )


def write_netcdf(data: xr.Dataset, path: Path) -> None:
    """Write a dataset, compressed, whole or not at all.

    Raises
    ------
    InputError
        If the folder does not exist.
    OSError
        If the file cannot be written, as on a full disk; nothing is left behind.
    """
    encoding = {name: {"zlib": True, "complevel": 1, "shuffle": True} for name in data.data_vars}
    # Into memory first: on a full disk HDF5 does not raise but ends the process, and leaves half a file behind.
    memory = io.BytesIO()
    data.to_netcdf(memory, engine="h5netcdf", encoding=encoding)
    write_atomically(in_folder(path), lambda temporary: temporary.write_bytes(memory.getbuffer()))


def read_netcdf(path: str | Path) -> xr.Dataset:
    """Read a flight file into memory.

    Raises
    ------
    InputError
        If it is missing, unreadable, truncated, or no flight of this program.
    """
    path = Path(path)
    if not path.is_file():
        raise InputError(f"{path}: no such file; give a flight.nc that 'rotorfault fly' wrote")
    try:
        with xr.open_dataset(path, engine="h5netcdf") as opened:
            data = opened.load()
    except Exception as error:
        # h5py and xarray raise a dozen kinds for files that are truncated or no HDF5 at all.
        reason = " ".join(str(error).split())[:120]
        raise InputError(f"{path}: cannot be read as a flight ({reason}); fly it again") from None
    if data.attrs.get("format") != FORMAT:
        raise InputError(f"{path}: attribute 'format' is {data.attrs.get('format')!r}; allowed: '{FORMAT}'")
    return data


def complete(data: xr.Dataset, path: str | Path) -> xr.Dataset:
    """The same dataset, if it has all signals and attributes that the numbers of a flight are computed from.

    Raises
    ------
    InputError
        If one is missing.
    """
    hint = "fly it again with 'rotorfault fly --repeat'"
    for name in quantities():
        if name not in data.data_vars:
            raise InputError(f"{path}: signal '{name}' is missing; {hint}")
    for name in ATTRIBUTES:
        if name not in data.attrs:
            raise InputError(f"{path}: attribute '{name}' is missing; {hint}")
    return data


def configuration(data: xr.Dataset, path: str | Path) -> dict[str, Any]:
    """The scenario's tables that a flight file holds."""
    try:
        tables: dict[str, Any] = json.loads(data.attrs["configuration"])
    except (KeyError, json.JSONDecodeError) as error:
        raise InputError(f"{path}: attribute 'configuration' is missing or damaged ({error})") from None
    return tables
