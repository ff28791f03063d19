"""A log of PX4 (ULog), as Flight Review and PlotJuggler read it.

Where PX4 has a topic for something, it is written as that, in PX4's frames (north, east, down; forward, right, down),
x being north, and with PX4's numbers of motors. Those topics have single precision, as in PX4. What was estimated is
in the topics of PX4's estimator, what is true in those with ``_groundtruth``. What a flight does not know, such as a
battery, is not there.

Besides, each topic of rotorfault is there as ``rotorfault_TOPIC``, with all signals, in rotorfault's frames, with its
numbers of rotors, in double precision; units and meanings are information messages.
"""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rotorfault.base.files import in_folder, write_atomically
from rotorfault.base.plain_text import one_line
from rotorfault.base.progress import Bar
from rotorfault.maths.arrays import Array
from rotorfault.maths.geometry import Vec3
from rotorfault.maths.rotation import Quat
from rotorfault.model.conventions import convert
from rotorfault.results.airframe import Airframe, px4_order
from rotorfault.results.exporters import ulog_text
from rotorfault.results.exporters.content import SERIOUS, Column, Content, by_topic, identifiers, number_columns
from rotorfault.results.exporters.ulog_text import MOST_FIELDS, Topic

BLOCK = 20000  # records that are turned into bytes at once
MOST_MOTORS = 12  # of PX4's topic actuator_motors
MAV_TYPES = {3: 15, 4: 2, 6: 13, 8: 14, 12: 29}  # of MAVLink, by number of rotors
LONGEST = 60  # characters of a name of a topic or field
ATTITUDES = ("controller.attitude_command", "controller.attitude_demand")
"""Signals with the attitude that a controller wants, the one that it tracks first."""


def write_ulog(content: Content, path: Path) -> None:
    """Write a flight as a log of PX4.

    Parameters
    ----------
    content : Content
    path : Path
    """
    stamps = np.round(content.time * 1e6).astype("<u8")
    order, airframe = px4_order(content.airframe)
    own, units = _own(content, stamps)
    topics = [*_px4(content, stamps, order), *own]
    definitions = [ulog_text.header(), *_about(content, order, airframe), *units]
    definitions += [ulog_text.parameter(key, value) for key, value in _parameters(content.airframe, order).items()]
    definitions += [ulog_text.definition(topic) for topic in topics]
    definitions += [ulog_text.subscription(topic, number) for number, topic in enumerate(topics)]
    texts = [
        (
            round(1e6 * event.time),
            ulog_text.text(round(1e6 * event.time), 4 if event.kind in SERIOUS else 6, event.text),
        )
        for event in content.events
    ]

    def write(temporary: Path) -> None:
        with temporary.open("wb") as file:
            file.write(b"".join(definitions))
            for first in range(0, len(stamps), BLOCK):
                block = slice(first, min(first + BLOCK, len(stamps)))
                _write_block(file, ulog_text.records(topics, block), stamps[block], texts)
                bar.update(block.stop)
            file.write(b"".join(message for _, message in texts))

    with Bar("writing", len(stamps), "records") as bar:
        write_atomically(in_folder(path), write)


def _write_block(
    file: io.BufferedWriter, rows: NDArray[np.uint8], stamps: NDArray[np.uint64], texts: list[tuple[int, bytes]]
) -> None:
    """Records, and between them what is said; texts that are written are taken out of the list."""
    written = 0
    while texts and texts[0][0] <= stamps[-1]:
        time, message = texts.pop(0)
        until = int(np.searchsorted(stamps, time))
        file.write(rows[written:until].tobytes())
        file.write(message)
        written = until
    file.write(rows[written:].tobytes())


def _about(content: Content, order: NDArray[np.intp], airframe: str) -> list[bytes]:
    """What is said of the whole file."""
    attributes = content.attributes()
    whose = f"PX4's {airframe}" if airframe else "the vehicle file's, for PX4 has no airframe with rotors there"
    motors = ", ".join(f"motor {k} is rotor {rotor + 1}" for k, rotor in enumerate(order, start=1))
    said = {
        "sys_name": "rotorfault",
        "ver_hw": "SIMULATION",
        "ver_sw": attributes.get("version", ""),
        "rotorfault_title": content.title,
        "rotorfault_frames": "topics of PX4: NED and FRD, x is north; rotorfault_*: x forward, y left, z up",
        "rotorfault_motor_order": f"topics of PX4: {motors or 'none'} (order is {whose})",
    }
    names = [key for key in attributes if key not in ("configuration", "title")]
    said |= {
        f"rotorfault_{word}": one_line(attributes[key])
        for word, key in zip(identifiers(names, LONGEST, lower=True), names, strict=True)
    }
    return [
        *(ulog_text.information(key, value) for key, value in said.items()),
        ulog_text.long_information("rotorfault_configuration", attributes.get("configuration", "")),
    ]


def _parameters(airframe: Airframe, order: NDArray[np.intp]) -> dict[str, int | float]:
    """Parameters of PX4 that say the same as the vehicle file."""
    found: dict[str, int | float] = {"MAV_TYPE": MAV_TYPES.get(airframe.count, 0), "CA_AIRFRAME": 0}
    found["CA_ROTOR_COUNT"] = airframe.count
    for motor, rotor in enumerate(order):
        x, y, z = convert("position", airframe.places[rotor], "rotorfault", "ned")
        # PX4 counts a rotor that turns counter-clockwise as positive: its drag turns the body to the right.
        moment = -airframe.torque_ratio * airframe.yaw_signs[rotor]
        words = {"PX": x, "PY": y, "PZ": z, "KM": moment}
        found |= {f"CA_ROTOR{motor}_{word}": float(value) for word, value in words.items()}
    return found


