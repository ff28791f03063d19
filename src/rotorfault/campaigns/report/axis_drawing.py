"""Axes of a campaign's figures: where cells lie, ticks, labels, panels."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from rotorfault.campaigns.flight_set import Counts
from rotorfault.campaigns.report.maps import View
from rotorfault.campaigns.sampling.statistics import Array
from rotorfault.report.style import BLUE, ORANGE, SKY, shown, unit

MOST_TICKS = 9
BESIDE = 14  # letters of a name that has others beside it
BELOW = 28  # letters of one that has others below it
MOST_STEP = 0.2  # of an axis, between cells that may be joined by a line
WIDTH_MM, MM_PER_LETTER, MM_PER_HANDLE = 160.0, 1.5, 13.0  # of a legend, as its letters are
# From sand (all failed) to blue (all successful), ever darker, so also in grey: lines in black and vermilion are seen
# on all of it. No cell has a colour that could be taken for the ground, which is hatched where nothing was flown.
SUCCESS_COLOURS = ("#F7DF9C", "#BFDDE6", SKY, "#2A85BF")
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


def ticks(view: View, most: int = MOST_TICKS, letters: int = BESIDE) -> tuple[Array, list[str]]:
    """Places and texts of ticks: round numbers between the outermost values, or values of cells."""
    at = places(view)
    if view.even and len(view.values) > 1:
        values = np.asarray(MaxNLocator(most, steps=[1, 2, 2.5, 5, 10]).tick_values(at[0], at[-1]))
        slack = 1e-9 * (at[-1] - at[0])
        values = values[(values >= at[0] - slack) & (values <= at[-1] + slack)]
        return values, [f"{value:.10g}".replace("-", "−") for value in values]
    chosen = range(0, len(view.values), -(-len(view.values) // most))
    return np.array([at[i] for i in chosen]), [shown(view.text(i), letters) for i in chosen]


def scale_x(axes: Axes, view: View, most: int = MOST_TICKS) -> None:
    """Limits and ticks of a horizontal axis."""
    edges, (at, texts) = borders(view), ticks(view, most)
    axes.set_xlim(edges[0], edges[-1])
    axes.set_xticks(at, texts)


def scale_y(axes: Axes, view: View) -> None:
    """Limits and ticks of a vertical axis."""
    edges, (at, texts) = borders(view), ticks(view, letters=BELOW)
    axes.set_ylim(edges[0], edges[-1])
    axes.set_yticks(at, texts)


def legend_columns(labels: Iterable[str], most: int = 4) -> int:
    """Entries beside each other in a legend, so that it stays on the page."""
    longest = max(map(len, labels), default=1)
    return max(1, min(most, int(WIDTH_MM // (MM_PER_LETTER * longest + MM_PER_HANDLE))))


def coarse(view: View) -> bool:
    """Whether cells lie so far apart that nothing is drawn between them as if it were known.

    The rule: a step is longer than a fifth of what is drawn of the axis; so it is with fewer than six even values.
    """
    at = places(view)
    return len(at) > 1 and bool(np.diff(at).max() > (MOST_STEP + 1e-9) * (at[-1] - at[0]))


def known_between(view: View, lower: Array, upper: Array) -> NDArray[np.bool_]:
    """Between which neighbouring cells a curve may be drawn as a line; elsewhere it is a faint, dashed connection.

    The rule: the axis is not coarse, and the intervals of the two cells overlap. Where they do not, the curve changes
    by more than can be seen of it, and where in between nobody has looked.

    Parameters
    ----------
    view : View
    lower, upper : ndarray, shape (cells,)
        Of the intervals; NaN in cells without flights.

    Returns
    -------
    ndarray of bool, shape (cells - 1,)
    """
    if coarse(view):
        return np.zeros(max(len(lower) - 1, 0), dtype=bool)
    # Asked so that NaN is no overlap.
    return np.asarray((lower[1:] <= upper[:-1]) & (lower[:-1] <= upper[1:]))


def pieces(values: Array, which: NDArray[np.bool_]) -> Counts:
    """Indices of the cells of a broken line over some of the connections between neighbours; -1 is a gap."""
    found: list[int] = []
    for i in np.flatnonzero(which & ~np.isnan(values[:-1]) & ~np.isnan(values[1:])).tolist():
        found += [i + 1] if found and found[-1] == i else [-1, i, i + 1]
    return np.array(found, dtype=np.int64)


def columns(count: int) -> int:
    """Panels beside each other, so that the last row is well filled."""
    return count if count <= 3 else 2 if count == 4 else 3
