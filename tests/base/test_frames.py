"""Columns as tables of pandas, polars and Arrow."""

from __future__ import annotations

import importlib.util

import numpy as np
import pytest

from rotorfault.base import frames
from rotorfault.base.errors import MissingExtraError

COLUMNS = {
    "outcome": np.array(["settled", "ground"]),
    "survived": np.array([True, False]),
    "cost": np.array([1.5, np.nan]),
    "alarms": np.array([0, 3]),
    "strided": np.arange(4.0)[::2],
}


def test_all_libraries_have_the_same_table() -> None:
    pytest.importorskip("pandas")
    arrow, polars, pandas = (make(COLUMNS) for make in (frames.to_arrow, frames.to_polars, frames.to_pandas))
    assert arrow.column_names == polars.columns == list(pandas.columns) == list(COLUMNS)
    assert [str(kind) for kind in arrow.schema.types] == ["string", "bool", "double", "int64", "double"]
    for name, column in COLUMNS.items():
        for found in (arrow[name].to_numpy(zero_copy_only=False), polars[name].to_numpy(), pandas[name].to_numpy()):
            assert [repr(x) for x in np.asarray(found).tolist()] == [repr(x) for x in column.tolist()], name


def test_rows_have_the_names_of_the_columns() -> None:
    first, second = frames.rows(COLUMNS)
    assert first == {"outcome": "settled", "survived": True, "cost": 1.5, "alarms": 0, "strided": 0.0}
    assert second["alarms"] == 3


def test_without_pandas_it_is_told_how_to_have_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    with pytest.raises(MissingExtraError, match=r"pip install pandas.*to_polars"):
        frames.to_pandas(COLUMNS)
