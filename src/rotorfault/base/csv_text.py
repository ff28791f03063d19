"""CSV as other tools read it: a column has one type in all files, and no digit is lost.

A float is written as the shortest text that gives it back to the last bit, and always looks like one (``0.0``), for
readers guess types by looks; an integer is written without a point, a truth value as ``true`` or ``false``, text as
it is, with quotation marks where it needs them (RFC 4180). What has no value is empty.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from rotorfault.base.files import in_folder, write_atomically

BLOCK = 2000  # rows that are turned into text at once: some megabytes


def cell(value: object) -> str:
    """The text of one value."""
    if value is None:
        return ""
    if isinstance(value, (bool, np.bool_)):
        return "true" if value else "false"
    if isinstance(value, (float, np.floating)):
        return _float(float(value))
    return str(value)


def number(value: float | None) -> float | None:
    """A number as a float, whatever it was held as; None, so an empty cell, where there is no finite one."""
    return float(value) if value is not None and math.isfinite(value) else None


def _float(value: float) -> str:
    # Readers know NaN by this spelling; Python's own they take for text.
    return repr(value) if value == value else "NaN"


def write_rows(path: Path, header: Sequence[str], rows: Iterable[Sequence[object]]) -> Path:
    """Write a table given row by row, whole or not at all.

    Parameters
    ----------
    path : Path
    header : sequence of str
        Names of the columns.
    rows : iterable of sequence
        Of values as `cell` takes them.

    Raises
    ------
    InputError
        If the folder does not exist.
    """

    def write(file: IO[str]) -> None:
        csv.writer(file, lineterminator="\n").writerows([cell(value) for value in row] for row in rows)

    return _write(path, header, write)


def write_columns(
    path: Path, columns: dict[str, NDArray[Any]], done: Callable[[int], object] = lambda rows: None
) -> Path:
    """Write a table given column by column, whole or not at all; the text is made a block of rows at a time.

    Parameters
    ----------
    path : Path
    columns : dict of str to ndarray, shape (rows,)
        By name; the type of each says how its values are written.
    done : callable, optional
        Is told the number of rows that are written.

    Raises
    ------
    InputError
        If the folder does not exist.
    """

    def write(file: IO[str]) -> None:
        table = csv.writer(file, lineterminator="\n")
        plain = all(values.dtype.kind in "fiub" for values in columns.values())
        for start in range(0, len(next(iter(columns.values()))), BLOCK):
            block = [_texts(values[start : start + BLOCK]) for values in columns.values()]
            if plain:  # nothing needs quotation marks, and to look for them takes long
                file.writelines(f"{','.join(row)}\n" for row in zip(*block, strict=True))
            else:
                table.writerows(zip(*block, strict=True))
            done(start + len(block[0]))

    return _write(path, list(columns), write)


def _texts(values: NDArray[Any]) -> list[str]:
    if values.dtype.kind == "f":
        # Single precision becomes double here: its own digits alone would read back as another number.
        whole = values.astype(float)
        if (whole == whole[0]).all() and (whole[0] != 0.0 or not np.signbit(whole).any()):
            return [repr(float(whole[0]))] * len(whole)  # a flag, or what nothing changes
        return list(map(_float if np.isnan(whole).any() else repr, whole.tolist()))
    return [cell(value) for value in values.tolist()]


def _write(path: Path, header: Sequence[str], write: Callable[[IO[str]], None]) -> Path:
    def whole(temporary: Path) -> None:
        with temporary.open("w", encoding="utf-8", newline="") as file:
            csv.writer(file, lineterminator="\n").writerow(header)
            write(file)

    write_atomically(in_folder(path), whole)
    return path
