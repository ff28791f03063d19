"""Error against cost: what `rotorfault.bench.accuracy` and the peers measured, on logarithmic axes.

Down is more accurate, left is cheaper. Beside each point stands its step.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from itertools import count, cycle, pairwise
from typing import Any, NamedTuple

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter
from matplotlib.transforms import Bbox

from rotorfault.base.errors import InputError
from rotorfault.report.style import BLUE, GREEN, GREY, ORANGE, PURPLE, SKY, STYLE, VERMILION, new_figure

OURS = "rotorfault RK4"
PEER_COLOURS = (VERMILION, GREEN, PURPLE, ORANGE, SKY)
MARKERS = ("o", "s", "^", "D", "v", "P")
LEAST, MOST = 0.35, 0.6  # decades of room around the points: at each side, at the top and the bottom
SIDES = ((1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (-1, 1), (1, -1), (-1, -1))  # where a label may stand
ALIGN: Any = {-1: ("right", "top"), 0: ("center", "center"), 1: ("left", "bottom")}
GAP = 4.8  # points between a marker and its label


Spot = tuple[tuple[float, float], tuple[int, int]]  # a place in the data, and the side of it


class Point(NamedTuple):
    """One step of one series."""

    cost: float  # us of wall time per simulated second on one core
    error: float  # m
    label: str


class Series(NamedTuple):
    """Points that a line joins."""

    label: str
    look: dict[str, Any]  # of the line
    points: list[Point]
    sides: Sequence[tuple[int, int]]  # of the labels, the best one first


def draw(ours: Mapping[str, Any], peers: Mapping[str, Any] | None = None) -> Figure:
    """The figure.

    Parameters
    ----------
    ours : mapping
        What `rotorfault.bench.accuracy.measure` returned.
    peers : mapping, optional
        What `rotorfault.bench.peers.measure` returned; peers without points are left out.

    Returns
    -------
    Figure
        16 cm wide.

    Raises
    ------
    InputError
        If there is no point to draw.
    """
    series = [one for one in (*_ours(ours), *_peers(peers or {})) if one.points]
    if not series:
        raise InputError("accuracy: no step has a positive error and a cost; measure again")
    with rc_context(STYLE):
        figure = new_figure(10.5)
        axes = figure.add_subplot()
        for one in series:
            axes.plot([p.cost for p in one.points], [p.error for p in one.points], label=one.label, **one.look)
        axes.axhline(ours["limit_m"], color=GREY, linestyle=(0, (6.0, 1.5, 1.0, 1.5)), linewidth=0.9, zorder=1.6)
        _axes(axes, [p for one in series for p in one.points], float(ours["limit_m"]))
        figure.legend(loc="outside upper center", ncols=min(3, len(series)))
        figure.draw_without_rendering()  # places of labels are measured on the page
        name = f"1/{1.0 / ours['share']:.0f} of what sensor noise or 1 % more mass does"
        _label(axes, series, float(ours["limit_m"]), name)
    return figure


def _ours(ours: Mapping[str, Any]) -> Iterator[Series]:
    # The two curves start at one point and run side by side: labels stand on their outer sides.
    sides = (((1, 0), (1, 1), *SIDES), ((-1, 0), (-1, -1), *SIDES))
    for k, (name, curve) in enumerate(ours["curves"].items()):
        look = {"color": BLUE, "marker": "o", "markersize": 4.5, "linestyle": "-" if k == 0 else ":", "zorder": 3.0}
        look["markerfacecolor"] = BLUE if k == 0 else "white"
        yield Series(f"{OURS}, {name}", look, _points(curve["points"]), sides[min(k, 1)])


def _peers(peers: Mapping[str, Any]) -> Iterator[Series]:
    colours = cycle(PEER_COLOURS)
    for name, result in peers.items():
        entries = result.get("accuracy", [])
        if not entries:
            continue
        colour, number = next(colours), count()
        for integrator in dict.fromkeys(str(entry["integrator"]) for entry in entries):
            look = {"color": colour, "marker": MARKERS[next(number) % len(MARKERS)], "markersize": 4.5}
            own = [entry for entry in entries if str(entry["integrator"]) == integrator]
            yield Series(f"{name}, {integrator}", look | {"linestyle": "-", "linewidth": 0.9}, _points(own), SIDES)


def _points(entries: Sequence[Mapping[str, Any]]) -> list[Point]:
    points = []
    for entry in sorted(entries, key=lambda entry: float(entry["step"])):
        error, speed = float(entry["error_m"]), float(entry["simulated_s_per_s_per_core"])
        if 0.0 < error < math.inf and 0.0 < speed < math.inf:
            points.append(Point(1e6 / speed, error, f"{1e3 * float(entry['step']):.3g} ms"))
    return points


def _axes(axes: Axes, points: Sequence[Point], limit: float) -> None:
    axes.set_xscale("log")
    axes.set_yscale("log")
    costs, errors = [point.cost for point in points], [*(point.error for point in points), limit]
    axes.set_xlim(min(costs) * 10.0**-LEAST, max(costs) * 10.0**LEAST)
    axes.set_ylim(min(errors) * 10.0**-MOST, max(errors) * 10.0**MOST)
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(LogLocator(numticks=9))
        axis.set_minor_formatter(NullFormatter())
    axes.set_xlabel("wall time per simulated second and core (µs)")
    axes.set_ylabel("error of the position at 10 s (m)")


def _label(axes: Axes, series: Sequence[Series], limit: float, name: str) -> None:
    """Write the step beside each point, and the name of the limit along its line, where nothing else stands."""
    place, points = axes.transData.transform, axes.figure.dpi / 72.0
    marks = [place((p.cost, p.error)) for one in series for p in one.points]
    taken = [Bbox.from_bounds(x - 3.0 * points, y - 3.0 * points, 6.0 * points, 6.0 * points) for x, y in marks]
    taken += _along(axes, series, 2.0 * points)
    low, high = axes.get_xlim()
    along = [(low * (high / low) ** share, limit) for share in (0.99, 0.75, 0.5, 0.25, 0.01)]
    y = float(place((low, limit))[1])
    taken.append(Bbox.from_extents(axes.bbox.x0, y - 0.5, axes.bbox.x1, y + 0.5))
    spots = [(where, side) for where in along for side in ((-1, 1), (-1, -1), (1, 1), (1, -1))]
    taken.append(_write(axes, name, spots, taken, GREY))
    written: list[tuple[float, float, str]] = []
    for one in series:
        for p in one.points:
            x, y = place((p.cost, p.error))
            if any(p.label == text and math.hypot(x - a, y - b) < 4.0 * points for a, b, text in written):
                continue  # two series share this point
            written.append((x, y, p.label))
            spots = [((p.cost, p.error), side) for side in one.sides]
            taken.append(_write(axes, p.label, spots, taken, one.look["color"]))


def _along(axes: Axes, series: Sequence[Series], size: float) -> list[Bbox]:
    """Small boxes along all lines, so that no label lies on one."""
    boxes = []
    for one in series:
        marks = [axes.transData.transform((p.cost, p.error)) for p in one.points]
        for (x0, y0), (x1, y1) in pairwise(marks):
            parts = max(2, math.ceil(math.hypot(x1 - x0, y1 - y0) / size))
            for k in range(1, parts):
                x, y = x0 + (x1 - x0) * k / parts, y0 + (y1 - y0) * k / parts
                boxes.append(Bbox.from_bounds(x - 0.5, y - 0.5, 1.0, 1.0))
    return boxes


def _write(axes: Axes, text: str, spots: Sequence[Spot], taken: Sequence[Bbox], colour: str) -> Bbox:
    """Write a text at the first spot where it covers nothing, else where it covers least; its box."""
    written = axes.annotate(text, (1.0, 1.0), (0.0, 0.0), textcoords="offset points", color=colour, fontsize=7.0)
    written.set_in_layout(False)

    def put(spot: Spot) -> Bbox:
        where, (right, up) = spot
        gap = GAP if 0 in (right, up) else 0.7 * GAP
        written.xy = where
        written.set_position((gap * right, gap * up))
        written.set_horizontalalignment(ALIGN[right][0])
        written.set_verticalalignment(ALIGN[up][1])
        return written.get_window_extent()

    best = min(spots, key=lambda spot: _covered(put(spot), taken, axes.bbox))  # the first of equals
    return put(best)


def _covered(box: Bbox, taken: Sequence[Bbox], page: Bbox) -> float:
    """Area of a box that lies on others or outside the page."""
    low, high = np.array([(other.min, other.max) for other in (page, *taken)]).swapaxes(0, 1)
    sides = np.maximum(np.minimum(high, box.max) - np.maximum(low, box.min), 0.0)
    inside, *shared = np.prod(sides, axis=1)
    # Rounding must not decide between two that cover nothing.
    return float(max(box.width * box.height - inside, 1e-6) + sum(shared))
