"""PX4's logs, of all three generations of topics, as one record.

Up to 1.12 the mixer's inputs are ``actuator_controls_0`` and its outputs pulses; from 1.14 on (1.13 with
``SYS_CTRL_ALLOC``) there are set-points of torque and thrust and ``actuator_motors``; the oldest have rates in
``sensor_combined`` alone. Geometry is ``CA_ROTOR*`` where there is any.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from rotorfault.logs.commands import mixed, share_of_pulse
from rotorfault.logs.log import Damage, Layout, Log, Note, Series, named_layout
from rotorfault.logs.ulog import Topic, ULogFile, read_ulog
from rotorfault.maths.arrays import Array
from rotorfault.model.thrust_curve import share_of
from rotorfault.model.vehicle import MOST_ROTORS

WANTED = dict.fromkeys(
    (
        "actuator_controls_0", "actuator_outputs", "actuator_motors", "vehicle_torque_setpoint",
        "vehicle_thrust_setpoint", "vehicle_angular_velocity", "sensor_combined", "vehicle_attitude",
        "vehicle_local_position", "vehicle_acceleration", "esc_status", "failure_detector_status", "battery_status",
        "vehicle_land_detected", "wind",
    )
)  # fmt: skip
FLIP = np.array([1.0, -1.0, -1.0])  # from forward, right, down to forward, left, up
FRAMES_BY_TYPE = {2: "quad-x", 13: "hexa-x", 14: "octa-x"}  # MAV_TYPE: PX4's generic frame of so many motors
PLUS = {5001: "quad-plus", 7001: "hexa-plus", 9001: "octa-plus"}


def read_px4_log(path: Path) -> Log:
    """A ULog as a `Log`.

    Parameters
    ----------
    path : Path

    Raises
    ------
    InputError
        If it cannot be opened.
    """
    file = read_ulog(path, WANTED)
    remarks: list[str] = []
    layout = _layout(file)
    series = {name: one for name, one in _motion(file) if one is not None}
    series |= _commands(file, layout, remarks)
    series |= _power(file)
    if layout is not None and layout.assumed:
        remarks.append(f"motor places are assumed: {layout.source}")
    generation = (
        "torque set-points" if ("vehicle_torque_setpoint", 0) in file.topics
        else "actuator controls" if ("actuator_controls_0", 0) in file.topics else "no set-points"
    )  # fmt: skip
    damage = Damage(file.lost, file.reason)
    for topic in file.topics.values():
        if topic.rows.every > 1:
            remarks.append(f"{topic.name}: one of {topic.rows.every} records is used, the log being long")
    kind = f"PX4 ULog with {generation}"
    return Log(path.name, kind, layout, series, file.parameters, _notes(file), damage, tuple(remarks))


def _series(file: ULogFile, name: str, fields: Sequence[str], scale: Array | float = 1.0) -> Series | None:
    """Some fields of a topic's first instance that has them."""
    for instance in range(4):
        topic = file.topics.get((name, instance))
        if topic is not None and len(topic.rows) and _has(topic, fields):
            table = topic.rows.table()
            with np.errstate(invalid="ignore", over="ignore"):
                values = np.column_stack([table[field].astype(float) for field in fields]) * scale
            return Series(table["timestamp"].astype(float) * 1e-6, values)
    return None


def _has(topic: Topic, fields: Sequence[str]) -> bool:
    names = topic.rows.dtype.names or ()
    return all(field in names and topic.rows.dtype[field].kind in "fiu" for field in fields)


def _indexed(name: str, count: int) -> list[str]:
    return [f"{name}[{k}]" for k in range(count)]


def _motion(file: ULogFile) -> list[tuple[str, Series | None]]:
    def first(*choices: tuple[str, Sequence[str], Array | float]) -> Series | None:
        return next((one for choice in choices if (one := _series(file, *choice)) is not None), None)

    turned = np.array([1.0, 1.0, -1.0, -1.0])
    return [
        ("rates", first(
            ("vehicle_angular_velocity", _indexed("xyz", 3), FLIP), ("sensor_combined", _indexed("gyro_rad", 3), FLIP)
        )),
        ("attitude", first(("vehicle_attitude", _indexed("q", 4), turned))),
        ("position", first(("vehicle_local_position", ("x", "y", "z"), FLIP))),
        ("velocity", first(("vehicle_local_position", ("vx", "vy", "vz"), FLIP))),
        ("specific_force", first(
            ("sensor_combined", _indexed("accelerometer_m_s2", 3), FLIP),
            ("vehicle_acceleration", _indexed("xyz", 3), FLIP),
        )),
        ("landed", first(("vehicle_land_detected", ("landed",), 1.0))),
        ("wind", first(("wind", ("windspeed_north", "windspeed_east"), np.array([1.0, -1.0])))),
    ]  # fmt: skip


def _power(file: ULogFile) -> dict[str, Series]:
    found = {
        "battery": _series(file, "battery_status", ("voltage_v", "current_a")),
        "rpm": _series(file, "esc_status", [f"esc[{k}].esc_rpm" for k in range(8)]),
        "current": _series(file, "esc_status", [f"esc[{k}].esc_current" for k in range(8)]),
    }
    return {name: one for name, one in found.items() if one is not None}


