"""Logs of PX4 and ArduPilot of any topics, messages and parameters, for tests to put together."""

from __future__ import annotations

import struct
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from made_up_logs import FLIP, Flown
from numpy.typing import NDArray

from rotorfault.logs.log import named_layout

Array = NDArray[np.float64]


class Rows(NamedTuple):
    """A topic or message: its fields, when it came, and with what."""

    name: str
    fields: Sequence[tuple[str, str]]  # name and type: float, uint8_t, float[3] of a topic; letters of a message
    time: Array  # s
    values: Array  # (n, fields written out)
    instance: int = 0


def ulog(topics: Sequence[Rows], parameters: Mapping[str, float], dropouts: Sequence[float] = ()) -> bytes:
    """A ULog with records in the order of their times."""
    letters = {"float": "f", "uint8_t": "B", "int32_t": "i", "uint16_t": "H"}

    def message(kind: str, body: bytes) -> bytes:
        return struct.pack("<HB", len(body), ord(kind)) + body

    out = [b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0)]
    told = set()
    for topic in topics:
        if topic.name not in told:
            told.add(topic.name)
            text = "".join(f"{kind} {field};" for field, kind in topic.fields)
            out.append(message("F", f"{topic.name}:uint64_t timestamp;{text}".encode()))
    for key, value in parameters.items():
        whole = float(value).is_integer() and not key.startswith("CA_ROTOR0") and "_P" not in key and "_K" not in key
        word = f"{'int32_t' if whole else 'float'} {key}".encode()
        number = struct.pack("<i", int(value)) if whole else struct.pack("<f", value)
        out.append(message("P", bytes([len(word)]) + word + number))
    records: list[tuple[float, bytes]] = []
    for number, topic in enumerate(topics):
        out.append(message("A", struct.pack("<BH", topic.instance, number) + topic.name.encode()))
        form = "<HQ"
        for _, kind in topic.fields:
            base, _, length = kind.partition("[")
            form += letters[base] * (int(length.rstrip("]")) if length else 1)
        for time, row in zip(topic.time, np.atleast_2d(topic.values), strict=True):
            cells = [int(v) if c in "BiH" else float(v) for v, c in zip(row, form[3:], strict=True)]
            records.append((time, message("D", struct.pack(form, number, max(int(time * 1e6), 0), *cells))))
    records += [(time, message("O", struct.pack("<H", 100))) for time in dropouts]
    records.sort(key=lambda one: one[0])
    return b"".join([*out, *(body for _, body in records)])


def dataflash(messages: Sequence[Rows], parameters: Mapping[str, float], texts: Mapping[float, str]) -> bytes:
    """A dataflash log with records in the order of their times."""
    sizes = {"Q": "Q", "N": "16s", "f": "f", "B": "B", "Z": "64s", "H": "H", "b": "b"}
    out: list[bytes] = []

    def told(number: int, name: str, form: str, columns: str) -> None:
        size = 3 + struct.calcsize("<" + "".join(sizes[c] for c in form))
        out.append(b"\xa3\x95\x80" + struct.pack("<BB4s16s64s", number, size, name.encode(), form.encode(),
                                                   columns.encode()))  # fmt: skip

    told(130, "PARM", "QNf", "TimeUS,Name,Value")
    told(131, "MSG", "QZ", "TimeUS,Message")
    for key, value in parameters.items():
        out.append(b"\xa3\x95\x82" + struct.pack("<Q16sf", 0, key.encode(), value))
    records = [(time, b"\xa3\x95\x83" + struct.pack("<Q64s", int(time * 1e6), text.encode()))
               for time, text in texts.items()]  # fmt: skip
    numbers: dict[str, int] = {}
    for topic in messages:
        form = "Q" + "".join(kind for _, kind in topic.fields)
        if topic.name not in numbers:
            numbers[topic.name] = 140 + len(numbers)
            told(numbers[topic.name], topic.name, form, ",".join(["TimeUS", *(name for name, _ in topic.fields)]))
        head = b"\xa3\x95" + bytes([numbers[topic.name]])
        for time, row in zip(topic.time, np.atleast_2d(topic.values), strict=True):
            cells = [int(v) if c in "BHb" else float(v) for v, c in zip(row, form[1:], strict=True)]
            records.append((time, head + struct.pack("<" + form, max(int(time * 1e6), 0), *cells)))
    records.sort(key=lambda one: one[0])
    return b"".join([*out, *(body for _, body in records)])


def fields(name: str, count: int) -> list[tuple[str, str]]:
    """Fields of floats, such as a vector's."""
    return [(name, f"float[{count}]")]


def px4_topics(flight: Flown, torque: Array, thrust: Array, every: int = 2) -> list[Rows]:
    """What PX4 from 1.14 on logs of a flight; set-points are normalised, about its axes forward, right, down."""
    t, part = flight.time[::every], slice(None, None, every)
    up = np.column_stack([0 * thrust, 0 * thrust, -thrust])
    place = [("x", "float"), ("y", "float"), ("z", "float"), ("vx", "float"), ("vy", "float"), ("vz", "float")]
    return [
        Rows("vehicle_torque_setpoint", fields("xyz", 3), t, torque[part]),
        Rows("vehicle_thrust_setpoint", fields("xyz", 3), t, up[part]),
        Rows("vehicle_angular_velocity", fields("xyz", 3), t, (flight.rates * FLIP)[part]),
        Rows("vehicle_acceleration", fields("xyz", 3), t, (flight.force * FLIP)[part]),
        Rows("vehicle_local_position", place, t, np.hstack([flight.position * FLIP, flight.velocity * FLIP])[part]),
    ]


def ardupilot_messages(flight: Flown, torque: Array, every: int = 4) -> list[Rows]:
    """What ArduPilot logs of a flight; `torque` is ROut, POut, YOut about its axes."""
    t, part = flight.time[::every], slice(None, None, every)
    thrust = flight.command.mean(axis=1, keepdims=True)
    motion = np.hstack([0.0 * thrust, flight.rates * FLIP, flight.force * FLIP])
    place = np.hstack([0.0 * thrust, flight.velocity * FLIP, flight.position * FLIP])
    imu = [("I", "B"), *((f"{a}{b}", "f") for a in ("Gyr", "Acc") for b in "XYZ")]
    filter_ = [("C", "B"), *((name, "f") for name in ("VN", "VE", "VD", "PN", "PE", "PD"))]
    return [
        Rows("RATE", [(name, "f") for name in ("ROut", "POut", "YOut", "AOut")], t,
             np.hstack([torque, thrust])[part]),
        Rows("IMU", imu, t, motion[part]),
        Rows("XKF1", filter_, t, place[part]),
    ]  # fmt: skip


def geometry(frame: str) -> dict[str, float]:
    """CA_ROTOR parameters of a named frame."""
    layout = named_layout(frame, "")
    found: dict[str, float] = {"CA_ROTOR_COUNT": float(len(layout.places))}
    for k, ((x, y), turn) in enumerate(zip(layout.places, layout.yaw, strict=True)):
        found |= {f"CA_ROTOR{k}_PX": 0.2 * x, f"CA_ROTOR{k}_PY": -0.2 * y, f"CA_ROTOR{k}_KM": -0.05 * turn}
    return found
