"""The bytes of ULog, the log format of PX4: messages of the definitions, and many records of data at once.

https://docs.px4.io/main/en/dev_log/ulog_file_format: a header, definitions (flags, formats, information,
parameters), then data (subscriptions, records, logged texts). Each message has its size, a letter and its content.
"""

from __future__ import annotations

import struct
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

MAGIC = b"ULog\x01\x12\x35\x01"
FLAGS, FORMAT, INFORMATION, MORE, PARAMETER, SUBSCRIPTION, DATA, TEXT = "BFIMPADL"
LONGEST = 60000  # bytes of a text: the size of a message has 16 bits
MOST_FIELDS = 1000  # of a topic, so that its format fits into a message
TYPES = {"<f4": "float", "<f8": "double", "<u8": "uint64_t", "<u4": "uint32_t", "<u2": "uint16_t", "|u1": "uint8_t",
         "|b1": "bool"}  # fmt: skip
"""Names of types, by those of NumPy."""


class Topic(NamedTuple):
    """Records of one kind."""

    name: str
    fields: dict[str, NDArray[Any]]  # by name, shape (records,) or (records, length); the first is ``timestamp``


def header() -> bytes:
    """The beginning of a file whose clock starts at 0."""
    return MAGIC + struct.pack("<Q", 0) + _message(FLAGS, bytes(40))


def _message(letter: str, content: bytes) -> bytes:
    return struct.pack("<HB", len(content), ord(letter)) + content


def cut_bytes(text: str, most: int) -> bytes:
    """A text in at most so many bytes, no character of it in half."""
    return text.encode("utf-8", "replace")[:most].decode("utf-8", "ignore").encode("utf-8")


def information(key: str, value: str) -> bytes:
    """A text that is said of the file, cut where it is too long.

    Parameters
    ----------
    key : str
        A word of letters, digits, underscores and dots.
    value : str
    """
    text = cut_bytes(value, LONGEST)
    name = f"char[{len(text)}] {key}".encode("ascii")
    return _message(INFORMATION, bytes([len(name)]) + name + text)


def long_information(key: str, value: str) -> bytes:
    """A text of any length that is said of the file, in pieces; characters beyond ASCII are written out."""
    whole = value.encode("ascii", "backslashreplace")
    pieces = [whole[at : at + LONGEST] for at in range(0, len(whole), LONGEST)]
    found = b""
    for number, piece in enumerate(pieces):
        name = f"char[{len(piece)}] {key}".encode("ascii")
        found += _message(MORE, bytes([number > 0, len(name)]) + name + piece)
    return found


def parameter(key: str, value: int | float) -> bytes:
    """A parameter of PX4's."""
    kind, form = ("int32_t", "<i") if isinstance(value, int) else ("float", "<f")
    name = f"{kind} {key}".encode("ascii")
    return _message(PARAMETER, bytes([len(name)]) + name + struct.pack(form, value))


def text(time: int, level: int, words: str) -> bytes:
    """A logged text; `time` is in µs, `level` is one of Linux: 4 for a warning, 6 for information."""
    return _message(TEXT, struct.pack("<BQ", ord(str(level)), time) + cut_bytes(words, LONGEST))


def definition(topic: Topic) -> bytes:
    """The format of a topic."""
    fields = []
    for name, values in topic.fields.items():
        kind = TYPES[values.dtype.str]
        fields.append(f"{kind}[{values.shape[1]}] {name};" if values.ndim > 1 else f"{kind} {name};")
    return _message(FORMAT, f"{topic.name}:{''.join(fields)}".encode("ascii"))


def subscription(topic: Topic, number: int) -> bytes:
    """What says that data of a number are of a topic."""
    return _message(SUBSCRIPTION, struct.pack("<BH", 0, number) + topic.name.encode("ascii"))


def records(topics: list[Topic], part: slice) -> NDArray[np.uint8]:
    """The data of some records of all topics, in order of time: a row of bytes for each record.

    Parameters
    ----------
    topics : list of Topic
        Of the same times.
    part : slice
        Which of their records.
    """
    return np.hstack([_rows(topic, number, part) for number, topic in enumerate(topics)])


def _rows(topic: Topic, number: int, part: slice) -> NDArray[np.uint8]:
    count = len(topic.fields["timestamp"][part])
    columns = [values[part].reshape(count, -1) for values in topic.fields.values()]
    content = [np.ascontiguousarray(column).view(np.uint8).reshape(count, -1) for column in columns]
    size = sum(column.shape[1] for column in content) + 2
    head = np.frombuffer(struct.pack("<HBH", size, ord(DATA), number), dtype=np.uint8)
    return np.hstack([np.broadcast_to(head, (count, len(head))), *content])
