"""Flying a scenario: one flight, or several that differ in numbers only."""

from __future__ import annotations

import copy
import json
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from rotorfault._version import __version__
from rotorfault.autopilot.control import CONTROLLER
from rotorfault.autopilot.control.python_controller import as_controller
from rotorfault.autopilot.diagnosis import DIAGNOSIS
from rotorfault.base.bounds import require, require_shallow
from rotorfault.base.errors import InputError, as_text, short
from rotorfault.base.foreign import is_own, source_digest
from rotorfault.base.progress import Bar
from rotorfault.base.versions import versions
from rotorfault.engine import default_engine, load_engine
from rotorfault.engine.batch import Batch, Recording
from rotorfault.flight import doubts
from rotorfault.flight.assembly import Own, assemble, assemble_all
from rotorfault.flight.flight import Flight
from rotorfault.flight.following import Follow, Following
from rotorfault.loop.scores import ENDS
from rotorfault.maths.geometry import spread
from rotorfault.maths.records import unflatten
from rotorfault.plant import PLANT
from rotorfault.results.flight_data import FORMAT, flight_data
from rotorfault.results.outcome import Outcome, finite_or_none
from rotorfault.results.score_table import score_table
from rotorfault.scenario.library import load_scenario
from rotorfault.scenario.overrides import override_all
from rotorfault.scenario.part import NO_PRESET
from rotorfault.scenario.scenario import Scenario, allowed_with, scenario_from
from rotorfault.scenario.slots import SLOTS


def fly(
    scenario: str | Path | Mapping[str, Any] | Scenario,
    controller: Any = None,
    *,
    settings: Mapping[str, Any] | None = None,
    engine: str | None = None,
    seed: int | None = None,
    allow_code: bool = False,
    follow: Follow | None = None,
) -> Flight:
    """Fly a scenario.

    Warns of what is hardly meant: a vehicle's numbers (`VehicleWarning`), faults outside the attainable set
    (`FaultWarning`), a preset made for other rotors or commands that rattle (`ControllerWarning`), a reference that
    is not flown whole (`ReferenceWarning`), a start upside down (`StartWarning`).

    Parameters
    ----------
    scenario : str, Path, mapping or Scenario
        Name of a built-in scenario, path of a TOML file, tables as such a file holds, or a checked scenario.
    controller : str or object, optional
        Name of a registered controller, or a place in code (``FILE.py:NAME``); or your own: a block
        (`rotorfault.Controller`) or any object with a method
        ``update(time, estimate, reference, vehicle) -> Wrench`` (python engine only).
    settings : mapping, optional
        Dotted keys and values that override the scenario's, such as ``{"fault.0.loss": 0.4}``.
    engine : str, optional
        simd, numpy or python; the fastest that is installed if not given.
    seed : int, optional
        Names the random numbers of sensor noise and gusts.
    allow_code : bool
        Whether code that the scenario names may run; code that is named here may.
    follow : callable, optional
        Is called with the records, a piece at a time, while the flight is computed, and may take its time; see
        `rotorfault.flight.following`.

    Returns
    -------
    Flight

    Raises
    ------
    InputError
        If anything that was given cannot be used; one line that says how to mend it.
    """
    named = controller if isinstance(controller, str) else None
    own = controller if named is None else None
    if own is not None:
        _require_no_settings(settings or {})
    checked = prepare(scenario, named, settings, seed, allow_code)
    doubts.warn(checked, own_controller=own is not None)
    flight = fly_checked(checked, own, engine, follow)
    if doubt := doubts.rattling(flight.scores, flight.label):
        warnings.warn(doubt.says, doubt.kind, stacklevel=2)
    return flight


