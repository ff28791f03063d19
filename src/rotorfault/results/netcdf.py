"""Writing a flight as NetCDF-4, straight from its arrays.

A NetCDF-4 file is an HDF5 file in which dimensions are *dimension scales*, as "NetCDF-4 File Format Specification"
of Unidata describes (sections "Dimensions", "Dimension Scales", "Coordinate Variables"): each coordinate is a scale
that bears the number of its dimension, and is attached to every variable along it. The file is what xarray writes of
the same flight, in half the time and without loading xarray; a test compares both as xarray reads them.
"""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from rotorfault.base.files import in_folder, write_atomically
from rotorfault.results.flight_data import FlightData, Variable

COMPRESSION = {"compression": "gzip", "compression_opts": 1, "shuffle": True}
"""Of signals. A higher level takes many times longer for a few percent."""

_SCALE = b"DIMENSION_SCALE"
_OWN = {
    "CLASS", "NAME", "REFERENCE_LIST", "DIMENSION_LIST", "_FillValue", "_NCProperties", "_Netcdf4Coordinates",
    "_Netcdf4Dimid",
}  # fmt: skip


def write_netcdf(data: FlightData, path: Path) -> None:
    """Write a flight, compressed, whole or not at all.

    Raises
    ------
    InputError
        If the folder does not exist.
    OSError
        If the file cannot be written, as on a full disk; nothing is left behind.
    """
    content = encoded(data)
    write_atomically(in_folder(path), lambda temporary: temporary.write_bytes(content.getbuffer()))


def encoded(data: FlightData) -> io.BytesIO:
    """The content of the file. On a full disk HDF5 would end the process and leave half a file: so, into memory."""
    memory = io.BytesIO()
    number = {name: i for i, name in enumerate(data.coordinates)}
    with h5py.File(memory, "w", track_order=True) as file:
        _attributes(file, data.attrs)
        scales = {name: _add(file, name, variable, number, {}) for name, variable in data.coordinates.items()}
        for name, scale in scales.items():
            scale.make_scale(name)
        for name, variable in data.variables.items():
            made = _add(file, name, variable, number, COMPRESSION)
            for axis, dim in enumerate(variable.dims):
                made.dims[axis].attach_scale(scales[dim])
        properties = f"version=2,hdf5={h5py.version.hdf5_version},h5py={h5py.__version__}"
        file.attrs["_NCProperties"] = np.array(properties, dtype=h5py.string_dtype("ascii", len(properties)))
    return memory


def plain_arrays(file: h5py.File) -> FlightData:
    """What `encoded` wrote, read back; of a file of others it may be wrong, or raise whatever h5py does.

    Parameters
    ----------
    file : h5py.File
        Open for reading.
    """
    names = {int(one.attrs["_Netcdf4Dimid"]): name for name, one in file.items() if one.attrs.get("CLASS") == _SCALE}
    read = {}
    for name, one in file.items():
        about = dict(one.attrs)
        dims = tuple(names[int(i)] for i in about["_Netcdf4Coordinates"])
        values = one.asstr()[()].astype(str) if one.dtype.kind == "O" else one[()]
        read[name] = Variable(dims, values, _said(about))
    scales = set(names.values())
    return FlightData(
        {name: one for name, one in read.items() if name not in scales},
        {name: one for name, one in read.items() if name in scales},
        _said(dict(file.attrs)),
    )


def _said(attributes: dict[str, Any]) -> dict[str, Any]:
    """Attributes of the flight, without those that HDF5 and NetCDF have for themselves."""
    return {
        name: value if isinstance(value, str) or np.size(value) != 1 else np.ravel(value)[0]
        for name, value in attributes.items()
        if name not in _OWN
    }


def _add(file: Any, name: str, variable: Variable, number: dict[str, int], options: dict[str, Any]) -> Any:
    values = variable.values
    if values.dtype.kind == "U":
        made = file.create_dataset(name, data=values.astype(object), dtype=h5py.string_dtype(), track_order=True)
    elif values.dtype.kind == "f":
        made = file.create_dataset(name, data=values, fillvalue=np.nan, track_order=True, **options)
        made.attrs["_FillValue"] = np.array([np.nan])
    else:
        made = file.create_dataset(name, data=values, track_order=True, **options)
    made.attrs["_Netcdf4Dimid"] = np.int32(number[variable.dims[0]])
    made.attrs["_Netcdf4Coordinates"] = np.array([number[dim] for dim in variable.dims], dtype=np.int32)
    _attributes(made, variable.attrs)
    return made


def _attributes(place: Any, attributes: dict[str, Any]) -> None:
    for name, value in attributes.items():
        # Numbers of NetCDF attributes are arrays, texts are not.
        place.attrs[name] = value if isinstance(value, str) else np.atleast_1d(value)