def _px4(content: Content, stamps: NDArray[np.uint64], order: NDArray[np.intp]) -> list[Topic]:
    """What PX4 has topics for."""
    both = {"timestamp": stamps, "timestamp_sample": stamps}
    topics = []
    for ending, what in (("", "_estimated"), ("_groundtruth", "")):
        attitude = {"q": _ned(content, "quaternion", f"quaternion{what}")}
        rates = {"xyz": _ned(content, "rates", f"body_rates{what}")}
        topics += [
            Topic(f"vehicle_attitude{ending}", both | attitude),
            Topic(f"vehicle_angular_velocity{ending}", both | rates),
            Topic(f"vehicle_local_position{ending}", both | _local_position(content, what)),
        ]
    topics.append(Topic("vehicle_local_position_setpoint", {"timestamp": stamps} | _wanted(content)))
    for signal in ATTITUDES:
        if signal in content.data:
            topics.append(
                Topic("vehicle_attitude_setpoint", {"timestamp": stamps} | _wanted_attitude(content, signal))
            )
            break
    flags = content.values("fault_flag")
    if flags.shape[1] == len(order) and len(order) <= MOST_MOTORS:
        share = content.values("thrust_command")[:, order] / content.airframe.thrust_max
        control = np.full((len(stamps), MOST_MOTORS), np.nan, dtype="<f4")
        control[:, : len(order)] = share
        mask = ((flags[:, order] > 0.5) @ (1 << np.arange(len(order)))).astype("<u2")
        reversible = np.full(len(stamps), (1 << len(order)) - 1 if _reversible(content) else 0, dtype="<u2")
        topics += [
            Topic("actuator_motors", both | {"reversible_flags": reversible, "control": control}),
            Topic(
                "failure_detector_status",
                {"timestamp": stamps, "fd_motor": mask > 0, "motor_failure_mask": mask},
            ),
        ]
    return topics


def _reversible(content: Content) -> bool:
    return float(content.data.attrs.get("thrust_min", 0.0)) < 0.0


def _ned(content: Content, kind: str, signal: str) -> Array:
    """A signal in PX4's frames, in single precision."""
    return _single(convert(kind, content.values(signal), "rotorfault", "ned"))


def _single(values: Array) -> Array:
    found: Array = np.asarray(values).astype("<f4")
    return found


def _components(names: str, values: Array) -> dict[str, Array]:
    return {name: values[:, k] for k, name in enumerate(names.split())}


def _local_position(content: Content, what: str) -> dict[str, Any]:
    count = len(content.time)
    q = content.values(f"quaternion{what}").T
    yaw = np.arctan2(2.0 * (q[0] * q[3] + q[1] * q[2]), 1.0 - 2.0 * (q[2] ** 2 + q[3] ** 2))
    return {
        **{name: np.ones(count, dtype=bool) for name in ("xy_valid", "z_valid", "v_xy_valid", "v_z_valid")},
        **_components("x y z", _ned(content, "position", f"position{what}")),
        **_components("vx vy vz", _ned(content, "velocity", f"velocity{what}")),
        "heading": _single(-yaw),
    }


def _wanted(content: Content) -> dict[str, Any]:
    yaw = content.values("yaw_reference")
    return {
        **_components("x y z", _ned(content, "position", "position_reference")),
        "yaw": _single(-((yaw + np.pi) % (2.0 * np.pi) - np.pi)),
        **_components("vx vy vz", _ned(content, "velocity", "velocity_reference")),
        "acceleration": _ned(content, "acceleration", "acceleration_reference"),
    }


def _wanted_attitude(content: Content, signal: str) -> dict[str, Any]:
    q = Quat.from_euler(Vec3(*content.values(signal).T))
    wanted = convert("quaternion", np.stack([q.w, q.x, q.y, q.z], axis=1), "rotorfault", "ned")
    most = content.airframe.thrust_max * max(content.airframe.count, 1)
    thrust = np.zeros((len(content.time), 3))
    thrust[:, 2] = -content.values("thrust_demand") / most
    return {"q_d": _single(wanted), "thrust_body": _single(thrust)}


def _own(content: Content, stamps: NDArray[np.uint64]) -> tuple[list[Topic], list[bytes]]:
    """All signals as they were recorded, and what they mean."""
    topics, abouts = [], []
    found: list[tuple[str, list[Column]]] = []
    for topic, members in by_topic(number_columns(content.data)).items():
        parts = [members[at : at + MOST_FIELDS] for at in range(0, len(members), MOST_FIELDS)]
        found += [(f"rotorfault_{topic}", part) for part in parts]
    words = identifiers((topic for topic, _ in found), LONGEST, lower=True)
    for word, (_, members) in zip(words, found, strict=True):
        names = ["timestamp", *(column.field for column in members)]
        fields: dict[str, NDArray[Any]] = {"timestamp": stamps}
        for name, column in zip(identifiers(names, LONGEST, lower=True)[1:], members, strict=True):
            fields[name] = _as_ulog(column.values)
            abouts.append(ulog_text.information(f"about.{word}.{name}", column.about(content.units)))
        topics.append(Topic(word, fields))
    return topics, abouts


def _as_ulog(values: NDArray[Any]) -> NDArray[Any]:
    """Numbers in a type that ULog has: truth values as they are, others in double precision."""
    return np.asarray(values, dtype="|b1" if values.dtype.kind == "b" else "<f8")
