"""Flights as xarray datasets and NetCDF files: one variable per signal, units and frames in attributes.

The attribute ``configuration`` of a file holds the whole scenario as JSON, ``versions`` those of the libraries, so
that a flight can be repeated from its file alone.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, TypeVar

import h5netcdf
import h5py
import xarray as xr

from rotorfault.base.bounds import require
from rotorfault.base.errors import InputError
from rotorfault.base.files import instead_of_folder
from rotorfault.results.flight_data import FORMAT, FlightData, Variable
from rotorfault.results.netcdf import plain_arrays
from rotorfault.results.seal import DIGESTS, changed_attributes, changed_variables
from rotorfault.results.whole import json_table

OLD_FORMAT = "rotorfault-flight-1"
HDF5 = b"\x89HDF\r\n\x1a\n"  # how a file begins that is or was one
Content = TypeVar("Content")


def as_dataset(data: FlightData) -> xr.Dataset:
    """The same records as a dataset, on the same memory."""
    return xr.Dataset(
        {name: tuple(variable) for name, variable in data.variables.items()},
        coords={name: tuple(variable) for name, variable in data.coordinates.items()},
        attrs=data.attrs,
    )


def as_flight_data(data: xr.Dataset) -> FlightData:
    """A dataset's records as plain arrays, on the same memory."""

    def variables(group: Mapping[Any, xr.DataArray]) -> dict[str, Variable]:
        return {
            str(name): Variable(tuple(map(str, one.dims)), one.values, {str(k): v for k, v in one.attrs.items()})
            for name, one in group.items()
        }

    return FlightData(variables(data.data_vars), variables(data.coords), data.attrs)


def read_netcdf(path: str | Path) -> xr.Dataset:
    """Read a flight file into memory.

    Raises
    ------
    InputError
        If it is missing, unreadable, truncated, or no flight of this program.
    """
    require(path, (str, Path), "flight", "the path of a flight.nc")
    if (quick := _as_written(Path(path))) is not None:
        return as_dataset(quick)
    data = _from(Path(path), _dataset)
    form = data.attrs.get("format")
    if form == OLD_FORMAT:
        raise InputError(
            f"{path}: was written by version {data.attrs.get('version', '0.1')} and holds other signals than this "
            "version reads; 'rotorfault fly --repeat' flies it again"
        )
    if form != FORMAT:
        raise InputError(f"{path}: attribute 'format' is {form!r}; allowed: '{FORMAT}'")
    _require_unchanged(data.attrs, path)
    if changed := changed_variables(as_flight_data(data)):
        more = f" (and {len(changed) - 1} more)" if len(changed) > 1 else ""
        raise InputError(
            f"{path}: signal '{changed[0]}'{more} is not what was written: the file is damaged or was edited; "
            "'rotorfault fly --repeat' flies it again"
        )
    data.attrs.pop(DIGESTS, None)  # whoever changes the data and saves them gets new ones
    return data


def _require_unchanged(attributes: Mapping[str, Any], path: str | Path) -> None:
    if changed_attributes(attributes):
        raise InputError(
            f"{path}: its attributes are not what was written: the file is damaged or was edited; restore it from a "
            "copy, or fly the scenario anew"
        )


def _from(path: Path, read: Callable[[Path], Content]) -> Content:
    """What is read of any file that xarray reads."""
    if path.is_dir():
        raise InputError(f"{path}: {instead_of_folder(path, '.nc')}")
    if not path.is_file():
        raise InputError(f"{path}: no such file; give a flight.nc that 'rotorfault fly' wrote")
    try:
        # First by h5py alone: an h5netcdf file that could not be opened prints a traceback when it is collected.
        with h5py.File(path, "r"):
            pass
        return read(path)
    except PermissionError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); check its permissions") from None
    except Exception:
        # h5py and xarray raise a dozen kinds, in words of their own, for files that are cut or no HDF5 at all.
        with path.open("rb") as file:
            begins = file.read(len(HDF5))
        if HDF5.startswith(begins):
            raise InputError(
                f"{path}: is cut or damaged ({path.stat().st_size:,} bytes); restore a copy, or fly it again"
            ) from None
        raise InputError(f"{path}: is no flight file; give a flight.nc that 'rotorfault fly' wrote") from None


def _as_written(path: Path) -> FlightData | None:
    """A file that is what `write_netcdf` wrote to the last bit, as its digests say; None for any other.

    In a third of the time that xarray takes, and less for short flights: it asks about each variable again and again.
    """
    try:
        with h5py.File(path, "r") as file:
            read = plain_arrays(file)
    except Exception:
        return None  # `_dataset` meets the same, and says what it is
    if read.attrs.get("format") != FORMAT or DIGESTS not in read.attrs:
        return None
    if changed_attributes(read.attrs) or changed_variables(read):
        return None
    return FlightData(read.variables, read.coordinates, {k: v for k, v in read.attrs.items() if k != DIGESTS})


def _dataset(path: Path) -> xr.Dataset:
    """All of it, in memory."""
    with xr.open_dataset(path, engine="h5netcdf", phony_dims="access") as opened:
        return opened.load()


def _attributes(path: Path) -> dict[str, Any]:
    """What is said of the whole flight. The signals take twenty times as long to read."""
    with h5netcdf.File(path, "r", phony_dims="access") as opened:
        return dict(opened.attrs)


def read_configuration(path: str | Path) -> tuple[dict[str, Any], dict[str, Any]]:
    """The scenario's tables and the attributes of a flight file, also of one whose signals cannot be read any more.

    Raises
    ------
    InputError
        If it is missing, unreadable, truncated, or no flight of this program.
    """
    require(path, (str, Path), "flight", "the path of a flight.nc")
    attributes = _from(Path(path), _attributes)
    if attributes.get("format") not in (FORMAT, OLD_FORMAT):
        raise InputError(f"{path}: attribute 'format' is {attributes.get('format')!r}; allowed: '{FORMAT}'")
    _require_unchanged(attributes, path)
    if not isinstance(attributes.get("engine"), str):
        raise InputError(
            f"{path}: attribute 'engine' is {attributes.get('engine')!r}; allowed: the name of an engine"
        )
    return configuration(attributes, path), attributes


def configuration(attributes: Mapping[str, Any], path: str | Path) -> dict[str, Any]:
    """The scenario's tables that a flight file holds."""
    return json_table(attributes, "configuration", path)
