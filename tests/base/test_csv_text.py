"""CSV: a column's type shows in every cell, every float comes back to the last bit, files are whole or not there."""

from __future__ import annotations

import csv
import errno
import math
import struct
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rotorfault.base.csv_text import BLOCK, cell, number, write_columns, write_rows
from rotorfault.base.errors import InputError


@given(st.floats(allow_nan=False))
def test_a_float_comes_back_and_looks_like_one(value: float) -> None:
    text = cell(value)
    assert struct.pack("d", float(text)) == struct.pack("d", value)
    assert any(mark in text for mark in (".", "e", "inf"))


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.0, "0.0"), (-0.0, "-0.0"), (np.float64(3.0), "3.0"), (1e300, "1e+300"), (math.nan, "NaN"),
        (math.inf, "inf"), (7, "7"), (np.int64(-2), "-2"), (True, "true"), (np.bool_(False), "false"), (None, ""),
        ("a b", "a b"),
    ],
)  # fmt: skip
def test_each_type_has_its_look(value: object, text: str) -> None:
    assert cell(value) == text


def test_what_is_no_finite_number_is_an_empty_cell() -> None:
    assert [number(value) for value in (None, math.nan, math.inf, 2)] == [None, None, None, 2.0]
    assert isinstance(number(2), float)


def test_columns_keep_their_types_over_blocks(tmp_path: Path) -> None:
    count = 2 * BLOCK + 3
    columns = {
        "time [s]": np.arange(count) * 0.1,
        "third": np.full(count, 1.0 / 3.0, dtype=np.float32),
        "count": np.arange(count),
        "flag": np.arange(count) % 2 == 0,
        'a "word", and more': np.full(count, "x,y"),
    }
    told: list[int] = []
    path = write_columns(tmp_path / "table.csv", columns, told.append)
    assert told == [BLOCK, 2 * BLOCK, count]
    with path.open(encoding="utf-8", newline="") as file:
        header, *rows = csv.reader(file)
    assert header == list(columns)
    assert len(rows) == count
    assert [float(row[0]) for row in rows] == columns["time [s]"].tolist()
    assert {row[1] for row in rows} == {repr(float(np.float32(1.0 / 3.0)))}
    assert [int(row[2]) for row in rows] == list(range(count))
    assert {row[3] for row in rows} == {"true", "false"}
    assert {row[4] for row in rows} == {"x,y"}


def test_a_table_that_fails_midway_leaves_what_was_there(tmp_path: Path) -> None:
    path = write_rows(tmp_path / "table.csv", ["a"], [[1.0]])

    def rows():  # type: ignore[no-untyped-def]
        yield [2.0]
        raise OSError(errno.ENOSPC, "No space left on device")

    with pytest.raises(OSError, match="No space"):
        write_rows(path, ["a"], rows())
    assert path.read_text(encoding="utf-8") == "a\n1.0\n"
    assert list(tmp_path.iterdir()) == [path]
    with pytest.raises(InputError, match="there is no folder"):
        write_rows(tmp_path / "nowhere" / "table.csv", ["a"], [])
