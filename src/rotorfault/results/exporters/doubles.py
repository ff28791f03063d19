"""Messages of Protocol Buffers that are rows of doubles: their schema, and the bytes of all of them at once.

In such a message each field is a tag and eight bytes, so all messages have the same length and NumPy makes them in
one go; field by field it would take longer than the flight.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rotorfault.base.errors import missing_extra
from rotorfault.results.exporters.content import Column, identifiers

LONGEST = 100  # characters of a field
DOUBLE, OPTIONAL, FIXED_64 = 1, 1, 1  # of descriptors, and of the wire


def field_names(members: Sequence[Column]) -> list[str]:
    """Names of fields as a schema allows them, the time first."""
    return identifiers(["time", *(column.field for column in members)], LONGEST)


def schema(name: str, fields: Sequence[str], abouts: Sequence[str]) -> bytes:
    """The schema of a topic, as a set of file descriptors.

    Parameters
    ----------
    name : str
        Of the topic.
    fields : sequence of str
        The time in s first.
    abouts : sequence of str
        What each other field means, with its unit: comments in the schema.

    Raises
    ------
    MissingExtraError
        If the library of Protocol Buffers is not installed.
    """
    try:
        from google.protobuf.descriptor_pb2 import FileDescriptorSet
    except ImportError:
        raise missing_extra("the format mcap needs the package protobuf", "export") from None

    whole = FileDescriptorSet()
    file = whole.file.add(name=f"rotorfault/{name}.proto", package="rotorfault", syntax="proto3")
    message = file.message_type.add(name=name)
    abouts = ["time since the start of the flight [s]", *abouts]
    for number, (field, about) in enumerate(zip(fields, abouts, strict=True)):
        message.field.add(name=field, number=number + 1, type=DOUBLE, label=OPTIONAL)
        file.source_code_info.location.add(path=[4, 0, 2, number], span=[number, 0, 0], leading_comments=about)
    content: bytes = whole.SerializeToString()
    return content


def messages(values: Sequence[NDArray[Any]]) -> NDArray[np.uint8]:
    """The bytes of the messages, one row each.

    Parameters
    ----------
    values : sequence of ndarray, shape (records,)
        Of each field, in their order.
    """
    pieces: list[NDArray[np.uint8]] = []
    for number, column in enumerate(values, start=1):
        tag = np.frombuffer(_varint(number << 3 | FIXED_64), dtype=np.uint8)
        pieces.append(np.broadcast_to(tag, (len(column), len(tag))))
        pieces.append(np.ascontiguousarray(column, dtype="<f8").view(np.uint8).reshape(len(column), 8))
    return np.hstack(pieces)


def _varint(number: int) -> bytes:
    found = bytearray()
    while number > 127:
        found.append(number & 127 | 128)
        number >>= 7
    return bytes([*found, number])
