"""Panels over time, below and beside each other: curves of flights, strips of bars, their limits and notes.

What a diverging flight does near its end does not set the scale of a panel; how far it goes is written in.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from rotorfault.maths.arrays import Array
from rotorfault.report.drawn import Drawn, detail, whole
from rotorfault.report.marks import END, keep_ends_inside, mark_onsets
from rotorfault.report.style import BLACK, BUCKETS, GREEN, GREY, LIGHT, envelope, number, padded, span

REACH = 3.0  # spans by which a panel may exceed its core before it is cut
NEAR_END = 0.98  # share of a lost flight that counts for the scale of a panel
FULL = 0.7  # height of the bars of a strip over that of a row
BAND: dict[str, Any] = {"color": GREEN, "alpha": 0.18, "linewidth": 0.0, "zorder": 0.8}


class Curve(NamedTuple):
    """One curve of a panel."""

    signal: str
    column: int | None
    style: dict[str, Any]  # of `Axes.plot`; without a colour it takes its flight's
    shared: bool = False  # drawn once in black where all flights agree on it


class Panel(NamedTuple):
    """Curves over time: what is drawn and what is written beside it."""

    name: str
    curves: tuple[Curve, ...]  # the first is the flight's own, and gets the mark of its end
    reach: float = REACH
    core: float | None = None  # plus and minus what the panel is meant to show at least to be cut beyond it
    follows: float | None = None  # least span where the second curve and the starts are what sets the scale
    height: float = 1.0  # in proportion to the other panels of the figure
    onset_of: int | None = None  # the rotor whose fault onsets are marked; those of all rotors if None
    band: float | None = None  # half width of a band around zero, shaded
    zero_too: bool = True  # whether it is drawn where its curves are zero throughout the window


class Strip(NamedTuple):
    """Bars over time where indicators are 1, a row for each; several flights below each other within a row."""

    name: str
    rows: tuple[tuple[str, str, int], ...]  # title, signal, column
    height: float = 0.75


class Column(NamedTuple):
    """Panels below each other over one window of time; None leaves a place empty."""

    panels: Sequence[Panel | Strip | None]
    window: tuple[float, float]
    title: str = ""
    labelled: bool = True  # whether names stand beside the panels
    shaded: tuple[float, float] | None = None  # a part of the window that another column shows


def solid(signal: str, column: int | None = None) -> Curve:
    """The curve of a flight itself."""
    return Curve(signal, column, {})


def dashed(signal: str, column: int | None = None, width: float = 0.9, shared: bool = True) -> Curve:
    """A reference or a command."""
    return Curve(signal, column, {"linestyle": (0, (4.0, 2.2)), "linewidth": width, "zorder": 2.6}, shared)


def draw_panel(axes: Axes, panel: Panel, drawn: Sequence[Drawn], window: tuple[float, float]) -> None:
    """Draw the curves of a panel in a window of time, set its limits, mark fault onsets and ends of flights."""
    parts: list[Array] = []
    for curve in panel.curves:
        having = [flight for flight in drawn if flight.has(curve.signal)]
        if not having:
            continue
        once = curve.shared and agree(having, curve)
        # The longest flight stands for all.
        for flight in [max(having, key=lambda f: f.end)] if once else having:
            time, values = _inside(flight, curve, window)
            colour = BLACK if once else _darker(flight.colour) if curve.shared else flight.colour
            style = {"color": colour, "linestyle": flight.line, "linewidth": flight.width} | curve.style
            axes.plot(*envelope(time, values), **style)
            parts.append(values)
    if panel.band is not None:
        axes.axhspan(-panel.band, panel.band, **BAND)
        parts.append(1.25 * np.array([-panel.band, panel.band]))
    _limit(axes, parts, core_of(panel, drawn, window), panel.reach)
    if not panel.curves[0].shared:
        for flight in drawn:
            _mark_end(axes, flight, panel.curves[0], window)
    axes.set_xlim(*window)
    axes.xaxis.set_major_locator(MaxNLocator(7, steps=[1, 2, 5, 10]))
    axes.yaxis.set_major_locator(MaxNLocator(max(2, round(5 * panel.height)), steps=[1, 2, 2.5, 5, 10]))
    mark_onsets(axes, drawn, window, panel.onset_of)


def draw_strip(axes: Axes, strip: Strip, drawn: Sequence[Drawn], window: tuple[float, float]) -> None:
    """Draw the bars of a strip in a window of time; the first row is at the top."""
    height = FULL / len(drawn)
    for place, (_, signal, column) in enumerate(strip.rows):
        for k, flight in enumerate(drawn):
            on = spans(flight, flight.values(signal, column) > 0.5)
            top = place - 0.5 * FULL + k * height
            axes.broken_barh(on, (top, height), facecolor=flight.colour, linewidth=0.0, zorder=2.0)
    axes.set_yticks(range(len(strip.rows)), [title for title, _, _ in strip.rows])
    axes.set_ylim(len(strip.rows) - 0.5, -0.5)
    axes.set_xlim(*window)
    axes.tick_params(axis="y", length=0.0)
    mark_onsets(axes, drawn, window)


def spans(flight: Drawn, on: NDArray[np.bool_]) -> list[tuple[float, float]]:
    """Start and length in s of each time during which an indicator is on."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], on, [False]]))).reshape(-1, 2)
    # The last record holds for a period.
    time = np.append(flight.time, whole([flight])[1])
    starts, ends = time[edges[:, 0]], time[edges[:, 1]]
    if len(edges) > BUCKETS:
        # Gaps that nobody could see are closed, for an indicator that chatters would make a file of megabytes.
        open_ = starts[1:] - ends[:-1] > flight.end / (4 * BUCKETS)
        starts, ends = starts[np.append(True, open_)], ends[np.append(open_, True)]
    return [(float(start), float(end - start)) for start, end in zip(starts, ends, strict=True)]


