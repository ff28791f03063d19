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

from rotorfault.errors import InputError
from rotorfault.report.style import (
    BLACK,
    COLOURS,
    GREY,
    LIGHT,
    LINES,
    Array,
    envelope,
    number,
    padded,
    shown,
    span,
    unit,
)

REACH = 3.0  # spans by which a panel may exceed its core before it is cut
NEAR_END = 0.98  # share of a lost flight that counts for the scale of a panel
BEFORE, AFTER = 1.0, 2.2  # s around fault onsets that the detail shows
DETAIL = 0.6  # a detail must be shorter than this share of the flight


class Flight(NamedTuple):
    """A flight as it is drawn."""

    label: str
    data: xr.Dataset  # cut at its end
    time: Array  # s
    lost: bool  # ended before it was meant to
    colour: str
    line: str
    width: float  # earlier flights are wider, so that both of two equal curves are seen

    def values(self, signal: str, column: int | None = None) -> Array:
        """Samples of one column of a signal."""
        values = np.asarray(self.data[signal].values, dtype=float)
        return values if column is None else values[:, column]

    def label_of(self, signal: str) -> str:
        """Unit of a signal in brackets, as it stands on an axis."""
        return f"({unit(str(self.data[signal].attrs.get('units', '1')))})"

    @property
    def end(self) -> float:
        """Time of the last record, in s."""
        return float(self.time[-1]) if len(self.time) else 0.0

    @property
    def onsets(self) -> dict[int, float]:
        """Time in s at which the true loss of each rotor becomes non-zero."""
        true = np.nan_to_num(np.asarray(self.data["loss_true"].values, dtype=float)) > 0.0
        rotors = (int(rotor) for rotor in self.data["rotor"].values)
        return {r: float(self.time[seen.argmax()]) for r, seen in zip(rotors, true.T, strict=True) if seen.any()}

    @property
    def threshold(self) -> float | None:
        """Loss above which the diagnosis suspects a rotor; None for a diagnosis that has none."""
        try:
            return float(json.loads(self.data.attrs["configuration"])["diagnosis"]["decision"]["threshold"])
        except (KeyError, TypeError, ValueError):
            return None


def flights(data: xr.Dataset | Mapping[str, xr.Dataset]) -> list[Flight]:
    """Flights with their looks, in the order given.

    Raises
    ------
    InputError
        If there is none, or one has no records.
    """
    if isinstance(data, xr.Dataset):
        data = {str(data.attrs.get("controller", "flight")): data}
    if not data:
        raise InputError("no flight to draw; give at least one")
    looks = islice(cycle((colour, line) for line, colour in product(LINES, COLOURS)), len(data))
    return [
        _flight(label, flight, colour, line, 1.7 - 0.8 * k / max(len(data) - 1, 1) if len(data) > 1 else 1.1)
        for k, ((label, flight), (colour, line)) in enumerate(zip(data.items(), looks, strict=True))
    ]


def _flight(label: str, data: xr.Dataset, colour: str, line: str, width: float) -> Flight:
    time = np.asarray(data["time"].values, dtype=float)
    if not len(time):
        raise InputError(f"flight '{label}' has no records; fly it again")
    finite = np.isfinite(data["position"].values).all(axis=1) & np.isfinite(data["attitude"].values).all(axis=1)
    # Up to the first gap: what comes after it is no flight. The first record stays, so that there is one.
    records = max(int(np.argmin(finite)) if not finite.all() else len(time), 1)
    end = float(data.attrs.get("end_time", math.inf))
    step = float(time[1] - time[0]) if len(time) > 1 else 0.0
    if math.isfinite(end):
        records = min(records, max(int(np.searchsorted(time, end + 1e-6 * step, side="right")), 1))
    lost = records < len(time) - 1
    return Flight(shown(label), data.isel(time=slice(records)), time[:records], lost, colour, line, width)


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
    reach: float | None = REACH  # None: never cut
    core: float | None = None  # limits that count as core, as plus and minus this number


def solid(signal: str, column: int | None = None) -> Curve:
    """The curve of a flight itself."""
    return Curve(signal, column, {})


def dashed(signal: str, column: int | None = None, width: float = 0.9, shared: bool = True) -> Curve:
    """A reference or a command."""
    return Curve(signal, column, {"linestyle": (0, (4.0, 2.2)), "linewidth": width, "zorder": 2.6}, shared)


