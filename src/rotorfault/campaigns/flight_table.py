"""The table of a campaign as users have it: an Arrow table that becomes pandas or polars too."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, final

import pyarrow as pa

from rotorfault.base.frames import require_pandas

if TYPE_CHECKING:
    import pandas as pd
    import polars as pl


@final
class FlightTable:
    """One row per flight of a campaign.

    ``pandas.DataFrame(table)``, ``polars.DataFrame(table)`` and ``pyarrow.table(table)`` take it as it is; whatever a
    `pyarrow.Table` has (``column_names``, ``num_rows``, ``filter``, ``to_pylist`` ...), it has too.

    Parameters
    ----------
    table : pyarrow.Table
    """

    def __init__(self, table: pa.Table) -> None:
        self._table = table

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(f"'FlightTable' object has no attribute '{name}'")
        return getattr(self._table, name)

    def __dir__(self) -> list[str]:
        return sorted({*super().__dir__(), *(name for name in dir(self._table) if not name.startswith("_"))})

    def __repr__(self) -> str:
        return f"<table of {len(self):,} flights: {len(self._table.column_names)} columns>"

    def __len__(self) -> int:
        return int(self._table.num_rows)

    def __getitem__(self, name: str) -> Any:
        """A column, as Arrow has it."""
        return self._table[name]

    def __contains__(self, name: object) -> bool:
        return name in self._table.column_names

    def __iter__(self) -> Iterator[dict[str, Any]]:
        return iter(self._table.to_pylist())

    def __eq__(self, other: object) -> bool:
        return bool(self._table.equals(other._table)) if isinstance(other, FlightTable) else NotImplemented

    __hash__ = None  # type: ignore[assignment]

    def __arrow_c_stream__(self, requested_schema: object = None) -> object:
        """The table for polars, pyarrow and whatever else speaks the protocol of Arrow."""
        stream: object = self._table.__arrow_c_stream__(requested_schema)
        return stream

    def to_pandas(self) -> pd.DataFrame:
        """The table as a pandas DataFrame.

        Raises
        ------
        MissingExtraError
            If pandas is not installed.
        """
        require_pandas()
        frame: pd.DataFrame = self._table.to_pandas()
        return frame

    def to_polars(self) -> pl.DataFrame:
        """The table as a polars DataFrame."""
        import polars as pl

        return pl.DataFrame(self._table)

    def to_arrow(self) -> pa.Table:
        """The table as a pyarrow Table."""
        return self._table
