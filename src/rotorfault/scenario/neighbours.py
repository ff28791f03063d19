"""Neighbours of a scenario: the same task with a vehicle, start and faults that are a little different.

They answer whether a flight is an accident of its numbers. What varies is unknown to the autopilot.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np

from rotorfault.base.bounds import positive, require, whole_number
from rotorfault.base.errors import InputError
from rotorfault.plant import FAULT
from rotorfault.scenario.mismatch import Mismatch
from rotorfault.scenario.scenario import MOST_SEED, Scenario, Start


def neighbour(
    scenario: Scenario, seed: int, spread: float = 0.1, onset: tuple[float, float] = (0.5, 5.0)
) -> Scenario:
    """A seeded neighbour.

    Parameters
    ----------
    scenario : Scenario
    seed : int
        0 or greater. Names the draw; the same seed gives the same neighbour.
    spread : float
        Between 0 and 1, both excluded. True mass, principal moments of inertia and drag, and each initial
        position, attitude and rate, are multiplied by factors uniform in 1 -+ spread, independently; but no moment
        is drawn above the sum of the others.
    onset : (2,) float
        All faults that set in at a time are moved to a common one, uniform in this interval [s].

    Returns
    -------
    Scenario
        Same parts, same length: it may fly in one batch with the original.

    Raises
    ------
    InputError
        If `seed` or `spread` is out of its range.
    """
    require(scenario, Scenario, "scenario", "a Scenario, such as load_scenario(...) returns")
    seed = whole_number(seed, "seed", 0, MOST_SEED)
    if positive(spread, "spread", "1", 1.0) == 1.0:
        raise InputError(f"spread: got {spread!r}; allowed: between 0 and 1, both excluded")
    # The second word keeps this stream apart from the sensor noise of the same seed.
    draw = np.random.Generator(np.random.Philox(np.random.SeedSequence([seed, 1 << 40])))

    def factors(count: int) -> list[float]:
        return [float(x) for x in draw.uniform(1.0 - spread, 1.0 + spread, count)]

    def scaled(values: tuple[float, float, float]) -> tuple[float, float, float]:
        x, y, z = (value * factor for value, factor in zip(values, factors(3), strict=True))
        return x, y, z

    mass, *inertia, drag = factors(5)
    x, y, z = _existing(scenario.vehicle.vehicle.inertia, inertia)
    mismatch = Mismatch(mass=mass, inertia=(x, y, z), linear_drag=drag)
    start = Start(
        charge=scenario.start.charge,
        position=scaled(scenario.start.position),
        velocity=scaled(scenario.start.velocity),
        attitude=scaled(scenario.start.attitude),
        body_rates=scaled(scenario.start.body_rates),
    )
    moment = float(draw.uniform(*onset))
    # On a sampling instant, as the original's.
    moment = round(moment / scenario.period) * scenario.period
    faults = tuple(
        part.with_settings(part.settings.model_copy(update={"time": moment}))
        if "time" in type(part.settings).model_fields
        else part
        for part in scenario.all(FAULT)
    )
    return scenario.model_copy(update={"mismatch": mismatch, "start": start, "fault": faults})


def _existing(inertia: Iterable[float], factors: Sequence[float]) -> list[float]:
    """The factors, with that of the largest moment such that it is no larger than the sum of the others."""
    moments = [moment * factor for moment, factor in zip(inertia, factors, strict=True)]
    largest = max(moments)
    most = math.fsum(moments) - largest
    return [f * min(1.0, most / largest) if m == largest else f for m, f in zip(moments, factors, strict=True)]