def draw_panel(axes: Axes, panel: Panel, drawn: Sequence[Flight], window: tuple[float, float]) -> None:
    """Draw the curves of a panel in a window of time, set its limits, mark fault onsets and ends of flights."""
    parts: list[Array] = []
    core: list[Array] = [] if panel.core is None else [np.array([-panel.core, panel.core])]
    own = panel.curves[0]
    for curve in reversed(panel.curves):
        once = curve.shared and _agree(drawn, curve)
        # The longest flight stands for all.
        for flight in [max(drawn, key=lambda f: f.end)] if once else drawn:
            inside = (flight.time >= window[0]) & (flight.time <= window[1])
            time, values = flight.time[inside], flight.values(curve.signal, curve.column)[inside]
            colour = BLACK if once or (curve.shared and len(drawn) == 1) else flight.colour
            if curve.shared and not once and len(drawn) > 1:
                colour = _darker(colour)
            style = {"color": colour, "linestyle": flight.line, "linewidth": flight.width} | curve.style
            axes.plot(*envelope(time, values), **style)
            parts.append(values)
            if panel.core is None:
                core.append(values[: max(int(NEAR_END * len(values)), 1)] if flight.lost else values)
    _limit(axes, parts, core, panel.reach)
    for flight in drawn:
        _mark_end(axes, flight, own, window)
    axes.set_xlim(*window)
    mark_onsets(axes, drawn, window)


def _agree(drawn: Sequence[Flight], curve: Curve) -> bool:
    """Whether a curve is the same in all flights while both fly."""
    if len({flight.time[1] - flight.time[0] for flight in drawn if len(flight.time) > 1}) > 1:
        longest = max(drawn, key=lambda f: f.end)
        return all(
            np.allclose(
                np.interp(f.time, longest.time, longest.values(curve.signal, curve.column)),
                f.values(curve.signal, curve.column),
                atol=1e-3,
            )
            for f in drawn
        )
    shortest = min(len(flight.time) for flight in drawn)
    first, *others = (flight.values(curve.signal, curve.column)[:shortest] for flight in drawn)
    return all(np.allclose(first, other, rtol=1e-6, atol=1e-9, equal_nan=True) for other in others)


def _darker(colour: str) -> tuple[float, float, float]:
    red, green, blue = (int(colour[k : k + 2], 16) / 255.0 for k in (1, 3, 5))
    return 0.55 * red, 0.55 * green, 0.55 * blue


def _limit(axes: Axes, parts: list[Array], core: list[Array], reach: float | None) -> None:
    """Limits over all that is drawn, but not farther than `reach` spans beyond the core; say what is cut."""
    everything, middle = span(parts), span(core)
    if everything is None or middle is None:
        axes.set_ylim(-1.0, 1.0)
        return
    low, high = everything
    if reach is not None:
        allowed = reach * max(middle[1] - middle[0], 1e-3 * max(map(abs, middle)), 1e-9)
        low, high = max(low, middle[0] - allowed), min(high, middle[1] + allowed)
    axes.set_ylim(*padded(low, high))
    note = {"transform": axes.transAxes, "ha": "right", "fontsize": 6.5, "color": "0.25", "zorder": 5}
    back = {"facecolor": "white", "edgecolor": "none", "alpha": 0.85, "pad": 0.8}
    if everything[1] > high:
        axes.text(0.99, 0.97, f"up to {number(everything[1])} ↑", va="top", bbox=back, **note)
    if everything[0] < low:
        axes.text(0.99, 0.03, f"down to {number(everything[0])} ↓", va="bottom", bbox=back, **note)


def _mark_end(axes: Axes, flight: Flight, curve: Curve, window: tuple[float, float]) -> None:
    values = flight.values(curve.signal, curve.column)
    finite = np.flatnonzero(np.isfinite(values))
    if not flight.lost or not finite.size or not window[0] <= flight.end <= window[1]:
        return
    low, high = axes.get_ylim()
    value = float(np.clip(values[finite[-1]], low, high))
    axes.plot(flight.time[finite[-1]], value, **END | {"color": flight.colour})


