"""Betaflight's blackbox, decoded to CSV by `blackbox_decode` or by its viewer, as one record.

The decoder may write units behind names, such as ``time (us)`` and ``gyroADC[0] (deg/s)``; what has none is raw. The
header of the log stands above the table only where a viewer wrote it. What it would say is then taken as its defaults
are, and the record says so: digital motors from 48 to 2047, of which 5.5 % idle; pulses from 1000 to 2000.

Sources: Betaflight's own names of fields and headers (`blackbox.c`), its mixers, and the options of
`blackbox_decode`. The curve from signal to thrust, where rotor speeds are not logged: ArduPilot's recommended
``MOT_THST_EXPO`` of 0.55 for propellers of 5 inches.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from rotorfault.base.errors import InputError
from rotorfault.logs.log import Layout, Log, Series, named_layout
from rotorfault.logs.table import Table, columns_of, layout_of, number_of
from rotorfault.maths.arrays import Array
from rotorfault.model.thrust_curve import share_of

G = 9.80665  # m/s^2 that it counts as 1 g
DIGITAL, PULSES = (48.0, 2047.0), (1000.0, 2000.0)  # range of its motors' signal
BELOW = 900.0  # that no pulse has
IDLE = 0.055  # of a digital signal: `dshot_idle_value`, as it is by default
POLES = 14.0  # of a motor: `motor_poles`, as it is by default
CURVE = 0.55
LEAST_SPEEDS = 200  # records with rotor speeds that tell a curve
LEVELS = np.array([256.0, 512.0, 1024.0, 2048.0, 4096.0, 8192.0])  # of an accelerometer, that are 1 g
UNIT = re.compile(r"^(.*\S)\s*\(([^()]*)\)$")
SECONDS = {"us": 1e-6, "ms": 1e-3, "s": 1.0, "": 1e-6}


def is_betaflight(names: set[str]) -> bool:
    """Whether columns are those of a decoded blackbox.

    Parameters
    ----------
    names : set of str
    """
    plain = {without_unit(name)[0] for name in names}
    return "motor[0]" in plain and bool(plain & {"gyroADC[0]", "gyroUnfilt[0]", "loopIteration"})


def without_unit(name: str) -> tuple[str, str]:
    """A column's name, and the unit behind it, empty where there is none.

    Parameters
    ----------
    name : str
    """
    match = UNIT.match(name)
    return (match[1], match[2].strip()) if match else (name, "")


def read_betaflight_log(path: Path, table: Table) -> Log:
    """A decoded blackbox as a `Log`.

    Parameters
    ----------
    path : Path
    table : Table

    Raises
    ------
    InputError
        If it has no times.
    """
    columns: dict[str, Array] = {}
    units: dict[str, str] = {}
    for name, values in table.columns.items():
        plain, unit = without_unit(name)
        columns.setdefault(plain, values)
        units.setdefault(plain, unit)
    time = columns.get("time")
    if time is None:
        raise InputError(f"{path}: has no column 'time (us)'; decode it with blackbox_decode")
    time = time * SECONDS.get(units["time"], 1e-6)
    facts, remarks = table.facts, list[str]()
    count = 0
    while f"motor[{count}]" in columns:
        count += 1
    motors = np.column_stack([columns[f"motor[{k}]"] for k in range(count)])
    speeds = columns_of(columns, *(f"eRPM[{k}]" for k in range(count)))
    ends, sure = _range(motors, facts, remarks, speeds is not None)
    signal = _signal(motors, ends)
    series: dict[str, Series] = {}
    if speeds is not None:
        poles = number_of(facts.get("motor_poles", ""))
        known = poles >= 2.0
        speeds = speeds * 100.0 / (0.5 * (poles if known else POLES))
        series["rpm"] = Series(time, speeds)
        if not known:
            remarks.append(
                f"rotor speeds are those of motors with {POLES:.0f} poles: the table does not say how many"
            )
    curve = _curve(signal, speeds, remarks)
    series["command"] = Series(time, share_of(signal, curve))
    if not sure:
        series["otherwise"] = Series(time, share_of(_signal(motors, (_idle(DIGITAL), DIGITAL[1])), curve))
    for field in ("gyroADC", "gyroUnfilt"):
        gyro = columns_of(columns, *(f"{field}[{k}]" for k in range(3)))
        if gyro is not None:
            # Its mixer raises left motors for positive roll, rear ones for pitch: axes forward, left, up, as ours.
            series["rates"] = Series(time, gyro * _of_gyro(units[f"{field}[0]"], facts))
            break
    acc = columns_of(columns, "accSmooth[0]", "accSmooth[1]", "accSmooth[2]")
    if acc is not None:
        series["specific_force"] = Series(time, acc * _of_acc(acc, units["accSmooth[0]"], facts))
    volts = next((name for name in ("vbatLatest", "vbat") if units.get(name) in ("V", "mV")), None)
    if volts is not None:
        series["battery"] = Series(time, columns[volts] * (1.0 if units[volts] == "V" else 1e-3))
    layout, why = layout_of(facts, count)
    if layout is None and not why:
        layout = _usual(count)
    if layout is not None and layout.assumed:
        remarks.append(f"motor places are assumed: {layout.source}")
    if layout is None and not why:
        why = f"where Betaflight has its {count} motors is not known; write a line '# motors = FRAME' above the table"
    return Log(path.name, "Betaflight blackbox CSV", layout, series, {}, (), table.damage, tuple(remarks), why)


def _usual(count: int) -> Layout | None:
    """Where so many motors are in its usual mixer."""
    if count == 4:
        return named_layout("quad-betaflight", "Betaflight's quad X, propellers in", assumed=True)
    if count == 8:
        return named_layout("octaquad-betaflight", "Betaflight's X8", assumed=True)
    if count == 6:  # rear right, front right, rear left, front left, right, left: hexa X
        angles = np.radians([150.0, 30.0, -150.0, -30.0, 90.0, -90.0])
        places = np.round(np.column_stack([np.cos(angles), -np.sin(angles)]), 12)
        turns = np.array([-1.0, -1.0, 1.0, 1.0, 1.0, -1.0])
        return Layout(places, turns, "Betaflight's hexa X", assumed=True)
    return None


def _signal(motors: Array, ends: tuple[float, float]) -> Array:
    """Values of motors as shares of their range."""
    share: Array = np.clip((motors - ends[0]) / (ends[1] - ends[0]), 0.0, 1.0)
    return share


def _idle(ends: tuple[float, float]) -> float:
    """Where digital motors idle by default."""
    return ends[0] + IDLE * (ends[1] - ends[0])


def _range(
    motors: Array, facts: Mapping[str, str], remarks: list[str], telemetry: bool
) -> tuple[tuple[float, float], bool]:
    """Ends of the motors' signal: where they idle, and the greatest; and whether that is sure.

    Only digital motors tell their speeds (`telemetry`).
    """
    said = [number_of(part) for part in facts.get("motoroutput", "").split(",")]
    if len(said) == 2 and said[1] > said[0] >= 0.0:
        return (said[0], said[1]), True
    running = motors[motors > 0.0]
    least, most = (float(running.min()), float(running.max())) if len(running) else (0.0, 0.0)
    low, high = number_of(facts.get("minthrottle", "")), number_of(facts.get("maxthrottle", ""))
    if telemetry or least < BELOW or most > PULSES[1] + 1.0:
        remarks.append("motors are digital and idle at 5.5 %: the table does not say its motorOutput")
        return (min(_idle(DIGITAL), max(least, DIGITAL[0])), DIGITAL[1]), True
    if high > low >= BELOW:
        return (low, high), True
    remarks.append(
        "motors are taken to have pulses of 1000 to 2000 us, for the table does not say its motorOutput; they may as "
        "well be digital, so that losses are told for both: export the log with its header"
    )
    return PULSES, False


def _curve(signal: Array, speeds: Array | None, remarks: list[str]) -> float:
    """How thrust follows the signal: as the square of the speed does, where speeds are logged."""
    if speeds is not None:
        inside = (signal > 0.02) & (signal < 0.98) & (speeds > 0.0) & np.isfinite(speeds)
        if inside.sum() >= LEAST_SPEEDS and float(np.ptp(signal[inside])) > 0.2:
            u, square = signal[inside], speeds[inside] ** 2
            (a, b), *_ = np.linalg.lstsq(np.column_stack([u, u**2]), square, rcond=None)
            if a + b > 0.0:
                curve = float(np.clip(b / (a + b), 0.0, 1.0))
                remarks.append(f"thrust follows the square of the rotor speeds: a curve of {curve:.2f}")
                return curve
    remarks.append(f"thrust follows the signal by a curve of {CURVE:g}, usual for propellers of 5 inches: no speeds "
                   "of rotors tell it")  # fmt: skip
    return CURVE


def _of_gyro(unit: str, facts: Mapping[str, str]) -> float:
    """rad/s of a unit of the gyro."""
    if unit == "rad/s":
        return 1.0
    if unit == "deg/s":
        return float(np.radians(1.0))
    fine = 0.1 if number_of(facts.get("blackbox_high_resolution", "")) > 0.0 else 1.0
    text = facts.get("gyro_scale", "")
    scale = number_of(text)
    if re.fullmatch(r"0x[0-9a-fA-F]{1,8}", text):
        scale = struct.unpack("<f", struct.pack("<I", int(text, 16)))[0]
    if 0.0 < scale < 1e-4:  # of former firmware, in rad/us
        return scale * 1e6
    return float(np.radians(scale if 1e-3 < scale < 10.0 else 1.0)) * fine


def _of_acc(acc: Array, unit: str, facts: Mapping[str, str]) -> float:
    """m/s^2 of a unit of the accelerometer."""
    if unit in ("g", "m/s2", "m/s^2"):
        return G if unit == "g" else 1.0
    one_g = number_of(facts.get("acc_1g", ""))
    if not one_g > 0.0:
        # What hangs from its rotors feels about 1 g in the middle.
        middle = float(np.nanmedian(np.linalg.norm(acc, axis=1)))
        one_g = float(LEVELS[np.argmin(np.abs(np.log(LEVELS / max(middle, 1.0))))])
    return G / one_g
