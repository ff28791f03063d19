"""Whatever is registered keeps the house rules, without being asked: no part is named here.

A new part goes through all of this once it is registered. Required settings are filled by `example`; a sort of field
that it does not know has to be taught to it.
"""

from __future__ import annotations

import inspect
import itertools
import types
import typing
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from pydantic import BaseModel, ValidationError

from rotorfault.base.errors import InputError
from rotorfault.cli.catalogue import REGISTRIES
from rotorfault.engine import have_simd, load_engine
from rotorfault.engine.batch import Batch, drive_template, no_watch
from rotorfault.engine.noise import GUSTS, Noise
from rotorfault.engine.structure import structure
from rotorfault.flight.assembly import assemble
from rotorfault.loop.closed_loop import Drive
from rotorfault.maths.geometry import Vec3, zeros
from rotorfault.maths.records import flatten, unflatten
from rotorfault.model.telemetry import SIGNAL_NAMES
from rotorfault.plant import no_noise
from rotorfault.scenario.scenario import Mismatch, Scenario, scenario_from

Array = NDArray[np.float64]
# Where a scenario names a part of each registry. The plant is a bare name: models of the body have no settings.
KEYS = {
    "controllers": "controller",
    "plants": "plant",
    "references": "reference",
    "winds": "wind",
    "faults": "fault",
    "sensors": "sensors",
    "diagnoses": "diagnosis",
    "allocators": "allocation",
    "responses": "on_fault",
}
PARTS = [(group, name) for group, registry in REGISTRIES.items() for name in registry]
each_part = pytest.mark.parametrize(("group", "name"), PARTS, ids=[f"{group}-{name}" for group, name in PARTS])
PLANTS = list(REGISTRIES["plants"])
WITH_SETTINGS = [(group, name) for group, name in PARTS if group != "plants"]
each_part_with_settings = pytest.mark.parametrize(
    ("group", "name"), WITH_SETTINGS, ids=[f"{group}-{name}" for group, name in WITH_SETTINGS]
)
STEPS = 150  # of 2 ms


# -------------------------------------------------------------------------------------------------- minimal settings


def example(model: type[BaseModel], folder: Path) -> dict[str, Any]:
    """Tables that set just what must be set. Numbers rise from field to field, so that ends come after starts."""
    rising = itertools.count(1)
    return {
        name: _value(field.annotation, field.metadata, folder, rising)
        for name, field in model.model_fields.items()
        if field.is_required()
    }


def _value(kind: Any, metadata: list[Any], folder: Path, rising: Iterator[int]) -> Any:
    origin, inner = typing.get_origin(kind), typing.get_args(kind)
    if origin is typing.Annotated:
        return _value(inner[0], list(inner[1:]), folder, rising)
    if origin in (typing.Union, types.UnionType):
        return _value(inner[0], metadata, folder, rising)
    if origin is tuple:
        count = 1 if inner[-1] is Ellipsis else len(inner)
        return [_value(inner[0], [], folder, rising) for _ in range(count)]
    if kind is float:
        return _within(0.05 * next(rising), metadata)
    if kind is int:
        return int(_within(1, metadata))
    if kind is str:
        file = folder / "table.csv"
        file.write_text("t,x,y,z\n0,0,0,0\n0.5,0.1,0.2,0.3\n1,0.2,0.1,0.4\n")
        return str(file)
    if inspect.isclass(kind) and issubclass(kind, BaseModel):
        return example(kind, folder)
    if kind is Callable or origin is Callable or "Callable" in repr(kind):
        return lambda time: (0.1 * time, 0.0, 0.2 * time * time, 0.0)
    raise NotImplementedError(f"teach tests/project/test_conformance.py an example of {kind!r}")


def _within(value: float, metadata: list[Any]) -> float:
    for bound in metadata:
        value = max(value, getattr(bound, "ge", value), getattr(bound, "gt", -np.inf) + 1e-3)
        value = min(value, getattr(bound, "le", value), getattr(bound, "lt", np.inf) - 1e-3)
    return value


def table(group: str, name: str, folder: Path) -> Any:
    """What stands in a scenario for a part."""
    if group == "plants":
        return name
    tables = {"kind": name, **example(REGISTRIES[group][name].Settings, folder)}
    return [tables] if group == "faults" else tables


def scenario(folder: Path, **parts: str) -> Scenario:
    """A flight of 0.3 s, away from rest, with the given parts by group, the defaults elsewhere."""
    base: dict[str, Any] = {
        "name": "conformance",
        "vehicle": "paper",
        "duration": 0.002 * STEPS,
        "period": 0.002,
        "step": 0.002,
        "seed": 5,
        "start": {"position": [0.1, -0.1, 0.2], "attitude": [0.1, -0.2, 0.3], "velocity": [0.1, 0.2, 0.0]},
        "reference": {"kind": "set_point", "position": [0.2, 0.1, 0.3]},
    }
    base |= {"ground": -5.0} if parts.get("responses") == "land" else {}
    tables = base | {KEYS[group]: table(group, name, folder) for group, name in parts.items()}
    return scenario_from(tables, "test")


