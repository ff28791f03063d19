"""Mean square errors as bars: position above, attitude below, a column per sampling period.

A flight that was lost keeps its bars, over the time it flew; they are hatched, and when it ended is said above.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.ticker import LogLocator, MaxNLocator, NullLocator

from rotorfault.report.style import GREY, new_figure, number, span

ROWS = (("position", "position_mse", "m²"), ("attitude", "attitude_mse", "rad²"))
WIDE = 30.0  # largest over least value from which an axis is logarithmic
HEAD = 0.36  # share of a panel above the tallest bar, for the numbers
FOOT = 2.5  # the shortest bar on a logarithmic axis reaches from its value over this
LOST = "///////"


class Column(NamedTuple):
    """Flights beside each other in one column."""

    title: str
    summaries: Mapping[str, Mapping[str, Any]]  # by label, as `Flight.summary` gives them


def error_figure(columns: Sequence[Column], colours: Mapping[str, str]) -> Figure:
    """Bars of the mean square errors.

    Parameters
    ----------
    columns : sequence of Column
    colours : mapping of str to str
        Colour of each label; its order is that of the bars. With two labels, the ratio of the second to the first
        stands under each pair of flights that both flew to the end.
    """
    figure = new_figure(10.5)
    grid = figure.subplots(len(ROWS), len(columns), squeeze=False, sharey="row")
    labels = [label for label in colours if any(label in column.summaries for column in columns)]
    lost = False
    for row, (name, key, unit) in zip(grid, ROWS, strict=True):
        _scale(row[0], [value for column in columns for s in column.summaries.values() for value in s[key].values()])
        for axes, column in zip(row, columns, strict=True):
            lost |= _draw_column(axes, column, key, {label: colours[label] for label in labels})
        row[0].set_ylabel(f"{name} MSE ({unit})")
    for axes, column in zip(grid[0], columns, strict=True):
        axes.set_title("\n".join([column.title, *_fates(column, labels)]))
    figure.align_ylabels(grid[:, 0])
    handles: list[Artist] = [Patch(facecolor=colours[label], label=label) for label in labels]
    if lost:
        handles.append(Patch(facecolor="white", edgecolor=GREY, hatch=LOST, label="lost flight: mean until its end"))
    figure.legend(handles=handles, loc="outside upper center", ncols=len(handles))
    if len(labels) == 2:
        figure.supxlabel(f"under each axis: MSE of {labels[1]} over that of {labels[0]} (–)", fontsize=7.5)
    return figure


def _fates(column: Column, labels: Sequence[str]) -> list[str]:
    """A line for each flight of a column that was lost."""
    flights = [(label, column.summaries[label]) for label in labels if label in column.summaries]
    return [f"{label} {s['outcome']} at {s['end_time']:.3g} s" for label, s in flights if not s["survived"]]


def _scale(axes: Axes, values: Sequence[float | None]) -> None:
    """Limits with room for numbers above the bars; logarithmic where the values differ much."""
    positive = np.array([value for value in values if value is not None and value > 0.0], dtype=float)
    low, high = span([positive]) or (0.0, 1.0)
    if low > 0.0 and high > WIDE * low:
        bottom = low / FOOT
        axes.set_yscale("log")
        axes.set_ylim(bottom, bottom * (high / bottom) ** (1.0 / (1.0 - HEAD)))
        axes.yaxis.set_major_locator(LogLocator(numticks=8))
        axes.yaxis.set_minor_locator(NullLocator())
    else:
        axes.set_ylim(0.0, high / (1.0 - HEAD))
        axes.yaxis.set_major_locator(MaxNLocator(5, steps=[1, 2, 2.5, 5, 10]))


def _draw_column(axes: Axes, column: Column, key: str, colours: Mapping[str, str]) -> bool:
    """Bars of one panel; whether one of its flights was lost."""
    width = 0.8 / len(colours)
    names = list(next(iter(column.summaries.values()))[key])
    lost = False
    for k, (label, colour) in enumerate(colours.items()):
        if (summary := column.summaries.get(label)) is None:
            continue
        fell = not summary["survived"]
        lost |= fell
        hatched: dict[str, Any] = {"facecolor": "white", "edgecolor": colour, "hatch": LOST}
        look = hatched if fell else {"color": colour}
        for place, name in enumerate(names):
            value, middle = summary[key][name], place + (k - 0.5 * (len(colours) - 1)) * width
            if value is not None and math.isfinite(value) and value > 0.0:
                axes.bar(middle, value, 0.9 * width, linewidth=0.8, **look)
            floor = axes.get_ylim()[0]
            at, text = (floor, "none") if value is None else (max(value, floor), number(value))
            above: dict[str, Any] = {"textcoords": "offset points", "rotation": 90, "ha": "center", "va": "bottom"}
            axes.annotate(text, (middle, at), (0.0, 2.5), fontsize=6.5, **above)
    axes.set_xticks(range(len(names)), [f"{name}{_ratio(column, key, name, list(colours))}" for name in names])
    axes.set_xlim(-0.55, len(names) - 0.45)
    axes.grid(visible=False, axis="x")
    axes.tick_params(axis="x", length=0.0)
    return lost


def _ratio(column: Column, key: str, name: str, labels: Sequence[str]) -> str:
    """What stands under an axis' name: the ratio of the second flight's error to the first's, or a dash."""
    if len(labels) != 2:
        return ""
    summaries = [column.summaries.get(label) for label in labels]
    if any(summary is None or not summary["survived"] for summary in summaries):
        return "\n–"
    first, second = (summary[key][name] for summary in summaries if summary is not None)
    return f"\n{number(second / first)}" if first and second is not None else "\n–"
