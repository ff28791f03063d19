"""PX4's ULog, read in one pass with bounded memory: the wanted topics, parameters and messages.

A damaged or truncated log is read as far as it goes: where a message cannot be one, reading goes on at the next place
where four messages follow each other, and what lies between is counted as lost.

Source: PX4's description of the ULog file format, version 1.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from rotorfault.base.plain_text import one_line
from rotorfault.logs.stream import Rows, walk

MAGIC = b"ULog\x01\x12\x35"
HEAD = 16  # bytes of the file's head: magic, version, time
TYPES = {
    "int8_t": "i1", "uint8_t": "u1", "bool": "u1", "char": "S1", "int16_t": "<i2", "uint16_t": "<u2",
    "int32_t": "<i4", "uint32_t": "<u4", "int64_t": "<i8", "uint64_t": "<u8", "float": "<f4", "double": "<f8",
}  # fmt: skip
KINDS = frozenset(b"BFIMPQARDLCSO")  # of messages
LONGEST = {ord("F"): 16384, ord("S"): 8, ord("O"): 2, ord("R"): 2, ord("B"): 64}  # of some, beyond which it is none
MOST_LIKELY = 4096  # bytes of a message, while the step is being looked for
SURE = 4  # messages in a row that are taken for being in step again
AHEAD = 8 * MOST_LIKELY  # bytes that must be there to look for it
CANDIDATE = re.compile(b"[BFIMPQARDLCSO]")
DEEP, WIDE, MANY = 4, 8192, 2000  # types in types, bytes of a topic, notes and parameters that are kept


class Topic(NamedTuple):
    """Rows of a topic's instance."""

    name: str
    instance: int
    rows: Rows


class ULogFile(NamedTuple):
    """What was read."""

    topics: dict[tuple[str, int], Topic]
    parameters: dict[str, float]
    texts: list[tuple[int, str]]  # us, text
    info: dict[str, str]
    lost: int  # bytes
    reason: str


