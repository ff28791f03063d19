"""Maps: success rates with their boundaries, number of flights, differences between two variants."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import QuadMesh
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Rectangle

from rotorfault.campaigns.report.axis_drawing import (
    DIFFERENCE_COLOURS,
    FLIGHTS_COLOURS,
    SUCCESS_COLOURS,
    borders,
    coarse,
    colours,
    columns,
    label,
    places,
    scale_x,
    scale_y,
)
from rotorfault.campaigns.report.curves import LEVELS, Crossings, Slice, crossings, edges, slices
from rotorfault.campaigns.report.maps import Maps
from rotorfault.campaigns.sampling.statistics import Array
from rotorfault.report.style import BLACK, VERMILION, new_figure, shown

HALO: dict[str, Any] = {"color": "white", "linestyle": "-", "linewidth": 2.4, "alpha": 0.85}
LEVEL_LINES: dict[float, dict[str, Any]] = {
    0.5: {"color": BLACK, "linestyle": "-", "linewidth": 1.3},
    0.99: {"color": BLACK, "linestyle": (0, (2.4, 1.2)), "linewidth": 1.1},
}
WITH_YAW: dict[str, Any] = {"color": VERMILION, "linestyle": "-", "linewidth": 1.2}
WITHOUT_YAW: dict[str, Any] = {"color": VERMILION, "linestyle": (0, (2.4, 1.2)), "linewidth": 1.2}
DOTS: dict[str, Any] = {"color": BLACK, "marker": "o", "markersize": 2.4, "linestyle": "none"}
EMPTY = "0.85"
NOT_FLOWN: dict[str, Any] = {"facecolor": EMPTY, "edgecolor": "0.6", "linewidth": 0.0, "hatch": "/////"}
# Between coarse cells, where they run is not known: thin, and told apart by their dashes.
GUESSES: dict[float, dict[str, Any]] = {
    0.5: {"color": "0.35", "linestyle": (0, (9.0, 3.0)), "linewidth": 0.7},
    0.99: {"color": "0.35", "linestyle": (0, (2.4, 2.4)), "linewidth": 0.7},
}


class MapPanel(NamedTuple):
    """One map of a figure."""

    which: int  # place of the variant, or of the pair
    part: Slice
    title: str


def success_maps(maps: Maps, panels: Sequence[MapPanel], title: str = "") -> Figure:
    """Success rates with boundaries and limits; below each map the number of flights, where it is not the same."""
    counts = np.unique([panel.part.of(maps.variants[panel.which].flights) for panel in panels])
    figure, grid = _grid(maps, panels, title, rows=1 if len(counts) == 1 else 2)
    most = max(int(variant.flights.max()) for variant in maps.variants)
    handles: dict[str, Artist] = {}
    meshes: dict[str, QuadMesh] = {}
    for panel, axes, below in grid:
        variant = maps.variants[panel.which]
        rate, flights = panel.part.of(variant.success_rate), panel.part.of(variant.flights)
        meshes["success rate"] = _mesh(axes, maps, rate, SUCCESS_COLOURS, (0.0, 1.0))
        if below is not axes:
            flown = np.where(flights > 0, flights, np.nan)
            meshes["flights"] = _mesh(below, maps, flown, FLIGHTS_COLOURS, (0.0, float(most)))
        if np.isnan(rate).any():
            handles["not flown"] = Patch(**NOT_FLOWN)
        if not np.nan_to_num(rate).any():
            handles["no flight was successful"] = Patch(facecolor=SUCCESS_COLOURS[0])
        _limits(axes, maps, panel, handles)
        for level in LEVELS:
            _boundary(axes, maps, crossings(maps, variant, panel.part, level), handles)
    if len(counts) == 1:
        handles[f"each cell: {counts[0]:,} flight{'' if counts[0] == 1 else 's'}"] = Line2D([], [], linestyle="none")
    _bars(figure, grid, meshes, ("success rate (–)", "flights (–)")[: len(meshes)])
    _legend(figure, handles, _title(maps, panels, title))
    return figure


def difference_maps(maps: Maps, panels: Sequence[MapPanel], title: str = "") -> Figure:
    """Difference of success rates on common flights; dots where it is significant."""
    figure, grid = _grid(maps, panels, title, rows=1)
    values = [panel.part.of(maps.pairings[panel.which].difference.estimate) for panel in panels]
    most = max((float(np.nanmax(np.abs(v))) for v in values if not np.isnan(v).all()), default=0.0)
    reach = max(np.ceil(10.0 * most) / 10.0, 0.1)
    handles: dict[str, Artist] = {}
    meshes: dict[str, QuadMesh] = {}
    x, y = (places(view) for view in maps.views[:2])
    dotted = False
    for (panel, axes, _), difference in zip(grid, values, strict=True):
        pairing = maps.pairings[panel.which]
        meshes["difference"] = _mesh(axes, maps, difference, DIFFERENCE_COLOURS, (-reach, reach))
        i, j = np.nonzero(panel.part.of(pairing.significant))
        axes.plot(x[i], y[j], **DOTS)
        dotted |= bool(len(i))
        if np.isnan(difference).any():
            handles["no common flights"] = Patch(**NOT_FLOWN)
    level = f"p < {100.0 * (1.0 - maps.study.refine.level):.3g} % after Holm's correction"
    if dotted:
        handles[f"significant: {level}"] = Line2D([], [], **DOTS)
    else:
        handles[f"significant in no cell: {level}"] = Line2D([], [], linestyle="none")
    _bars(figure, grid, meshes, ("difference of success rates (–)",))
    _legend(figure, handles, _title(maps, panels, title))
    return figure


def _grid(
    maps: Maps, panels: Sequence[MapPanel], title: str, rows: int = 2
) -> tuple[Figure, list[tuple[MapPanel, Axes, Axes]]]:
    """A figure with empty maps; each panel with its axes, and those below it."""
    across = columns(len(panels))
    down = -(-len(panels) // across)
    tall = 7.4 if across <= 2 else 5.6
    figure = new_figure(1.8 + (0.6 if title else 0.0) + down * (tall if rows == 1 else 1.5 * tall))
    ratios = [2.0, 1.0][:rows] * down
    # A lone map keeps to the middle: over the whole width it would be stretched.
    grid = figure.subplots(rows * down, across, squeeze=False, sharex=True, sharey=True, height_ratios=ratios)
    for axes in grid.flat:
        axes.set_visible(False)
    x, y = maps.views[:2]
    placed = []
    for k, panel in enumerate(panels):
        row, column = divmod(k, across)
        rows_of = [grid[rows * row + i, column] for i in range(rows)]
        for axes in rows_of:
            axes.set_visible(True)
            axes.grid(visible=False)
            if column == 0:
                axes.set_ylabel(label(y))
        lowest = k + across >= len(panels)
        rows_of[-1].tick_params(labelbottom=lowest)
        if lowest:
            rows_of[-1].set_xlabel(label(x))
        rows_of[0].set_title("\n".join(shown(line, 40 if across <= 2 else 26) for line in panel.title.splitlines()))
        placed.append((panel, rows_of[0], rows_of[-1]))
    scale_x(grid[0, 0], x, 9 if across <= 2 else 6)
    scale_y(grid[0, 0], y)
    return figure, placed


def _title(maps: Maps, panels: Sequence[MapPanel], title: str) -> str:
    """What stands above the legend."""
    count = slices(maps)[1]
    words = [shown(title)] if title else []
    if len(panels) < count and title:
        words.append(f"{len(panels)} of {count} combinations of the further axes")
    return ": ".join(words)


def _mesh(axes: Axes, maps: Maps, values: Array, chosen: Sequence[str], limits: tuple[float, float]) -> QuadMesh:
    x, y = (borders(view) for view in maps.views[:2])
    if np.isnan(values).any():
        ground = Rectangle((x[0], y[0]), x[-1] - x[0], y[-1] - y[0], zorder=0.5, **NOT_FLOWN)
        axes.add_patch(ground)
    return axes.pcolormesh(
        x, y, np.ma.masked_invalid(values.T), cmap=colours("map", chosen), vmin=limits[0], vmax=limits[1],
        rasterized=values.size > 2000,
    )  # fmt: skip


def _bars(
    figure: Figure, grid: list[tuple[MapPanel, Axes, Axes]], meshes: dict[str, QuadMesh], labels: Sequence[str]
) -> None:
    """A colour bar beside each row of maps."""
    for i, (mesh, text) in enumerate(zip(meshes.values(), labels, strict=True)):
        rows: dict[float, list[Axes]] = {}
        for _, above, below in grid:
            place = (panel := (above, below)[i]).get_subplotspec()
            assert place is not None
            rows.setdefault(place.rowspan.start, []).append(panel)
        for axes in rows.values():
            bar = figure.colorbar(mesh, ax=axes, location="right", pad=0.02, aspect=18.0 if i == 0 else 9.0)
            bar.set_label(text)
            bar.outline.set_linewidth(0.5)


def _boundary(axes: Axes, maps: Maps, crossed: Crossings, handles: dict[str, Artist]) -> None:
    style = LEVEL_LINES[crossed.level]
    x, y = maps.views[:2]
    guessed = coarse(x) or coarse(y)
    for line in crossed.lines:
        along = x.coordinates(line[:, 0]), y.coordinates(line[:, 1])
        if guessed:
            axes.plot(*along, zorder=3.1, **GUESSES[crossed.level])
        else:
            _line(axes, *along, style, 3.0)
    if not len(crossed.points):
        return
    at = np.column_stack([x.coordinates(crossed.points[:, 0]), y.coordinates(crossed.points[:, 1])])
    for axis, view in enumerate((x, y)):
        which = crossed.along == axis
        middle = at[which, axis]
        ends = [
            np.where(np.isnan(end), middle, view.coordinates(end))
            for end in (crossed.lower[which], crossed.upper[which])
        ]
        bar = np.abs(np.array(ends) - middle)
        axes.errorbar(
            at[which, 0], at[which, 1], xerr=bar if axis == 0 else None, yerr=bar if axis == 1 else None, fmt="none",
            ecolor=style["color"], elinewidth=0.8, capsize=1.6, capthick=0.8, zorder=3.2,
        )  # fmt: skip
    if guessed:
        style = GUESSES[crossed.level]
    elif not crossed.lines:  # crossings of lines that are no neighbours
        style = {"color": BLACK, "linestyle": "none", "marker": "o", "markersize": 3.0, "zorder": 3.3}
        style["markerfacecolor"] = BLACK if crossed.level == LEVELS[0] else "white"
        axes.plot(at[:, 0], at[:, 1], **style)
    handles[f"{100.0 * crossed.level:g} % success, with interval"] = Line2D([], [], **style)


def _line(axes: Axes, x: Array, y: Array, style: dict[str, Any], zorder: float) -> None:
    """A line on a light ground of its own, so that it is seen on every colour of the map."""
    axes.plot(x, y, zorder=zorder, **HALO)
    axes.plot(x, y, zorder=zorder + 0.1, **style)


def _limits(axes: Axes, maps: Maps, panel: MapPanel, handles: dict[str, Artist]) -> None:
    edge = edges(maps, panel.which, panel.part)
    if edge is None:
        return
    x, y = maps.views[:2]
    for text, lines, style in (
        ("limit of hover, yaw held", edge.with_yaw, WITH_YAW),
        ("limit of hover, yaw given up", edge.without_yaw, WITHOUT_YAW),
    ):
        for line in lines:
            _line(axes, x.coordinates(line[:, 0]), y.coordinates(line[:, 1]), style, 2.6)
            handles[text] = Line2D([], [], **style)


def _legend(figure: Figure, handles: dict[str, Artist], title: str) -> None:
    order = sorted(handles, key=lambda text: not text[0].isdigit())  # the levels first, each above its like
    figure.legend(
        [handles[text] for text in order],
        order,
        loc="outside upper center",
        ncols=-(-len(handles) // 2),
        title=title or None,
    )
