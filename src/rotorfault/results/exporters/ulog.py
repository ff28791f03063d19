"""A flight as a PX4 log (ULog): PX4's own topics in PX4's frames, and all signals under names of rotorfault.

Topics that PX4 has are named and filled as PX4 does, so Flight Review and PlotJuggler draw them as of any flight.
What is estimated is in ``vehicle_attitude`` and its like, the truth in those with ``_groundtruth``. Their world is
north, east, down with x taken for north, their body forward, right, down. Motors are in PX4's order where PX4 has an
airframe with rotors at those places, else in the order of the vehicle's file; the message ``rotorfault_motors`` says
which. All signals, in the frames of rotorfault, are in topics ``rotorfault_flight`` and ``rotorfault_SLOT``; their
units are in the message ``rotorfault_signals``. Format: ULog version 1, as documented by PX4.
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
from rotorfault.results.events import Event
from rotorfault.results.exporters.wanted import Names, Wanted, signals
from rotorfault.results.flight_data import FlightData

MAGIC = b"ULog\x01\x12\x35\x01"
MOST_MOTORS = 12  # of PX4's actuator_motors
MICRO = 1e6
TYPES = {"float": "<f4", "double": "<f8", "uint16_t": "<u2"}
MAV_TYPES = {3: 15, 4: 2, 6: 13, 8: 14}  # of MAVLink, by the number of rotors
LEVELS = {"fault": 3, "false_alarm": 4, "alarm": 4, "given_up": 4}  # of a log: 3 error, 4 warning, else 6 information
LONGEST = 2**16 - 64  # bytes of a message
PIECE = 60_000  # bytes of a text in pieces


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
        for key, value in _parameters(data, motors).items():
            file.write(_parameter(key, value))
        file.write(_configuration(data))
        for topic in topics:
            file.write(_message("F", _format(topic).encode()))
        for number, topic in enumerate(topics):
            file.write(_message("A", struct.pack("<BH", 0, number) + topic.name.encode()))
        rows = _rows(time, topics)
        begun = 0
        for event in wanted.events:
            until = int(np.searchsorted(time, event.time))
            file.write(rows[begun:until].tobytes())
            begun = until
            level, stamp = LEVELS.get(event.kind, 6), round(max(event.time, 0.0) * MICRO)
            file.write(_message("L", struct.pack("<BQ", level + 48, stamp) + _cut(_told(event, motors), 2000)))
        file.write(rows[begun:].tobytes())


def _told(event: Event, motors: list[int]) -> str:
    """An event in words; topics count motors, so where a rotor has another number there, both are said."""
    if event.rotor - 1 not in motors or motors[event.rotor - 1] == event.rotor - 1:
        return event.text
    return f"{event.text} (rotor {event.rotor} is motor {motors.index(event.rotor - 1) + 1})"


def _message(kind: str, body: bytes) -> bytes:
    return struct.pack("<HB", len(body), ord(kind)) + body


def _cut(text: str, most: int) -> bytes:
    """A text in no more bytes, no character of it in half."""
    return text.encode()[:most].decode(errors="ignore").encode()


def _information(key: str, text: str) -> bytes:
    """A message of information; a long text is cut, for a message has a length."""
    value = _cut(text, LONGEST - len(key))
    name = f"char[{len(value)}] {key}".encode()
    return _message("I", bytes([len(name)]) + name + value)


def _parameter(key: str, value: float) -> bytes:
    kind, form = ("int32_t", "<i") if isinstance(value, int) else ("float", "<f")
    name = f"{kind} {key}".encode()
    return _message("P", bytes([len(name)]) + name + struct.pack(form, value))


def _parameters(data: FlightData, motors: list[int]) -> dict[str, float]:
    """Parameters of PX4's that say where rotors are and how they turn, by the numbers of motors."""
    frame = airframe_of(data)
    if frame.rotors != len(motors) or not motors:
        return {}
    found: dict[str, float] = {"MAV_TYPE": MAV_TYPES.get(frame.rotors, 0), "CA_ROTOR_COUNT": frame.rotors}
    for motor, rotor in enumerate(motors):
        x, y, z = convert("position", frame.places[rotor], "rotorfault", "ned")
        # Positive in PX4 for a rotor that turns counter-clockwise, whose drag turns the body to the right.
        moment = -frame.torque_ratio * frame.yaw_signs[rotor]
        found |= {f"CA_ROTOR{motor}_{name}": float(value) for name, value in zip(
            ("PX", "PY", "PZ", "KM"), (x, y, z, moment), strict=True
        )}  # fmt: skip
    return found


