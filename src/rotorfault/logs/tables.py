"""Tables as logs: our documented columns, Betaflight's decoded blackbox, and logs of the Crazyflie's variables.

Lines above the names may say ``# motors = FRAME`` and ``# thrust_curve = 0.3``. Which of the three it is shows in the
names of the columns.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from rotorfault.base.errors import InputError
from rotorfault.base.plain_text import one_line
from rotorfault.logs.ardupilot import quaternions
from rotorfault.logs.betaflight import is_betaflight, read_betaflight_log
from rotorfault.logs.log import Log, Series, named_layout
from rotorfault.logs.table import Table, columns_of, layout_of, number_of, read_table
from rotorfault.model.thrust_curve import share_of

G = 9.80665  # m/s^2 that a Crazyflie and a flight controller count as 1 g
FULL_U16 = 65535.0  # of a Crazyflie's motor command


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
    if is_betaflight(names):
        return read_betaflight_log(path, table)
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


def _documented(path: Path, table: Table) -> Log:
    columns, time = table.columns, table.columns["time"]
    count = 0
    while f"motor_{count + 1}" in columns:
        count += 1
    numbers = range(1, count + 1)
    curve = min(max(number_of(table.facts.get("thrust_curve", "0")), -1.0), 1.0)
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
        name: Series(time, values) for name, of in parts.items() if (values := columns_of(columns, *of)) is not None
    }
    if "command" in series:
        share = np.clip(series["command"].values, 0.0, 1.0)
        series["command"] = Series(time, share_of(share, curve))
    angles = columns_of(columns, "roll", "pitch", "yaw")
    if "attitude" not in series and angles is not None:
        series["attitude"] = Series(time, quaternions(angles))
    if "voltage" in columns:
        series["battery"] = Series(time, columns["voltage"])
    layout, why = layout_of(table.facts, count)
    if layout is None and count == 4 and not why:
        layout = named_layout("quad-x", "PX4's quad X", assumed=True)
    if layout is None and not why:
        why = f"where its {count} motors are is not known; write a line '# motors = FRAME' above the table"
    remarks = () if layout is None or not layout.assumed else (f"motor places are assumed: {layout.source}",)
    return Log(path.name, "CSV with documented columns", layout, series, {}, (), table.damage, remarks, why)


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
        stamps = c.get("timestamp", c.get("Timestamp"))
        if stamps is None:
            raise InputError(f"{path}: has no column t, time or timestamp")
        time = stamps * 1e-3  # ms, as the client logs it
    motors = np.column_stack([c[f"motor.m{k}"] for k in range(1, 5) if f"motor.m{k}" in c])
    series = {"command": Series(time, np.clip(motors / FULL_U16, 0.0, 1.0))}
    if (gyro := columns_of(c, "gyro.x", "gyro.y", "gyro.z")) is not None:
        series["rates"] = Series(time, np.radians(gyro))
    elif (gyro := columns_of(c, "imu_gyro_x", "imu_gyro_y", "imu_gyro_z")) is not None:
        series["rates"] = Series(time, gyro)  # rad/s, as NanoBench has it
    for name, scale, choices in (
        ("position", 1.0, (("px", "py", "pz"), _state("x", "y", "z"))),
        ("velocity", 1.0, (("vx", "vy", "vz"), _state("vx", "vy", "vz"))),
        ("specific_force", G, (("acc.x", "acc.y", "acc.z"), ("imu_acc_x", "imu_acc_y", "imu_acc_z"))),
        ("attitude", 1.0, (("qw", "qx", "qy", "qz"), _state("qw", "qx", "qy", "qz"))),
    ):
        for choice in choices:
            if name not in series and (values := columns_of(c, *choice)) is not None:
                series[name] = Series(time, values * scale)
    if "pm.vbatMV" in c:
        series["battery"] = Series(time, c["pm.vbatMV"] * 1e-3)
    elif "pm.vbat" in c:
        series["battery"] = Series(time, c["pm.vbat"])
    angles = columns_of(c, *_state("roll", "pitch", "yaw"))
    if angles is None:
        angles = columns_of(c, "stabilizer.roll", "stabilizer.pitch", "stabilizer.yaw")
    if "attitude" not in series and angles is not None:
        # Its firmware has pitch positive for the nose up, against its own axes.
        series["attitude"] = Series(time, quaternions(np.radians(angles * np.array([1.0, -1.0, 1.0]))))
    layout = named_layout("quad-crazyflie", "the Crazyflie's order of motors")
    if motors.shape[1] != 4:
        raise InputError(f"{path}: has {motors.shape[1]} of the motors motor.m1 to motor.m4")
    return Log(path.name, "variables of a Crazyflie", layout, series, {}, (), table.damage, ())


def _state(*names: str) -> tuple[str, ...]:
    return tuple(f"stateEstimate.{name}" for name in names)
