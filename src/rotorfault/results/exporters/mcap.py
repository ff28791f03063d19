"""A flight as MCAP: messages that Foxglove draws, all signals by slot, events as a log; JSON with schemas.

Foxglove's frames are right-handed with z up, as ours are, so nothing is converted: ``world`` has x forward, y left, z
up, ``vehicle`` is the body. The 3-D messages come at no more than 100 Hz; signals come with every record.
"""

from __future__ import annotations

import json
import math
import warnings
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from rotorfault.base.errors import FileWarning, missing_extra
from rotorfault.base.files import write_atomically
from rotorfault.base.progress import Bar
from rotorfault.maths.arrays import Array
from rotorfault.results.exporters.foxglove import layout, scene, schema, thrust_arrows
from rotorfault.results.exporters.wanted import Names, Signal, Wanted, signals, texts
from rotorfault.results.flight_data import FlightData
from rotorfault.results.flown import vehicle_file_of

NANO = 1e9
BLOCK = 2000  # records that are turned into text at once
RATE = 100.0  # Hz: of messages that are drawn in 3-D
# Of foxglove.Log: 4 an error, 3 a warning; all else is 2, information.
LEVELS = {"fault": 4, "false_alarm": 3, "alarm": 3, "given_up": 3}


def write(data: FlightData, path: Path, wanted: Wanted) -> None:
    """Write a flight as MCAP, and a layout for Foxglove beside it.

    Parameters
    ----------
    data : FlightData
    path : Path
    wanted : Wanted

    Raises
    ------
    MissingExtraError
        Without the library mcap.
    """
    try:
        from mcap.writer import Writer
    except ModuleNotFoundError:
        raise missing_extra("MCAP needs the library mcap", "export") from None
    time = np.asarray(data["time"].values, dtype=float)
    topics = _topics(data)
    with path.open("wb") as file, Bar("writing", len(time), "records") as bar:
        writer = Writer(file)
        writer.start(profile="", library="rotorfault")
        writer.add_metadata("rotorfault", texts(data))
        numbers: dict[str, int] = {}

        def send(topic: str, name: str, content: dict[str, Any] | str, at: float) -> None:
            if topic not in numbers:
                about = json.dumps(topics[topic] if topic in topics else schema(name)).encode()
                number = writer.register_schema(name=name, encoding="jsonschema", data=about)
                numbers[topic] = writer.register_channel(topic=topic, message_encoding="json", schema_id=number)
            stamp = round(at * NANO)
            text = content if isinstance(content, str) else _json(content)
            writer.add_message(numbers[topic], log_time=stamp, data=text.encode(), publish_time=stamp)

        if len(time):
            for topic, name, content, at in _drawn(data, time):
                send(topic, name, content, at)
        found = {topic: _messages(time, members) for topic, members in _fields(data).items()}
        for record, at in enumerate(time):
            for topic, messages in found.items():
                send(topic, f"rotorfault{topic.replace('/', '.')}", next(messages), float(at))
            bar.update(record + 1)
        for event in wanted.events:
            level = LEVELS.get(event.kind, 2)
            log = {
                "timestamp": _stamp(event.time),
                "level": level,
                "message": event.text,
                "name": event.kind,
                "file": "",
                "line": 0,
            }
            send("/events", "foxglove.Log", log, event.time)
        writer.finish()  # type: ignore[no-untyped-call]
    beside = wanted.path.with_name(f"{wanted.path.stem}.foxglove.json")
    text = json.dumps(layout(_fields(data)), indent=1)
    if beside.exists() and (not beside.is_file() or beside.read_bytes() != text.encode()):
        kept = f"{beside}: was there already and is kept; move it away and export again for the layout of this flight"
        warnings.warn(kept, FileWarning, stacklevel=2)
        return
    write_atomically(beside, lambda temporary: temporary.write_text(text, encoding="utf-8"))
    wanted.companions.append(beside)


