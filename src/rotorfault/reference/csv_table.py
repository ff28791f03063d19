"""Reference tables in CSV files: read with line numbers in every complaint."""

from __future__ import annotations

import csv
import math
from pathlib import Path

import numpy as np

from rotorfault.base.errors import InputError, unknown
from rotorfault.maths.arrays import Array

REQUIRED = ("t", "x", "y", "z")
OPTIONAL = ("yaw", "vx", "vy", "vz", "ax", "ay", "az", "yaw_rate")
GROUPS = (("vx", "vy", "vz"), ("ax", "ay", "az"))
"""Columns that only come together."""


def read_table(text: str, path: str | Path) -> dict[str, Array]:
    """Columns of a CSV table with a header line, that was read from `path`.

    Returns
    -------
    dict of ndarray, shape (n,)
        `REQUIRED` and those of `OPTIONAL` that the file has; n is at least 2, t grows strictly.

    Raises
    ------
    InputError
        If a column is missing, unknown or twice there; a row has too few or too many
        values, or one that is no finite number; there are fewer than two rows, or the times do not grow.
    """
    lines = text.lstrip("\ufeff").splitlines()
    reader = csv.reader(lines, skipinitialspace=True)
    try:
        rows = [(reader.line_num, row) for row in reader if any(cell.strip() for cell in row)]
    except csv.Error as error:
        raise InputError(f"{path}: line {reader.line_num}: {error}; allowed: comma-separated numbers") from None
    if not rows:
        raise InputError(f"{path}: is empty; allowed: a header line with {', '.join(REQUIRED)} and rows of numbers")
    names = [name.strip() for name in rows[0][1]]
    _check_header(names, path)
    table = np.array([_numbers(row, names, f"{path}: line {line}") for line, row in rows[1:]]).reshape(-1, len(names))
    if len(table) < 2:
        raise InputError(f"{path}: got {len(table)} rows of numbers; allowed: at least 2")
    times = table[:, names.index("t")]
    for index in np.flatnonzero(~(np.diff(times) > 0.0))[:1]:
        line = rows[index + 2][0]
        allowed = f"later than the row before, {float(times[index])!r} s; sort the rows and remove doubles"
        raise InputError(f"{path}: line {line}: t: got {float(times[index + 1])!r} s; allowed: {allowed}")
    return dict(zip(names, table.T.copy(), strict=True))


def _check_header(names: list[str], path: str | Path) -> None:
    for name in names:
        if name not in REQUIRED + OPTIONAL:
            raise InputError(f"{path}: {unknown('column', name, [*REQUIRED, *OPTIONAL])}")
        if names.count(name) > 1:
            raise InputError(f"{path}: column '{name}' is there {names.count(name)} times; allowed: once")
    for name in REQUIRED:
        if name not in names:
            raise InputError(f"{path}: column '{name}' is missing; got {', '.join(names)}; add it to the header line")
    for group in GROUPS:
        missing = [name for name in group if name not in names]
        if 0 < len(missing) < len(group):
            raise InputError(f"{path}: column '{missing[0]}' is missing; {', '.join(group)} only come together")
    if "ax" in names and "vx" not in names:
        raise InputError(f"{path}: column 'vx' is missing; accelerations need velocities: add vx, vy, vz")
    if "yaw_rate" in names and "yaw" not in names:
        raise InputError(f"{path}: column 'yaw' is missing; yaw_rate needs it: add it")


def _numbers(row: list[str], names: list[str], where: str) -> list[float]:
    if len(row) != len(names):
        raise InputError(f"{where}: got {len(row)} values; allowed: {len(names)} ({', '.join(names)})")
    numbers = []
    for name, cell in zip(names, row, strict=True):
        try:
            number = float(cell)
        except ValueError:
            number = math.nan
        if not math.isfinite(number):
            raise InputError(f"{where}: {name}: got '{cell.strip()[:40]}'; allowed: a finite number")
        numbers.append(number)
    return numbers
