"""Fault detection: true and estimated loss of each rotor, when a fault is declared, and the residual behind it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from rotorfault.report.panels import (
    REFERENCE,
    Drawn,
    Panel,
    dashed,
    draw_panel,
    keep_ends_inside,
    legend,
    one_scale,
    sample,
    solid,
    whole,
)
from rotorfault.report.style import GREY, new_figure, span

THRESHOLD: dict[str, Any] = {"color": GREY, "linestyle": (0, (6.0, 1.5, 1.0, 1.5)), "linewidth": 0.9}
SHADE, STRIP = 0.16, 0.6  # opacity where a fault is declared: of the whole panel, of a strip at its top
BEFORE, AFTER = 0.05, 0.25  # s around the onsets that the detail shows


def detection_figure(drawn: Sequence[Drawn]) -> Figure:
    """A row per rotor: loss over the flight, loss around the fault onsets, residual over the flight."""
    figure = new_figure(12.5)
    close = _around_onsets(drawn)
    windows = [whole(drawn)] if close is None else [whole(drawn), close]
    rotors = [int(rotor) for rotor in drawn[0].data["rotor"].values]
    grid = figure.subplots(len(rotors), len(windows) + 1, squeeze=False, sharex="col")
    thresholds = sorted({flight.threshold for flight in drawn if flight.threshold is not None})
    for k, (row, rotor) in enumerate(zip(grid, rotors, strict=True)):
        for axes, window in zip(row, windows, strict=False):
            loss = Panel(f"loss {rotor}", (solid("loss_estimated", k), dashed("loss_true", k)), reach=np.inf)
            draw_panel(axes, loss, drawn, window)
            for threshold in thresholds:
                axes.axhline(threshold, zorder=1.6, **THRESHOLD)
            _shade_flags(axes, drawn, k)
        draw_panel(row[-1], Panel(f"residual {rotor}", (solid("thrust_residual", k),)), drawn, windows[0])
        row[0].set_ylabel(f"rotor {rotor} {drawn[0].unit_of('loss_estimated')}")
        row[-1].set_ylabel(f"rotor {rotor} {drawn[0].unit_of('thrust_residual')}")
    losses = [flight.values(name) for flight in drawn for name in ("loss_estimated", "loss_true")]
    top = max((span(losses) or (0.0, 0.0))[1] * 1.15, max(thresholds, default=0.0) * 1.5, 0.05)
    top = min(top, 1.1)  # a loss is at most 1, whatever a diverging flight says
    for axes in grid[:, :-1].flat:
        axes.set_ylim(-0.04 * top, top)
        keep_ends_inside(axes)
    one_scale(grid[:, -1])
    titles = ["loss", "loss around the fault onset"][: len(windows)]
    for axes, title in zip(grid[0], [*titles, "thrust residual"], strict=True):
        axes.set_title(title)
    for axes in grid[-1]:
        axes.set_xlabel("time (s)")
        axes.xaxis.set_major_locator(MaxNLocator(4, steps=[1, 2, 5, 10]))
    for axes in grid[:, 1 : len(windows)].flat:
        axes.tick_params(labelleft=False)
    figure.align_ylabels(grid[:, 0])
    figure.align_ylabels(grid[:, -1])
    others: list[Any] = [sample("true loss", **REFERENCE)]
    if thresholds:
        others.append(sample("threshold", **THRESHOLD))
    colour, strength = (drawn[0].colour, SHADE) if len(drawn) == 1 else (GREY, STRIP)
    others.append(Patch(facecolor=colour, alpha=strength, linewidth=0.0, label="fault declared"))
    legend(figure, drawn, others, own="estimate")
    return figure


def _around_onsets(drawn: Sequence[Drawn]) -> tuple[float, float] | None:
    """The window around all fault onsets; None without faults, or where it would show most of the flight again."""
    onsets = [time for flight in drawn for time in flight.onsets.values()]
    if not onsets:
        return None
    end = whole(drawn)[1]
    first, last = max(min(onsets) - BEFORE, 0.0), min(max(onsets) + AFTER, end)
    return (first, last) if last - first < 0.5 * end else None


def _shade_flags(axes: Axes, drawn: Sequence[Drawn], rotor: int) -> None:
    """Shade where a fault is declared: the whole height for one flight, a strip at the top for each of several."""
    height = 1.0 if len(drawn) == 1 else 0.055
    for k, flight in enumerate(drawn):
        flagged = np.concatenate([[False], flight.values("fault_flag", rotor) > 0.5, [False]])
        edges = np.flatnonzero(np.diff(flagged)).reshape(-1, 2)
        time = np.append(flight.time, flight.end)
        spans = [(time[first], time[last] - time[first]) for first, last in edges]
        axes.broken_barh(
            spans,
            (1.0 - (k + 1) * height, height),
            transform=axes.get_xaxis_transform(),
            facecolor=flight.colour,
            alpha=SHADE if len(drawn) == 1 else STRIP,
            linewidth=0.0,
            zorder=0.8,
        )