def _stamp(time: float) -> dict[str, int]:
    nanoseconds = round(time * NANO)
    return {"sec": nanoseconds // 10**9, "nsec": nanoseconds % 10**9}


def _fields(data: FlightData) -> dict[str, dict[str, Signal]]:
    """Signals by topic and by the name that their field has there."""
    topics = Names()
    found: dict[str, dict[str, Signal]] = {}
    slots: dict[str, tuple[str, Names]] = {}
    for signal in signals(data):
        if signal.slot not in slots:
            slots[signal.slot] = (f"/{topics(signal.slot or 'flight')}", Names())
            slots[signal.slot][1]("timestamp")
            found[slots[signal.slot][0]] = {}
        topic, names = slots[signal.slot]
        found[topic][names(signal.name)] = signal
    return found


def _json(content: Any) -> str:
    return json.dumps(content, allow_nan=False, separators=(",", ":"))


def _messages(time: Array, members: Mapping[str, Signal]) -> Iterator[str]:
    """The messages of a topic, one per record, null where a number is not finite.

    Their numbers are put into one template: to make each message of its parts would take four times as long.
    """
    keys = {key: _keys(signal) if signal.columns != ("",) else [] for key, signal in members.items()}
    holes: dict[str, Any] = {"timestamp": {"sec": 0, "nsec": 0}}
    holes |= {key: dict.fromkeys(inner, 0) if inner else 0 for key, inner in keys.items()}
    # Keys are letters, digits and underscores, so each zero that follows a colon is a number.
    template = _json(holes).replace(":0", ":%s")
    for first in range(0, len(time), BLOCK):
        part = slice(first, first + BLOCK)
        stamps = [_stamp(at) for at in time[part].tolist()]
        columns = [[str(stamp[key]) for stamp in stamps] for key in ("sec", "nsec")]
        columns += [_numbers(column) for signal in members.values() for column in signal.values[part].T]
        for row in zip(*columns, strict=True):
            yield template % row


def _numbers(values: Array) -> list[str]:
    """Numbers as JSON has them, to the last bit."""
    if not np.isfinite(values).all():
        return [repr(value) if math.isfinite(value) else "null" for value in values.tolist()]
    if (values == values[0]).all() and not np.signbit(values).any():
        return [repr(float(values[0]))] * len(values)  # a flag, or what nothing changes
    return list(map(repr, values.tolist()))


def _keys(signal: Signal) -> list[str]:
    names = Names()
    return [names(column) for column in signal.columns]


def _topics(data: FlightData) -> dict[str, dict[str, Any]]:
    """A JSON schema per topic of signals, with units and meanings."""
    number = {"type": ["number", "null"]}
    found = {}
    for topic, members in _fields(data).items():
        properties: dict[str, Any] = {"timestamp": schema("time")}
        for key, signal in members.items():
            text = f"{signal.meaning} [{signal.unit}]" + (f"; {signal.frame}" if signal.frame else "")
            if signal.columns == ("",):
                properties[key] = {**number, "description": text, "unit": signal.unit}
            else:
                inner = {name: {**number, "unit": signal.unit} for name in _keys(signal)}
                properties[key] = {"type": "object", "description": text, "properties": inner}
        found[topic] = {"title": topic, "type": "object", "properties": properties}
    return found


def _drawn(data: FlightData, time: np.ndarray[Any, Any]) -> Iterator[tuple[str, str, dict[str, Any], float]]:
    """What Foxglove draws: the vehicle once, then its pose, its thrusts and where it should be."""
    file = vehicle_file_of(data)
    if file is not None:
        yield "/vehicle", "foxglove.SceneUpdate", scene(file, _stamp(float(time[0]))), float(time[0])
    step = float(time[-1] - time[0]) / max(len(time) - 1, 1)
    every = max(1, round(1.0 / (RATE * step))) if step > 0.0 else 1
    for record in range(0, len(time), every):
        at = float(time[record])
        position, quaternion = _row(data, "position", record), _row(data, "quaternion", record)
        if position is not None and quaternion is not None:
            w, x, y, z = quaternion
            yield (
                "/tf",
                "foxglove.FrameTransform",
                {
                    "timestamp": _stamp(at),
                    "parent_frame_id": "world",
                    "child_frame_id": "vehicle",
                    "translation": dict(zip("xyz", position, strict=True)),
                    "rotation": {"x": x, "y": y, "z": z, "w": w},
                },
                at,
            )
        if (wished := _row(data, "position_reference", record)) is not None:
            turned = 0.5 * float(data["yaw_reference"].values[record]) if "yaw_reference" in data else 0.0
            orientation = {"x": 0.0, "y": 0.0, "z": float(np.sin(turned)), "w": float(np.cos(turned))}
            pose = {"position": dict(zip("xyz", wished, strict=True)), "orientation": orientation}
            yield "/desired", "foxglove.PoseInFrame", {"timestamp": _stamp(at), "frame_id": "world", "pose": pose}, at
        thrust = _row(data, "thrust", record)
        if file is not None and thrust is not None and len(thrust) == len(file.rotor):
            yield "/thrust", "foxglove.SceneUpdate", thrust_arrows(file, thrust, _stamp(at)), at


def _row(data: FlightData, name: str, record: int) -> list[float] | None:
    """The values of a signal at a record, if there are any and all are finite."""
    if name not in data:
        return None
    values = np.asarray(data[name].values[record], dtype=float)
    return [float(value) for value in values] if np.isfinite(values).all() else None