def fly_checked(
    scenario: Scenario, controller: Any = None, engine: str | None = None, follow: Follow | None = None
) -> Flight:
    """Fly a checked scenario without a word about what is hardly meant, for studies of what is odd on purpose.

    Parameters
    ----------
    scenario : Scenario
    controller : object, optional
        Flies in place of the scenario's; as for `fly`.
    engine : str, optional
        As for `fly`.
    follow : callable, optional
        As for `fly`.

    Raises
    ------
    InputError
        If the engine cannot run a part.
    """
    own: Own = {} if controller is None else {CONTROLLER: as_controller(controller)}
    batch = assemble(scenario, own)
    python_only = any(part.python_only for _, part in batch.loop.each())
    name = ("python" if python_only else default_engine(1)) if engine is None else engine
    if name != "python" and python_only:
        raise InputError(
            f"engine '{name}' cannot run a controller that is a plain Python object; use engine 'python'"
        )
    following = None
    if follow is not None:
        about = _attributes(scenario, name, controller) | {"duration": scenario.duration}
        following = Following(follow, batch.loop.layout, scenario.period * batch.every, about)
    flight = _flight(scenario, _run(batch, name, scenario.period, following), batch, 0, name, controller)
    if following is not None:
        following.end(len(flight.records()["time"].values))
    return flight


def _require_no_settings(settings: Mapping[str, Any]) -> None:
    """Refuse settings of the scenario's controller where it does not fly."""
    for key in settings:
        if isinstance(key, str) and key.partition(".")[0] == CONTROLLER.name:
            raise InputError(
                f"settings: {key} has no effect on a controller that is an object; give the object its settings, or "
                "name its class, FILE.py:NAME"
            )


def fly_all(scenarios: Sequence[Scenario], *, engine: str | None = None) -> list[Flight]:
    """Fly scenarios that differ in numbers only, in one batch, everything recorded.

    Parameters
    ----------
    scenarios : sequence of Scenario
    engine : str, optional
        simd, numpy or python; the fastest that is installed if not given.

    Raises
    ------
    InputError
        If they differ in more; see `rotorfault.flight.assembly.assemble_all`.
    """
    allowed = "Scenario objects, such as load_scenario(...) returns"
    require(scenarios, Sequence, "scenarios", f"a list of {allowed}")
    for scenario in scenarios:
        require(scenario, Scenario, "scenarios", allowed)
        doubts.warn(scenario)
    name = default_engine(len(scenarios)) if engine is None else engine
    batch = assemble_all(scenarios)
    recording = _run(batch, name, scenarios[0].period)
    return [_flight(scenario, recording, batch, i, name, None) for i, scenario in enumerate(scenarios)]


def prepare(
    scenario: str | Path | Mapping[str, Any] | Scenario,
    controller: str | None = None,
    settings: Mapping[str, Any] | None = None,
    seed: int | None = None,
    allow_code: bool = False,
) -> Scenario:
    """Check a scenario with what overrides it; see `fly`."""
    overrides: dict[str, Any] = {} if controller is None else {"controller.kind": controller}
    if not isinstance(settings or {}, Mapping) or not all(isinstance(key, str) for key in settings or {}):
        hint = "dotted keys and values, such as {'duration': 5.0}"
        raise InputError(f"settings: got {short(settings)}; allowed: {hint}")
    require(scenario, (str, Path, Mapping, Scenario), "scenario", "a name, a path, tables or a Scenario")
    require_shallow(scenario, "scenario")
    require_shallow(settings, "settings")
    overrides |= dict(settings or {})
    if seed is not None:
        overrides["seed"] = seed
    if isinstance(scenario, (str, Path)):
        return load_scenario(scenario, overrides, allow_code=allow_code)
    if isinstance(scenario, Scenario) and not overrides:
        return scenario
    tables = scenario.as_tables() if isinstance(scenario, Scenario) else copy.deepcopy(dict(scenario))
    override_all(tables, overrides)
    # What is in a checked scenario was allowed when it was checked.
    allowed = allowed_with(isinstance(scenario, Scenario) or allow_code, overrides)
    return scenario_from(tables, as_text(tables.get("name", "scenario")), allowed)


def repeat(
    path: str | Path, engine: str | None = None, *, allow_code: bool = False, follow: Follow | None = None
) -> Flight:
    """Fly again what a flight file holds.

    Parameters
    ----------
    path : str or Path
        A ``flight.nc``, of this version or an older one.
    engine : str, optional
        That of the file if not given.
    allow_code : bool
        Whether code that the file names may run.
    follow : callable, optional
        As for `fly`.

    Raises
    ------
    InputError
        If the file cannot be read, names code that is not allowed, or was flown by a controller that is not in it.
    """
    from rotorfault.results.dataset import OLD_FORMAT, read_configuration

    tables, attributes = read_configuration(path)
    if attributes.get("own_controller"):
        raise InputError(
            f"{path}: was flown by your own controller '{attributes['own_controller']}', which a file cannot hold; "
            "fly it with rotorfault.fly(scenario, controller=...)"
        )
    if attributes["format"] == OLD_FORMAT:
        _without_presets(tables)
    _without_reaction(tables)
    scenario = scenario_from(tables, str(path), allow_code)
    return fly(scenario, engine=str(attributes["engine"]) if engine is None else engine, follow=follow)


