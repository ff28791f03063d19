"""ArduPilot's dataflash logs as one record.

What the motors were asked for is rebuilt from ``RATE.ROut``, ``POut``, ``YOut`` and ``AOut``; ``RCOU`` is what was
sent, as pulses that ``MOT_*`` turn into thrust. ``SERVOn_FUNCTION`` 33 to 40 are motors 1 to 8.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from rotorfault.logs.commands import mixed, share_of_pulse
from rotorfault.logs.dataflash import DataflashFile, read_dataflash
from rotorfault.logs.log import Damage, Layout, Log, Note, Series, named_layout
from rotorfault.maths.arrays import Array
from rotorfault.maths.geometry import Vec3
from rotorfault.maths.rotation import Quat
from rotorfault.model.importers.ardupilot import BY_NUMBERS
from rotorfault.model.thrust_curve import share_of

WANTED = dict.fromkeys(
    (
        "RCOU", "RCO2", "RCO3", "ATT", "RATE", "IMU", "GYR", "ACC", "XKF1", "NKF1", "EKF1", "XKF4", "NKF4", "XKF2",
        "NKF2", "EKF2", "BAT", "CURR", "ESC", "CTUN", *(f"ESC{k}" for k in range(1, 9)),
    )
)  # fmt: skip
CLOCKS = {"TimeUS": 1e-6, "TimeMS": 1e-3}  # s of a record's time; the second up to version 3.2
OUTPUTS = (("RCOU", 14), ("RCO2", 18), ("RCO3", 32))  # messages of outputs, and the last that each has
FLIP = np.array([1.0, -1.0, -1.0])
FUNCTIONS = {**{33 + k: k for k in range(8)}, **{82 + k: 8 + k for k in range(4)}}  # SERVOn_FUNCTION: index of motor
OTHERS = re.compile(r"\b(ArduPlane|Rover|ArduSub|Blimp|AntennaTracker)\b")  # vehicles whose logs look alike
FORMER = {0.0: (1, 0), 1.0: (1, 1)}  # FRAME of versions before 3.5: FRAME_CLASS and FRAME_TYPE


def read_ardupilot_log(path: Path) -> Log:
    """A dataflash log as a `Log`.

    Parameters
    ----------
    path : Path

    Raises
    ------
    InputError
        If it cannot be opened.
    """
    file = read_dataflash(path, WANTED)
    remarks: list[str] = []
    layout, why = _layout(file)
    if layout is not None and layout.assumed:
        remarks.append(f"motor places are assumed: {layout.source}")
    series = {**_motion(file), **_commands(file, layout, remarks), **_power(file, layout)}
    for message in file.messages.values():
        if message.rows.every > 1:
            remarks.append(f"{message.name}: one of {message.rows.every} records is used, the log being long")
    damage = Damage(file.lost, file.reason)
    notes = tuple(_note(time * 1e-6, text) for time, text in file.texts)
    return Log(
        path.name, "ArduPilot dataflash", layout, series, file.parameters, notes, damage, tuple(remarks), why
    )  # fmt: skip


def _note(time: float, text: str) -> Note:
    match = re.search(r"Potential Thrust Loss \((\d+)\)", text)
    return Note(time, text, match is not None, int(match[1][:3]) if match else None)


def _series(
    file: DataflashFile,
    name: str,
    fields: Sequence[str],
    scale: Array | float = 1.0,
    index: str = "",
    which: int | None = None,
) -> Series | None:
    """Some fields of a message; of those that have several instances, the one that is asked for, or the first."""
    message = file.messages.get(name)
    if message is None or not len(message.rows):
        return None
    table = message.rows.table()
    names = table.dtype.names or ()
    clock = next((name for name in CLOCKS if name in names), None)
    if clock is None or any(f not in names or table.dtype[f].kind not in "fiu" for f in fields):
        return None
    if index in names and table.dtype[index].kind in "iu":
        one = which if which is not None and (table[index] == which).any() else table[index].min()
        table = table[table[index] == one]
    with np.errstate(invalid="ignore"):
        values = np.column_stack([table[f].astype(float) * message.scale.get(f, 1.0) for f in fields]) * scale
    return Series(table[clock].astype(float) * CLOCKS[clock], values)


def _motion(file: DataflashFile) -> dict[str, Series]:
    degrees = np.radians(1.0)
    found = {
        "rates": _series(file, "IMU", ("GyrX", "GyrY", "GyrZ"), FLIP, "I")
        or _series(file, "GYR", ("GyrX", "GyrY", "GyrZ"), FLIP, "I")
        or _series(file, "RATE", ("R", "P", "Y"), FLIP * degrees),
        "specific_force": _series(file, "IMU", ("AccX", "AccY", "AccZ"), FLIP, "I")
        or _series(file, "ACC", ("AccX", "AccY", "AccZ"), FLIP, "I"),
    }
    for filter_ in ("XKF", "NKF", "EKF"):
        core = _primary(file, f"{filter_}4")
        velocity = _series(file, f"{filter_}1", ("VN", "VE", "VD"), FLIP, "C", core)
        position = _series(file, f"{filter_}1", ("PN", "PE", "PD"), FLIP, "C", core)
        wind = _series(file, f"{filter_}2", ("VWN", "VWE"), np.array([1.0, -1.0]), "C", core)
        found |= {name: one for name, one in (("velocity", velocity), ("position", position), ("wind", wind))
                  if found.get(name) is None}  # fmt: skip
    angles = _series(file, "ATT", ("Roll", "Pitch", "Yaw"), FLIP * degrees)
    if angles is not None:
        found["attitude"] = Series(angles.time, quaternions(angles.values))
    return {name: one for name, one in found.items() if one is not None}


def quaternions(angles: Array) -> Array:
    """Quaternions, scalar first, of roll, pitch and yaw.

    Parameters
    ----------
    angles : (n, 3) ndarray, rad
        Roll, pitch, yaw.
    """
    q = Quat.from_euler(Vec3(*angles.T))
    return np.column_stack([q.w, q.x, q.y, q.z])


def _primary(file: DataflashFile, name: str) -> int | None:
    """The core of the filter that flew for most of the log."""
    flown = _series(file, name, ("PI",))
    if flown is None or not len(flown.values) or not np.isfinite(flown.values).all() or flown.values.min() < 0.0:
        return None
    return int(np.bincount(flown.values[:, 0].astype(int)).argmax())


def _layout(file: DataflashFile) -> tuple[Layout | None, str]:
    """The frame by its numbers, and why there is none."""
    for _, text in file.texts:
        if (other := OTHERS.search(text)) is not None:
            return None, f"it is a log of {other[1]}: only multirotors can be diagnosed"
    kind, type_ = file.parameters.get("FRAME_CLASS"), file.parameters.get("FRAME_TYPE", 1.0)
    if kind is None:
        former = FORMER.get(file.parameters.get("FRAME", -1.0))
        if former is not None:
            return named_layout(BY_NUMBERS[former], f"FRAME {file.parameters['FRAME']:.0f}", assumed=True), ""
        return named_layout("quad-x", "ArduPilot's quad X; the log names no frame", assumed=True), ""
    if not np.isfinite([kind, type_]).all():
        return None, "FRAME_CLASS and FRAME_TYPE are no numbers"
    frame = BY_NUMBERS.get((int(kind), int(type_)))
    said = f"FRAME_CLASS {kind:.0f}, FRAME_TYPE {type_:.0f}"
    return (None, f"{said} is no frame that is known") if frame is None else (named_layout(frame, said), "")


def _commands(file: DataflashFile, layout: Layout | None, remarks: list[str]) -> dict[str, Series]:
    found: dict[str, Series] = {}
    if layout is None:
        return found
    asked = _series(file, "RATE", ("ROut", "POut", "YOut", "AOut"))
    output = _output(file, len(layout.places))
    if output is not None:
        found["output"] = output
    if asked is not None:
        values = asked.values
        found["command"] = Series(asked.time, mixed(layout, values[:, :3] * FLIP, values[:, 3], "ardupilot"))
        remarks.append("commands are rebuilt from RATE.ROut, POut, YOut, AOut")
    elif output is not None:
        found["command"] = output
        remarks.append("commands are those of RCOU")
    return found


def _channels(file: DataflashFile, count: int) -> dict[int, int]:
    """The output of each motor, from 1; as they are by default where nothing says it."""
    channels = {
        FUNCTIONS[int(value)]: number
        for number in range(1, 33)
        if (value := file.parameters.get(f"SERVO{number}_FUNCTION", 0.0)) in FUNCTIONS
    }
    return channels or {k: k + 1 for k in range(count)}


def _pulses(file: DataflashFile, channels: Sequence[int]) -> Series | None:
    """Some outputs, from 1, at the times of the first: not all are in one message where there are more than 14."""
    each = []
    for channel in channels:
        name = next((name for name, last in OUTPUTS if channel <= last), "")
        one = _series(file, name, [f"C{channel}"])
        if one is None:
            return None
        each.append(one)
    time = each[0].time
    if all(len(one.time) == len(time) for one in each):
        return Series(time, np.column_stack([one.values[:, 0] for one in each]))
    return Series(time, np.column_stack([one.at(time)[:, 0] for one in each]))


def _output(file: DataflashFile, count: int) -> Series | None:
    parameters, channels = file.parameters, _channels(file, count)
    if any(k not in channels for k in range(count)):
        return None
    pulses = _pulses(file, [channels[k] for k in range(count)])
    if pulses is None:
        return None
    low, high = parameters.get("MOT_PWM_MIN", 1000.0) or 1000.0, parameters.get("MOT_PWM_MAX", 2000.0) or 2000.0
    least, most = parameters.get("MOT_SPIN_MIN", 0.15), parameters.get("MOT_SPIN_MAX", 0.95)
    expo = parameters.get("MOT_THST_EXPO", 0.65)
    if not (np.isfinite([low, high, least, most, expo]).all() and most > least and abs(expo) <= 1.0):
        return None
    signal = np.clip((share_of_pulse(pulses.values, low, high) - least) / (most - least), 0.0, 1.0)
    return Series(pulses.time, share_of(signal, expo))


def _power(file: DataflashFile, layout: Layout | None) -> dict[str, Series]:
    found: dict[str, Series] = {}
    battery = _series(file, "BAT", ("Volt", "Curr"), index="Instance") or _series(file, "CURR", ("Volt", "Curr"))
    if battery is not None:
        found["battery"] = battery
    if layout is None:
        return found
    count = len(layout.places)
    numbers = [_channels(file, count).get(k, 0) - 1 for k in range(count)]  # an ESC has the number of its output
    message = file.messages.get("ESC")
    table = None if message is None else message.rows.table()
    there = set() if table is None or "Instance" not in (table.dtype.names or ()) else set(table["Instance"].tolist())
    if there and not set(numbers) <= there:
        numbers = list(range(count))
    for field, name in (("RPM", "rpm"), ("Curr", "current")):
        if there:
            each = [_series(file, "ESC", (field,), index="Instance", which=k) for k in numbers]
        else:  # up to version 4.0, each a message of its own
            each = [_series(file, f"ESC{k + 1}", (field,)) for k in numbers]
        known = [one for one in each if one is not None and len(one.time) > 1]
        if len(known) == count:
            time = known[0].time
            found[name] = Series(time, np.column_stack([one.at(time)[:, 0] for one in known]))
    return found
