"""PX4's logs, of all three generations of topics, as one record.

Up to 1.12 the mixer's inputs are ``actuator_controls_0`` and its outputs pulses; from 1.14 on (1.13 with
``SYS_CTRL_ALLOC``) there are set-points of torque and thrust and ``actuator_motors``; the oldest have rates in
``sensor_combined`` alone. Geometry is ``CA_ROTOR*`` where there is any.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

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
        "vehicle_land_detected", "wind", "actuator_outputs_sim", "sensor_gyro",
    )
)  # fmt: skip
FLIP = np.array([1.0, -1.0, -1.0])  # from forward, right, down to forward, left, up
FRAMES_BY_TYPE = {2: "quad-x", 13: "hexa-x", 14: "octa-x"}  # MAV_TYPE: PX4's generic frame of so many motors
OTHER_TYPES = {
    1: "an aeroplane", 3: "a coaxial helicopter", 4: "a helicopter", 7: "an airship", 8: "a balloon", 10: "a rover",
    11: "a boat", 12: "a submarine", 15: "a tricopter with a servo", **dict.fromkeys(range(19, 26), "a VTOL"),
}  # fmt: skip
# SYS_AUTOSTART: airframes of PX4 are numbered by kind, a thousand each.
AIRFRAMES = {
    4: "quad-x", 5: "quad-plus", 6: "hexa-x", 7: "hexa-plus", 8: "octa-x", 9: "octa-plus", 11: "y6b",
    12: "octaquad-x",
}  # fmt: skip
FIRST_FUNCTION = 101  # ACTUATOR_FUNCTION of motor 1
OUTPUTS = [*(("actuator_outputs", k) for k in range(4)), *(("actuator_outputs_sim", k) for k in range(2))]
DRIVERS, MOST_OUTPUTS = ("PWM_MAIN", "PWM_AUX", "UAVCAN_EC", "SIM_GZ_EC", "HIL_ACT"), 16  # that have functions
MOST_ESCS = 8  # that a log has fields for in all versions
LIFTING = 0.5  # least share of a rotor's thrust that has to point up: cosine of 60 degrees


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
    layout, why = _layout(file)
    series = {name: one for name, one in _motion(file) if one is not None}
    series |= _commands(file, layout, remarks)
    count = 0 if layout is None else len(layout.places)
    series |= _power(file, count) if count else {}
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
    return Log(path.name, kind, layout, series, file.parameters, _notes(file, count), damage, tuple(remarks), why)


def _series(file: ULogFile, name: str, fields: Sequence[str], scale: Array | float = 1.0) -> Series | None:
    """Some fields of a topic: of its instances the first that has about as many records as any."""
    having = [
        topic for instance in range(4)
        if (topic := file.topics.get((name, instance))) is not None and len(topic.rows) and _has(topic, fields)
    ]  # fmt: skip
    most = max((len(topic.rows) * topic.rows.every for topic in having), default=0)
    for topic in having:
        if 2 * len(topic.rows) * topic.rows.every >= most:
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
            ("vehicle_angular_velocity", _indexed("xyz", 3), FLIP),
            ("sensor_combined", _indexed("gyro_rad", 3), FLIP),
            ("sensor_gyro", ("x", "y", "z"), FLIP),
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


def _power(file: ULogFile, count: int) -> dict[str, Series]:
    found = {"battery": _series(file, "battery_status", ("voltage_v", "current_a"))}
    order = _escs(file, count)
    if order:
        found["rpm"] = _series(file, "esc_status", [f"esc[{k}].esc_rpm" for k in order])
        found["current"] = _series(file, "esc_status", [f"esc[{k}].esc_current" for k in order])
    return {name: one for name, one in found.items() if one is not None}


def _escs(file: ULogFile, count: int) -> list[int]:
    """Which ESC each motor has: by their functions where these are logged, else in their order."""
    functions = _series(file, "esc_status", [f"esc[{k}].actuator_function" for k in range(MOST_ESCS)])
    if functions is not None and len(functions.values):
        last = functions.values[-1].astype(int).tolist()
        wanted = [FIRST_FUNCTION + k for k in range(count)]
        if all(one in last for one in wanted):
            return [last.index(one) for one in wanted]
        if any(last):
            return []
    return list(range(count))


def _layout(file: ULogFile) -> tuple[Layout | None, str]:
    """Geometry by parameters, else the generic frame of the airframe or the type; and why there is none."""
    parameters = file.parameters
    kind, start = parameters.get("MAV_TYPE", 0.0), parameters.get("SYS_AUTOSTART", 0.0)
    if kind in OTHER_TYPES:
        return None, f"MAV_TYPE is {kind:.0f}, {OTHER_TYPES[int(kind)]}: only multirotors can be diagnosed"
    count = parameters.get("CA_ROTOR_COUNT", 0.0)
    if count > 0.0 and parameters.get("SYS_CTRL_ALLOC", 1.0):
        if not 3 <= count <= MOST_ROTORS:
            return None, f"CA_ROTOR_COUNT is {count:.0f}: only multirotors of 3 to {MOST_ROTORS} can be diagnosed"
        return _by_parameters(parameters, int(count))
    frame = AIRFRAMES.get(int(start) // 1000) if np.isfinite(start) else None
    if frame is not None:
        assumed = int(start) % 1000 > 1  # not the generic one, whose geometry is known
        return named_layout(frame, f"{frame}, for SYS_AUTOSTART is {start:.0f}", assumed), ""
    frame = FRAMES_BY_TYPE.get(int(kind)) if np.isfinite(kind) else None
    if frame is not None:
        return named_layout(frame, f"PX4's generic {frame}, for MAV_TYPE is {kind:.0f}", assumed=True), ""
    if file.topics:
        return named_layout("quad-x", "PX4's generic quad-x; the log does not name its type", assumed=True), ""
    return None, ""


def _by_parameters(parameters: Mapping[str, float], count: int) -> tuple[Layout | None, str]:
    """Where CA_ROTOR* have the rotors."""

    def of(word: str, default: float) -> Array:
        return np.array([parameters.get(f"CA_ROTOR{k}_{word}", default) for k in range(count)])

    axes = np.column_stack([of("AX", 0.0), of("AY", 0.0), of("AZ", -1.0)])
    places, turns = np.column_stack([of("PX", 0.0), -of("PY", 0.0)]), of("KM", 0.05)
    if not np.isfinite(np.hstack([axes, places, turns[:, None]])).all():
        return None, "CA_ROTOR parameters are no numbers"
    lift = -axes[:, 2] / np.maximum(np.linalg.norm(axes, axis=1), 1e-9)
    if lift.min() < LIFTING:
        weak = int(np.argmin(lift)) + 1
        return None, f"CA_ROTOR{weak - 1} does not pull up: only multirotors can be diagnosed"
    longest = float(np.hypot(*places.T).max())
    if not 1e-3 < longest < 1e3:
        return None, "CA_ROTOR parameters put all rotors at one place"
    yaw = np.where(turns > 0.0, -1.0, np.where(turns < 0.0, 1.0, 0.0))
    return Layout(places / longest, yaw, "CA_ROTOR parameters"), ""


def _commands(file: ULogFile, layout: Layout | None, remarks: list[str]) -> dict[str, Series]:
    """Commands that were asked for, and what was sent to the motors."""
    found: dict[str, Series] = {}
    if layout is None:
        return found
    count = len(layout.places)
    output = _output(file, count)
    asked = _asked(file, layout)
    if output is not None and output.stopped.any():
        remarks.append("a motor that is stopped (no number) is taken as asked for as much as the others in the mean")
    if output is not None:
        found["output"] = output.sent
    if asked is not None and (output is None or asked.rate >= output.sent.rate or count == 4):
        found["command"] = asked
        remarks.append("commands are rebuilt from set-points of torque and thrust")
    elif output is not None:
        found["command"] = output.asked
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
    return Series(controls.time, mixed(layout, values[:, :3] * FLIP, values[:, 3], "px4 mixer"))


def _finite(series: Series) -> tuple[Array, Array]:
    good = np.isfinite(series.values).all(axis=1) & np.isfinite(series.time)
    order = np.argsort(series.time[good], kind="stable")
    return series.time[good][order], series.values[good][order]


class _Output(NamedTuple):
    """What was sent to the motors, as shares of thrust."""

    sent: Series  # 0 where a motor is stopped
    stopped: NDArray[np.bool_]  # (n, N) while others run

    @property
    def asked(self) -> Series:
        """The same, with the mean of the others where a motor is stopped: it is no longer asked."""
        values = self.sent.values.copy()
        running = np.maximum((~self.stopped).sum(axis=1), 1)
        mean = np.where(self.stopped, 0.0, values).sum(axis=1) / running
        values[self.stopped] = np.repeat(mean[:, None], values.shape[1], axis=1)[self.stopped]
        return Series(self.sent.time, values)


def _stopped(file: ULogFile, count: int) -> _Output | None:
    """`actuator_motors`, in which a motor without a number is stopped."""
    motors = _series(file, "actuator_motors", _indexed("control", min(count, 12))) if count else None
    if motors is None:
        return None
    none = ~np.isfinite(motors.values)
    running = np.nan_to_num(motors.values, nan=0.0) > 0.0
    stopped = none & running.any(axis=1, keepdims=True)
    return _Output(Series(motors.time, np.where(none, 0.0, motors.values)), stopped)


def _output(file: ULogFile, count: int) -> _Output | None:
    """What was sent to the motors: as thrust where that is logged, else by their pulses."""
    if (motors := _stopped(file, count)) is not None:
        return motors
    best: Series | None = None
    fields = [f"output[{k}]" for k in _channels(file.parameters, count)]
    for name, instance in OUTPUTS:  # of the output drivers, the one whose channels move like motors
        topic = file.topics.get((name, instance))
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
    sent = Series(best.time, share_of(signal, curve))
    return _Output(sent, np.zeros(sent.values.shape, dtype=bool))


def _channels(parameters: Mapping[str, float], count: int) -> list[int]:
    """The output of each motor, from 0: by the functions of the driver that has all motors, else in their order."""
    for family in DRIVERS:
        function = {parameters.get(f"{family}_FUNC{k + 1}", 0.0): k for k in range(MOST_OUTPUTS - 1, -1, -1)}
        if all(FIRST_FUNCTION + k in function for k in range(count)):
            return [function[FIRST_FUNCTION + k] for k in range(count)]
    return list(range(min(count, MOST_OUTPUTS)))


def _notes(file: ULogFile, count: int) -> tuple[Note, ...]:
    notes = [Note(time * 1e-6, text) for time, text in file.texts]
    if (motors := _stopped(file, count)) is not None:
        twice = motors.stopped[:-1] & motors.stopped[1:]
        for k in np.flatnonzero(twice.any(axis=0)):
            begin = float(motors.sent.time[int(np.argmax(twice[:, k]))])
            text = f"motor {k + 1} is stopped by the allocation, others run"
            notes.append(Note(begin, text, True, int(k) + 1, True))
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
