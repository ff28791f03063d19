"""The search: CMA-ES over training flights, all candidates of a generation in one batch per group.

Source: N. Hansen, "The CMA Evolution Strategy: A Tutorial", arXiv 1604.00772; the implementation is the package cma.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from typing import Any, NamedTuple

import cma
import numpy as np

from rotorfault._version import __version__
from rotorfault.autopilot.control import CONTROLLER
from rotorfault.base.bounds import whole_number
from rotorfault.base.errors import InputError, short
from rotorfault.base.foreign import is_place
from rotorfault.engine import default_engine, load_engine
from rotorfault.engine.batch import Batch, no_watch
from rotorfault.flight.assembly import assemble_all
from rotorfault.flight.candidates import assemble_with
from rotorfault.maths.arrays import Array
from rotorfault.model.telemetry import Layout
from rotorfault.results.flight_data import flight_data
from rotorfault.results.score_table import score_table
from rotorfault.scenario.scenario import Scenario
from rotorfault.tuning.space import SPACES, at_bounds, candidate, settings_at, space_of
from rotorfault.tuning.training import NEEDED, balanced, objective_of, training_groups

# Initial standard deviation as a share of each range. Our choice: the first generations look around the start, which
# flies, and not at the bounds.
SPREAD = 0.15
MOST_GENERATIONS, MOST_POPULATION = 100_000, 10_000
MOST_SEED = 2**32 - 1  # that the optimiser takes


class Tuned(NamedTuple):
    """What a search found, and how."""

    controller: str
    settings: dict[str, Any]  # tables of the controller
    record: dict[str, Any]  # optimiser, budget, seed, objective


def tune(
    controller: str,
    generations: int = 100,
    population: int = 24,
    seed: int = 1,
    overrides: dict[str, Any] | None = None,
    report: Callable[[int, float], None] | None = None,
    objective: str = "balanced",
    box: str = "standard",
    neighbours: int | None = None,
) -> Tuned:
    """Search the gains of a controller.

    Parameters
    ----------
    controller : str
        One of `rotorfault.tuning.space.SPACES`, or ``FILE.py:NAME`` for a class of your own with a `search`.
    generations, population : int
        Budget: their product is the number of candidates.
    seed : int
        Of the optimiser; the training flights have seeds of their own.
    overrides : dict, optional
        Dotted keys and values for all training flights, such as ``{"vehicle": "hummingbird"}``.
    report : callable, optional
        Called with the generations done and the best objective so far.
    objective : str
        What the search is for: one of `rotorfault.tuning.training.OBJECTIVES`.
    box : str
        Bounds of the search: one of `rotorfault.tuning.space.BOXES`.
    neighbours : int, optional
        Training flights in each group, at most; as many as the presets were found with if not given.

    Returns
    -------
    Tuned
        After Ctrl-C: the best until then.

    Raises
    ------
    InputError
        If a number is out of its range, there is no search space for the controller, it cannot be flown in a batch,
        or what overrides the training flights takes their faults away.
    """
    generations = whole_number(generations, "generations", 1, MOST_GENERATIONS)
    population = whole_number(population, "population", 4, MOST_POPULATION)
    seed = whole_number(seed, "seed", 1, MOST_SEED)
    space, worth = space_of(controller, box), objective_of(objective).worth
    groups = training_groups(controller, overrides or {}, neighbours)
    low, start, high = (np.log([entry[i] for entry in space]) for i in (1, 2, 3))

    def values(x: Array) -> Array:
        return np.asarray(np.exp(low + np.clip(x, 0.0, 1.0) * (high - low)))

    def tables(x: Array) -> dict[str, Any]:
        point = values(x)
        return settings_at(controller, {entry[0]: float(p) for entry, p in zip(space, point, strict=True)})

    search = cma.CMAEvolutionStrategy(
        (start - low) / (high - low),
        SPREAD,
        {"bounds": [0.0, 1.0], "popsize": population, "seed": seed, "verbose": -9},
    )
    done = 0
    try:
        while done < generations:
            points = search.ask()
            search.tell(points, _evaluate(controller, [tables(x) for x in points], groups, worth))
            done += 1
            if report is not None:
                report(done, float(search.result.fbest))
    except KeyboardInterrupt:
        if done == 0:
            raise
    record = {
        "optimiser": f"CMA-ES (cma {cma.__version__})",
        "generations": done,
        "population": population,
        "seed": seed,
        "flights_per_candidate": sum(map(len, groups)),
        "searched_for": objective,
        "box": box,
        "at_bounds": at_bounds(space, [float(value) for value in values(search.result.xbest)]),
        "objective": round(float(search.result.fbest), 4),
        "version": __version__,
        **({"overrides": dict(overrides)} if overrides else {}),
    }
    return Tuned(controller, tables(search.result.xbest), record)


def _evaluate(
    controller: str,
    candidates: list[dict[str, Any]],
    groups: list[list[Scenario]],
    worth: Callable[..., float] = balanced,
) -> list[float]:
    """Mean objective of each candidate; the groups count alike."""
    total = np.zeros(len(candidates))
    for group in groups:
        parts = [candidate(group[0], controller, table) for table in candidates]
        scenarios = [one.model_copy(update={CONTROLLER.name: part}) for part in parts for one in group]
        whole = assemble_with(group, CONTROLLER, parts) if controller in SPACES else assemble_all(scenarios)
        known = Layout(tuple(signal for signal in whole.loop.layout.signals if signal.name in NEEDED))
        batch = whole._replace(wanted=tuple(row for s in known.signals for row in _rows(whole, s.name)))
        recording = load_engine(default_engine(len(scenarios)))(batch, no_watch)
        if recording.interrupted:
            raise KeyboardInterrupt  # half a flight must not be judged
        times, table = recording.steps * group[0].period, score_table(batch, recording.state)
        scores = [
            worth(one, flight_data(known, recording.signals[:, :, i], times, {}), table.row(i))
            for i, one in enumerate(scenarios)
        ]
        total += np.array(scores).reshape(len(candidates), len(group)).mean(axis=1)
    return [float(x) for x in total / len(groups)]


def _rows(batch: Batch, name: str) -> range:
    place = batch.loop.layout.place(name)
    return range(place.start, place.stop)


def as_toml(tuned: Tuned, name: str) -> str:
    """A preset as TOML text, with the record of how it was found; of a controller of your own, a scenario's table."""
    if is_place(tuned.controller):
        record = [f"# {key}: {value}" for key, value in tuned.record.items()]
        return (
            "\n".join([*record, *_table({"kind": tuned.controller, **tuned.settings}, "controller")]).strip() + "\n"
        )
    return "\n".join(_table({**tuned.settings, "record": tuned.record}, name)).strip() + "\n"


