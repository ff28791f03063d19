"""Columns as tables of pandas, polars and Arrow.

What has columns offers them by the protocol of Arrow (``__arrow_c_stream__``), which polars, pyarrow and others take
as it is, and by its rows, which pandas takes. pandas comes with xarray, but nothing here asks for it before it is
wanted.
"""

from __future__ import annotations

import importlib.util
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from rotorfault.base.errors import MissingExtraError

if TYPE_CHECKING:
    import pandas as pd
    import polars as pl
    import pyarrow as pa

Columns = Mapping[str, NDArray[Any]]


def to_arrow(columns: Columns) -> pa.Table:
    """Columns as an Arrow table.

    Parameters
    ----------
    columns : mapping of str to ndarray, shape (N,)
    """
    # Takes longer to load than many flights to fly.
    import pyarrow as pa

    return pa.table({name: pa.array(_plain(column)) for name, column in columns.items()})


def to_polars(columns: Columns) -> pl.DataFrame:
    """Columns as a data frame of polars.

    Parameters
    ----------
    columns : mapping of str to ndarray, shape (N,)
    """
    import polars as pl

    return pl.DataFrame({name: _plain(column) for name, column in columns.items()})


def to_pandas(columns: Columns) -> pd.DataFrame:
    """Columns as a data frame of pandas.

    Parameters
    ----------
    columns : mapping of str to ndarray, shape (N,)

    Raises
    ------
    MissingExtraError
        If pandas is not installed.
    """
    require_pandas()
    import pandas as pd

    return pd.DataFrame({name: _plain(column) for name, column in columns.items()})


def require_pandas() -> None:
    """Say how pandas is had where it is not installed; see `MissingExtraError`."""
    if importlib.util.find_spec("pandas") is None:
        raise MissingExtraError(
            "a pandas table needs pandas, which is not installed; install it with 'pip install pandas', or take "
            "to_polars() or to_arrow()"
        )


def rows(columns: Columns) -> Iterator[dict[str, Any]]:
    """Row after row, each with the names of the columns.

    Parameters
    ----------
    columns : mapping of str to ndarray, shape (N,)
    """
    lists = [np.asarray(column).tolist() for column in columns.values()]
    return (dict(zip(columns, row, strict=True)) for row in zip(*lists, strict=True))


def _plain(column: NDArray[Any]) -> Any:
    """A column as all of them take it: texts as a list, for they know no texts of NumPy."""
    column = np.asarray(column)
    return column.tolist() if column.dtype.kind in "UO" else np.ascontiguousarray(column)
