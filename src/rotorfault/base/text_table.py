"""Tables of plain text, for terminals."""

from __future__ import annotations

import shutil
import textwrap
from collections.abc import Iterator, Sequence

NARROWEST = 24  # characters of a column whose text goes on in further lines
PAGE = 118  # characters of a line where no terminal says how many it has


def terminal_width() -> int:
    """Characters of a line of the terminal."""
    return shutil.get_terminal_size((PAGE, 24)).columns


def table_lines(
    rows: Sequence[Sequence[str]],
    align: str,
    indent: int = 0,
    rule: bool = False,
    least: Sequence[int] = (),
    most: int | None = None,
) -> list[str]:
    """Rows as lines, columns aligned and two spaces apart, without spaces at their ends.

    Parameters
    ----------
    rows : sequence of sequence of str
        A text per column each; a heading is a row like the others.
    align : str
        ``<`` (left) or ``>`` (right) for each column.
    indent : int
        Spaces before each line.
    rule : bool
        Whether a line of dashes follows the first row.
    least : sequence of int, optional
        Least widths of the first columns in characters, for tables that are to stand below each other.
    most : int, optional
        Characters of a line: beyond, the text of the last column goes on below.

    Returns
    -------
    list of str
    """
    widths = [max(len(cell) for cell in column) for column in zip(*rows, strict=True)]
    widths[: len(least)] = [max(pair) for pair in zip(least, widths, strict=False)]
    if most is not None:
        widths[-1] = min(widths[-1], max(NARROWEST, most - indent - sum(widths[:-1]) - 2 * len(widths[:-1])))
        rows = [line for row in rows for line in _wrapped(row, widths[-1])]
    lines = [
        " " * indent + "  ".join(f"{cell:{a}{w}}" for cell, a, w in zip(row, align, widths, strict=True)).rstrip()
        for row in rows
    ]
    if rule:
        lines.insert(1, " " * indent + "  ".join("-" * width for width in widths))
    return lines


def _wrapped(row: Sequence[str], width: int) -> Iterator[Sequence[str]]:
    """A row with the text of its last column in lines of a width."""
    first, *rest = textwrap.wrap(row[-1], width, break_on_hyphens=False) or [""]
    yield [*row[:-1], first]
    yield from ([*("" for _ in row[:-1]), line] for line in rest)
