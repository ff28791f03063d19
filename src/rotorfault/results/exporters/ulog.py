"""A flight as a PX4 log (ULog): PX4's own topics in PX4's frames, and all signals under names of rotorfault.

Topics that PX4 has are named and filled as PX4 does, so Flight Review and PlotJuggler draw them as of any flight: the
world is north, east, down with x taken for north, the body forward, right, down. Motors are in PX4's order where the
vehicle is an X quadrotor, else in the order of its file; the message ``rotorfault_motors`` says which. All signals,
in the frames of rotorfault, are in topics ``rotorfault_flight`` and ``rotorfault_SLOT``; their units are in the
message ``rotorfault_signals``. Format: ULog version 1, as documented by PX4.
"""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rotorfault._version import __version__
from rotorfault.base.errors import InputError
from rotorfault.base.plain_text import one_line
from rotorfault.maths.arrays import Array
from rotorfault.model.conventions import convert
from rotorfault.results.airframe import airframe_of, px4_order
from rotorfault.results.events import events
from rotorfault.results.exporters.wanted import Names, Wanted, signals
from rotorfault.results.flight_data import FlightData

MAGIC = b"ULog\x01\x12\x35\x01"
MOST_MOTORS = 12  # of PX4's actuator_motors
MICRO = 1e6
LEVELS = {"fault": 3, "false_alarm": 4, "alarm": 4, "given_up": 4}  # of a log: 3 error, 4 warning, else 6 information
LONGEST = 2**16 - 64  # bytes of a message


class Topic(NamedTuple):
    """A topic: its fields besides the time stamp, all of one type."""

    name: str
    fields: tuple[tuple[str, int], ...]  # name and length; 0 for a number
    values: Array  # (records, all numbers of all fields)
    type: str = "float"


def write(data: FlightData, path: Path, wanted: Wanted) -> None:
    """Write a flight as a ULog.

    Parameters
    ----------
    data : FlightData
    path : Path
    wanted : Wanted

    Raises
    ------
    InputError
        If the flight begins before time 0, which the format has no place for.
    """
    time = np.asarray(data["time"].values, dtype=float)
    if len(time) and time[0] < 0.0:
        raise InputError(f"the flight begins at {time[0]:g} s; a ULog has no time before 0")
    motors, order = _motors(data)
    topics = [*_px4(data, motors), *_own(data)]
    units = {
        f"{signal.slot}.{signal.name}".lstrip("."): [signal.unit, signal.frame, list(signal.columns)]
        for signal in signals(data)
    }
    about = {key: one_line(str(data.attrs.get(key, "")))[:2000] for key in ("scenario", "controller", "vehicle")}
    information = {
        "sys_name": "rotorfault",
        "ver_sw_release_str": __version__,
        "rotorfault_flight": json.dumps(about),
        "rotorfault_motors": order,
        "rotorfault_signals": json.dumps(units),
    }
    with path.open("wb") as file:
        file.write(MAGIC + struct.pack("<Q", round(time[0] * MICRO) if len(time) else 0))
        file.write(_message("B", bytes(40)))
        for key, text in information.items():
            file.write(_information(key, text))
        for topic in topics:
            file.write(_message("F", _format(topic).encode()))
        for number, topic in enumerate(topics):
            file.write(_message("A", struct.pack("<BH", 0, number) + topic.name.encode()))
        rows = _rows(time, topics)
        begun = 0
        for event in events(data):
            until = int(np.searchsorted(time, event.time))
            file.write(rows[begun:until].tobytes())
            begun = until
            level, stamp = LEVELS.get(event.kind, 6), round(max(event.time, 0.0) * MICRO)
            file.write(_message("L", struct.pack("<BQ", level + 48, stamp) + event.text.encode()[:2000]))
        file.write(rows[begun:].tobytes())


def _message(kind: str, body: bytes) -> bytes:
    return struct.pack("<HB", len(body), ord(kind)) + body


def _information(key: str, text: str) -> bytes:
    """A message of information; a long text is cut, for a message has a length."""
    value = text.encode()[: LONGEST - len(key)]
    name = f"char[{len(value)}] {key}".encode()
    return _message("I", bytes([len(name)]) + name + value)


def _format(topic: Topic) -> str:
    fields = "".join(f"{topic.type}{f'[{length}]' if length else ''} {name};" for name, length in topic.fields)
    return f"{topic.name}:uint64_t timestamp;{fields}"


def _rows(time: Array, topics: list[Topic]) -> NDArray[np.void]:
    """All messages of data: for each record those of all topics, one behind the other."""
    columns: list[tuple[str, str] | tuple[str, str, tuple[int, ...]]] = []
    for number, topic in enumerate(topics):
        kind = {"float": "<f4", "double": "<f8"}[topic.type]
        columns += [
            (f"size{number}", "<u2"),
            (f"kind{number}", "u1"),
            (f"id{number}", "<u2"),
            (f"time{number}", "<u8"),
        ]
        columns.append((f"values{number}", kind, (topic.values.shape[1],)))
    rows = np.zeros(len(time), dtype=np.dtype(columns))
    stamps = np.rint(time * MICRO).astype(np.uint64)
    for number, topic in enumerate(topics):
        width = topic.values.shape[1] * {"float": 4, "double": 8}[topic.type]
        rows[f"size{number}"], rows[f"kind{number}"], rows[f"id{number}"] = 2 + 8 + width, ord("D"), number
        rows[f"time{number}"], rows[f"values{number}"] = stamps, topic.values
    return rows


