"""One table of text: a row per record, a column per component."""

from __future__ import annotations

from pathlib import Path

from rotorfault.base.csv_text import write_columns
from rotorfault.base.progress import Bar
from rotorfault.results.exporters.content import Content, table


def write_csv(content: Content, path: Path) -> None:
    """Write a flight as one table of text.

    Parameters
    ----------
    content : Content
    path : Path
    """
    found = table(content.data, content.units)
    with Bar("writing", len(content.time), "records") as bar:
        write_columns(path, found, bar.update)