END: dict[str, Any] = {"marker": "x", "markersize": 5.0, "markeredgewidth": 1.4, "clip_on": False, "linestyle": ""}
ONSET: dict[str, Any] = {"color": BLACK, "linestyle": ":", "linewidth": 0.9}


def mark_onsets(axes: Axes, drawn: Sequence[Flight], window: tuple[float, float]) -> None:
    """A thin dotted line at each fault onset in a window."""
    for time in sorted({time for flight in drawn for time in flight.onsets.values()}):
        if window[0] <= time <= window[1]:
            axes.axvline(time, zorder=1.5, **ONSET)


def onset_label(drawn: Sequence[Flight]) -> str | None:
    """What the legend says about the fault onsets; None if there are none."""
    found = {tuple(sorted(flight.onsets.items())) for flight in drawn if flight.onsets}
    if not found:
        return None
    if len(found) > 1:
        return "fault onset"
    times: dict[float, list[int]] = {}
    for rotor, time in found.pop():
        times.setdefault(time, []).append(rotor)
    if len(times) > 2:
        return "fault onset"
    told = (
        f"rotor{'s' if len(rotors) > 1 else ''} {', '.join(map(str, rotors))} at {time:.4g} s"
        for time, rotors in times.items()
    )
    return f"fault onset ({'; '.join(told)})"


def whole(drawn: Sequence[Flight]) -> tuple[float, float]:
    """The window that shows the longest flight."""
    end = max(flight.end for flight in drawn)
    return 0.0, end if end > 0.0 else 1.0


def detail(drawn: Sequence[Flight]) -> tuple[float, float] | None:
    """The window of the first seconds and the faults; None where it would show most of the flight again."""
    times = [time for flight in drawn for time in flight.onsets.values()]
    first, last = (min(times), max(times)) if times else (0.0, 1.8)
    start = math.floor(first - BEFORE) if first > 3.0 else 0.0
    window = float(start), float(math.ceil(last + AFTER))
    end = whole(drawn)[1]
    return window if window[1] <= end and window[1] - window[0] < DETAIL * end else None


def timeline(figure: Figure, panels: Sequence[Panel], drawn: Sequence[Flight], same_scale: bool = False) -> None:
    """Panels below each other over the whole flight, and beside them a detail of the first seconds where useful."""
    close = detail(drawn)
    windows = [whole(drawn)] if close is None else [whole(drawn), close]
    grid = figure.subplots(len(panels), len(windows), squeeze=False, sharex="col", sharey="all" if same_scale else False)
    for row, panel in zip(grid, panels, strict=True):
        for axes, window in zip(row, windows, strict=True):
            draw_panel(axes, panel, drawn, window)
            axes.yaxis.set_major_locator(MaxNLocator(5, steps=[1, 2, 2.5, 5, 10]))
            if close is not None and axes is row[0]:
                axes.axvspan(*close, color=LIGHT, linewidth=0.0, zorder=0.5)
        row[0].set_ylabel(f"{panel.name} {drawn[0].label_of(panel.curves[0].signal)}")
    if close is not None:
        grid[0, 0].set_title("whole flight")
        grid[0, 1].set_title(f"shaded part, {close[0]:g} s to {close[1]:g} s")
    for axes in grid[-1]:
        axes.set_xlabel("time (s)")
    figure.align_ylabels(grid[:, 0])


def sample(label: str, **style: Any) -> Line2D:
    """A line that stands in a legend only."""
    return Line2D([], [], label=label, **style)


def legend(figure: Figure, drawn: Sequence[Flight], others: Iterable[Artist]) -> None:
    """A legend above the panels: flights, what else is drawn, fault onset, end of a flight."""
    handles: list[Artist] = [sample(f.label, color=f.colour, linestyle=f.line, linewidth=f.width) for f in drawn]
    handles += others
    if (onset := onset_label(drawn)) is not None:
        handles.append(sample(onset, **ONSET))
    if any(flight.lost for flight in drawn):
        colour = drawn[0].colour if len(drawn) == 1 else GREY
        handles.append(sample("end of flight", **END | {"color": colour}))
    # About 105 characters of the legend's font fit into a line; a handle takes the room of seven.
    longest = max(len(str(handle.get_label())) for handle in handles)
    columns = min(max(105 // (longest + 7), 1), len(handles))
    figure.legend(handles=handles, loc="outside upper center", ncols=columns)
