"""Tables as logs: our documented columns, Betaflight's decoded blackbox, and logs of the Crazyflie's variables.

A table is a CSV file with a line of names, or an ``.npz`` with an array per column. Lines before it that begin with
``#`` may say ``# key = value``: ``motors`` (a named frame, or places), ``vehicle``, ``thrust_curve``. Which of the
three it is shows in the names of the columns.
"""

from __future__ import annotations

import csv
import io
import re
import zipfile
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np

from rotorfault.base.errors import InputError
from rotorfault.base.plain_text import one_line
from rotorfault.logs.ardupilot import quaternions
from rotorfault.logs.log import Damage, Layout, Log, Series, named_layout
from rotorfault.logs.stream import content, opened
from rotorfault.maths.arrays import Array
from rotorfault.model.frames import ALIASES, FRAMES
from rotorfault.model.thrust_curve import share_of

MOST_ROWS = 2_000_000  # of a table, beyond which every second one is dropped
MOST_COLUMNS, LONGEST_LINE = 400, 1 << 16
G = 9.80665  # m/s^2 that a Crazyflie and a flight controller count as 1 g
FULL_U16 = 65535.0  # of a Crazyflie's motor command


class Table(NamedTuple):
    """Columns of numbers; NaN where a cell has none."""

    columns: dict[str, Array]
    facts: dict[str, str]  # of the lines that begin with #
    damage: Damage


def read_table(path: Path) -> Table:
    """The columns of a CSV file or an ``.npz``.

    Parameters
    ----------
    path : Path

    Raises
    ------
    InputError
        If it cannot be opened, or has no columns of numbers.
    """
    return _npz(path) if path.suffix.lower() == ".npz" else _csv(path)


def _npz(path: Path) -> Table:
    columns: dict[str, Array] = {}
    lost: list[str] = []
    with opened(path) as file:
        try:
            with np.load(file, allow_pickle=False) as data:
                for name in data.files[:MOST_COLUMNS]:
                    try:
                        values = data[name]
                    except (ValueError, OSError, EOFError, zipfile.BadZipFile, MemoryError, NotImplementedError):
                        lost.append(name)
                        continue
                    if values.ndim == 1 and values.dtype.kind in "fiub" and len(values) <= MOST_ROWS:
                        columns[name] = values.astype(float)
        except Exception as error:  # whatever a broken archive raises in its many layers
            raise InputError(f"{path}: is no readable .npz ({one_line(str(error))[:100]})") from None
    longest = max(map(len, columns.values()), default=0)
    columns = {name: values for name, values in columns.items() if len(values) == longest}
    if not columns:
        raise InputError(f"{path}: has no columns of numbers; see the documentation of logs for their names")
    reason = f"columns {', '.join(map(one_line, lost[:5]))} are damaged" if lost else ""
    return Table(columns, {}, Damage(len(lost), reason))


def _csv(path: Path) -> Table:
    facts: dict[str, str] = {}
    rows: list[list[float]] = []
    header: list[str] = []
    bad, every, seen, blocks = 0, 1, 0, []
    with content(path) as log, io.TextIOWrapper(log.file, encoding="utf-8", errors="replace", newline="") as file:
        while line := file.readline(LONGEST_LINE):
            if not header:
                header = _head(line, facts)
                continue
            seen += 1
            if every > 1 and seen % every:
                continue
            cells = line.rstrip("\r\n").split(",")
            if len(cells) != len(header):
                bad += bool(line.strip())
                continue
            rows.append([_number(cell) for cell in cells])
            if len(rows) >= 20000:
                blocks.append(np.array(rows, dtype=float))
                rows = []
                if sum(map(len, blocks)) * len(header) > 8 * MOST_ROWS:
                    blocks, every = [np.concatenate(blocks)[::2]], 2 * every
        packed = log.said()
    if rows:
        blocks.append(np.array(rows, dtype=float))
    if not header or not blocks:
        raise InputError(f"{path}: has no line of names with rows of numbers below; allowed: a flight log")
    table = np.concatenate(blocks)
    columns = {name: table[:, k] for k, name in enumerate(header) if np.isfinite(table[:, k]).any()}
    torn = f"{bad} rows have not as many cells as there are names" if bad else ""
    return Table(columns, facts, Damage(bad, "; ".join(filter(None, (packed, torn)))))


