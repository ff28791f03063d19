"""Tables of numbers: CSV files with a line of names, and ``.npz`` with an array per column.

Lines above the names that begin with ``#`` may say ``# key = value``; what Betaflight's viewer writes above them,
``"key","value"``, counts as the same.
"""

from __future__ import annotations

import csv
import io
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np

from rotorfault.base.errors import InputError
from rotorfault.base.plain_text import one_line
from rotorfault.base.progress import Bar
from rotorfault.logs.log import Damage, Layout, named_layout
from rotorfault.logs.stream import content, opened
from rotorfault.maths.arrays import Array
from rotorfault.model.frames import ALIASES, FRAMES

MOST_ROWS = 2_000_000  # of a table, beyond which every second one is dropped
MOST_COLUMNS, LONGEST_LINE = 400, 1 << 16


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
    with (
        content(path) as log,
        io.TextIOWrapper(log.file, encoding="utf-8", errors="replace", newline="") as file,
        Bar(f"reading {path.name}", path.stat().st_size, "bytes") as bar,
    ):
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
            rows.append([number_of(cell) for cell in cells])
            if len(rows) >= 20000:
                blocks.append(np.array(rows, dtype=float))
                rows = []
                bar.update(log.file.tell() if log.packed is None else log.packed.at())
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
    return (
        names if 3 <= len(names) <= MOST_COLUMNS and not any(not np.isnan(number_of(name)) for name in names) else []
    )


def _isnumber_of(text: str) -> bool:
    return not np.isnan(number_of(text))


def number_of(text: str) -> float:
    """A number, NaN where the text is none.

    Parameters
    ----------
    text : str
    """
    try:
        return float(text)
    except ValueError:
        return float("nan")


def columns_of(columns: Mapping[str, Array], *names: str) -> Array | None:
    """Some columns side by side; None where one is missing.

    Parameters
    ----------
    columns : mapping of str to (n,) ndarray
    *names : str
    """
    return np.column_stack([columns[name] for name in names]) if all(name in columns for name in names) else None


def layout_of(facts: Mapping[str, str], count: int) -> tuple[Layout | None, str]:
    """The layout that the line ``# motors = FRAME`` names; or why what it says is none.

    Parameters
    ----------
    facts : mapping of str to str
        Of the lines above the names.
    count : int
        Motors of the table.
    """
    said = facts.get("motors", "")
    if not said:
        return None, ""
    frame = ALIASES.get(said, said)
    if frame not in FRAMES or len(FRAMES[frame].motors) != count:
        return None, f"motors = {said} is no frame of {count} motors; 'rotorfault frames' lists their names"
    return named_layout(frame, f"motors = {said}"), ""