def covering() -> list[dict[str, str]]:
    """As few flights as have every part in one of them at least."""
    count = max(len(list(registry)) for registry in REGISTRIES.values())
    return [
        {group: list(registry)[k % len(list(registry))] for group, registry in REGISTRIES.items()}
        for k in range(count)
    ]


each_flight = pytest.mark.parametrize("parts", covering(), ids=["-".join(parts.values()) for parts in covering()])


def run(flown: Scenario, engine: str) -> Array:
    return load_engine(engine)(assemble(flown), no_watch).signals[:, :, 0]


# --------------------------------------------------------------------------------------------------------- the tests


def test_every_registry_has_its_place_in_a_scenario() -> None:
    assert set(KEYS) == set(REGISTRIES)
    assert set(KEYS.values()) <= set(Scenario.model_fields)
    assert all(list(registry) for registry in REGISTRIES.values())
    flown = {(group, name) for parts in covering() for group, name in parts.items()}
    assert flown == set(PARTS)


@each_part
def test_it_says_in_one_line_what_it_is(group: str, name: str) -> None:
    line = REGISTRIES[group].summary(name)
    assert 10 < len(line) <= 110, line
    assert line.endswith((".", ".)")), line


@each_part_with_settings
def test_its_settings_are_checked_and_explained(group: str, name: str) -> None:
    model = REGISTRIES[group][name].Settings
    assert issubclass(model, BaseModel)
    with pytest.raises(ValidationError, match="unknown key"):
        model.model_validate({"no such thing": 1.0})
    for field, about in _fields(model):
        assert about.description, f"{field} has no description"


def _fields(model: type[BaseModel]) -> Iterator[tuple[str, Any]]:
    for name, field in model.model_fields.items():
        yield name, field
        for kind in (field.annotation, *typing.get_args(field.annotation)):
            if inspect.isclass(kind) and issubclass(kind, BaseModel):
                yield from ((f"{name}.{inner}", about) for inner, about in _fields(kind))


@each_part
def test_it_flies(group: str, name: str, tmp_path: Path) -> None:
    """0.3 s on floats, all numbers finite."""
    flown = scenario(tmp_path, **{group: name})
    found = run(flown, "python")
    assert found.shape == (STEPS, len(SIGNAL_NAMES))
    assert np.isfinite(found).all(), SIGNAL_NAMES[int(np.argmin(np.isfinite(found).all(axis=0)))]


@each_flight
@pytest.mark.parametrize("engine", ["simd", "numpy"])
def test_every_engine_gives_the_same_numbers(engine: str, parts: dict[str, str], tmp_path: Path) -> None:
    if engine == "simd" and not have_simd():
        pytest.skip("needs llvmlite")
    flown = scenario(tmp_path, **parts)
    found, wanted = run(flown, engine), run(flown, "python")
    size = np.maximum(1.0, np.abs(wanted).max(axis=0))
    worst = (np.abs(found - wanted) / size).max(axis=0)
    assert worst.max() <= 1e-9, SIGNAL_NAMES[int(np.argmax(worst))]


def float_step(batch: Batch, leaves: list[float], drive: Drive) -> Array:
    after = batch.loop.step(unflatten(batch.state, leaves), drive, batch.parameters)
    return np.array([float(x) for x in flatten(after)])


@each_flight
def test_traced_in_casadi_it_gives_the_same_numbers(parts: dict[str, str], tmp_path: Path) -> None:
    """And no number of the settings is baked in: other settings' parameters, in the same trace, give their flight."""
    casadi = pytest.importorskip("casadi")
    flown = scenario(tmp_path, **parts)
    batch = assemble(flown)
    record = (batch.state, Drive(_reference(batch, 0), no_noise()), batch.parameters)
    symbols = casadi.SX.sym("x", len(flatten(record)))
    state, drive, parameters = unflatten(record, casadi.vertsplit(symbols))
    trace = casadi.Function("step", [symbols], [casadi.vertcat(*flatten(batch.loop.step(state, drive, parameters)))])

    for other in (batch, assemble(_all_nudged(flown))):
        assert structure(other.loop) == structure(batch.loop)
        leaves = [float(x) for x in flatten(other.state)]
        noise, gusts = (Noise(other.seeds, *stream).draw(STEPS)[:, :, 0] for stream in ((), (GUSTS,)))
        for k in range(STEPS):
            normals = unflatten(no_noise(), noise[k].tolist())
            here = Drive(
                _reference(other, k),
                normals if other.loop.sensors.needs_noise else no_noise(),
                Vec3.of(gusts[k].tolist()) if other.loop.plant.wind.needs_noise else zeros(),
            )
            wanted = float_step(other, leaves, here)
            if k % 29 == 0 or 49 <= k <= 51:
                numbers = [*leaves, *flatten((here, other.parameters))]
                found = np.array(trace(casadi.DM([float(x) for x in numbers]))).ravel()
                size = np.maximum(1.0, np.abs(wanted))
                assert (np.abs(found - wanted) / size).max() <= 1e-10, f"step {k}"
            leaves = wanted[: len(leaves)].tolist()


