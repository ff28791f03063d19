"""Where on a map hover is physically possible, whoever controls: `rotorfault.analysis.hover` for each cell.

What counts is the true vehicle with its mismatch, the losses that stay (faults step, ramp and total) and the mean
wind. Gusts, rotor lag and the way from flight before the fault are not looked at: beyond the limit nothing stays in
place for long, within it a controller may still fail.

What a study draws is looked at by its ends: a cell in which hover is possible at some of them and not at others gets
no answer. Of a normal draw the ends are three deviations away.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rotorfault.analysis.hover import hover_margin
from rotorfault.campaigns.axes import Columns, columns
from rotorfault.campaigns.sampling.statistics import Array
from rotorfault.campaigns.study import Draw, Study
from rotorfault.maths.geometry import PerRotor, Vec3
from rotorfault.model.vehicle import Vehicle
from rotorfault.model.vehicle_file import load_vehicle
from rotorfault.plant import FAULT, WIND
from rotorfault.scenario.scenario import Scenario

LASTING = {"step": "time", "ramp": "start", "total": "time"}  # kinds of faults, and where their onset stands
WINDS = ("none", "constant", "dryden")  # that have a mean velocity and nothing else that pushes
MOST_ENDS = 256  # combinations of ends of draws; beyond, there is no answer
DEVIATIONS = 3.0


class Limits(NamedTuple):
    """Whether hover is possible: 1, 0, or NaN where it depends on what is drawn."""

    with_yaw: Array
    without_yaw: Array


def limits(study: Study, variant: int, values: Mapping[str, NDArray[Any]], *, middle: bool = False) -> Limits | None:
    """Whether hover is possible at some values of a study's axes.

    Parameters
    ----------
    study : Study
    variant : int
        Place of the variant, whose vehicle, faults and wind count.
    values : mapping of str to ndarray, shape (N,)
        Of every axis.
    middle : bool, optional
        Take the middle of drawn numbers instead of their ends, so that there is an answer everywhere.

    Returns
    -------
    Limits or None
        Each of shape (N,). None where it is not known: faults or winds of other kinds, or too many draws.
    """
    scenario = study.scenarios[variant]
    count = len(next(iter(values.values())))
    ends = [_ends(draw, middle) for draw in study.draw if _matters(draw)]
    if not _understood(scenario, study) or np.prod([len(e) for e in ends], initial=1.0) > MOST_ENDS:
        return None
    names = [draw.name for draw in study.draw if _matters(draw)]
    answers = []
    for chosen in itertools.product(*ends):
        draws = {name: np.full(count, value) for name, value in zip(names, chosen, strict=True)}
        answers.append(_possible(scenario, columns({**values, **draws}), count))
    possible = np.array(answers)  # (ends, 2, N)
    every, some = possible.min(axis=0), possible.max(axis=0)
    return Limits(*np.where(every == some, every, every if middle else np.nan))


def _matters(draw: Draw) -> bool:
    """Whether it changes losses, wind or vehicle; most draws only change what happens on the way."""
    any_value = _ends(draw, middle=True)[0]
    changed = columns({draw.name: np.array([any_value])})
    return any(_decides(key) or not _harmless(key) for key in changed)


def _ends(draw: Draw, middle: bool) -> list[Any]:
    if draw.choice is not None:
        return list(draw.choice)
    low, high = draw.uniform or (0.0, 0.0)
    if draw.normal is not None:
        mean, deviation = draw.normal
        low, high = mean - DEVIATIONS * deviation, mean + DEVIATIONS * deviation
    return [0.5 * (low + high)] if middle else [low, high]


def _decides(key: str) -> bool:
    """Keys of a scenario whose values are taken over."""
    last = key.rpartition(".")[2]
    return (
        key in ("vehicle", "mismatch.mass", "mismatch.rotor_gain", "mismatch.linear_drag")
        or key.startswith("wind.velocity_W.")
        or (key.startswith("fault.") and last in ("loss", "rotor", "time", "start"))
    )


def _harmless(key: str) -> bool:
    """Keys of a scenario that do not change what is physically possible."""
    if key == "wind.wind_at_6m" or key.endswith(".end"):
        return True
    if key.startswith("mismatch."):
        return key.startswith(("mismatch.inertia", "mismatch.rotor_bandwidth"))
    return key.partition(".")[0] not in ("fault", "wind", "vehicle", "duration", "plant")


def _understood(scenario: Scenario, study: Study) -> bool:
    """Whether faults, wind and all keys that vary are of the kinds that this file knows."""
    names = [part.name for part in study.axis] + [part.name for part in study.draw]
    varied = columns({name: np.ones(1) for name in names})
    return (
        scenario[WIND].kind in WINDS
        and all(fault.kind in LASTING for fault in scenario.all(FAULT))
        and all(_decides(key) or _harmless(key) for key in varied)
    )


def _possible(scenario: Scenario, settings: Columns, count: int) -> Array:
    """Indicators with and without yaw, shape (2, N)."""
    effect = [np.ones(count) for _ in range(4)]
    for k, fault in enumerate(scenario.all(FAULT)):
        onset_key = LASTING[fault.kind]
        loss = settings.get(f"fault.{k}.loss", getattr(fault.settings, "loss", 1.0))
        onset = settings.get(f"fault.{k}.{onset_key}", getattr(fault.settings, onset_key))
        rotor = settings.get(f"fault.{k}.rotor", fault.settings.rotor)
        lasting = np.where(onset < scenario.duration, 1.0 - loss, 1.0)
        for i in range(4):
            effect[i] = effect[i] * np.where(rotor == i + 1, lasting, 1.0)
    losses = PerRotor.of(1.0 - each for each in effect)
    still = scenario[WIND].kind == "none"
    wind = (0.0, 0.0, 0.0) if still else scenario[WIND].settings.velocity_W
    wind_W = Vec3(*(settings.get(f"wind.velocity_W.{i}", wind[i]) + np.zeros(count) for i in range(3)))
    possible = np.full((2, count), np.nan)
    for vehicle, which in _vehicles(scenario, settings, count):
        part = {key: np.broadcast_to(column, (count,))[which] for key, column in settings.items()}
        margin = hover_margin(
            _true(vehicle, scenario, part), losses.map(lambda x, w=which: x[w]),
            Vec3(*(each[which] for each in (wind_W.x, wind_W.y, wind_W.z))),
        )  # fmt: skip
        possible[0, which], possible[1, which] = margin.with_yaw, margin.without_yaw
    return possible


def _vehicles(scenario: Scenario, settings: Columns, count: int) -> list[tuple[Vehicle, NDArray[np.bool_]]]:
    """Each vehicle, and where it flies."""
    if "vehicle" not in settings:
        return [(scenario.vehicle.vehicle, np.ones(count, dtype=bool))]
    column = np.broadcast_to(settings["vehicle"], (count,))
    return [(load_vehicle(str(name)).vehicle, column == name) for name in np.unique(column)]


def _true(vehicle: Vehicle, scenario: Scenario, settings: Columns) -> Vehicle:
    factors = {
        name: settings.get(f"mismatch.{name}", getattr(scenario.mismatch, name))
        for name in ("mass", "rotor_gain", "linear_drag")
    }
    return vehicle._replace(**{name: getattr(vehicle, name) * factor for name, factor in factors.items()})
