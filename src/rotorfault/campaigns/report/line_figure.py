"""Studies with one axis: success rates and differences as lines with intervals."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from rotorfault.campaigns.report.axis_drawing import (
    coarse,
    known_between,
    label,
    legend_columns,
    pieces,
    places,
    scale_x,
)
from rotorfault.campaigns.report.curves import LEVELS, Slice, crossings, edges
from rotorfault.campaigns.report.maps import Maps
from rotorfault.campaigns.sampling.statistics import Array
from rotorfault.report.style import BLACK, COLOURS, GREY, LINES, new_figure, shown

LINE = Slice("", (slice(None),))
# Black, as colours are those of the variants.
WITH_YAW: dict[str, Any] = {"color": BLACK, "linestyle": "-", "linewidth": 1.2}
WITHOUT_YAW: dict[str, Any] = {"color": BLACK, "linestyle": (0, (2.4, 1.2)), "linewidth": 1.2}

FAINT: dict[str, Any] = {"linestyle": (0, (4.0, 3.0)), "linewidth": 0.6, "alpha": 0.6}


def look(k: int) -> dict[str, Any]:
    """Colour and kind of line of the k-th variant."""
    return {"color": COLOURS[k % len(COLOURS)], "linestyle": LINES[k // len(COLOURS) % len(LINES)]}


def join(axes: Axes, at: Array, values: Array, known: NDArray[np.bool_], style: dict[str, Any]) -> None:
    """Lines between the marks of neighbouring cells: faint and dashed where what lies between is not known.

    Parameters
    ----------
    axes : Axes
    at, values : ndarray, shape (cells,)
    known : ndarray of bool, shape (cells - 1,)
    style : dict
        Of the line where it is known.
    """
    for which, look_of in ((known, style), (~known, {**FAINT, "color": style["color"]})):
        cells = pieces(values, which)
        axes.plot(*(np.where(cells < 0, np.nan, each[cells]) for each in (at, values)), **look_of)


def success_lines(maps: Maps) -> Figure:
    """Success rates with the intervals of cells, and where they cross the levels; below, the number of flights."""
    figure = new_figure(11.0)
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=[3.0, 1.0])
    x = maps.views[0]
    at = places(x)
    handles: dict[str, Artist] = {}
    beside = _beside(maps)
    for k, variant in enumerate(maps.variants):
        style = look(k)
        marks = {**style, "linestyle": "none", "marker": "o", "markersize": 3.0}
        if x.numeric:
            known = known_between(x, variant.lower, variant.upper)
            join(above, at, variant.success_rate, known, style)
        above.plot(at, variant.success_rate, **marks)
        reach = [variant.success_rate - variant.lower, variant.upper - variant.success_rate]
        above.errorbar(
            at + beside[k],
            variant.success_rate,
            yerr=np.nan_to_num(reach),
            fmt="none",
            ecolor=style["color"],
            elinewidth=0.7,
        )
        below.plot(at, np.where(variant.flights > 0, variant.flights, np.nan), **marks)
        handles[shown(variant.label, 30)] = Line2D([], [], marker="o", markersize=3.0, **style)
        for level in LEVELS:
            _crossing(above, maps, k, level)
    for level in LEVELS:
        above.axhline(level, color=GREY, linewidth=0.6, zorder=1.0)
    _limits(above, maps, handles)
    above.set_ylim(-0.03, 1.05)
    above.set_ylabel("success rate (–)")
    below.set_ylim(0.0, 1.08 * max(int(variant.flights.max()) for variant in maps.variants))
    below.set_ylabel("flights (–)")
    _finish(figure, below, maps, handles)
    return figure


def difference_lines(maps: Maps) -> Figure:
    """Differences of success rates with the intervals of their cells; filled where significant."""
    figure = new_figure(7.5)
    axes = figure.subplots()
    at = places(maps.views[0])
    handles: dict[str, Artist] = {}
    width = _width(maps)
    for k, pair in enumerate(maps.pairings):
        style = {**look(k), "linestyle": "none"}
        here = at + width * (k - 0.5 * (len(maps.pairings) - 1)) / len(maps.pairings)
        estimate, lower, upper = pair.difference
        reach = np.nan_to_num([estimate - lower, upper - estimate])
        axes.errorbar(here, estimate, yerr=reach, fmt="none", ecolor=style["color"], elinewidth=0.7)
        for which, fill in ((pair.significant, style["color"]), (~pair.significant, "white")):
            axes.plot(here[which], estimate[which], marker="o", markersize=3.6, markerfacecolor=fill, **style)
        handles[shown(f"{pair.first} less {pair.second}", 40)] = Line2D([], [], marker="o", markersize=3.6, **style)
    handles["significant after Holm's correction: filled"] = Line2D(
        [], [], marker="o", markersize=3.6, color=BLACK, linestyle="none"
    )
    axes.axhline(0.0, color=GREY, linewidth=0.6, zorder=1.0)
    axes.set_ylim(-1.05, 1.05)
    axes.set_ylabel("difference of success rates (–)")
    _finish(figure, axes, maps, handles)
    return figure


def _width(maps: Maps) -> float:
    """Over which marks of one cell are spread, so that none hides another."""
    at = places(maps.views[0])
    return 0.2 * float(np.diff(at).min()) if len(at) > 1 else 0.2


def _beside(maps: Maps) -> list[float]:
    count = len(maps.variants)
    return [_width(maps) * (k - 0.5 * (count - 1)) / count for k in range(count)]


def _crossing(axes: Axes, maps: Maps, k: int, level: float) -> None:
    """The interval of a crossing lies on the level's line."""
    x, crossed = maps.views[0], crossings(maps, maps.variants[k], LINE, level)
    for point, lower, upper in zip(crossed.points[:, 0], crossed.lower, crossed.upper, strict=True):
        ends = [x.coordinates(np.array([point if np.isnan(end) else end]))[0] for end in (lower, upper)]
        colour = look(k)["color"]
        axes.plot(ends, [level, level], color=colour, linewidth=2.4, alpha=0.45, solid_capstyle="butt")
        if not coarse(x):  # else where between two cells it is, nobody has seen
            at = x.coordinates(np.array([point]))
            axes.plot(at, [level], color=colour, marker="|", markersize=7.0, markeredgewidth=1.4)


def _limits(axes: Axes, maps: Maps, handles: dict[str, Artist]) -> None:
    """Limits of hover; of variants that share them once."""
    lines: set[tuple[str, float]] = set()
    for k in range(len(maps.variants)):
        edge = edges(maps, k, LINE)
        for text, style, places_of in (
            ("limit of hover, yaw held", WITH_YAW, edge.with_yaw if edge else []),
            ("limit of hover, yaw given up", WITHOUT_YAW, edge.without_yaw if edge else []),
        ):
            for point in places_of:
                if (key := (text, round(float(point[0, 0]), 9))) not in lines:
                    axes.axvline(float(maps.views[0].coordinates(point[:, 0])[0]), **style)
                    handles[text] = Line2D([], [], **style)
                    lines.add(key)


def _finish(figure: Figure, lowest: Axes, maps: Maps, handles: dict[str, Artist]) -> None:
    scale_x(lowest, maps.views[0])
    lowest.set_xlabel(label(maps.views[0]))
    figure.align_ylabels()
    figure.legend(list(handles.values()), list(handles), loc="outside upper center", ncols=legend_columns(handles))
