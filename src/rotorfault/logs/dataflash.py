"""ArduPilot's dataflash logs, read in one pass with bounded memory: the wanted messages, parameters and texts.

Each message has two bytes of head, its number and a body; messages of type FMT say what the body of others is. A
reader of our own, for it need not hold the log: it keeps the wanted messages alone and reads on behind damage.

Source: ArduPilot's description of logs, `AP_Logger`.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from rotorfault.base.plain_text import one_line
from rotorfault.logs.stream import Rows, walk

HEAD = b"\xa3\x95"
FMT, FMT_BODY = 128, struct.Struct("<BB4s16s64s")
TYPES = {
    "a": "<32i2", "b": "i1", "B": "u1", "h": "<i2", "H": "<u2", "i": "<i4", "I": "<u4", "f": "<f4", "d": "<f8",
    "n": "S4", "N": "S16", "Z": "S64", "c": "<i2", "C": "<u2", "e": "<i4", "E": "<u4", "L": "<i4", "M": "u1",
    "q": "<i8", "Q": "<u8", "g": "<f2",
}  # fmt: skip
HUNDREDTH = frozenset("cCeE")
MANY = 2000  # notes and parameters that are kept
TEXTS = ("PARM", "MSG", "ERR", "EV")


class Message(NamedTuple):
    """What a type of messages is, and its rows."""

    name: str
    scale: dict[str, float]
    rows: Rows


class DataflashFile(NamedTuple):
    """What was read."""

    messages: dict[str, Message]
    parameters: dict[str, float]
    texts: list[tuple[int, str]]  # us, text
    lost: int  # bytes
    reason: str


class _Reader:
    def __init__(self, wanted: Mapping[str, object]) -> None:
        self.wanted = {*wanted, *TEXTS}
        self.sizes: dict[int, int] = {FMT: 3 + FMT_BODY.size}
        self.rows: dict[int, Rows] = {}
        self.messages: dict[str, Message] = {}
        self.lost, self.gaps, self.astray = 0, 0, False

    def step(self, data: bytes, at: int, last: bool) -> int:
        """Use the messages of a chunk; see `rotorfault.logs.stream.Step`."""
        end, sizes, rows = len(data), self.sizes, self.rows
        while at + 3 <= end:
            number = data[at + 2]
            size = sizes.get(number, 0) if data[at] == 0xA3 and data[at + 1] == 0x95 else 0
            if not size:
                after = data.find(HEAD, at + 1)
                after = after if after >= 0 else max(at + 1, end - (0 if last else 2))
                self.lost += after - at
                self.gaps += not self.astray
                self.astray, at = True, after
                continue
            behind = at + size
            if behind > end:
                return at
            self.astray = False
            one = rows.get(number)
            if one is not None:
                one.add(data[at + 3 : behind])
            elif number == FMT:
                self._format(data[at + 3 : behind])
            at = behind
        return at

    def _format(self, body: bytes) -> None:
        number, size, name, form, labels = FMT_BODY.unpack(body)
        kinds = form.rstrip(b"\0").decode("ascii", "replace")
        columns = labels.rstrip(b"\0").decode("ascii", "replace").split(",")
        if size < 3 or number == FMT:
            return
        self.sizes[number] = size
        word = name.rstrip(b"\0").decode("ascii", "replace")
        if word not in self.wanted or word in self.messages:
            return
        if len(columns) != len(kinds) or len(set(columns)) != len(columns) or any(k not in TYPES for k in kinds):
            return
        if not all(columns):
            return
        dtype: np.dtype[Any] = np.dtype([(c, TYPES[k]) for c, k in zip(columns, kinds, strict=True)])
        if not 0 < dtype.itemsize <= 252:
            return
        scale = {c: 0.01 for c, k in zip(columns, kinds, strict=True) if k in HUNDREDTH}
        self.messages[word] = Message(word, scale, Rows(dtype))
        self.rows[number] = self.messages[word].rows


def read_dataflash(path: Path, wanted: Mapping[str, object]) -> DataflashFile:
    """Read some messages of a dataflash log.

    Parameters
    ----------
    path : Path
    wanted : mapping
        Names of messages are its keys.

    Raises
    ------
    InputError
        If it cannot be opened.
    """
    reader = _Reader(wanted)
    rest, packed = walk(path, reader.step)
    lost = reader.lost + rest
    places = f" at {reader.gaps} places" if reader.gaps > 1 else ""
    reason = f"{lost} bytes{places} are no messages: damaged or cut off" if lost else ""
    reason = "; ".join(filter(None, (packed, reason)))
    messages = {name: one for name, one in reader.messages.items() if name not in TEXTS}
    return DataflashFile(messages, _parameters(reader.messages), _texts(reader.messages), lost, reason)


def _parameters(messages: Mapping[str, Message]) -> dict[str, float]:
    found: dict[str, float] = {}
    if "PARM" in messages:
        table = messages["PARM"].rows.table()
        names = table.dtype.names or ()
        if "Name" in names and "Value" in names and table.dtype["Name"].kind == "S":
            for name, value in zip(table["Name"][: 10 * MANY], table["Value"], strict=False):
                found.setdefault(bytes(name).decode("ascii", "replace"), float(value))
    return found


def _texts(messages: Mapping[str, Message]) -> list[tuple[int, str]]:
    found: list[tuple[int, str]] = []
    for word in ("MSG", "ERR"):
        if word not in messages:
            continue
        table = messages[word].rows.table()[:MANY]
        names = table.dtype.names or ()
        if "TimeUS" not in names:
            continue
        for row in table:
            if word == "MSG":
                field = next((n for n in ("Message", "Msg") if n in names), None)
                text = "" if field is None else bytes(row[field]).decode("utf-8", "replace")
            else:
                text = "error " + ", ".join(f"{n} {row[n]}" for n in names if n != "TimeUS")
            if text:
                found.append((int(row["TimeUS"]), one_line(text)))
    return sorted(found)