def _motors(data: FlightData) -> tuple[list[int], str]:
    """Which rotor is each motor, as indices, and what is said of it."""
    count = data["thrust_command"].values.shape[1] if "thrust_command" in data else 0
    airframe = airframe_of(data)
    if airframe.rotors != count or not count:
        return list(range(count)), "motor n is rotor n of the vehicle file"
    order, name = px4_order(airframe)
    if not name:
        return order.tolist(), "motor n is rotor n of the vehicle file; PX4 has no order for this layout"
    numbers = ", ".join(str(k + 1) for k in order)
    return order.tolist(), f"PX4's order for {name}: motors 1 to {count} are rotors {numbers} of the vehicle file"


def _px4(data: FlightData, motors: list[int]) -> list[Topic]:
    """PX4's own topics, of what the flight recorded."""
    found: list[Topic] = []

    def of(name: str, kind: str | None = None) -> Array:
        values = np.asarray(data[name].values, dtype=float)
        return values if kind is None else convert(kind, values, "rotorfault", "ned")

    def has(*names: str) -> bool:
        return all(name in data for name in names)

    if has("quaternion"):
        found.append(Topic("vehicle_attitude", (("q", 4),), of("quaternion", "quaternion")))
    if has("position", "velocity"):
        names = ("x", "y", "z", "vx", "vy", "vz", "heading")
        yaw = -of("attitude")[:, 2:] if has("attitude") else np.full((len(data["time"].values), 1), np.nan)
        values = np.hstack([of("position", "position"), of("velocity", "velocity"), yaw])
        found.append(Topic("vehicle_local_position", tuple((name, 0) for name in names), values))
    if has("position_reference", "velocity_reference"):
        names = ("x", "y", "z", "vx", "vy", "vz", "yaw")
        yaw = (
            -of("yaw_reference")[:, None] if has("yaw_reference") else np.full((len(data["time"].values), 1), np.nan)
        )
        values = np.hstack([of("position_reference", "position"), of("velocity_reference", "velocity"), yaw])
        found.append(Topic("vehicle_local_position_setpoint", tuple((name, 0) for name in names), values))
    if has("body_rates"):
        found.append(Topic("vehicle_angular_velocity", (("xyz", 3),), of("body_rates", "rates")))
    if has("controller.attitude_command"):
        angles = of("controller.attitude_command", "euler")
        found.append(Topic("vehicle_attitude_setpoint", (("q_d", 4),), _quaternions(angles)))
    if has("torque_demand"):
        found.append(Topic("vehicle_torque_setpoint", (("xyz", 3),), of("torque_demand", "rates")))
    if has("thrust_demand"):
        up = of("thrust_demand")
        found.append(Topic("vehicle_thrust_setpoint", (("xyz", 3),), np.column_stack([0 * up, 0 * up, -up])))
    if has("wind"):
        wind = of("wind", "velocity")
        found.append(Topic("wind", (("windspeed_north", 0), ("windspeed_east", 0)), wind[:, :2]))
    if has("thrust_command") and float(data.attrs.get("thrust_max", 0.0)) > 0.0:
        shares = np.full((len(data["time"].values), MOST_MOTORS), np.nan)
        used = motors[:MOST_MOTORS]
        shares[:, : len(used)] = of("thrust_command")[:, used] / float(data.attrs["thrust_max"])
        found.append(Topic("actuator_motors", (("control", MOST_MOTORS),), shares))
    return found


def _quaternions(angles: Array) -> Array:
    """Quaternions, scalar first, of roll, pitch and yaw."""
    (cr, cp, cy), (sr, sp, sy) = np.cos(0.5 * angles.T), np.sin(0.5 * angles.T)
    return np.column_stack(
        [
            cr * cp * cy + sr * sp * sy,
            sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy,
        ]
    )


def _own(data: FlightData) -> list[Topic]:
    """All signals, in double precision and in the frames of rotorfault, a topic per slot."""
    names = Names()
    found: dict[str, tuple[str, list[tuple[str, int]], list[Array]]] = {}
    fields: dict[str, Names] = {}
    for signal in signals(data):
        if signal.slot not in found:
            found[signal.slot] = (names(f"rotorfault_{signal.slot or 'flight'}"), [], [])
            fields[signal.slot] = Names()
            fields[signal.slot]("timestamp")
        _, parts, values = found[signal.slot]
        width = 0 if signal.columns == ("",) else len(signal.columns)
        parts.append((fields[signal.slot](signal.name), width))
        values.append(signal.values)
    return [Topic(name, tuple(parts), np.hstack(values), "double") for name, parts, values in found.values()]
