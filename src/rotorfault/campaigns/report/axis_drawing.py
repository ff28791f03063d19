"""Axes of a campaign's figures: where cells lie, ticks, labels, panels."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.ticker import MaxNLocator

from rotorfault.campaigns.report.maps import View
from rotorfault.campaigns.sampling.statistics import Array
from rotorfault.report.style import BLUE, ORANGE, SKY, shown, unit

MOST_TICKS = 9
WIDTH_MM, MM_PER_LETTER, MM_PER_HANDLE = 160.0, 1.5, 13.0  # of a legend, as its letters are
# From pale (all failed) to deep (all successful): lines in black and vermilion are seen on all of it.
SUCCESS_COLOURS = ("#FFF6D6", "#CFE4EE", SKY, "#2A85BF")
FLIGHTS_COLOURS = ("#F4F4F4", "#6E6E6E")
DIFFERENCE_COLOURS = ("#B35A00", ORANGE, "#F7F7F7", SKY, BLUE)


def colours(name: str, chosen: Sequence[str]) -> LinearSegmentedColormap:
    """A colour map of some colours."""
    return LinearSegmentedColormap.from_list(name, list(chosen))


def places(view: View) -> Array:
    """Where the cells' middles are drawn."""
    return view.coordinates(view.positions)


def borders(view: View) -> Array:
    """Where the cells' edges are drawn, one more than there are cells."""
    at = places(view)
    if len(at) == 1:
        return np.array([at[0] - 0.5, at[0] + 0.5])
    middles = 0.5 * (at[:-1] + at[1:])
    return np.concatenate([[2.0 * at[0] - middles[0]], middles, [2.0 * at[-1] - middles[-1]]])


def label(view: View) -> str:
    """Name and unit of an axis."""
    return f"{shown(view.title, 40)} ({unit(view.unit)})" if view.unit else shown(view.title, 40)


def ticks(view: View, most: int = MOST_TICKS) -> tuple[Array, list[str]]:
    """Places and texts of ticks: round numbers between the outermost values, or values of cells."""
    at = places(view)
    if view.even and len(view.values) > 1:
        values = np.asarray(MaxNLocator(most, steps=[1, 2, 2.5, 5, 10]).tick_values(at[0], at[-1]))
        slack = 1e-9 * (at[-1] - at[0])
        values = values[(values >= at[0] - slack) & (values <= at[-1] + slack)]
        return values, [f"{value:.10g}".replace("-", "−") for value in values]
    chosen = range(0, len(view.values), -(-len(view.values) // most))
    return np.array([at[i] for i in chosen]), [shown(view.text(i), 14) for i in chosen]


def scale_x(axes: Axes, view: View, most: int = MOST_TICKS) -> None:
    """Limits and ticks of a horizontal axis."""
    edges, (at, texts) = borders(view), ticks(view, most)
    axes.set_xlim(edges[0], edges[-1])
    axes.set_xticks(at, texts)


def scale_y(axes: Axes, view: View) -> None:
    """Limits and ticks of a vertical axis."""
    edges, (at, texts) = borders(view), ticks(view)
    axes.set_ylim(edges[0], edges[-1])
    axes.set_yticks(at, texts)


def legend_columns(labels: Iterable[str], most: int = 4) -> int:
    """Entries beside each other in a legend, so that it stays on the page."""
    longest = max(map(len, labels), default=1)
    return max(1, min(most, int(WIDTH_MM // (MM_PER_LETTER * longest + MM_PER_HANDLE))))


def columns(count: int) -> int:
    """Panels beside each other, so that the last row is well filled."""
    return count if count <= 3 else 2 if count == 4 else 3
