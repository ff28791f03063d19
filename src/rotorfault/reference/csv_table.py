"""Reference tables in CSV files: read with line numbers in every complaint.

Columns are separated by commas, semicolons or tabs, as the header line shows. Where commas do not separate they may
be decimal, as spreadsheets write numbers in many countries; then no cell may hold a point, which may mark thousands.
"""

from __future__ import annotations

import csv
import math
import re
from pathlib import Path

import numpy as np

from rotorfault.base.errors import InputError, unknown
from rotorfault.base.number_rule import plain_number
from rotorfault.maths.arrays import Array

REQUIRED = ("t", "x", "y", "z")
OPTIONAL = ("yaw", "vx", "vy", "vz", "ax", "ay", "az", "yaw_rate")
GROUPS = (("vx", "vy", "vz"), ("ax", "ay", "az"))
"""Columns that only come together."""
SEPARATORS = {",": "commas", ";": "semicolons", "\t": "tabs"}
ALLOWED = "numbers separated by commas, semicolons or tabs"


def read_table(text: str, path: str | Path) -> dict[str, Array]:
    """Columns of a CSV table with a header line, that was read from `path`; see this module for separators.

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
    if lines and re.fullmatch(r"\s*sep=.?\s*", lines[0]):
        lines[0] = ""  # a spreadsheet's word to itself; the header line shows it as well
    separator = _separator(lines, path)
    reader = csv.reader(lines, delimiter=separator, skipinitialspace=separator != "\t")
    try:
        rows = [(reader.line_num, row) for row in reader if any(cell.strip() for cell in row)]
    except csv.Error as error:
        raise InputError(f"{path}: line {reader.line_num}: {error}; allowed: {ALLOWED}") from None
    if not rows:
        raise InputError(f"{path}: is empty; allowed: a header line with {', '.join(REQUIRED)} and rows of numbers")
    names = [name.strip() for name in rows[0][1]]
    _check_header(names, path)
    decimal = _decimal(rows[1:], separator, path)
    table = np.array(
        [_numbers(row, names, decimal, f"{path}: line {line}") for line, row in rows[1:]], dtype=np.float64
    ).reshape(-1, len(names))
    if len(table) < 2:
        raise InputError(f"{path}: got {len(table)} rows of numbers; allowed: at least 2")
    times = table[:, names.index("t")]
    for index in np.flatnonzero(~(np.diff(times) > 0.0))[:1]:
        line = rows[index + 2][0]
        allowed = f"later than the row before, {float(times[index])!r} s; sort the rows and remove doubles"
        raise InputError(f"{path}: line {line}: t: got {float(times[index + 1])!r} s; allowed: {allowed}")
    return dict(zip(names, table.T.copy(), strict=True))


def _separator(lines: list[str], path: str | Path) -> str:
    """What stands between columns, by the header line."""
    header = next((line for line in lines if line.strip()), "")
    found = [separator for separator in SEPARATORS if separator in header]
    if len(found) > 1:
        raise InputError(
            f"{path}: the header line has {' and '.join(SEPARATORS[one] for one in found)}; allowed: one"
        )
    if not found and len(header.split()) > 1:
        raise InputError(f"{path}: got the header line '{header.strip()[:40]}'; allowed: {ALLOWED}")
    return found[-1] if found else ","


def _decimal(rows: list[tuple[int, list[str]]], separator: str, path: str | Path) -> str:
    """The decimal mark of a table."""
    if separator == ",":
        return "."
    first = {mark: next((line for line, row in rows for cell in row if mark in cell), 0) for mark in ",."}
    if all(first.values()):
        raise InputError(
            f"{path}: commas in numbers (line {first[',']}) and points (line {first['.']}); allowed: one of them, as "
            "decimal mark, and nothing between thousands"
        )
    return "," if first[","] else "."


def _check_header(names: list[str], path: str | Path) -> None:
    for name in names:
        if name not in REQUIRED + OPTIONAL:
            bare = re.split(r"[\s(\[]", name.strip("# "))[0]
            hint = f"; write '{bare}' alone, units are m, s and rad" if bare in REQUIRED + OPTIONAL else ""
            raise InputError(f"{path}: {unknown('column', name, [*REQUIRED, *OPTIONAL])}{hint}")
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


def _numbers(row: list[str], names: list[str], decimal: str, where: str) -> list[float]:
    if len(row) != len(names):
        hint = ""
        if decimal == "." and len(row) > len(names) and all(re.fullmatch(r"\s*[+-]?\d+\s*", cell) for cell in row):
            hint = "; with decimal commas, separate the columns by semicolons or tabs"
        raise InputError(f"{where}: got {len(row)} values; allowed: {len(names)} ({', '.join(names)}){hint}")
    numbers = []
    for name, cell in zip(names, row, strict=True):
        number = plain_number(cell.strip().replace(decimal, "."))
        if math.isnan(number):
            allowed = "a finite number in digits, such as 0.5, -2 or 1e-3"
            raise InputError(f"{where}: {name}: got '{cell.strip()[:40]}'; allowed: {allowed}")
        numbers.append(number)
    return numbers