def _reference(batch: Batch, row: int) -> Any:
    return unflatten(drive_template(batch).reference, batch.reference[row].tolist())


# ------------------------------------------------------------------------------- numbers are numbers, not structure


def _float_paths(tables: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    items = tables.items() if isinstance(tables, dict) else enumerate(tables) if isinstance(tables, list) else ()
    for key, value in items:
        if isinstance(value, float):
            yield (*path, key)
        yield from _float_paths(value, (*path, key))


def _copy(tables: Any) -> Any:
    if isinstance(tables, dict):
        return {key: _copy(value) for key, value in tables.items()}
    return [_copy(item) for item in tables] if isinstance(tables, (list, tuple)) else tables


def _nudge(flown: Scenario, key: str, paths: list[tuple[Any, ...]]) -> Scenario:
    """The scenario with floats of one of its parts changed a little, up or, where that is not allowed, down."""
    part = getattr(flown, key)
    settings = part[0].settings if key == "fault" else part.settings
    plain = _copy(settings.model_dump())
    for factor in (1.01, 0.99):
        changed = _copy(plain)
        for path in paths:
            here = changed
            for step in path[:-1]:
                here = here[step]
            here[path[-1]] = here[path[-1]] * factor or 0.01
        try:
            valid = type(settings).model_validate(changed)
        except ValidationError:
            continue
        kind = part[0] if key == "fault" else part
        made = type(kind)(kind.registry, kind.kind, valid)
        return flown.model_copy(update={key: (made,) if key == "fault" else made})
    raise AssertionError(f"{key} {paths} can be changed neither up nor down")


def _paths(flown: Scenario, key: str) -> list[tuple[Any, ...]]:
    part = getattr(flown, key)
    settings = part[0].settings if key == "fault" else part.settings
    return list(_float_paths(_copy(settings.model_dump())))


def _baked(flown: Scenario) -> set[tuple[str, tuple[Any, ...]]]:
    """The floats that are structure, and rightly so.

    Allocators have no parameters; and the age of an oracle's truth acts in the closed loop, outside the part.
    """
    delay = {("diagnosis", (name,)) for name in ("delay",) if assemble(flown).loop.autopilot.diagnoser.oracle_delay}
    return delay | {("allocation", path) for path in _paths(flown, "allocation")}


def _all_nudged(flown: Scenario) -> Scenario:
    baked = _baked(flown)
    for key in KEYS.values():
        if key not in ("plant", "reference"):
            for path in _paths(flown, key):
                if (key, path) not in baked:
                    flown = _nudge(flown, key, [path])
    return flown


@each_part_with_settings
def test_every_float_of_its_settings_is_a_parameter(group: str, name: str, tmp_path: Path) -> None:
    """Hence the flights of a batch may differ in it, and one compiled loop serves them all."""
    key = KEYS[group]
    flown = scenario(tmp_path, **{group: name})
    before, baked = assemble(flown), _baked(flown)
    for path in _paths(flown, key):
        after = assemble(_nudge(flown, key, [path]))
        if (key, path) in baked:
            assert structure(after.loop) != structure(before.loop), f"{path}: another flight's code would serve"
            continue
        assert structure(after.loop) == structure(before.loop), path
        if group != "references":  # their numbers are in the table
            numbers = zip(flatten(after.parameters), flatten(before.parameters), strict=True)
            assert any(a != b for a, b in numbers), f"{path} has no effect"


MISMATCHES: list[dict[str, Any]] = [
    {"mass": 1.01},
    {"inertia": [1.01, 1.0, 1.0]},
    {"inertia": [1.0, 1.01, 1.0]},
    {"inertia": [1.0, 1.0, 1.01]},
    {"rotor_bandwidth": 1.01},
    {"rotor_gain": 1.01},
    {"linear_drag": 1.01},
]


@pytest.mark.parametrize("name", PLANTS)
def test_the_numbers_of_a_plant_are_those_of_the_true_vehicle(name: str, tmp_path: Path) -> None:
    """Hence one compiled loop serves all vehicles; each number acts, and only on the truth."""
    tables = scenario(tmp_path, plants=name).as_tables()
    with pytest.raises(InputError, match="plant"):
        scenario_from(tables | {"plant": {"kind": name, "mass": 1.0}}, "test")
    assert {key for mismatch in MISMATCHES for key in mismatch} == set(Mismatch.model_fields)
    flown = scenario_from(tables, "test")
    before, path = assemble(flown), run(flown, "python")
    for mismatch in MISMATCHES:
        other = scenario_from(tables | {"mismatch": mismatch}, "test")
        after = assemble(other)
        assert structure(after.loop) == structure(before.loop), mismatch
        assert flatten(after.parameters.autopilot) == flatten(before.parameters.autopilot), mismatch
        assert np.abs(run(other, "python") - path).max() > 1e-6, mismatch
