"""What all figures of flights share: flights with their colours, panels over time, fault onsets, legends.

A flight is drawn up to its end: the last record at which it is finite, or its attribute ``end_time``. What a
diverging flight does near its end does not set the scale of a panel; how far it goes is written into the panel.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping, Sequence
from itertools import cycle, islice, product
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from rotorfault.base.errors import InputError
from rotorfault.maths.arrays import Array
from rotorfault.report.style import (
    BLACK,
    COLOURS,
    GREY,
    LIGHT,
    LINES,
    envelope,
    number,
    padded,
    shown,
    span,
    unit,
)
from rotorfault.results.outcome import Outcome

ROOM = 0.98  # share of the width that a legend may take
REACH = 3.0  # spans by which a panel may exceed its core before it is cut
NEAR_END = 0.98  # share of a lost flight that counts for the scale of a panel
WIDE, THIN, ALONE = 1.5, 0.9, 1.1  # line widths in points: first and last of several flights, a single one
BEFORE, AFTER = 1.0, 2.2  # s around fault onsets that the detail shows
DETAIL = 0.6  # a detail must be shorter than this share of the flight


class Drawn(NamedTuple):
    """A flight as it is drawn."""

    label: str
    data: xr.Dataset  # cut at its end
    time: Array  # s
    fate: str  # how it ended before it was meant to, in a word; empty for a flight that did not
    colour: str
    line: str
    width: float  # earlier flights are wider, so that both of two equal curves are seen

    def values(self, signal: str, column: int | None = None) -> Array:
        """Samples of one column of a signal; NaN where the flight has no such signal."""
        if not self.has(signal):
            return np.full(len(self.time), np.nan)
        values = np.asarray(self.data[signal].values, dtype=float)
        return values if column is None else values[:, column]

    def has(self, signal: str) -> bool:
        """Whether the flight recorded a signal: a controller records what it has."""
        return signal in self.data

    def unit_of(self, signal: str) -> str:
        """Unit of a signal in brackets, as it stands on an axis."""
        return f"({unit(str(self.data[signal].attrs.get('units', '1')))})"

    @property
    def end(self) -> float:
        """Time of the last record, in s."""
        return float(self.time[-1]) if len(self.time) else 0.0

    @property
    def onsets(self) -> dict[int, float]:
        """Time in s at which the first fault of each rotor begins, as the scenario has it."""
        scores = json.loads(self.data.attrs.get("scores", "{}"))
        rotors = (int(rotor) for rotor in self.data["rotor"].values)
        onsets = {rotor: scores.get(f"onset.{rotor}") for rotor in rotors}
        return {rotor: float(onset) for rotor, onset in onsets.items() if onset is not None}

    @property
    def threshold(self) -> float | None:
        """Loss above which the diagnosis suspects a rotor; None for a diagnosis that has none."""
        return float(self.data.attrs.get("threshold", 0.0)) or None


def flights(data: xr.Dataset | Mapping[str, xr.Dataset]) -> list[Drawn]:
    """Flights with their looks, in the order given.

    Raises
    ------
    InputError
        If there is none.
    """
    if isinstance(data, xr.Dataset):
        data = {str(data.attrs.get("controller", "flight")): data}
    if not data:
        raise InputError("no flight to draw; give at least one")
    looks = islice(cycle((colour, line) for line, colour in product(LINES, COLOURS)), len(data))
    widths = np.linspace(WIDE, THIN, len(data)) if len(data) > 1 else [ALONE]
    return [
        _drawn(label, flight, colour, line, float(width))
        for (label, flight), (colour, line), width in zip(data.items(), looks, widths, strict=True)
    ]


def _drawn(label: str, data: xr.Dataset, colour: str, line: str, width: float) -> Drawn:
    if not data.sizes["time"]:
        data = data.reindex(time=[0.0])  # lost before its first record: one record of NaN
    time = np.asarray(data["time"].values, dtype=float)
    finite = np.isfinite(data["position"].values).all(axis=1) & np.isfinite(data["attitude"].values).all(axis=1)
    # Up to the first gap: what comes after it is no flight. The first record stays, so that there is one.
    records = len(time) if finite.all() else max(int(np.argmin(finite)), 1)
    outcome = Outcome(str(data.attrs.get("outcome", "")), float(data.attrs.get("end_time", time[-1])))
    kept = int((time[:records] <= outcome.time * (1.0 + 1e-9)).sum())
    fate = "lost" if records < len(time) else ""
    if outcome.kind and not outcome.survived:
        fate = outcome.kind
    records = max(kept, 1)
    return Drawn(shown(label), data.isel(time=slice(records)), time[:records], fate, colour, line, width)


class Curve(NamedTuple):
    """One curve of a panel."""

    signal: str
    column: int | None
    style: dict[str, Any]  # of `Axes.plot`; without a colour it takes its flight's
    shared: bool = False  # drawn once in black where all flights agree on it


class Panel(NamedTuple):
    """One row of a figure over time: what is drawn and what is written beside it."""

    name: str
    curves: tuple[Curve, ...]  # the first is the flight's own, and gets the mark of its end
    reach: float = REACH
    core: float | None = None  # plus and minus what the panel is meant to show at least to be cut beyond it
    follows: float | None = None  # least span where the second curve and the starts are what sets the scale
    height: float = 1.0  # in proportion to the other panels of the figure


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
        once = curve.shared and _agree(having, curve)
        # The longest flight stands for all.
        for flight in [max(having, key=lambda f: f.end)] if once else having:
            time, values = _inside(flight, curve, window)
            colour = BLACK if once else _darker(flight.colour) if curve.shared else flight.colour
            style = {"color": colour, "linestyle": flight.line, "linewidth": flight.width} | curve.style
            axes.plot(*envelope(time, values), **style)
            parts.append(values)
    _limit(axes, parts, _core(panel, drawn, window), panel.reach)
    if not panel.curves[0].shared:
        for flight in drawn:
            _mark_end(axes, flight, panel.curves[0], window)
    axes.set_xlim(*window)
    axes.xaxis.set_major_locator(MaxNLocator(7, steps=[1, 2, 5, 10]))
    axes.yaxis.set_major_locator(MaxNLocator(max(2, round(5 * panel.height)), steps=[1, 2, 2.5, 5, 10]))
    mark_onsets(axes, drawn, window)


def _inside(flight: Drawn, curve: Curve, window: tuple[float, float]) -> tuple[Array, Array]:
    # Samples just outside the window are drawn as well, so that curves reach its edges.
    first = max(int(np.searchsorted(flight.time, window[0], side="left")) - 1, 0)
    last = int(np.searchsorted(flight.time, window[1], side="right")) + 1
    return flight.time[first:last], flight.values(curve.signal, curve.column)[first:last]


def _core(panel: Panel, drawn: Sequence[Drawn], window: tuple[float, float]) -> list[Array]:
    """The values that a panel must show in any case."""
    if panel.core is not None:
        return [np.array([-panel.core, panel.core])]
    own, *others = panel.curves
    values = [_inside(flight, own, window)[1] for flight in drawn]
    if panel.follows is None:
        # Lost flights set the scale only among themselves, and without what they do near their end.
        survived = [v for f, v in zip(drawn, values, strict=True) if not f.fate]
        return survived or [v[: max(int(NEAR_END * len(v)), 1)] for v in values]
    core = [_inside(flight, curve, window)[1] for flight in drawn for curve in others] + [v[:1] for v in values]
    low, high = span(core) or (0.0, 0.0)
    spare = max(panel.follows - (high - low), 0.0) / 2.0
    return [np.array([low - spare, high + spare])]


def _agree(drawn: Sequence[Drawn], curve: Curve) -> bool:
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


def keep_ends_inside(axes: Axes) -> None:
    """Move marks of ends to the edge of the panel where they lie outside; to be called after its limits changed."""
    for line in axes.lines:
        if line.get_marker() == END["marker"]:
            line.set_ydata(np.clip(np.asarray(line.get_ydata(), dtype=float), *axes.get_ylim()))


REFERENCE: dict[str, Any] = {"color": BLACK, "linestyle": (0, (4.0, 2.2)), "linewidth": 0.9}
END: dict[str, Any] = {"marker": "x", "markersize": 5.0, "markeredgewidth": 1.4, "clip_on": False, "linestyle": ""}
ONSET: dict[str, Any] = {"color": BLACK, "linestyle": ":", "linewidth": 0.9}


def mark_onsets(axes: Axes, drawn: Sequence[Drawn], window: tuple[float, float]) -> None:
    """A thin dotted line at each fault onset in a window."""
    for time in sorted({time for flight in drawn for time in flight.onsets.values()}):
        if window[0] <= time <= window[1]:
            axes.axvline(time, zorder=1.5, **ONSET)


def onset_label(drawn: Sequence[Drawn]) -> str | None:
    """What the legend says about the fault onsets; None if there are none."""
    onsets = {tuple(sorted(flight.onsets.items())) for flight in drawn if flight.onsets}
    if not onsets:
        return None
    if len(onsets) > 1:
        return "fault onset"
    times: dict[float, list[int]] = {}
    for rotor, time in onsets.pop():
        times.setdefault(time, []).append(rotor)
    if len(times) > 2:
        return "fault onset"
    faults = (
        f"rotor{'s' if len(rotors) > 1 else ''} {', '.join(map(str, rotors))} at {time:.4g} s"
        for time, rotors in times.items()
    )
    return f"fault onset ({'; '.join(faults)})"


def whole(drawn: Sequence[Drawn]) -> tuple[float, float]:
    """The window that shows the longest flight."""
    longest = max(drawn, key=lambda flight: flight.end)
    if longest.end <= 0.0:
        return 0.0, 1.0
    # To the end of the last period, so that a flight of 20 s has its tick at 20 s.
    return 0.0, longest.end + float(longest.time[-1] - longest.time[-2])


def detail(drawn: Sequence[Drawn]) -> tuple[float, float] | None:
    """The window of the first seconds and the faults; None where it would show most of the flight again."""
    times = [time for flight in drawn for time in flight.onsets.values()]
    first, last = (min(times), max(times)) if times else (0.0, 1.8)
    start = math.floor(first - BEFORE) if first > 3.0 else 0.0
    window = float(start), float(math.ceil(last + AFTER))
    end = whole(drawn)[1]
    return window if window[1] <= end and window[1] - window[0] < DETAIL * end else None


def timeline(
    figure: Figure,
    panels: Sequence[Panel],
    drawn: Sequence[Drawn],
    common: bool = False,
    beside: Sequence[Panel] | None = None,
) -> None:
    """Panels below each other over the whole flight, and beside them a detail of the first seconds where useful.

    With `common`, all panels have one scale. With `beside`, these panels stand there instead, over the whole flight.
    """
    close = None if beside else detail(drawn)
    windows = [whole(drawn)] * 2 if beside else [whole(drawn)] if close is None else [whole(drawn), close]
    heights = {"height_ratios": [panel.height for panel in panels]}
    grid = figure.subplots(len(panels), len(windows), squeeze=False, sharex="col", gridspec_kw=heights)
    for row, panel, other in zip(grid, panels, beside or panels, strict=True):
        for axes, window, one in zip(row, windows, (panel, other), strict=False):
            draw_panel(axes, one, drawn, window)
            if close is not None and axes is row[0]:
                axes.axvspan(*close, color=LIGHT, linewidth=0.0, zorder=0.5)
            if axes is row[0] or beside:
                axes.set_ylabel(f"{one.name} {drawn[0].unit_of(one.curves[0].signal)}")
    if common:
        one_scale(grid.flat)
    if close is not None:
        grid[0, 0].set_title("whole flight")
        grid[0, 1].set_title(f"shaded part, {close[0]:g} s to {close[1]:g} s")
    for axes in grid[-1]:
        axes.set_xlabel("time (s)")
    for column in grid.T:
        figure.align_ylabels(column)


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


def sample(label: str, **style: Any) -> Line2D:
    """A line that stands in a legend only."""
    return Line2D([], [], label=label, **style)


def legend(
    figure: Figure,
    drawn: Sequence[Drawn],
    others: Iterable[Artist],
    own: str | None = None,
    onset_style: Mapping[str, Any] | None = None,
) -> float:
    """A legend above the panels: flights, what else is drawn, fault onset, end of a flight.

    `own` is what the curve of a single flight is called; the flight's label if it is None. Returns the height of
    the legend's lower edge, as a share of the figure's.
    """
    handles: list[Artist] = [sample(f.label, color=f.colour, linestyle=f.line, linewidth=f.width) for f in drawn]
    if own is not None and len(drawn) == 1:
        handles[0].set_label(own)
    handles += others
    if (onset := onset_label(drawn)) is not None:
        handles.append(sample(onset, **(onset_style or ONSET)))
    if lost := [flight for flight in drawn if flight.fate]:
        text = f"{lost[0].fate} at {lost[0].end:.4g} s" if len(drawn) == 1 else "end of flight"
        handles.append(sample(text, **END | {"color": drawn[0].colour if len(drawn) == 1 else GREY}))
    for columns in range(len(handles), 0, -1):
        rows = math.ceil(len(handles) / columns)
        box = figure.legend(handles=handles, loc="outside upper center", ncols=math.ceil(len(handles) / rows))
        extent = box.get_window_extent()
        if columns == 1 or extent.width < ROOM * figure.bbox.width:
            break
        box.remove()
    return 1.0 - 1.5 * float(extent.height / figure.bbox.height)
