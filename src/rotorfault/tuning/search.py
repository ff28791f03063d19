"""The search: CMA-ES over training flights, all candidates of a generation in one batch per group.

Source: N. Hansen, "The CMA Evolution Strategy: A Tutorial", arXiv 1604.00772; the implementation is the package cma.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from rotorfault._version import __version__
from rotorfault.autopilot.control import CONTROLLER
from rotorfault.base.bounds import require, whole_number
from rotorfault.base.errors import InputError, missing_extra, short
from rotorfault.base.files import output_folder, write_atomically
from rotorfault.base.one_line import LONGEST, brief, cut
from rotorfault.base.progress import Bar
from rotorfault.engine import default_engine, load_engine
from rotorfault.engine.batch import Batch, no_watch
from rotorfault.flight.assembly import assemble_all
from rotorfault.flight.candidates import assemble_with
from rotorfault.maths.arrays import Array
from rotorfault.model.motion import mean_bandwidth
from rotorfault.model.telemetry import Layout
from rotorfault.results.flight_data import flight_data
from rotorfault.results.score_table import score_table
from rotorfault.scenario.preset_file import ENDING
from rotorfault.scenario.scenario import Scenario
from rotorfault.tuning.objectives import NEEDED, balanced, objective_of
from rotorfault.tuning.space import SPACES, at_bounds, candidate, settings_at, space_of
from rotorfault.tuning.training import training_groups

# Initial standard deviation as a share of each range. Our choice: the first generations look around the start, which
# flies, and not at the bounds.
SPREAD = 0.15
MOST_GENERATIONS, MOST_POPULATION = 100_000, 10_000
MOST_NEIGHBOURS = 1000
MOST_SEED = 2**32 - 1  # that the optimiser takes

ScenarioLike = str | Path | Mapping[str, Any] | Scenario


class Tuned(NamedTuple):
    """What a search found, and how."""

    controller: str  # registered name, or place in code
    settings: dict[str, Any]  # tables of the controller
    record: dict[str, Any]  # what it is for; optimiser, budget, seed, objective

    def __repr__(self) -> str:
        return cut(f"<gains of {brief(self.controller)}, {brief(self.record)}>", LONGEST)

    def as_toml(self, name: str = "tuned") -> str:
        """The gains as a file of presets, with the record of how they were found.

        Parameters
        ----------
        name : str
            Of the preset: up to 60 letters, digits, hyphens and underscores.

        Raises
        ------
        InputError
            If no table can have this name.
        """
        return "\n".join(_table({**self.settings, "record": self.record}, require_name(name))).strip() + "\n"

    def save(self, path: str | Path, name: str = "tuned") -> Path:
        """Write the gains as a file that ``preset = "FILE.toml"`` takes in every scenario, study and command.

        Parameters
        ----------
        path : str or Path
            Ends in ``.toml``.
        name : str
            Of the preset.

        Raises
        ------
        InputError
            If path or name are none, or the folder cannot be written.
        """
        path = preset_path(path)
        text = self.as_toml(name)
        output_folder(path.parent)
        write_atomically(path, lambda temporary: temporary.write_text(text, encoding="utf-8"))
        return path


def preset_path(path: str | Path) -> Path:
    """The same path, if a file of presets can have it.

    Raises
    ------
    InputError
        If it ends otherwise than in ``.toml``.
    """
    require(path, (str, Path), "path", "that of a file that ends in .toml")
    if not str(path).endswith(ENDING):
        raise InputError(f"{path}: allowed: a file that ends in {ENDING}, which scenarios then take as a preset")
    return Path(path)


def tune(
    controller: str = "roismc",
    scenarios: ScenarioLike | Sequence[ScenarioLike] = (),
    *,
    settings: Mapping[str, Any] | None = None,
    objective: str = "balanced",
    box: str = "standard",
    generations: int = 100,
    population: int = 24,
    seed: int = 1,
    neighbours: int | None = None,
    allow_code: bool = False,
    report: Callable[[int, float], None] | None = None,
) -> Tuned:
    """Search the gains of a controller by CMA-ES over training flights.

    Parameters
    ----------
    controller : str
        One of `rotorfault.tuning.space.SPACES`, or ``FILE.py:NAME`` for a class of your own with a `search`.
    scenarios : str, Path, mapping, Scenario, or several
        What is flown: neighbours of each, see `rotorfault.tuning.training`. The paper's three cases if none is given.
    settings : mapping, optional
        Dotted keys and values for all training flights, such as ``{"vehicle": "hummingbird"}``.
    objective : str
        What the search is for: one of `rotorfault.tuning.objectives.OBJECTIVES`.
    box : str
        Bounds of the search: one of `rotorfault.tuning.space.BOXES`.
    generations, population : int
        Budget: their product is the number of candidates.
    seed : int
        Of the optimiser; the training flights have seeds of their own.
    neighbours : int, optional
        Training flights in each group: at most so many of the paper's cases, so many of each scenario that is given.
    allow_code : bool
        Whether code that the scenarios name may run; code that is named here may.
    report : callable, optional
        Called with the generations done and the best objective so far.

    Returns
    -------
    Tuned
        After Ctrl-C: the best until then.

    Raises
    ------
    InputError
        If a number is out of its range, there is no search space for the controller, it cannot be flown in a batch,
        or a scenario cannot be used.
    MissingExtraError
        If the package cma is not installed.
    """
    cma = _optimiser()
    require(controller, str, "controller", "a registered name, or FILE.py:NAME")
    generations = whole_number(generations, "generations", 1, MOST_GENERATIONS)
    population = whole_number(population, "population", 4, MOST_POPULATION)
    seed = whole_number(seed, "seed", 1, MOST_SEED)
    if neighbours is not None:
        neighbours = whole_number(neighbours, "neighbours", 1, MOST_NEIGHBOURS)
    flown = [scenarios] if isinstance(scenarios, (str, Path, Mapping, Scenario)) else list(scenarios)
    space, worth = space_of(controller, box), objective_of(objective).worth
    groups = training_groups(controller, settings or {}, neighbours, flown, allow_code=allow_code)
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
        with Bar(f"tuning {controller}", generations, "generations") as bar:
            while done < generations:
                points = search.ask()
                search.tell(points, _evaluate(controller, [tables(x) for x in points], groups, worth))
                done += 1
                bar.update(done)
                if report is not None:
                    report(done, float(search.result.fbest))
    except KeyboardInterrupt:
        if done == 0:
            raise
    first = groups[0][0]
    record = {
        CONTROLLER.name: controller,
        "vehicle": first.vehicle.name,
        "rotor_bandwidth": mean_bandwidth(first.vehicle.vehicle),
        "scenarios": list(dict.fromkeys(group[0].name for group in groups)),
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
        **({"settings": _plain(settings)} if settings else {}),
    }
    return Tuned(controller, tables(search.result.xbest), record)


def _optimiser() -> Any:
    try:
        # An extra, which everything but a search does without.
        import cma
    except ImportError:
        raise missing_extra("tuning needs the package cma", "tune") from None
    return cma


def _plain(settings: Mapping[str, Any]) -> dict[str, Any]:
    """Settings as a TOML file can hold them."""
    return {key: json.loads(json.dumps(value, default=str)) for key, value in settings.items() if value is not None}


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


def _table(tables: dict[str, Any], prefix: str) -> list[str]:
    # A dotted key below one that has a value of its own, as `vehicle.mass` below `vehicle`, cannot be a table there.
    whole = {key for key in tables if "." in key and key.partition(".")[0] in tables}
    plain = {key: value for key, value in tables.items() if key in whole or not isinstance(value, dict)}
    written = (f"{json.dumps(key) if key in whole else _key(key)} = {_value(value)}" for key, value in plain.items())
    lines = [f"[{prefix}]", *written, ""] if plain else []
    for key, value in tables.items():
        if key not in plain:
            lines += _table(value, f"{prefix}.{_key(key)}")
    return lines


def _value(value: Any) -> str:
    if isinstance(value, (list, tuple)):
        return f"[{', '.join(map(_value, value))}]"
    if isinstance(value, dict):
        return f"{{ {', '.join(f'{_key(key)} = {_value(one)}' for key, one in value.items())} }}"
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