def _configuration(data: FlightData) -> bytes:
    """The whole scenario as JSON, in as many pieces as it needs."""
    text = str(data.attrs.get("configuration", "")).encode("ascii", "backslashreplace")
    found = b""
    for at in range(0, len(text), PIECE):
        piece = text[at : at + PIECE]
        name = f"char[{len(piece)}] rotorfault_configuration".encode()
        found += _message("M", bytes([at > 0, len(name)]) + name + piece)
    return found


def _format(topic: Topic) -> str:
    fields = "".join(f"{topic.type}{f'[{length}]' if length else ''} {name};" for name, length in topic.fields)
    return f"{topic.name}:uint64_t timestamp;{fields}"


def _rows(time: Array, topics: list[Topic]) -> NDArray[np.void]:
    """All messages of data: for each record those of all topics, one behind the other."""
    columns: list[tuple[str, str] | tuple[str, str, tuple[int, ...]]] = []
    for number, topic in enumerate(topics):
        kind = TYPES[topic.type]
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
        width = topic.values.shape[1] * np.dtype(TYPES[topic.type]).itemsize
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

    # As in a simulation of PX4's: what is estimated, and the truth beside it.
    for what, ending in (("_estimated", ""), ("", "_groundtruth")):
        position, velocity, attitude = f"position{what}", f"velocity{what}", f"attitude{what}"
        if has(f"quaternion{what}"):
            turned = of(f"quaternion{what}", "quaternion")
            found.append(Topic(f"vehicle_attitude{ending}", (("q", 4),), turned))
        if has(position, velocity):
            names = ("x", "y", "z", "vx", "vy", "vz", "heading")
            yaw = -of(attitude)[:, 2:] if has(attitude) else np.full((len(data["time"].values), 1), np.nan)
            values = np.hstack([of(position, "position"), of(velocity, "velocity"), yaw])
            found.append(Topic(f"vehicle_local_position{ending}", tuple((name, 0) for name in names), values))
        if has(f"body_rates{what}"):
            rates = of(f"body_rates{what}", "rates")
            found.append(Topic(f"vehicle_angular_velocity{ending}", (("xyz", 3),), rates))
    if has("position_reference", "velocity_reference"):
        names = ("x", "y", "z", "vx", "vy", "vz", "yaw")
        yaw = (
            -of("yaw_reference")[:, None] if has("yaw_reference") else np.full((len(data["time"].values), 1), np.nan)
        )
        values = np.hstack([of("position_reference", "position"), of("velocity_reference", "velocity"), yaw])
        found.append(Topic("vehicle_local_position_setpoint", tuple((name, 0) for name in names), values))
    if has("controller.attitude_command"):
        angles = of("controller.attitude_command", "euler")
        found.append(Topic("vehicle_attitude_setpoint", (("q_d", 4),), _quaternions(angles)))
    most = float(data.attrs.get("thrust_max", 0.0)) * len(motors)
    if has("thrust_demand") and most > 0.0:
        up = of("thrust_demand") / most  # PX4 has it as a share of the greatest
        found.append(Topic("vehicle_thrust_setpoint", (("xyz", 3),), np.column_stack([0 * up, 0 * up, -up])))
    if has("wind"):
        wind = of("wind", "velocity")
        found.append(Topic("wind", (("windspeed_north", 0), ("windspeed_east", 0)), wind[:, :2]))
    if has("thrust_command") and float(data.attrs.get("thrust_max", 0.0)) > 0.0:
        shares = np.full((len(data["time"].values), MOST_MOTORS), np.nan)
        used = motors[:MOST_MOTORS]
        shares[:, : len(used)] = of("thrust_command")[:, used] / float(data.attrs["thrust_max"])
        found.append(Topic("actuator_motors", (("control", MOST_MOTORS),), shares))
        if has("fault_flag"):
            mask = (of("fault_flag")[:, used] > 0.5) @ (1 << np.arange(len(used)))
            fields = (("fd_motor", 0), ("motor_failure_mask", 0))
            values = np.column_stack([mask > 0, mask])
            found.append(Topic("failure_detector_status", fields, values, "uint16_t"))
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
