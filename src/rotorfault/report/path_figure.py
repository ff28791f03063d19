"""The path of flights in space, with start, target and the places where faults set in."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from matplotlib.transforms import Bbox

from rotorfault.maths.arrays import Array
from rotorfault.report.drawn import Drawn
from rotorfault.report.marks import END, REFERENCE, legend, sample
from rotorfault.report.style import BLACK, GREY, extremes, new_figure, span

START: dict[str, Any] = {"linestyle": "", "marker": "o", "markersize": 5.0, "markerfacecolor": "white"}
FAULT: dict[str, Any] = {"linestyle": "", "marker": "D", "markersize": 4.5, "markeredgecolor": BLACK}
SAME_PLACE = 0.03  # of the largest side of a reference: points closer than this are one place
REACH = 10.0  # largest sides of the reference by which a path may leave it before it is cut
EDGE = 0.96  # share of the figure that the box with its labels takes
TARGET: dict[str, Any] = {"linestyle": "", "marker": "*", "markersize": 9.0, "color": BLACK}


def path_figure(drawn: Sequence[Drawn]) -> Figure:
    """Paths in three dimensions with equal scales, and their shadows on the floor of the box."""
    figure = new_figure(11.5)
    axes: Any = figure.add_subplot(projection="3d")  # Axes3D has no complete type annotations
    low, high = _box(drawn)
    cut = False
    for flight in drawn:
        path = flight.values("position")
        outside = np.any((path < low) | (path > high), axis=1)
        cut |= bool(outside.any())
        kept = np.unique(np.concatenate([extremes(path[:, k]) for k in range(3)]))
        visible = np.where(np.asarray(outside)[:, None], np.nan, path)
        axes.plot(*visible[kept].T, color=flight.colour, linestyle=flight.line, linewidth=flight.width, zorder=4)
        # A shadow on the floor tells how deep the path lies.
        axes.plot(visible[kept, 0], visible[kept, 1], low[2], color="0.8", linewidth=0.7, zorder=1)
        axes.plot(*visible[:1].T, **START, markeredgecolor=flight.colour, zorder=6)
        for time in sorted(set(flight.onsets.values())):
            # Between the last record and the end of the flight there is no place to mark.
            at = visible[int(np.searchsorted(flight.time, time)) :][:1]
            axes.plot(*at.T, **FAULT, markerfacecolor=flight.colour, zorder=7)
        if flight.fate:
            axes.plot(*visible[-1:].T, **END, color=flight.colour, zorder=7)
    others = _targets(axes, drawn)
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
    axes.set_box_aspect(high - low)
    axes.view_init(elev=24.0, azim=-56.0)
    wide = float((high - low).max())
    for name, one, size in zip("xyz", (axes.xaxis, axes.yaxis, axes.zaxis), high - low, strict=True):
        one.set_major_locator(MaxNLocator(max(2, round(6.0 * float(size) / wide)), steps=[1, 2, 2.5, 5, 10]))
        one.set_label_text(f"{name} {drawn[0].unit_of('position')}")
        one.pane.set_facecolor("white")
    axes.tick_params(pad=0.0)
    # Labels stand off in proportion to the sides of the box: in a flat, long one that of z would be far away.
    axes.zaxis.labelpad = 17.5 * float((high - low)[2]) / wide - 13.5
    others.insert(0, sample("start", color=GREY, **START))
    if cut:
        others.append(sample("cut where it is far off", linestyle=""))
    top = legend(figure, drawn, others, onset_style=FAULT | {"markerfacecolor": GREY})
    _fill(figure, axes, high - low, top)
    return figure


def _fill(figure: Figure, axes: Any, aspect: Array, top: float) -> None:
    """Enlarge and move the box so that it fills the figure below `top` with all its labels inside.

    The layout engine cannot do this: it takes the room of axes in three dimensions for given.
    """
    figure.set_layout_engine("none")
    zoom, middle, size = 1.0, np.array([0.5, top / 2.0]), np.array([1.0, top])
    for _ in range(3):  # labels do not grow with the box, so one round is not enough
        axes.set_box_aspect(aspect, zoom=zoom)
        axes.set_position([*(middle - size / 2.0), *size])
        figure.draw_without_rendering()
        extent = Bbox.union(
            [axis.get_tightbbox() for axis in (axes.xaxis, axes.yaxis, axes.zaxis)] + [_corners(axes)]
        )
        low, high = figure.transFigure.inverted().transform(extent.get_points())
        zoom *= float(min(EDGE / (high - low)[0], EDGE * top / (high - low)[1]))
        middle += np.array([0.5, top / 2.0]) - 0.5 * (low + high)
    axes.set_position([*(middle - size / 2.0), *size])


def _corners(axes: Any) -> Bbox:
    corners = np.array([*product(axes.get_xlim(), axes.get_ylim(), axes.get_zlim(), [1.0])])
    x, y, _, w = axes.get_proj() @ corners.T
    pixels = axes.transData.transform(np.column_stack([x / w, y / w]))
    return Bbox([pixels.min(axis=0), pixels.max(axis=0)])


def _box(drawn: Sequence[Drawn]) -> tuple[Array, Array]:
    """Corners of the drawn space: paths and references, paths that fly far off cut."""
    low, high = np.zeros(3), np.zeros(3)
    targets, starts = [f.values("position_reference") for f in drawn], [f.values("position")[:1] for f in drawn]
    core = np.concatenate(targets + starts)
    size = max(float(np.ptp(core, axis=0).max()), 1.0)
    for k in range(3):
        least, most = span([f.values("position", k) for f in drawn] + [core[:, k]]) or (0.0, 0.0)
        least, most = max(least, core[:, k].min() - REACH * size), min(most, core[:, k].max() + REACH * size)
        low[k], high[k] = least, most
    # A path in a plane still gets a box with some depth.
    spare = np.maximum(0.3 * (high - low).max() - (high - low), 0.0) / 2.0 + 0.04 * (high - low).max()
    spare = spare if (high > low).any() else np.full(3, 0.5)
    return low - spare, high + spare


def once(path: Array) -> Array:
    """A path with gaps (NaN) where it has been before: dashes drawn twice would fill each other's gaps."""
    cell = SAME_PLACE * float(np.ptp(path, axis=0).max())
    _, first, cells = np.unique(np.floor(path / cell), axis=0, return_index=True, return_inverse=True)
    cells = cells.reshape(-1)
    visit = np.cumsum(np.diff(cells, prepend=cells[0]) != 0)
    return np.where((visit == visit[first][cells])[:, None], path, np.nan)


def _targets(axes: Any, drawn: Sequence[Drawn]) -> list[Any]:
    """Draw where the flights were to go: a path where the reference moves, a star where it ends."""
    handles: list[Any] = []
    names: set[str] = set()
    for flight in drawn:
        path = flight.values("position_reference")
        if np.ptp(path, axis=0).max() > 1e-9:
            path = once(path)
            kept = np.unique(np.concatenate([extremes(path[:, k]) for k in range(3)]))
            axes.plot(*path[kept].T, **REFERENCE, zorder=5)
            name, style = "reference", REFERENCE
        else:
            axes.plot(*path[-1:].T, **TARGET, zorder=5)
            name, style = "target", TARGET
        if name not in names:
            names.add(name)
            handles.append(sample(name, **style))
    return handles
