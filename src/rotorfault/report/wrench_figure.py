"""Wrench: what the controller demanded, what the rotors gave, what was left out, and what was given up for it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from rotorfault.maths.arrays import ANGLES
from rotorfault.report.drawn import Drawn, whole
from rotorfault.report.marks import legend, sample
from rotorfault.report.panels import Curve, Panel, Strip, core_of, solid, timeline
from rotorfault.report.style import ORANGE, new_figure, span
from rotorfault.results.derived import given_wrench

# Demands are as noisy as what they are made of, so they lie below, and dashes would not be seen.
DEMAND: dict[str, Any] = {"linestyle": "-", "linewidth": 1.8, "zorder": 1.8}
ALLOCATED: dict[str, Any] = {"color": ORANGE, "linestyle": "-", "linewidth": 0.9, "zorder": 1.9}
LIGHT_GREY = "0.62"
HEIGHT = 2.4  # cm per row
ROUNDING = 1e-6  # of the largest demand
GIVEN_UP = Strip("given up", (("tilt", "given_up", 0), ("thrust", "given_up", 1), ("yaw", "given_up", 2)))


def wrench_figure(drawn: Sequence[Drawn]) -> Figure:
    """Thrust and torques: demanded, allocated (what commands are believed to give) and delivered by the true rotors.

    Below stand the parts of the demand that were left unallocated, demanded less allocated, and when tilt, thrust or
    yaw was given up; each only where it happened.
    """
    drawn = [_with_given(flight) for flight in drawn]
    alone = len(drawn) == 1
    demanded = DEMAND | ({"color": LIGHT_GREY} if alone else {"alpha": 0.35})
    given: list[Panel | Strip] = []
    left: list[Panel | Strip] = []
    for name, kind, k in (("thrust", "thrust", None), *((angle, "torque", k) for k, angle in enumerate(ANGLES))):
        curves = [solid(f"{kind}_given", k), Curve(f"{kind}_demand", k, demanded)]
        asked = core_of(Panel(name, (solid(f"{kind}_demand", k),)), drawn, whole(drawn))
        if any((np.nan_to_num(flight.values(f"{kind}_unallocated", k)) != 0.0).any() for flight in drawn):
            # What is left out may be nothing until the end, and then has no scale of its own.
            size = max(map(abs, span(asked) or (0.0, 0.0)))
            curve = solid(f"{kind}_unallocated", k)
            left.append(Panel(f"unallocated\n{name}", (curve,), 0.5, size or None, height=0.8, zero_too=False))
            curves += [Curve(f"{kind}_allocated", k, ALLOCATED)] if alone else []
        given.append(Panel(name, tuple(curves)))
    rows = [*given, *left]
    rows += [GIVEN_UP] if any(flight.moves("given_up") for flight in drawn) else []
    figure = new_figure(1.5 + HEIGHT * sum(row.height for row in rows))
    timeline(figure, rows, drawn)
    others = [sample("demanded", **DEMAND | {"color": LIGHT_GREY})]
    if alone and left:
        others.append(sample("allocated, as believed", **ALLOCATED))
    legend(figure, drawn, others, own="allocated" if drawn[0].vehicle is None else "delivered")
    return figure


def _with_given(flight: Drawn) -> Drawn:
    """With the allocated wrench, and with the one that true thrusts give; without a vehicle, it is that."""
    for name in ("thrust", "torque"):
        demand, left = flight.values(f"{name}_demand"), flight.values(f"{name}_unallocated")
        left = np.where(np.abs(left) <= ROUNDING * np.nanmax(np.abs(demand), axis=0, initial=0.0), 0.0, left)
        flight = flight.adding({f"{name}_unallocated": left}, f"{name}_demand")
        allocated = demand - left
        flight = flight.adding({f"{name}_allocated": allocated, f"{name}_given": allocated}, f"{name}_demand")
    if (vehicle := flight.vehicle) is None:
        return flight
    thrust, torque = given_wrench(vehicle, flight.values("thrust"))
    flight = flight.adding({"thrust_given": thrust}, "thrust_demand")
    return flight.adding({"torque_given": torque}, "torque_demand")
