"""Marks that all figures of flights share: fault onsets, ends of flights, and the legend that explains them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from rotorfault.report.drawn import Drawn
from rotorfault.report.style import BLACK, GREY

ROOM = 0.98  # share of the width that a legend may take
REFERENCE: dict[str, Any] = {"color": BLACK, "linestyle": (0, (4.0, 2.2)), "linewidth": 0.9}
END: dict[str, Any] = {"marker": "x", "markersize": 5.0, "markeredgewidth": 1.4, "clip_on": False, "linestyle": ""}
ONSET: dict[str, Any] = {"color": BLACK, "linestyle": ":", "linewidth": 0.9}


def mark_onsets(axes: Axes, drawn: Sequence[Drawn], window: tuple[float, float], rotor: int | None = None) -> None:
    """A thin dotted line at each fault onset in a window, of one rotor or of all."""
    times = {time for flight in drawn for hit, time in flight.onsets.items() if rotor in (None, hit)}
    for time in sorted(times):
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


def keep_ends_inside(axes: Axes) -> None:
    """Move marks of ends to the edge of the panel where they lie outside; to be called after its limits changed."""
    for line in axes.lines:
        if line.get_marker() == END["marker"]:
            line.set_ydata(np.clip(np.asarray(line.get_ydata(), dtype=float), *axes.get_ylim()))


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
