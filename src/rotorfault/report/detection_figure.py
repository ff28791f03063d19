"""Fault detection: true and estimated loss of each rotor, the threshold in force, and when a fault is declared."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from rotorfault.autopilot.diagnosis.decision import SMALL_THRUST
from rotorfault.report.drawn import Drawn, around_onsets, whole
from rotorfault.report.marks import REFERENCE, keep_ends_inside, legend, sample
from rotorfault.report.panels import Column, Curve, Panel, core_of, dashed, grid, note_cut, solid, spans
from rotorfault.report.style import BLACK, GREY, ORANGE, new_figure, padded, span
from rotorfault.results.derived import missing_thrust, stuck_at, stuck_text

THRESHOLD: dict[str, Any] = {"linestyle": (0, (6.0, 1.5, 1.0, 1.5)), "linewidth": 0.8, "zorder": 1.9}
IN_FORCE = "thrust_threshold"  # N, of diagnoses that record one
SEEN = 0.02  # estimated loss below which there is nothing to see
SHADE, STRIP = 0.16, 0.6  # opacity where a fault is declared: of the whole panel, of a strip at its top
BEFORE, AFTER = 0.05, 0.25  # s around the onsets that the detail shows
HEIGHT = 2.75  # cm per rotor


def detection_figure(drawn: Sequence[Drawn]) -> Figure | None:
    """A row per rotor: loss over the flight, loss around the fault onsets, and the thrust that is missing.

    Without any loss, true or estimated, only what is missing is shown, below its threshold. None if no flight has a
    diagnosis that estimates anything.
    """
    drawn = [_with_missing(flight) for flight in drawn]
    residuals = any(flight.moves("thrust_residual") for flight in drawn)
    if not residuals and not any(flight.moves("loss_estimated") for flight in drawn):
        return None
    estimated = span(flight.values("loss_estimated") for flight in drawn) or (0.0, 0.0)
    losses = estimated[1] > SEEN or any(f.moves(name) for f in drawn for name in ("loss_true", "fault_flag"))
    rotors = [int(rotor) for rotor in drawn[0].data["rotor"].values]
    threshold = THRESHOLD | ({"color": ORANGE} if len(drawn) == 1 else {})
    # A rotor that gives too much, as a stuck one may, is suspected as well.
    too_much = any((f.values("thrust_missing") < -f.values(IN_FORCE)).any() for f in drawn if f.has(IN_FORCE))
    loss_panels, missing_panels = [], []
    for k, rotor in enumerate(rotors):
        limit = Curve("loss_threshold", k, threshold)
        curves = (solid("loss_estimated", k), dashed("loss_true", k), limit)
        held = {float(stuck_at(flight.data)[-1, k]) for flight in drawn}
        words = f"{stuck_text(*held)}\n" if len(held) == 1 and np.isfinite([*held]).all() else ""
        loss_panels.append(Panel(f"{words}rotor {rotor}", curves, reach=np.inf))
        limits = [Curve(IN_FORCE, k, threshold), Curve("threshold_below", k, threshold)]
        missing = (solid("thrust_missing", k), *limits[: 1 + too_much])
        missing_panels.append(Panel(f"rotor {rotor}", missing, reach=np.inf))
    columns: list[Column] = []
    if losses:
        columns.append(Column(loss_panels, whole(drawn), "loss"))
        if (close := around_onsets(drawn, BEFORE, AFTER)) is not None:
            columns.append(Column(loss_panels, close, "loss around the fault onset", labelled=False))
    if residuals:
        columns.append(Column(missing_panels, whole(drawn), "missing thrust"))
    figure = new_figure(1.5 + HEIGHT * len(rotors))
    made = grid(figure, columns, drawn)
    _scale_losses([axes for column in made[: len(columns) - residuals] for axes in column], drawn)
    if residuals:
        _scale_missing(made[-1], missing_panels, drawn)
    for column, below in zip(columns, made, strict=True):
        for rotor, axes in enumerate(below):
            _shade_flags(axes, drawn, rotor)
        below[-1].xaxis.set_major_locator(MaxNLocator(4 if len(columns) > 1 else 7, steps=[1, 2, 5, 10]))
        if not column.labelled:
            for axes in below:
                axes.tick_params(labelleft=False)
    others: list[Any] = [sample("true loss", **REFERENCE)] if losses else []
    if any(flight.shows("loss_threshold") for flight in drawn):
        others.append(sample("threshold in force", **{"color": BLACK} | threshold))
    if any(flight.moves("fault_flag") for flight in drawn):
        colour, strength = (drawn[0].colour, SHADE) if len(drawn) == 1 else (GREY, STRIP)
        others.append(Patch(facecolor=colour, alpha=strength, linewidth=0.0, label="fault declared"))
    legend(figure, drawn, others, own="estimate")
    return figure


def _with_missing(flight: Drawn) -> Drawn:
    """With the thrust that each rotor lacks beside a sound one, and the threshold in force as a loss."""
    flight = flight.adding({"thrust_missing": missing_thrust(flight.values("thrust_residual"))}, "thrust_residual")
    # A rotor that is stuck has no loss: that it falls short of its command by some share says nothing of it.
    loss = np.where(np.isfinite(stuck_at(flight.data)), np.nan, flight.values("loss_true"))
    flight = flight.adding({"loss_true": loss}, "loss_true")
    recorded = flight.data.get("diagnosis.threshold")
    if recorded is None or recorded.dims != ("time", "rotor"):
        return flight
    if recorded.attrs.get("units") == "1":
        return flight.adding({"loss_threshold": recorded.values}, "loss_estimated")
    if recorded.attrs.get("units") != "N":
        return flight
    # The loss is estimated with the same denominator.
    least = SMALL_THRUST * float(flight.data.attrs.get("thrust_max", 0.0))
    thrust = np.maximum(flight.values("expected_thrust"), max(least, 1e-9))
    flight = flight.adding({IN_FORCE: recorded.values, "threshold_below": -recorded.values}, "thrust_residual")
    return flight.adding({"loss_threshold": recorded.values / thrust}, "loss_estimated")


def _scale_losses(panels: Sequence[Axes], drawn: Sequence[Drawn]) -> None:
    """One scale from no loss to the largest, with room for the threshold as it usually is."""
    losses = [flight.values(name) for flight in drawn for name in ("loss_estimated", "loss_true")]
    top = max((span(losses) or (0.0, 0.0))[1] * 1.15, _usual(drawn, "loss_threshold"), 0.05)
    # A loss is at most 1, whatever a diverging flight says.
    _rescale(panels, -0.04 * min(top, 1.1), min(top, 1.1))


def _scale_missing(below: Sequence[Axes], panels: Sequence[Panel], drawn: Sequence[Drawn]) -> None:
    """One scale for what is missing of all rotors, with room for the threshold as it usually is."""
    core = [values for panel in panels for values in core_of(panel, drawn, whole(drawn))]
    low, high = span(core) or (0.0, 1.0)
    _rescale(below, *padded(low, max(high, _usual(drawn, IN_FORCE))))
    for k, axes in enumerate(below):
        if (everything := span(flight.values("thrust_missing", k) for flight in drawn)) is not None:
            note_cut(axes, everything)


def _usual(drawn: Sequence[Drawn], threshold: str) -> float:
    """Half again as much as a threshold is for half of the time, in its unit."""
    usual = [np.nanmedian(limit) for f in drawn if np.isfinite(limit := f.values(threshold)).any()]
    return 1.5 * float(max(usual, default=0.0))


def _rescale(panels: Sequence[Axes], low: float, high: float) -> None:
    for axes in panels:
        axes.set_ylim(low, high)
        for note in list(axes.texts):  # they tell what was cut at the old scale
            note.remove()
        keep_ends_inside(axes)


def _shade_flags(axes: Axes, drawn: Sequence[Drawn], rotor: int) -> None:
    """Shade where a fault is declared: the whole height for one flight, a strip at the top for each of several."""
    height = 1.0 if len(drawn) == 1 else 0.055
    for k, flight in enumerate(drawn):
        axes.broken_barh(
            spans(flight, flight.values("fault_flag", rotor) > 0.5),
            (1.0 - (k + 1) * height, height),
            transform=axes.get_xaxis_transform(),
            facecolor=flight.colour,
            alpha=SHADE if len(drawn) == 1 else STRIP,
            linewidth=0.0,
            zorder=0.8,
        )