def _inside(flight: Drawn, curve: Curve, window: tuple[float, float]) -> tuple[Array, Array]:
    # Samples just outside the window are drawn as well, so that curves reach its edges.
    first = max(int(np.searchsorted(flight.time, window[0], side="left")) - 1, 0)
    last = int(np.searchsorted(flight.time, window[1], side="right")) + 1
    return flight.time[first:last], flight.values(curve.signal, curve.column)[first:last]


def core_of(panel: Panel, drawn: Sequence[Drawn], window: tuple[float, float]) -> list[Array]:
    """The values that a panel must show in any case."""
    if panel.core is not None:
        return [np.array([-panel.core, panel.core])]
    own, *others = panel.curves
    if panel.follows is None:
        # Lost flights set the scale only among themselves, and without what they do near their end.
        meant = [curve for curve in panel.curves if curve is own or not curve.shared]
        survived = [_inside(f, curve, window)[1] for f in drawn if not f.fate for curve in meant]
        lost = (_inside(f, curve, window)[1] for f in drawn for curve in meant)
        return survived or [v[: max(int(NEAR_END * len(v)), 1)] for v in lost]
    values = [_inside(flight, own, window)[1] for flight in drawn]
    core = [_inside(flight, curve, window)[1] for flight in drawn for curve in others] + [v[:1] for v in values]
    low, high = span(core) or (0.0, 0.0)
    spare = max(panel.follows - (high - low), 0.0) / 2.0
    return [np.array([low - spare, high + spare])]


def agree(drawn: Sequence[Drawn], curve: Curve) -> bool:
    """Whether a curve is the same in all flights while all fly."""
    shortest = min(drawn, key=lambda flight: flight.end)
    curves = [np.interp(shortest.time, f.time, f.values(curve.signal, curve.column)) for f in drawn]
    return all(np.allclose(curves[0], other, rtol=1e-6, atol=1e-9, equal_nan=True) for other in curves[1:])


def _darker(colour: str) -> tuple[float, float, float]:
    red, green, blue = (int(colour[k : k + 2], 16) / 255.0 for k in (1, 3, 5))
    return 0.55 * red, 0.55 * green, 0.55 * blue


def _limit(axes: Axes, parts: list[Array], core: list[Array], reach: float) -> None:
    """Limits over all that is drawn, but not farther than `reach` spans beyond the core; say what is cut."""
    everything, middle = span(parts), span(core)
    if everything is None:
        axes.set_ylim(-1.0, 1.0)
        axes.text(0.5, 0.5, "no finite values", transform=axes.transAxes, ha="center", va="center", color=GREY)
        return
    middle = middle or everything
    allowed = reach * max(middle[1] - middle[0], 1e-3 * max(map(abs, middle)), 1e-9)
    low, high = max(everything[0], middle[0] - allowed), min(everything[1], middle[1] + allowed)
    axes.set_ylim(*padded(low, high))
    note_cut(axes, everything)


def note_cut(axes: Axes, everything: tuple[float, float]) -> None:
    """Say how far curves go on beyond a panel."""
    low, high = axes.get_ylim()
    note: dict[str, Any] = {"transform": axes.transAxes, "ha": "right", "fontsize": 6.5, "color": "0.25", "zorder": 5}
    back = {"facecolor": "white", "edgecolor": "none", "alpha": 0.85, "pad": 0.8}
    if everything[1] > high:
        axes.text(0.99, 0.97, f"up to {number(everything[1])} ↑", va="top", bbox=back, **note)
    if everything[0] < low:
        axes.text(0.99, 0.03, f"down to {number(everything[0])} ↓", va="bottom", bbox=back, **note)