def _layout(file: ULogFile) -> Layout | None:
    """Geometry by parameters, else the generic frame of the vehicle's type."""
    parameters = file.parameters
    count = parameters.get("CA_ROTOR_COUNT", 0.0)
    if 3 <= count <= MOST_ROTORS and parameters.get("SYS_CTRL_ALLOC", 1.0):
        rows = [
            (parameters.get(f"CA_ROTOR{k}_PX", 0.0), -parameters.get(f"CA_ROTOR{k}_PY", 0.0))
            for k in range(int(count))
        ]
        places, turns = np.array(rows), [parameters.get(f"CA_ROTOR{k}_KM", 0.05) for k in range(int(count))]
        longest = float(np.hypot(*places.T).max())
        if np.isfinite(places).all() and 1e-3 < longest < 1e3:
            return Layout(places / longest, np.where(np.array(turns) > 0.0, -1.0, 1.0), "CA_ROTOR parameters")
    start = parameters.get("SYS_AUTOSTART", 0.0)
    if start in PLUS:
        return named_layout(PLUS[int(start)], f"SYS_AUTOSTART {start:.0f}")
    kind = parameters.get("MAV_TYPE")
    frame = FRAMES_BY_TYPE.get(int(kind)) if kind is not None and np.isfinite(kind) else None
    if frame is not None:
        return named_layout(frame, f"PX4's generic {frame}, for MAV_TYPE is {kind:.0f}", assumed=True)
    if file.topics:
        return named_layout("quad-x", "PX4's generic quad-x; the log does not name its type", assumed=True)
    return None


def _commands(file: ULogFile, layout: Layout | None, remarks: list[str]) -> dict[str, Series]:
    """Commands that were asked for, and what was sent to the motors."""
    found: dict[str, Series] = {}
    if layout is None:
        return found
    count = len(layout.places)
    output = _output(file, count)
    asked = _asked(file, layout)
    if output is not None:
        found["output"] = output
    if asked is not None and (output is None or asked.rate >= output.rate or count == 4):
        found["command"] = asked
        remarks.append("commands are rebuilt from set-points of torque and thrust")
    elif output is not None:
        found["command"] = output
        remarks.append("commands are those logged of the motors")
    return found


def _asked(file: ULogFile, layout: Layout) -> Series | None:
    torque = _series(file, "vehicle_torque_setpoint", _indexed("xyz", 3), FLIP)
    thrust = _series(file, "vehicle_thrust_setpoint", ("xyz[2]",), -1.0)
    if torque is not None and thrust is not None:
        thrust = Series(*_finite(thrust))
        if len(thrust.time) > 1:
            up = thrust.at(torque.time)[:, 0]
            return Series(torque.time, mixed(layout, torque.values, up, "px4"))
    controls = _series(file, "actuator_controls_0", _indexed("control", 4))
    if controls is None:
        return None
    values = controls.values
    return Series(controls.time, mixed(layout, values[:, :3] * FLIP, values[:, 3], "px4"))


def _finite(series: Series) -> tuple[Array, Array]:
    good = np.isfinite(series.values).all(axis=1) & np.isfinite(series.time)
    order = np.argsort(series.time[good], kind="stable")
    return series.time[good][order], series.values[good][order]


def _output(file: ULogFile, count: int) -> Series | None:
    """What was sent to the motors, as shares of thrust; a motor that is stopped has 0."""
    if (motors := _series(file, "actuator_motors", _indexed("control", min(count, 12)))) is not None:
        return Series(motors.time, np.nan_to_num(motors.values, nan=0.0))
    best: Series | None = None
    for instance in range(4):  # of the output drivers, the one whose channels move like motors
        topic = file.topics.get(("actuator_outputs", instance))
        fields = _indexed("output", min(count, 16))
        if topic is None or not len(topic.rows) or not _has(topic, fields):
            continue
        table = topic.rows.table()
        with np.errstate(invalid="ignore", over="ignore"):
            values = np.column_stack([table[field].astype(float) for field in fields])
        if np.isfinite(values).all() and (best is None or values.std() > best.values.std()):
            best = Series(table["timestamp"].astype(float) * 1e-6, values)
    if best is None:
        return None
    low, high = file.parameters.get("PWM_MIN", 1000.0), file.parameters.get("PWM_MAX", 2000.0)
    if best.values.max(initial=0.0) <= 1.0:
        signal = np.clip(best.values, 0.0, 1.0)  # of simulated motors
    elif "CA_ROTOR_COUNT" in file.parameters and best.values.max(initial=0.0) <= 1001.0:
        signal = share_of_pulse(best.values, 0.0, 1000.0)  # of a simulation
    else:
        signal = share_of_pulse(best.values, low, high)
    curve = min(max(file.parameters.get("THR_MDL_FAC", 0.0), 0.0), 1.0)
    return Series(best.time, share_of(signal, curve))


def _notes(file: ULogFile) -> tuple[Note, ...]:
    notes = [Note(time * 1e-6, text) for time, text in file.texts]
    for mask_name in ("motor_failure_mask", "fd_motor"):
        status = _series(file, "failure_detector_status", (mask_name,))
        if status is None or not (on := status.values[:, 0] > 0.5).any():
            continue
        first = int(np.argmax(on))
        mask = int(status.values[first, 0]) if mask_name == "motor_failure_mask" else 0
        motor = mask.bit_length() if mask and mask & (mask - 1) == 0 else None
        text = f"failure detector: motor {motor}" if motor else "failure detector: a motor"
        notes.append(Note(float(status.time[first]), text, True, motor))
        break
    alarms = (re.search(r"[Mm]otor (\d+).*fail", note.text) for note in notes)
    return tuple(
        note if match is None else note._replace(alarm=True, motor=int(match[1][:3]))
        for note, match in zip(notes, alarms, strict=True)
    )
