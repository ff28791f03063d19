"""Tables of plain text, for terminals."""

from __future__ import annotations

from collections.abc import Sequence


def table_lines(
    rows: Sequence[Sequence[str]], align: str, indent: int = 0, rule: bool = False, least: Sequence[int] = ()
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

    Returns
    -------
    list of str
    """
    widths = [max(len(cell) for cell in column) for column in zip(*rows, strict=True)]
    widths[: len(least)] = [max(pair) for pair in zip(least, widths, strict=False)]
    lines = [
        " " * indent + "  ".join(f"{cell:{a}{w}}" for cell, a, w in zip(row, align, widths, strict=True)).rstrip()
        for row in rows
    ]
    if rule:
        lines.insert(1, " " * indent + "  ".join("-" * width for width in widths))
    return lines