def _head(line: str, facts: dict[str, str]) -> list[str]:
    """The names of the columns, if this is their line; else what it says is kept."""
    if line.startswith("#"):
        key, _, value = line.lstrip("# ").partition("=")
        if value and len(facts) < MOST_COLUMNS:
            facts[key.strip().lower()] = one_line(value.strip())
        return []
    try:
        names = [cell.strip().strip('"') for cell in next(csv.reader([line]), [])]
    except csv.Error:
        return []
    if len(names) == 2 and len(facts) < MOST_COLUMNS:  # Betaflight's decoder writes "key","value" above
        facts[names[0].lower()] = one_line(names[1])
    return names if 3 <= len(names) <= MOST_COLUMNS and not any(map(_is_number, names)) else []


def _is_number(text: str) -> bool:
    return not np.isnan(_number(text))


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return float("nan")


def read_table_log(path: Path) -> Log:
    """A table as a `Log`.

    Parameters
    ----------
    path : Path

    Raises
    ------
    InputError
        If it cannot be read, or its columns are not those of a flight log.
    """
    table = read_table(path)
    names = set(table.columns)
    if "motor[0]" in names and "gyroADC[0]" in names:
        return _betaflight(path, table)
    renamed = {_crazyflie_name(name): values for name, values in table.columns.items()}
    if "motor.m1" in renamed:
        return _crazyflie(path, table._replace(columns=renamed))
    if "time" in names and any(re.fullmatch(r"motor_\d+", name) for name in names):
        return _documented(path, table)
    raise InputError(
        f"{path}: has columns {_some(names)}; allowed: time and motor_1, motor_2, ... "
        "(see docs/logs.md), Betaflight's decoded blackbox, or variables of a Crazyflie such as motor.m1"
    )


def _some(names: Iterable[str]) -> str:
    """A few names of columns, as far as they can be read."""
    shown = sorted(one_line(name)[:30] for name in names if name and name.isprintable() and "\ufffd" not in name)
    return ", ".join(shown[:6]) if shown else "without a readable name"


def _columns(columns: Mapping[str, Array], *names: str) -> Array | None:
    return np.column_stack([columns[name] for name in names]) if all(name in columns for name in names) else None


def _documented(path: Path, table: Table) -> Log:
    columns, time = table.columns, table.columns["time"]
    count = 0
    while f"motor_{count + 1}" in columns:
        count += 1
    numbers = range(1, count + 1)
    curve = min(max(_number(table.facts.get("thrust_curve", "0")), -1.0), 1.0)
    curve = 0.0 if np.isnan(curve) else curve
    parts = {
        "command": [f"motor_{k}" for k in numbers],
        "rates": ["gyro_x", "gyro_y", "gyro_z"],
        "attitude": ["qw", "qx", "qy", "qz"],
        "velocity": ["vx", "vy", "vz"],
        "position": ["x", "y", "z"],
        "specific_force": ["acc_x", "acc_y", "acc_z"],
        "rpm": [f"rpm_{k}" for k in numbers],
        "current": [f"current_{k}" for k in numbers],
    }
    series = {
        name: Series(time, values) for name, of in parts.items() if (values := _columns(columns, *of)) is not None
    }
    if "command" in series:
        share = np.clip(series["command"].values, 0.0, 1.0)
        series["command"] = Series(time, share_of(share, curve))
    angles = _columns(columns, "roll", "pitch", "yaw")
    if "attitude" not in series and angles is not None:
        series["attitude"] = Series(time, quaternions(angles))
    if "voltage" in columns:
        series["battery"] = Series(time, columns["voltage"])
    layout = _layout(table.facts, count)
    remarks = () if layout is None or not layout.assumed else (f"motor places are assumed: {layout.source}",)
    return Log(path.name, "CSV with documented columns", layout, series, {}, (), table.damage, remarks)


def _layout(facts: Mapping[str, str], count: int) -> Layout | None:
    """Of the line `# motors = FRAME`; without one, of four motors PX4's quad X."""
    said = facts.get("motors", "")
    frame = ALIASES.get(said, said)
    if frame in FRAMES and len(FRAMES[frame].motors) == count:
        return named_layout(frame, f"motors = {said}")
    return named_layout("quad-x", "PX4's quad X", assumed=True) if count == 4 else None


