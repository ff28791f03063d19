"""Sliding variables and V of flights whose law has them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter

from rotorfault.maths.arrays import ANGLES
from rotorfault.report.drawn import Drawn, whole
from rotorfault.report.marks import keep_ends_inside, legend
from rotorfault.report.panels import Panel, draw_panel, solid
from rotorfault.report.style import new_figure, span

DECADES = 12  # of V that are shown at most
GROUPS = (
    ("sigma_position", tuple("xyz")),
    ("sigma_attitude", tuple(f"\\mathrm{{{angle}}}" for angle in ANGLES)),
)


def sliding_figure(drawn: Sequence[Drawn], window: tuple[float, float] | None = None) -> Figure | None:
    """V, and below it the sliding variables of position and attitude; None if no law has any."""
    groups = [
        (f"controller.{name}", labels)
        for name, labels in GROUPS
        if any(flight.shows(f"controller.{name}") for flight in drawn)
    ]
    V = "controller.lyapunov"
    has_V = any(flight.shows(V) for flight in drawn)
    rows = len(groups) + has_V
    if not rows:
        return None
    # Flights of laws without them would stand in the legend and nowhere else.
    drawn = [flight for flight in drawn if flight.has(V) or any(flight.has(signal) for signal, _ in groups)]
    figure = new_figure(2.2 + 3.1 * rows)
    places = figure.add_gridspec(rows, 3)
    window = window or whole(drawn)
    made: list[Axes] = []

    def draw(axes: Axes, panel: Panel) -> Axes:
        draw_panel(axes, panel, drawn, window)
        signal = panel.curves[0].signal
        having = next(flight for flight in drawn if flight.has(signal))
        axes.set_ylabel(f"{panel.name} {having.unit_of(signal)}")
        made.append(axes)
        return axes

    if has_V:
        _logarithmic(draw(figure.add_subplot(places[0, :]), Panel("V", (solid(V),), reach=np.inf)), drawn)
    for row, (signal, labels) in enumerate(groups, start=int(has_V)):
        for k, label in enumerate(labels):
            draw(figure.add_subplot(places[row, k]), Panel(f"$\\sigma_{{{label}}}$", (solid(signal, k),)))
    last = rows - 1
    for axes in made:
        place = axes.get_subplotspec()
        if place is not None and (place.rowspan.start == last or len(place.colspan) > 1):
            axes.set_xlabel("time (s)")
        else:
            axes.tick_params(labelbottom=False)
    figure.align_ylabels()
    legend(figure, drawn, [])
    return figure


def _logarithmic(axes: Axes, drawn: Sequence[Drawn]) -> None:
    """V on a log scale over at most `DECADES`; a V of zero throughout is said in words."""
    values = [flight.values("controller.lyapunov") for flight in drawn]
    extent = span([value[value > 0.0] for value in values])
    if extent is None:
        if span(values) is not None:
            axes.text(0.5, 0.6, "V = 0", transform=axes.transAxes, ha="center")
        return
    axes.set_yscale("log", nonpositive="mask")
    # A flight that is lost may reach up as far as it likes, but not push the others out of sight.
    calm = span([v[v > 0.0] for f, v in zip(drawn, values, strict=True) if not f.fate]) or extent
    axes.set_ylim(max(calm[0], calm[1] * 10.0**-DECADES) / 2.0, extent[1] * 3.0)
    keep_ends_inside(axes)
    axes.yaxis.set_major_locator(LogLocator(numticks=5))
    if extent[1] > 100.0 * extent[0]:
        axes.yaxis.set_minor_formatter(NullFormatter())
