"""Rotors: thrust commanded, delivered and possible, when a fault strikes each and when it is declared."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from rotorfault.maths.arrays import Array
from rotorfault.maths.geometry import PerRotor, spread
from rotorfault.report.drawn import Drawn, around_onsets
from rotorfault.report.marks import legend, sample
from rotorfault.report.panels import Curve, Panel, grid, one_scale, solid, whole_and_detail
from rotorfault.report.style import BLACK, GREY, ORANGE, new_figure
from rotorfault.results.derived import STUCK_BELIEVED, believed_stuck_at

LIMIT: dict[str, Any] = {"color": BLACK, "linestyle": (0, (6.0, 1.5, 1.0, 1.5)), "linewidth": 0.7}
# Commands are as noisy as what they are made of, so they lie below, and dashes would not be seen.
COMMAND: dict[str, Any] = {"linestyle": "-", "linewidth": 1.4, "zorder": 1.8}
BEFORE, AFTER = 0.1, 0.5  # s around the fault onsets that the detail shows
POSSIBLE: dict[str, Any] = {"linestyle": (0, (1.0, 1.0)), "linewidth": 1.8, "zorder": 2.1}
FLAG: dict[str, Any] = {"linestyle": "", "marker": "v", "markersize": 5.5, "markeredgecolor": BLACK, "zorder": 6}
LIGHT_GREY = "0.62"
APART = 0.11  # of the height of a panel: between the marks of several flights
HEIGHT = 2.6  # cm per rotor
MARGIN = 0.07  # of the range of thrust, beyond its limits


def rotor_figure(drawn: Sequence[Drawn]) -> Figure:
    """A row per rotor, all on one scale.

    The command is what a sound rotor would be asked to give; a rotor that has lost thrust delivers less than that.
    The autopilot believes it to give at most its greatest thrust less the believed loss.
    """
    drawn = [_with_possible(flight) for flight in drawn]
    believing = any(flight.moves(name) for flight in drawn for name in ("loss_believed", STUCK_BELIEVED))
    alone = len(drawn) == 1
    rotors = [int(rotor) for rotor in drawn[0].data["rotor"].values]
    # Of several flights, each has its own colour for this too.
    look = POSSIBLE | {"color": ORANGE} if alone else POSSIBLE | {"linewidth": 1.2}
    command = COMMAND | ({"color": LIGHT_GREY} if alone else {"alpha": 0.35})
    panels = []
    for k, rotor in enumerate(rotors):
        curves = [solid("thrust", k), Curve("thrust_command", k, command)]
        curves += [Curve("thrust_possible", k, look)] if believing else []
        panels.append(Panel(f"rotor {rotor}", tuple(curves), 1.0, onset_of=rotor))
    figure = new_figure(1.5 + HEIGHT * len(rotors))
    made = grid(figure, whole_and_detail(panels, drawn, around_onsets(drawn, BEFORE, AFTER)), drawn)
    one_scale(axes for column in made for axes in column)
    limits = _limits(drawn)
    for column in made:
        for k, axes in enumerate(column):
            if limits:
                _draw_limits(axes, limits)
            _mark_flags(axes, drawn, k)
    others = [sample("commanded", **COMMAND | {"color": LIGHT_GREY})]
    if limits:
        others.append(sample("limits of a command", **LIMIT))
    if believing:
        others.append(sample("possible, as believed", **POSSIBLE | {"color": ORANGE if alone else GREY}))
    if any(flight.moves("fault_flag") for flight in drawn):
        others.append(sample("fault declared", **FLAG, markerfacecolor=drawn[0].colour if alone else GREY))
    legend(figure, drawn, others, own="delivered")
    return figure


def _with_possible(flight: Drawn) -> Drawn:
    """With the greatest thrust that the autopilot believes of each rotor; of one believed stuck, what it gives."""
    vehicle = flight.vehicle
    greatest: Array | float = float(flight.data.attrs.get("thrust_max", np.nan))
    if vehicle is not None:
        known = vehicle.thrust_max if isinstance(vehicle.thrust_max, PerRotor) else greatest
        greatest = np.array([*spread(vehicle.rotor_gain * known, vehicle.rotors)])
    held, followed = believed_stuck_at(flight.data), (1.0 - flight.values("loss_believed")) * greatest
    return flight.adding({"thrust_possible": np.where(np.isfinite(held), held, followed)}, "thrust")


def _limits(drawn: Sequence[Drawn]) -> list[float]:
    """Least and greatest commands in N of all flights; of different vehicles there may be more than two."""
    names = ("thrust_min", "thrust_max")
    return sorted({float(f.data.attrs[name]) for f in drawn for name in names if name in f.data.attrs})


def _draw_limits(axes: Axes, limits: Sequence[float]) -> None:
    low, high = axes.get_ylim()
    spare = MARGIN * (limits[-1] - limits[0])
    axes.set_ylim(min(low, limits[0] - spare), max(high, limits[-1] + spare))
    for limit in limits:
        axes.axhline(limit, zorder=1.6, **LIMIT)


def _mark_flags(axes: Axes, drawn: Sequence[Drawn], rotor: int) -> None:
    """A triangle at the top wherever the flag of a rotor rises."""
    first, last = axes.get_xlim()
    for k, flight in enumerate(drawn):
        flag = np.nan_to_num(flight.values("fault_flag", rotor)) > 0.5
        times = flight.time[flag & ~np.append(False, flag[:-1])]
        times = times[(times >= first) & (times <= last)]
        if not len(times):  # an empty line has no extent, which the layout takes for an endless one
            continue
        axes.plot(
            times,
            np.full(len(times), 0.97 - APART * k),
            **FLAG,
            markerfacecolor=flight.colour,
            transform=axes.get_xaxis_transform(),
            clip_on=False,
        )