def _mark_end(axes: Axes, flight: Drawn, curve: Curve, window: tuple[float, float]) -> None:
    values = flight.values(curve.signal, curve.column)
    finite = np.flatnonzero(np.isfinite(values))
    if not flight.fate or not finite.size or not window[0] <= flight.end <= window[1]:
        return
    low, high = axes.get_ylim()
    axes.plot(flight.time[finite[-1]], values[finite[-1]], **END | {"color": flight.colour})
    axes.set_ylim(low, high)
    keep_ends_inside(axes)


def grid(figure: Figure, columns: Sequence[Column], drawn: Sequence[Drawn]) -> list[list[Axes]]:
    """Draw columns of panels beside each other; a row without anything to show in any of them is left out.

    Returns
    -------
    list of list of Axes
        The panels of each column, from the top.
    """
    rows = [row for row in zip(*(column.panels for column in columns), strict=True) if _fill(row, drawn)]
    heights = [max(panel.height for panel in row if panel is not None) for row in rows]
    places = figure.add_gridspec(len(rows), len(columns), height_ratios=heights)
    made: list[list[Axes]] = []
    for k, column in enumerate(columns):
        below: list[Axes] = []
        for i, panel in enumerate(row[k] for row in rows):
            if panel is None or not _fill([panel], drawn, column.window):
                continue
            axes = figure.add_subplot(places[i, k], sharex=below[0] if below else None)
            _draw(axes, panel, column, drawn)
            below.append(axes)
        for axes in below[:-1]:
            axes.tick_params(labelbottom=False)
        if below:
            below[0].set_title(column.title)
            below[-1].set_xlabel("time (s)")
            figure.align_ylabels(below)
        made.append(below)
    return made


def _fill(
    row: Iterable[Panel | Strip | None], drawn: Sequence[Drawn], window: tuple[float, float] | None = None
) -> bool:
    """Whether a flight has anything to show in a row, in a window or at all."""
    for panel in row:
        if panel is None:
            continue
        if isinstance(panel, Panel):
            curves, zero_too = panel.curves, panel.zero_too
        else:
            curves, zero_too = tuple(solid(signal, column) for _, signal, column in panel.rows), False
        for flight, curve in product(drawn, curves):
            values = _inside(flight, curve, window or whole(drawn))[1]
            if (np.isfinite(values) & (zero_too | (values != 0.0))).any():
                return True
    return False


def _draw(axes: Axes, panel: Panel | Strip, column: Column, drawn: Sequence[Drawn]) -> None:
    if isinstance(panel, Strip):
        draw_strip(axes, panel, drawn, column.window)
        signal = panel.rows[0][1]
    else:
        draw_panel(axes, panel, drawn, column.window)
        signal = panel.curves[0].signal
    if column.shaded is not None:
        axes.axvspan(*column.shaded, color=LIGHT, linewidth=0.0, zorder=0.5)
    if column.labelled:
        having = next((flight for flight in drawn if flight.has(signal)), drawn[0])
        axes.set_ylabel(f"{panel.name} {having.unit_of(signal)}")
    elif isinstance(panel, Strip):
        axes.tick_params(labelleft=False)


def timeline(
    figure: Figure, panels: Sequence[Panel | Strip], drawn: Sequence[Drawn], common: bool = False
) -> list[list[Axes]]:
    """Panels below each other over the whole flight, and beside them a detail of the first seconds where useful.

    With `common`, all panels have one scale.
    """
    made = grid(figure, whole_and_detail(panels, drawn), drawn)
    if common:
        one_scale(axes for column in made for axes in column)
    return made


def whole_and_detail(
    panels: Sequence[Panel | Strip], drawn: Sequence[Drawn], close: tuple[float, float] | None = None
) -> list[Column]:
    """The columns of `timeline`, or with another part of the flight as the detail."""
    close = close or detail(drawn)
    if close is None:
        return [Column(panels, whole(drawn))]
    title = f"shaded part, {close[0]:.4g} s to {close[1]:.4g} s"
    return [
        Column(panels, whole(drawn), "whole flight", shaded=close),
        Column(panels, close, title, labelled=False),
    ]


def one_scale(panels: Iterable[Axes]) -> None:
    """Give panels the limits that hold all of them."""
    panels = list(panels)
    limits = [axes.get_ylim() for axes in panels]
    low, high = min(low for low, _ in limits), max(high for _, high in limits)
    for axes, (lower, upper) in zip(panels, limits, strict=True):
        axes.set_ylim(low, high)
        # Ends that were moved to the edge belong at the new one.
        for line in axes.lines:
            if line.get_marker() == END["marker"]:
                y = np.asarray(line.get_ydata(), dtype=float)
                line.set_ydata(np.where(y >= upper, high, np.where(y <= lower, low, y)))
