"""Where on a map hover can be controlled, whoever does it: `rotorfault.analysis.hover` for each cell.

Controlled means more than possible: every small change of wrench about hover can be given, so that the control
authority index (ACAI) is positive.

What counts is the true vehicle with its mismatch, the losses that stay and the mean wind; faults and winds are asked
for them. Gusts, rotor lag and the way from flight before the fault are not looked at: beyond the limit nothing stays
in place for long, within it a controller may still fail.

What a study draws is looked at by its ends: a cell in which it can at some of them and not at others gets no answer.
Of a normal draw the ends are three deviations away.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rotorfault.analysis.hover import hover_controlled
from rotorfault.base.one_line import record_line
from rotorfault.campaigns.axes import Columns
from rotorfault.campaigns.flight_set import columns_of
from rotorfault.campaigns.study import Cases, Study
from rotorfault.campaigns.varied import Draw
from rotorfault.engine.batch import columns as rows_of
from rotorfault.flight.assembly import Group, numbers_of
from rotorfault.flight.sweep import checked_columns, groups_of
from rotorfault.maths.arrays import Array
from rotorfault.maths.geometry import PerRotor, Vec3
from rotorfault.maths.records import flatten, unflatten
from rotorfault.model.likeness import alike, bare
from rotorfault.model.vehicle import Vehicle
from rotorfault.scenario.scenario import Scenario

MOST_ENDS = 256  # combinations of ends of draws; beyond, there is no answer
DEVIATIONS = 3.0


class Limits(NamedTuple):
    """Whether hover can be controlled: 1, 0, or NaN where it depends on what is drawn."""

    with_yaw: Array
    without_yaw: Array

    def __repr__(self) -> str:
        return record_line(self)


class Physics(NamedTuple):
    """What decides whether flights can hover, each number of shape (N,)."""

    vehicle: Vehicle  # true
    loss: PerRotor  # that stays
    wind_W: Vec3  # m/s, mean


def possible_text(possible: Limits | None, at: tuple[int, ...]) -> str:
    """Whether hover can be controlled, in words.

    Parameters
    ----------
    possible : Limits or None
    at : tuple of int
        Place in their arrays.
    """
    if possible is None:
        return "not known"
    words = {1.0: "yes", 0.0: "no"}
    held, free = (words.get(float(each[at]), "depends on what is drawn") for each in possible)
    return held if held == free else f"with yaw held {held}, given up {free}"


def limits(study: Study, variant: int, values: Mapping[str, NDArray[Any]], *, middle: bool = False) -> Limits | None:
    """Whether hover can be controlled at some values of a study's axes.

    Parameters
    ----------
    study : Study
        Whose draws and scenario count.
    variant : int
        Place of the variant, whose vehicle, faults and wind count.
    values : mapping of str to ndarray, shape (N,)
        Of every axis.
    middle : bool, optional
        Take the middle of drawn numbers instead of their ends, so that there is an answer everywhere.

    Returns
    -------
    Limits or None
        Each of shape (N,). None where it is not known: a fault whose loss depends on the command, a wind that pushes
        by more than its mean velocity, or too many draws.
    """
    count = len(next(iter(values.values())))
    if not study.case_axes:
        return _limits_of(study, variant, (), values, middle)
    found = Limits(np.full(count, np.nan), np.full(count, np.nan))
    chosen = list(zip(*(values[part.name].tolist() for part in study.case_axes), strict=True))
    for labels in dict.fromkeys(chosen):
        cases = tuple(
            next(case for case in part.case if case.label == label)
            for part, label in zip(study.case_axes, labels, strict=True)
        )
        which = np.array([one == labels for one in chosen])
        here = _limits_of(study, variant, cases, {name: column[which] for name, column in values.items()}, middle)
        if here is not None:
            found.with_yaw[which], found.without_yaw[which] = here
    return None if all(np.isnan(each).all() for each in found) else found


def _limits_of(
    study: Study, variant: int, cases: Cases, values: Mapping[str, NDArray[Any]], middle: bool
) -> Limits | None:
    """The same where all flights have the same cases."""
    scenario, count = study.scenario_of(variant, cases), len(next(iter(values.values())))
    every = [draw for _, draw in study.draws_of(cases).values()]
    here = _Flights(study, scenario, cases, every, {n: v for n, v in values.items() if n not in _names(study)})
    draws = [draw for draw in every if _matters(here, draw)]
    ends = [_ends(draw, middle) for draw in draws]
    if np.prod([len(e) for e in ends], initial=1.0) > MOST_ENDS:
        return None
    answers = []
    for chosen in itertools.product(*ends):
        drawn = {draw.name: np.full(count, value) for draw, value in zip(draws, chosen, strict=True)}
        others = {d.name: np.full(count, _ends(d, True)[0]) for d in every if d not in draws}
        varied = columns_of(study, {**here.values, **drawn, **others}, cases)
        physics = _physics(scenario, {**varied, "seed": np.zeros(count, int)}, count)
        if physics is None:
            return None
        answers.append([np.broadcast_to(one, (count,)) for one in hover_controlled(*physics)])
    possible = np.array(answers, dtype=float)  # (ends, 2, N)
    every, some = possible.min(axis=0), possible.max(axis=0)
    return Limits(*np.where(every == some, every, every if middle else np.nan))


class _Flights(NamedTuple):
    """Flights of one scenario."""

    study: Study
    scenario: Scenario
    cases: Cases
    draws: list[Draw]
    values: dict[str, NDArray[Any]]  # of axes that are no cases, shape (N,)


def _names(study: Study) -> set[str]:
    return {part.name for part in study.case_axes}


def _matters(flights: _Flights, draw: Draw) -> bool:
    """Whether a draw changes losses, wind or vehicle; most only change what happens on the way."""
    ends = _ends(draw, middle=False)
    first = {name: np.full(len(ends), column[0]) for name, column in flights.values.items()}
    others = {other.name: np.full(len(ends), _ends(other, True)[0]) for other in flights.draws}
    varied = columns_of(flights.study, {**first, **others, draw.name: np.array(ends)}, flights.cases)
    physics = _physics(flights.scenario, {**varied, "seed": np.zeros(len(ends), int)}, len(ends))
    if physics is None:
        return False
    rows = rows_of(physics, len(ends))
    return bool((rows != rows[:, :1]).any())


def _ends(draw: Draw, middle: bool) -> list[Any]:
    if draw.choice is not None:
        return [draw.choice[0]] if middle else list(draw.choice)
    low, high = draw.ends or (0.0, 0.0)
    if draw.normal is not None:
        mean, deviation = draw.normal
        low, high = mean - DEVIATIONS * deviation, mean + DEVIATIONS * deviation
    return [0.5 * (low + high)] if middle else [low, high]


def _physics(scenario: Scenario, varied: Columns, count: int) -> Physics | None:
    """What decides about hover in flights with some columns of a scenario; None where a part does not know."""
    checked = checked_columns(scenario, dict(varied))
    parts = []
    for group in groups_of(scenario, checked):
        physics = _physics_of(group)
        if physics is None:
            return None
        parts.append((group.flights, physics))
    vehicles = alike([physics.vehicle for _, physics in parts])
    found = [physics._replace(vehicle=vehicle) for (_, physics), vehicle in zip(parts, vehicles, strict=True)]
    rows = np.empty((len(flatten(found[0])), count))
    for (flights, _), physics in zip(parts, found, strict=True):
        rows[:, flights] = rows_of(physics, len(flights))
    return unflatten(found[0], list(rows))


def _physics_of(group: Group) -> Physics | None:
    loop, numbers = numbers_of(group)
    remaining: list[Any] = [1.0] * loop.rotors
    for fault, record in zip(loop.plant.faults, numbers.parts.fault if loop.plant.faults else (), strict=True):
        loss = fault.final_loss(record)
        if loss is None:
            return None
        lasting = np.where(fault.onset(record) < group.scenario.duration, 1.0 - loss, 1.0)
        remaining[fault.rotor - 1] = remaining[fault.rotor - 1] * lasting
    wind_W = loop.plant.wind.mean_velocity(numbers.parts.wind)
    # What a battery leaves of the greatest thrust depends on the flight.
    if wind_W is None or loop.battery:
        return None
    return Physics(bare(numbers.vehicle), PerRotor.of(1.0 - share for share in remaining), wind_W)