class _Reader:
    def __init__(self, wanted: Mapping[str, object]) -> None:
        self.wanted = wanted
        self.formats: dict[str, list[tuple[str, int, str]]] = {}
        self.dtypes: dict[str, np.dtype[Any] | None] = {}
        self.rows: dict[int, Rows] = {}
        self.found = ULogFile({}, {}, [], {}, 0, "")
        self.lost, self.gaps, self.dropouts, self.dropped_ms = 0, 0, 0, 0
        self.begun = self.searching = False
        self.handlers = {
            ord("F"): self._format, ord("A"): self._subscribe, ord("P"): self._parameter, ord("L"): self._text,
            ord("C"): self._tagged, ord("I"): self._info, ord("O"): self._dropout,
        }  # fmt: skip

    def step(self, data: bytes, at: int, last: bool) -> int:
        """Use the messages of a chunk; see `rotorfault.logs.stream.Step`."""
        if not self.begun:
            self.begun, at = True, HEAD
        end, rows, handlers = len(data), self.rows, self.handlers
        while at + 3 <= end:
            size, kind = data[at] | data[at + 1] << 8, data[at + 2]
            behind = at + 3 + size
            wrong = kind not in KINDS or size == 0 or size > LONGEST.get(kind, 65535)
            if wrong or behind > end:
                if not last and (not wrong or end - at < AHEAD):
                    return at
                after = self._in_step(data, at + 1, last)
                self.lost += after - at
                self.gaps += not self.searching
                self.searching = not last and after + AHEAD > end
                if self.searching:
                    return after
                at = after
                continue
            self.searching = False
            if kind == 68:  # D, the most frequent
                one = rows.get(data[at + 3] | data[at + 4] << 8) if size >= 2 else None
                if one is not None:
                    one.add(data[at + 5 : behind])
            elif (handler := handlers.get(kind)) is not None:
                handler(data[at + 3 : behind])
            at = behind
        return at

    @staticmethod
    def _in_step(data: bytes, at: int, last: bool) -> int:
        """The next place where messages follow each other, or how far there is none."""
        end = len(data)
        until = end if last else end - AHEAD
        for match in CANDIDATE.finditer(data, at + 2):
            begin = match.start() - 2
            if begin > until:
                break
            place, count = begin, 0
            while count < SURE and place + 3 <= end:
                size, kind = data[place] | data[place + 1] << 8, data[place + 2]
                if kind not in KINDS or size == 0 or size > LONGEST.get(kind, MOST_LIKELY):
                    break
                place, count = place + 3 + size, count + 1
            if count == SURE and place <= end:
                return begin
        return max(at, until)

    def _format(self, body: bytes) -> None:
        name, _, fields = body.decode("utf-8", "replace").partition(":")
        if len(self.formats) >= MANY:
            return
        parsed = []
        for field in fields.split(";"):
            kind, _, field_name = field.strip().partition(" ")
            if not field_name:
                continue
            base, _, count = kind.partition("[")
            length = count.rstrip("]")
            parsed.append((base, int(length) if length.isdigit() and len(length) < 6 else 0, field_name.strip()))
        self.formats[name] = parsed

    def _dtype(self, name: str) -> np.dtype[Any] | None:
        if name not in self.dtypes:
            fields = self._flat(name, "", 0)
            names = [field for field, _ in fields]
            fits = bool(fields) and len(set(names)) == len(names)
            made = np.dtype(fields) if fits else None
            self.dtypes[name] = made if made is not None and 0 < made.itemsize <= WIDE else None
        return self.dtypes[name]

    def _flat(self, name: str, prefix: str, depth: int) -> list[tuple[str, str]]:
        """Fields of a type with the fields of those in it, arrays written out as `name[0]`."""
        flat: list[tuple[str, str]] = []
        if depth > DEEP:
            return flat
        for base, length, field in self.formats.get(name, []):
            for k in range(length or 1):
                label = f"{prefix}{field}[{k}]" if length else f"{prefix}{field}"
                if base in TYPES:
                    flat.append((label, TYPES[base]))
                else:
                    flat += self._flat(base, f"{label}.", depth + 1)
                if len(flat) > WIDE:
                    return []
        return flat

    def _subscribe(self, body: bytes) -> None:
        if len(body) < 4 or len(self.rows) >= MANY:
            return
        instance, number = body[0], body[1] | body[2] << 8
        name = body[3:].decode("utf-8", "replace")
        self.rows.pop(number, None)
        if name not in self.wanted or instance > 3:
            return
        dtype = self._dtype(name)
        if dtype is None or dtype.names is None or dtype.names[0] != "timestamp":
            return
        topic = self.found.topics.get((name, instance))
        if topic is None:
            topic = self.found.topics[name, instance] = Topic(name, instance, Rows(dtype))
        self.rows[number] = topic.rows

    def _parameter(self, body: bytes) -> None:
        parts = _key_value(body)
        if parts is None or len(self.found.parameters) >= MANY:
            return
        kind, name, value = parts
        if kind in ("int32_t", "float") and len(value) >= 4:
            number = struct.unpack("<i" if kind == "int32_t" else "<f", value[:4])[0]
            self.found.parameters.setdefault(name, float(number))  # the one that the flight begins with

    def _info(self, body: bytes) -> None:
        parts = _key_value(body)
        if parts is not None and len(self.found.info) < MANY:
            kind, name, value = parts
            if kind.startswith("char"):
                self.found.info[name] = one_line(value.decode("utf-8", "replace"))

    def _text(self, body: bytes) -> None:
        self._said(body, 1)

    def _tagged(self, body: bytes) -> None:
        self._said(body, 3)

    def _said(self, body: bytes, skip: int) -> None:
        if len(body) > skip + 8 and len(self.found.texts) < MANY:
            time = int.from_bytes(body[skip : skip + 8], "little")
            self.found.texts.append((time, one_line(body[skip + 8 :].decode("utf-8", "replace").strip())))

    def _dropout(self, body: bytes) -> None:
        self.dropouts += 1
        self.dropped_ms += int.from_bytes(body[:2], "little")


def _key_value(body: bytes) -> tuple[str, str, bytes] | None:
    """Type, name and value of a message that has them."""
    if not body or 1 + body[0] > len(body):
        return None
    kind, _, name = body[1 : 1 + body[0]].decode("utf-8", "replace").partition(" ")
    return (kind, name, body[1 + body[0] :]) if name else None


def read_ulog(path: Path, wanted: Mapping[str, object]) -> ULogFile:
    """Read some topics of a ULog.

    Parameters
    ----------
    path : Path
    wanted : mapping
        Names of topics are its keys.

    Raises
    ------
    InputError
        If it cannot be opened.
    """
    reader = _Reader(wanted)
    rest, packed = walk(path, reader.step)
    lost, said = reader.lost + rest, [packed] if packed else []
    if lost:
        places = f" at {reader.gaps} places" if reader.gaps > 1 else ""
        said.append(f"{lost} bytes{places} are no messages: damaged or cut off")
    if reader.dropouts:
        said.append(f"the logger itself dropped {reader.dropped_ms / 1000:.2g} s in {reader.dropouts} gaps")
    return reader.found._replace(lost=lost, reason="; ".join(said))