def _without_presets(tables: dict[str, Any]) -> None:
    """Say of a scenario's complete tables that they come from no preset that is known: older files name none."""
    for slot in SLOTS:
        part = tables.get(slot.name)
        if slot.presets is not None and isinstance(part, dict) and slot.presets(as_text(part.get("kind"))):
            part.setdefault("preset", NO_PRESET)


def _without_reaction(tables: dict[str, Any]) -> None:
    """Say of a vehicle that has been flown before rotors could turn the body that its rotors did not."""
    vehicle = tables.get("vehicle")
    if isinstance(vehicle, dict):
        none = {"value": 0.0, "unit": "1", "source": "flown before there was a reaction of rotors"}
        vehicle.setdefault("rotor_reaction", none)


def _run(batch: Batch, engine: str, period: float, following: Following | None = None) -> Recording:
    if following is not None:
        return load_engine(engine)(batch._replace(look=following.look), following.watch)
    with Bar("flying", batch.steps * period, "s") as bar:

        def watch(done: int) -> bool:
            bar.update(done * period)
            return False

        return load_engine(engine)(batch, watch)


def _flight(scenario: Scenario, recording: Recording, batch: Batch, index: int, engine: str, own: Any) -> Flight:
    # Scores of one flight are those of a batch of one: the same code counts and reads them.
    scores = score_table(batch, recording.state).row(index)
    over = unflatten(batch.state, recording.state[:, index].tolist()).scores
    signals, times = recording.signals[:, :, index], recording.steps * scenario.period
    outcome = Outcome(str(scores["outcome"]), float(scores["end_time"]))
    end = len(times)
    if ENDS[int(over.over)] != "flying":
        # The record of the end itself (the first from it on) is kept where it has numbers, and the first in any case.
        end = min(int(np.searchsorted(recording.steps, over.end)) + 1, len(times))
        end = max(1, end - (1 if not np.isfinite(signals[end - 1]).all() else 0))
    attributes = _attributes(scenario, engine, own) | {
        "outcome": outcome.kind,
        "end_time": outcome.time,
        "scores": json.dumps(finite_or_none(scores)),
    }
    data = flight_data(batch.loop.layout, signals[:end], times[:end], attributes)
    return Flight(data, outcome, scores, scenario)


def _attributes(scenario: Scenario, engine: str, own: Any) -> dict[str, Any]:
    """What a flight file says of itself."""
    vehicle, controller = scenario.vehicle.vehicle, scenario[CONTROLLER]
    name = controller.kind.rpartition(":")[2] if own is None else type(own).__name__
    parts = [
        {"slot": slot.name, "kind": part.kind, "preset": part.preset_label, "source": part.source}
        for slot, part in scenario.parts()
        if own is None or slot is not CONTROLLER
    ]
    if own is not None:
        source = "" if is_own(type(own).__module__) else source_digest(own)
        parts.append({"slot": CONTROLLER.name, "kind": name, "preset": "", "source": source})
    decision = getattr(scenario[DIAGNOSIS].settings, "decision", None)
    return {
        "format": FORMAT,
        "title": f"{scenario.name} flown by {name}",
        "scenario": scenario.name,
        "controller": name,
        "preset": controller.preset_label if own is None else "",
        "own_controller": name if own is not None else "",
        "parts": json.dumps(parts),
        "plant": scenario[PLANT].kind,
        "vehicle": scenario.vehicle.name,
        "engine": engine,
        "seed": scenario.seed,
        "version": __version__,
        "versions": json.dumps(versions()),
        # Of rotors that differ, the least and the greatest of all; the configuration has each.
        "thrust_min": min(spread(vehicle.thrust_min, vehicle.rotors)),
        "thrust_max": max(spread(vehicle.thrust_max, vehicle.rotors)),
        "threshold": float(getattr(decision, "threshold", 0.0)),
        "configuration": json.dumps(scenario.as_tables()),
    }
