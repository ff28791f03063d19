"""Conclusions as a chart: a row per variation, a column per conclusion and case, moved ones marked."""

from __future__ import annotations

from collections.abc import Sequence

import matplotlib as mpl
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Rectangle

from rotorfault.report.style import ORANGE, SKY, STYLE, new_figure

NOTHING = "0.88"  # grey: a flight was lost, or both are equal
Cell = tuple[bool | None, bool] | None  # (holds, moved against the baseline); None: not flown


def conclusion_figure(
    cells: Sequence[Sequence[Cell]],
    labels: Sequence[tuple[str, str]],
    titles: Sequence[str],
    cases: Sequence[str],
) -> Figure:
    """Draw the chart.

    Parameters
    ----------
    cells : sequence of rows
        Columns by conclusion, then case.
    labels : sequence of (group, label)
        A line separates groups.
    titles : sequence of str
        One per conclusion.
    cases : sequence of str
        Written under the columns of each conclusion.
    """
    with mpl.rc_context(STYLE):
        figure = new_figure(2.6 + 0.4 * len(labels))
        axes = figure.subplots()
        for i, row in enumerate(cells):
            for j, cell in enumerate(row):
                if cell is None:
                    continue
                colour = NOTHING if cell[0] is None else SKY if cell[0] else ORANGE
                axes.add_patch(Rectangle((j - 0.45, i - 0.42), 0.9, 0.84, color=colour, linewidth=0.0))
                if cell[1]:
                    axes.plot(j, i, "o", color="black", markersize=2.6)
        n = len(cases)
        axes.set_xlim(-0.6, n * len(titles) - 0.4)
        axes.set_ylim(len(labels) - 0.4, -0.6)
        axes.set_xticks(range(n * len(titles)), list(cases) * len(titles))
        axes.set_yticks(range(len(labels)), [label for _, label in labels])
        axes.set_xlabel("case (number)")
        axes.tick_params(length=0.0)
        axes.grid(False)
        axes.spines[:].set_visible(False)
        for k, title in enumerate(titles):
            axes.annotate(
                title, (n * k + (n - 1) / 2.0, 1.0), xycoords=("data", "axes fraction"), xytext=(0, 3),
                textcoords="offset points", ha="center", va="bottom",
            )  # fmt: skip
            if k:
                axes.axvline(n * k - 0.5, color="0.6", linewidth=0.8)
        for i in range(1, len(labels)):
            if labels[i][0] != labels[i - 1][0]:
                axes.axhline(i - 0.5, color="0.6", linewidth=0.5)
        handles = [
            Patch(color=SKY, label="holds"),
            Patch(color=ORANGE, label="does not hold"),
            Patch(color=NOTHING, label="nothing to compare (lost, or equal)"),
            Line2D([], [], marker="o", color="black", linestyle="", markersize=2.6, label="differs from baseline"),
        ]
        figure.legend(handles=handles, loc="outside lower center", ncols=4)
    return figure
