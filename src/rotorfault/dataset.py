"""Flights as xarray datasets and NetCDF files: one variable per signal, units and frames in attributes.

The attribute ``configuration`` of a file holds the whole scenario as JSON, ``versions`` those of the libraries, so
that a flight can be repeated from its file alone.
"""

from __future__ import annotations

import io
import json
import platform
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from rotorfault._version import __version__
from rotorfault.engine.batch import Array
from rotorfault.errors import InputError
from rotorfault.files import in_folder, write_atomically
from rotorfault.geometry import Mat3, PerRotor, Vec3
from rotorfault.telemetry import RPY, quantities

AXES = ["x", "y", "z"]
ANGLES = ["roll", "pitch", "yaw"]
_LIBRARIES = ("numpy", "scipy", "xarray", "h5netcdf", "heyoka")
FORMAT = "rotorfault-flight-1"
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
    variables: dict[str, Any] = {}
    row = 0
    for name, (kind, quantity) in quantities().items():
        dims, shape = _shape(kind, quantity.frame == RPY)
        width = int(np.prod(shape, dtype=int))
        values = signals[:, row : row + width].reshape(len(times), *shape)
        row += width
        about = {"units": quantity.unit, "long_name": quantity.meaning}
        if quantity.frame:
            about["frame"] = quantity.frame
        variables[name] = (("time", *dims), values, about)
    coordinates = {
        "time": ("time", times, {"units": "s", "long_name": "time since the start of the flight"}),
        "axis": AXES,
        "angle": ANGLES,
        "angle_2": ANGLES,
        "rotor": ("rotor", [1, 2, 3, 4], {"long_name": "1 front, 2 rear, 3 right, 4 left on a plus vehicle"}),
    }
    return xr.Dataset(variables, coords=coordinates, attrs=attributes)


def _shape(kind: type, angular: bool) -> tuple[tuple[str, ...], tuple[int, ...]]:
    if kind is Vec3:
        return ("angle" if angular else "axis",), (3,)
    if kind is PerRotor:
        return ("rotor",), (4,)
    if kind is Mat3:
        return ("angle", "angle_2"), (3, 3)
    return (), ()


def versions() -> dict[str, str]:
    """Versions of rotorfault, Python and the libraries that numbers depend on."""
    found = {"rotorfault": __version__, "python": platform.python_version()}
    for library in _LIBRARIES:
        try:
            found[library] = metadata.version(library)
        except metadata.PackageNotFoundError:
            found[library] = "not installed"
    return found


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
