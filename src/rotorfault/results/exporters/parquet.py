"""A flight as a Parquet table: columns as in CSV, with units and meanings in the metadata of their fields."""

from __future__ import annotations

from pathlib import Path

from rotorfault.results.exporters.table import columns_of
from rotorfault.results.exporters.wanted import Wanted, texts
from rotorfault.results.flight_data import FlightData


def write(data: FlightData, path: Path, wanted: Wanted) -> None:
    """Write a flight as one Parquet table.

    Parameters
    ----------
    data : FlightData
    path : Path
    wanted : Wanted

    Raises
    ------
    InputError
        If something in the flight is not over time.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    columns = columns_of(data, wanted.units)
    about: list[dict[str, str]] = [{"units": "s", "long_name": "time since the start of the flight"}]
    for variable in data.variables.values():
        about += [variable.attrs] * int(variable.values[:1].size or 1)
    fields = [
        pa.field(name, pa.from_numpy_dtype(values.dtype), metadata={str(k): str(v) for k, v in attributes.items()})
        for (name, values), attributes in zip(columns.items(), about, strict=True)
    ]
    schema = pa.schema(fields, metadata=texts(data))
    pq.write_table(pa.table(list(columns.values()), schema=schema), path, compression="zstd")