def _table(tables: dict[str, Any], prefix: str) -> list[str]:
    plain = {key: value for key, value in tables.items() if not isinstance(value, dict)}
    lines = [f"[{prefix}]", *(f"{_key(key)} = {_value(value)}" for key, value in plain.items()), ""] if plain else []
    for key, value in tables.items():
        if isinstance(value, dict):
            lines += _table(value, f"{prefix}.{_key(key)}")
    return lines


def _value(value: Any) -> str:
    if isinstance(value, (list, tuple)):
        return f"[{', '.join(map(_value, value))}]"
    # JSON's texts and truth values are TOML's too; its numbers are Python's, but for those that are not finite.
    return json.dumps(value) if isinstance(value, (str, bool)) else repr(value)


def _key(key: str) -> str:
    """A key, dotted or not, quoted where TOML asks for it."""
    bare = (part if re.fullmatch(r"[A-Za-z0-9_-]+", part) else json.dumps(part) for part in key.split("."))
    return ".".join(bare)


def require_name(name: str) -> str:
    """The same name of a preset, if a TOML file can have it for a table's.

    Raises
    ------
    InputError
        If it is anything but letters, digits, hyphens and underscores.
    """
    if not re.fullmatch(r"[A-Za-z0-9_-]{1,60}", name):
        raise InputError(f"name: got {short(name)}; allowed: up to 60 letters, digits, hyphens and underscores")
    return name
