"""Position with its reference, the error beside it, and the wind below where it changes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from rotorfault.loop.scores import SETTLED, bands
from rotorfault.report.drawn import Drawn, detail, whole
from rotorfault.report.marks import REFERENCE, legend, sample
from rotorfault.report.panels import BAND, NEAR_END, Column, Curve, Panel, agree, dashed, grid, solid
from rotorfault.report.style import ORANGE, SKY, new_figure

# Apart from the flights' colours, and apart from each other where one curve lies on another.
WIND: tuple[dict[str, Any], ...] = (
    {"color": SKY, "linestyle": "-", "linewidth": 2.2, "zorder": 2.2},
    {"color": ORANGE, "linestyle": "-", "linewidth": 1.2, "zorder": 2.3},
    {"color": "0.2", "linestyle": "-", "linewidth": 0.7, "zorder": 2.4},
)
ROOM_FOR_BAND = 1.6  # half height of an error's panel over the settling band, at least
ERROR_REACH = 1.5  # heights of what an error's panel must show, by which it grows for the rest of the flight


def position_figure(drawn: Sequence[Drawn]) -> Figure:
    """Position and reference on the left, on the right the error, on a scale that shows what a fault does to it.

    Of a flight to a set point the left shows the first seconds and the faults, where that is a small part of it.

    The error on the way to a set point may leave its panel, which says how far; the error after the first fault, or
    of the second half of a flight without one, does not.
    """
    drawn = [_with_error(flight) for flight in drawn]
    width = _settling(drawn)
    wind, handles = _wind(drawn)
    reach = 10.0 if len(drawn) == 1 else 3.0
    positions = [
        Panel(name, (solid("position", k), dashed("position_reference", k)), reach, follows=1.0)
        for k, name in enumerate("xyz")
    ]
    errors = [
        Panel(f"{name} error", (solid("position_error", k),), ERROR_REACH, _core(drawn, k, band), band=band)
        for k, (name, band) in enumerate(zip("xyz", width, strict=True))
    ]
    figure = new_figure(10.0 + 2.0 * len(wind))
    # To a set point, the whole flight would show the position twice: the error is what is left of it.
    still = all(not np.ptp(flight.values("position_reference"), axis=0).any() for flight in drawn)
    close = detail(drawn) if still else None
    titles = ("position", "error of position")
    if close is not None:
        titles = (f"position, {close[0]:g} s to {close[1]:g} s", "error of position, whole flight")
    columns = [
        Column([*positions, *wind], close or whole(drawn), titles[0]),
        Column([*errors, *wind], whole(drawn), titles[1]),
    ]
    grid(figure, columns, drawn)
    settling = [Patch(**BAND, label=f"settled ({100.0 * SETTLED:g} %)")] if width[0] is not None else []
    legend(figure, drawn, [sample("reference", **REFERENCE), *settling, *handles])
    return figure


def _with_error(flight: Drawn) -> Drawn:
    error = flight.values("position") - flight.values("position_reference")
    flight = flight.adding({"position_error": error}, "position")
    for signal in ("wind", "disturbance"):
        flight = flight.adding({f"size_of_{signal}": np.linalg.norm(flight.values(signal), axis=1)}, signal)
    return flight


def _settling(drawn: Sequence[Drawn]) -> list[float | None]:
    """Half width on each axis [m] of the band within which flights count as settled, if it is the same for all."""
    widths = []
    for flight in drawn:
        reference, start = flight.values("position_reference"), flight.values("position")[0]
        if not np.isfinite(start).all():
            continue
        # The span of a moving reference is known of a whole flight alone.
        if flight.fate and np.ptp(reference, axis=0).any():
            return [None] * 3
        widths.append(bands(reference, start, SETTLED))
    if not widths or not np.allclose(widths, widths[0], rtol=1e-3):
        return [None] * 3
    return [float(width) for width in widths[0]]


def _core(drawn: Sequence[Drawn], axis: int, band: float | None) -> float | None:
    """What an error's panel must show on either side of zero, in m."""
    sizes = [0.0 if band is None else ROOM_FOR_BAND * band]
    survived = [flight for flight in drawn if not flight.fate]
    for flight in survived or drawn:
        first, last = min(flight.onsets.values(), default=0.5 * flight.end), len(flight.time)
        if flight.fate:
            first, last = 0.0, max(int(NEAR_END * last), 1)
        error = np.abs(flight.values("position_error", axis)[:last])[flight.time[:last] >= first]
        sizes += [float(error.max())] if error.size and np.isfinite(error).all() else []
    return max(sizes) or None


def _wind(drawn: Sequence[Drawn]) -> tuple[list[Panel], list[Any]]:
    """Strips with wind or disturbance that changes: on each axis if it is the same for all flights, else its size."""
    strips: list[Panel] = []
    handles: list[Any] = []
    for signal in ("wind", "disturbance"):
        having = [flight for flight in drawn if flight.shows(signal)]
        if not any(np.nanmax(np.ptp(flight.values(signal), axis=0)) > 0.0 for flight in having):
            continue
        curves = tuple(Curve(signal, k, style, shared=True) for k, style in enumerate(WIND))
        if all(agree(having, curve) for curve in curves):
            strips.append(Panel("wind", curves, np.inf, height=0.75))
            handles = [sample(f"wind on {name}", **style) for name, style in zip("xyz", WIND, strict=True)]
        else:
            strips.append(Panel("|wind|", (solid(f"size_of_{signal}"),), np.inf, height=0.75))
    return strips, handles