def _betaflight(path: Path, table: Table) -> Log:
    columns = table.columns
    time = columns.get("time (us)", columns.get("time"))
    if time is None:
        raise InputError(f"{path}: has no column 'time (us)'; decode it with blackbox_decode")
    time = time * 1e-6
    count = 0
    while f"motor[{count}]" in columns:
        count += 1
    motors = np.column_stack([columns[f"motor[{k}]"] for k in range(count)])
    low, high = (48.0, 2047.0) if np.nanmin(motors) < 900.0 else (1000.0, 2000.0)
    said = [_number(part) for part in table.facts.get("motoroutput", "").split(",")]
    if len(said) == 2 and said[1] > said[0] >= 0.0:
        low, high = said
    remarks = ["thrust is taken as proportional to the motor signal: Betaflight does not say its curve"]
    series = {"command": Series(time, np.clip((motors - low) / (high - low), 0.0, 1.0))}
    gyro = _columns(columns, "gyroADC[0]", "gyroADC[1]", "gyroADC[2]")
    if gyro is not None:
        # Its mixer raises left motors for positive roll, rear ones for pitch: axes forward, left, up, as ours.
        series["rates"] = Series(time, np.radians(gyro))
    acc = _columns(columns, "accSmooth[0]", "accSmooth[1]", "accSmooth[2]")
    if acc is not None:
        one_g = _number(table.facts.get("acc_1g", "2048"))
        one_g = one_g if one_g > 0.0 else 2048.0
        series["specific_force"] = Series(time, acc / one_g * G)
    rpm = _columns(columns, *(f"eRPM[{k}]" for k in range(count)))
    if rpm is not None:
        series["rpm"] = Series(time, rpm * 100.0)
    volts = columns.get("vbatLatest (V)")
    if volts is not None:
        series["battery"] = Series(time, volts)
    layout = named_layout("quad-betaflight", "Betaflight's quad X", assumed=True) if count == 4 else None
    if layout is not None:
        remarks.append("motor places are assumed: Betaflight's quad X, propellers in")
    return Log(path.name, "Betaflight blackbox CSV", layout, series, {}, (), table.damage, tuple(remarks))


def _crazyflie_name(name: str) -> str:
    """A variable's name as the firmware has it, without what recorders put around it."""
    for prefix in ("motor_", "est_", "att_", "pwr_", "pid_", "sp_"):
        rest = name.removeprefix(prefix)
        group, _, variable = rest.partition("_")
        if rest != name and variable and group in ("motor", "stateEstimate", "pm", "controller"):
            return f"{group}.{variable}"
    return name


def _crazyflie(path: Path, table: Table) -> Log:
    c = table.columns
    time = c.get("t", c.get("time"))
    if time is None:
        if "timestamp" not in c:
            raise InputError(f"{path}: has no column t, time or timestamp")
        time = c["timestamp"] * 1e-3  # ms, as the client logs it
    motors = np.column_stack([c[f"motor.m{k}"] for k in range(1, 5) if f"motor.m{k}" in c])
    series = {"command": Series(time, np.clip(motors / FULL_U16, 0.0, 1.0))}
    if (gyro := _columns(c, "gyro.x", "gyro.y", "gyro.z")) is not None:
        series["rates"] = Series(time, np.radians(gyro))
    elif (gyro := _columns(c, "imu_gyro_x", "imu_gyro_y", "imu_gyro_z")) is not None:
        series["rates"] = Series(time, gyro)  # rad/s, as NanoBench has it
    for name, scale, choices in (
        ("position", 1.0, (("px", "py", "pz"), _state("x", "y", "z"))),
        ("velocity", 1.0, (("vx", "vy", "vz"), _state("vx", "vy", "vz"))),
        ("specific_force", G, (("acc.x", "acc.y", "acc.z"), ("imu_acc_x", "imu_acc_y", "imu_acc_z"))),
        ("attitude", 1.0, (("qw", "qx", "qy", "qz"), _state("qw", "qx", "qy", "qz"))),
    ):
        for choice in choices:
            if name not in series and (values := _columns(c, *choice)) is not None:
                series[name] = Series(time, values * scale)
    if "pm.vbatMV" in c:
        series["battery"] = Series(time, c["pm.vbatMV"] * 1e-3)
    elif "pm.vbat" in c:
        series["battery"] = Series(time, c["pm.vbat"])
    layout = named_layout("quad-crazyflie", "the Crazyflie's order of motors")
    if motors.shape[1] != 4:
        raise InputError(f"{path}: has {motors.shape[1]} of the motors motor.m1 to motor.m4")
    return Log(path.name, "variables of a Crazyflie", layout, series, {}, (), table.damage, ())


def _state(*names: str) -> tuple[str, ...]:
    return tuple(f"stateEstimate.{name}" for name in names)
