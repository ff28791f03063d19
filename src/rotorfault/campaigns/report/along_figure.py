"""Along the first axis, over all cells of the others: grades, and how fast and how low flights recovered."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from rotorfault.campaigns.grading import GRADINGS
from rotorfault.campaigns.report.axis_drawing import borders, coarse, columns, label, legend_columns, places, scale_x
from rotorfault.campaigns.report.line_figure import join, look
from rotorfault.campaigns.report.maps import PROBABILITIES, Maps
from rotorfault.campaigns.sampling.statistics import Array
from rotorfault.report.style import BLACK, BLUE, GREEN, ORANGE, SKY, VERMILION, new_figure, padded, shown

COLOURS = (BLUE, SKY, GREEN, "#F0E442", ORANGE, VERMILION, "0.35")  # of grades in order
BESIDE = 0.6  # share of a cell over which marks of variants are spread
LEAST_HIGH = 1.0  # s or m: top of an axis on which all is 0


def grade_figure(maps: Maps) -> Figure:
    """Grades as shares of flights, one panel for each variant; the black line is the success rate."""
    across = columns(len(maps.variants))
    down = -(-len(maps.variants) // across)
    figure = new_figure(1.8 + down * (6.0 if across <= 2 else 4.6))
    grid = figure.subplots(down, across, squeeze=False, sharex=True, sharey=True)
    x = maps.views[0]
    edges, widths = borders(x)[:-1], np.diff(borders(x))
    # Successes below, so that the line above them is the success rate.
    names = GRADINGS[maps.study.grading].names
    colours = dict(zip(names, COLOURS, strict=True))
    order = [g for g in names if g in maps.study.success] + [g for g in names if g not in maps.study.success]
    for k, axes in enumerate(grid.flat):
        if k >= len(maps.variants):
            axes.set_visible(False)
            continue
        variant = maps.variants[k]
        shares = np.nan_to_num(variant.shares)
        below = np.zeros(shares.shape[1])
        for grade in order:
            share = shares[names.index(grade)]
            axes.bar(
                edges, share, widths, bottom=below, align="edge", color=colours[grade], edgecolor="white",
                linewidth=0.3 if len(widths) < 60 else 0.0,
            )  # fmt: skip
            below = below + share
        success_rate = sum(variant.shares[names.index(grade)] for grade in maps.study.success)
        axes.stairs(np.asarray(success_rate), borders(x), color=BLACK, linewidth=1.2, baseline=None)
        axes.set_title(shown(variant.label, 30))
        axes.grid(visible=False)
        if k % across == 0:
            axes.set_ylabel("share of flights (–)")
        axes.tick_params(labelbottom=(lowest := k + across >= len(maps.variants)))
        if lowest:
            axes.set_xlabel(label(x))
    scale_x(grid[0, 0], x, 9 if across <= 2 else 6)
    grid[0, 0].set_ylim(0.0, 1.0)
    present = [g for g in order if any(np.nansum(v.shares[names.index(g)]) > 0.0 for v in maps.variants)]
    handles: list[Artist] = [Patch(facecolor=colours[grade], label=grade) for grade in present]
    handles.append(Line2D([], [], color=BLACK, linewidth=1.2, label="success"))
    across = legend_columns([*present, "success"])
    figure.legend(handles=handles, loc="outside upper center", ncols=across)
    return figure


def recovery_figure(maps: Maps) -> Figure:
    """Median of recovery time and altitude lost, with bars between two quantiles."""
    figure = new_figure(11.5)
    above, below = figure.subplots(2, 1, sharex=True)
    handles: list[Artist] = [
        Line2D([], [], marker="o", markersize=3.0, label=shown(variant.label, 30), **look(k))
        for k, variant in enumerate(maps.variants)
    ]
    endless = _bars(above, maps, [variant.recovery_along for variant in maps.variants])
    endless |= _bars(below, maps, [variant.altitude_along for variant in maps.variants])
    above.set_ylabel("recovery time (s)")
    below.set_ylabel("altitude lost (m)")
    scale_x(below, maps.views[0])
    below.set_xlabel(label(maps.views[0]))
    figure.align_ylabels()
    low, high = (f"{100.0 * p:g}" for p in (PROBABILITIES[0], PROBABILITIES[-1]))
    handles.append(Line2D([], [], color="0.6", linewidth=2.4, label=f"{low} to {high} % of flights"))
    if endless:
        handles.append(Line2D([], [], marker="x", color=BLACK, linestyle="none", label="most never recover, or fail"))
    title = "median over all flights; those that never recover, or fail, count as beyond all others"
    across = legend_columns([str(handle.get_label()) for handle in handles])
    figure.legend(handles=handles, loc="outside upper center", ncols=across, title=title)
    return figure


def _bars(axes: Axes, maps: Maps, quantiles: list[Array]) -> bool:
    """Medians and bars of each variant beside those of the others; whether some median is beyond the axis."""
    x = maps.views[0]
    at = places(x)
    finite = [values[np.isfinite(values)] for values in quantiles]
    _, high = padded(
        0.0, max((float(values.max()) for values in finite if values.size), default=0.0) or LEAST_HIGH, 0.1
    )
    width = BESIDE * (float(np.diff(at).min()) if len(at) > 1 else 1.0)
    endless = False
    for k, (lower, median, upper) in enumerate(quantiles):
        style: dict[str, Any] = look(k)
        here = at + width * (k - 0.5 * (len(quantiles) - 1)) / len(quantiles)
        marked = np.where(np.isinf(median), np.nan, median)
        if x.numeric:
            # No interval says whether medians differ: it is the spacing of cells alone that counts.
            join(axes, here, marked, np.full(len(here) - 1, not coarse(x)), style)
        axes.plot(here, marked, **{**style, "linestyle": "none", "marker": "o", "markersize": 3.0})
        some = np.isfinite(lower)
        # To the top of the axis and beyond, where there is no upper end.
        top = np.where(np.isinf(upper), 2.0 * high, upper)
        axes.vlines(here[some], lower[some], top[some], color=style["color"], alpha=0.4, linewidth=2.4)
        beyond = np.isinf(median)
        axes.plot(here[beyond], np.full(beyond.sum(), 0.95 * high), marker="x", markersize=4.0, linestyle="none",
                  color=style["color"])  # fmt: skip
        endless |= bool(beyond.any())
    axes.set_ylim(-0.03 * high, high)
    axes.ticklabel_format(axis="y", style="plain")
    return endless
