"""A shaded table of numbers as a figure: rows by columns, one panel per quantity; lost flights stand out."""

from __future__ import annotations

from collections.abc import Sequence

import matplotlib as mpl
import numpy as np
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure

from rotorfault.report.style import ORANGE, STYLE, new_figure

Cell = float | str | None  # a number, a word for a flight without one, or nothing flown


def grid_figure(
    panels: Sequence[tuple[str, float, list[list[Cell]]]],
    rows: Sequence[str],
    columns: Sequence[str],
    groups: Sequence[str],
) -> Figure:
    """Draw tables one above the other.

    Parameters
    ----------
    panels : sequence of (title with unit, least, cells)
        Cells by row and column; numbers shaded on a logarithmic scale, those below `least` written as such.
    rows, columns : sequence of str
    groups : sequence of str
        Names over equal numbers of columns each.
    """
    with mpl.rc_context(STYLE):
        figure = new_figure(1.4 + len(panels) * (1.6 + 0.5 * len(rows)))
        all_axes = figure.subplots(len(panels), 1, squeeze=False)[:, 0]
        for axes, (title, least, cells) in zip(all_axes, panels, strict=True):
            numbers = np.array([[cell if isinstance(cell, float) else np.nan for cell in row] for row in cells])
            shown = np.maximum(numbers, least)
            finite = shown[np.isfinite(shown)]
            low, high = (finite.min(), finite.max()) if finite.size else (1.0, 10.0)
            norm = LogNorm(low, max(high, 1.01 * low))
            axes.imshow(shown, norm=norm, cmap="Blues", aspect="auto", alpha=0.75)
            for i, row in enumerate(cells):
                for j, cell in enumerate(row):
                    _write(axes, i, j, cell, least, norm)
            axes.set_xticks(range(len(columns)), columns)
            axes.set_yticks(range(len(rows)), rows)
            axes.tick_params(length=0.0)
            axes.grid(False)
            axes.spines[:].set_visible(False)
            width = len(columns) // len(groups)
            for k, group in enumerate(groups):
                middle = k * width + (width - 1) / 2.0
                axes.annotate(
                    group, (middle, 1.0), xycoords=("data", "axes fraction"), xytext=(0, 3),
                    textcoords="offset points", ha="center", va="bottom",
                )  # fmt: skip
                if k:
                    axes.axvline(k * width - 0.5, color="white", linewidth=3.0)
            axes.set_title(title, pad=16.0, loc="left", fontweight="bold")
    return figure


def _write(axes: mpl.axes.Axes, i: int, j: int, cell: Cell, least: float, norm: LogNorm) -> None:
    if cell is None:
        return
    colour = "black"
    if isinstance(cell, str):
        axes.add_patch(mpl.patches.Rectangle((j - 0.5, i - 0.5), 1.0, 1.0, color=ORANGE, alpha=0.55, linewidth=0.0))
        text = cell
    else:
        text = f"<{least:g}" if cell < least else f"{cell:.2g}" if cell < 100.0 else f"{cell:.0f}"
        colour = "white" if norm(max(cell, least)) > 0.7 else "black"
    axes.text(j, i, text, ha="center", va="center", fontsize=7.0, color=colour)
