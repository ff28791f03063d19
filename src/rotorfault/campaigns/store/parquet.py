"""Tables as Parquet files that prove themselves.

Two digests lie in a file's own metadata. The *content digest* is of the columns' names, types and values, however
they are encoded. The *seal* is of the file's bytes, with zeros in the seal's own place: one byte that changed
anywhere, in a page, a statistic or the footer, breaks it. It is checked before anything is decoded.
"""

from __future__ import annotations

import hashlib
import json
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

_ABOUT = "rotorfault.about"
_SEAL = b"rotorfault-seal-sha256:"
_DIGITS = 64
_ROWS = 1 << 17  # per row group: what readers share out among their threads
_MAGIC = b"PAR1"


class DamagedError(Exception):
    """A file is not what was written; the message says what is wrong with it."""


def canonical(table: pa.Table) -> pa.Table:
    """The same rows with the types that are kept: whole numbers, floats, truth values, texts.

    Raises
    ------
    ValueError
        If a column has another type, or two have the same name.
    """
    if len(set(table.column_names)) != table.num_columns:
        raise ValueError(f"columns must have different names; got {table.column_names}")
    columns, fields = [], []
    for name in table.column_names:
        column, kind = table[name], table[name].type
        if pa.types.is_dictionary(kind):
            kind = kind.value_type
        if pa.types.is_large_string(kind) or kind == pa.string_view():
            kind = pa.string()
        allowed = (
            pa.types.is_integer,
            pa.types.is_float32,
            pa.types.is_float64,
            pa.types.is_boolean,
            pa.types.is_string,
        )
        if not any(is_one(kind) for is_one in allowed):
            raise ValueError(f"column '{name}' has type {kind}; allowed: integer, float32, float64, bool, string")
        columns.append(column.cast(kind))
        fields.append(pa.field(name, kind))
    return pa.Table.from_arrays(columns, schema=pa.schema(fields)).combine_chunks()


def content_digest(table: pa.Table) -> str:
    """SHA-256 of a canonical table's columns; the same on every machine and with every version of the libraries."""
    digest = hashlib.sha256()
    for name in table.column_names:
        column = table[name]
        digest.update(json.dumps([name, str(column.type), len(column)]).encode())
        digest.update(np.packbits(pc.is_valid(column).to_numpy()).tobytes())
        if pa.types.is_string(column.type):
            texts = [text.encode() for text in pc.fill_null(column, "").to_pylist()]
            digest.update(np.array([len(text) for text in texts], dtype="<i8").tobytes())
            digest.update(b"".join(texts))
        else:
            # Whatever lies in memory where there is no value must not count.
            filled = column if column.null_count == 0 else pc.fill_null(column, pa.scalar(0).cast(column.type))
            values = filled.to_numpy()
            digest.update(values.astype(values.dtype.newbyteorder("<"), copy=False).tobytes())
    return digest.hexdigest()


def encode(table: pa.Table, about: dict[str, Any]) -> bytes:
    """A canonical table as a sealed Parquet file; the same bytes for the same table.

    Parameters
    ----------
    table : pyarrow.Table
    about : dict
        Kept beside it; plain data. The content digest is added as ``sha256``.
    """
    about = {**about, "rows": table.num_rows, "sha256": content_digest(table)}
    sink = pa.BufferOutputStream()
    # Numbers hardly ever repeat: looking for those that do would take most of the time.
    texts = [field.name for field in table.schema if pa.types.is_string(field.type)]
    with pq.ParquetWriter(sink, table.schema, compression="zstd", use_dictionary=texts) as writer:
        writer.write_table(table, row_group_size=_ROWS)
        # Not in the schema, of which the file holds a second copy: the seal must stand in one place.
        text = json.dumps(about, sort_keys=True, allow_nan=False)
        writer.add_key_value_metadata({_ABOUT: text, "rotorfault.seal": _SEAL.decode() + "0" * _DIGITS})
    content: bytes = sink.getvalue().to_pybytes()
    return _with_seal(content, hashlib.sha256(content).hexdigest())


def decode(content: bytes) -> tuple[dict[str, Any], pa.Table]:
    """What `encode` was given, if not one byte has changed.

    Raises
    ------
    DamagedError
        Says what is wrong.
    """
    if not content.startswith(_MAGIC):
        raise DamagedError("is empty" if not content else "is no Parquet file")
    if not content.endswith(_MAGIC):
        raise DamagedError("is cut short")
    if _SEAL not in content:
        raise DamagedError("was not written by rotorfault")
    if content != _with_seal(content, hashlib.sha256(_with_seal(content, "0" * _DIGITS)).hexdigest()):
        raise DamagedError("has changed since it was written")
    try:
        file = pq.ParquetFile(pa.BufferReader(content))
        about: dict[str, Any] = json.loads(file.metadata.metadata[_ABOUT.encode()])
        table = file.read(use_threads=False).replace_schema_metadata(None).combine_chunks()
        digest = about["sha256"]
    except (pa.ArrowException, OSError, ValueError, KeyError, TypeError) as error:
        raise DamagedError(f"cannot be read ({str(error).splitlines()[0]})") from None
    if digest != content_digest(table):
        raise DamagedError("holds other numbers than were written")
    return about, table


def _with_seal(content: bytes, digits: str) -> bytes:
    # The last place that looks like a seal: a text in the table could, but the footer comes after the rows.
    place = content.rfind(_SEAL) + len(_SEAL)
    return b"".join((content[:place], digits.encode(), content[place + _DIGITS :]))
