"""One table of Arrow in a Parquet file: the columns of csv, with unit, frame and meaning in each field's metadata.

The metadata of the file are the attributes of ``flight.nc``, the whole scenario as JSON among them.
"""

from __future__ import annotations

from pathlib import Path

from rotorfault.base.files import in_folder, write_atomically
from rotorfault.base.progress import Bar
from rotorfault.results.exporters.content import Content, columns, table

ROWS = 65536  # in a group: the table is written, and can be read, in pieces


def write_parquet(content: Content, path: Path) -> None:
    """Write a flight as a table of Arrow.

    Parameters
    ----------
    content : Content
    path : Path
    """
    # Takes longer to load than many flights to fly.
    import pyarrow as pa
    import pyarrow.parquet as pq

    time = content.data["time"]
    found = table(content.data, content.units)
    abouts = [{"unit": time.attrs.get("units", "s"), "meaning": time.attrs.get("long_name", "time"), "frame": ""}]
    abouts += [
        {"unit": one.unit if content.units else "", "meaning": one.meaning, "frame": one.frame}
        for one in columns(content.data)
    ]
    whole = pa.table({name: pa.array(values) for name, values in found.items()})
    fields = [
        field.with_metadata({key: text for key, text in about.items() if text})
        for field, about in zip(whole.schema, abouts, strict=True)
    ]
    schema = pa.schema(fields, metadata=content.attributes())
    whole = whole.cast(schema)

    def write(temporary: Path) -> None:
        with pq.ParquetWriter(temporary, schema, compression="zstd") as file:
            for first in range(0, len(whole), ROWS):
                file.write_table(whole.slice(first, ROWS))
                bar.update(first)

    with Bar("writing", len(whole), "records") as bar:
        write_atomically(in_folder(path), write)
