"""Whatever is registered keeps the house rules, without being asked: no part is named here, and no slot.

A new part goes through all of this once it is registered. Required settings are filled by `part_examples.example`; a
sort of field that it does not know has to be taught to it.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from part_examples import PARTS, each_part, part_of
from pydantic import BaseModel, ValidationError

from rotorfault.base.errors import InputError
from rotorfault.engine import default_engine, have_simd, load_engine
from rotorfault.engine.batch import Batch, drive_rows, drive_template, no_watch
from rotorfault.engine.structure import structure
from rotorfault.flight.assembly import assemble
from rotorfault.flight.check_block import check_block
from rotorfault.flight.rules import float_settings, nudged
from rotorfault.maths.records import flatten, unflatten
from rotorfault.plant import GROUND, PLANT
from rotorfault.scenario.mismatch import Mismatch
from rotorfault.scenario.part import part_from
from rotorfault.scenario.scenario import Scenario, scenario_from
from rotorfault.scenario.sensed import asked_for
from rotorfault.scenario.slots import SLOTS

Array = NDArray[np.float64]
Parts = dict[str, str]  # name of a part by that of its slot
STEPS = 50  # of 2 ms: more than half of them after the faults of the parts
EVERYWHERE = max(len(slot.registry) for slot in SLOTS)


def covering() -> list[Parts]:
    """As few flights as have every part in one of them at least."""
    flights = [
        {slot.name: list(slot.registry)[k % len(slot.registry)] for slot in SLOTS}
        for k in range(EVERYWHERE)
    ]  # fmt: skip
    for parts in flights:
        wanted = asked_for(SLOTS["estimator"], parts["sensors"])
        if parts["estimator"] == "direct":  # which cannot do without any reading of ideal sensors
            parts["estimator"] = wanted
    return flights


each_flight = pytest.mark.parametrize("parts", covering(), ids=["-".join(parts.values()) for parts in covering()])


def scenario(folder: Path, parts: Parts) -> Scenario:
    """A flight of 0.1 s, away from rest and from the ground, with these parts, and the defaults in other slots."""
    tables: dict[str, Any] = {
        "name": "conformance",
        "vehicle": "paper",
        "duration": 0.002 * STEPS,
        "period": 0.002,
        "step": 0.002,
        "seed": 5,
        "start": {"position": [0.1, -0.1, 5.2], "attitude": [0.1, -0.2, 0.3], "velocity": [0.1, 0.2, 0.0]},
        "reference": {"kind": "set_point", "position": [0.2, 0.1, 5.3]},
    }
    for slot in SLOTS:
        if slot.name in parts:
            part = part_of(slot, parts[slot.name], folder)
            if slot is GROUND:  # below any reference
                part = part.with_settings(part.settings.model_copy(update={"height": -5.0}))
            tables[slot.name] = [part] if slot.many else part
    return scenario_from(tables, "test")


def run(flown: Scenario, engine: str) -> Array:
    return load_engine(engine)(assemble(flown), no_watch).signals[:, :, 0]


_ON_FLOATS: dict[tuple[str, ...], Array] = {}


def on_floats(names: tuple[str, ...], flown: Scenario) -> Array:
    """The flight of these parts on floats, flown once for all that compare with it."""
    if names not in _ON_FLOATS:
        _ON_FLOATS[names] = run(flown, "python")
    return _ON_FLOATS[names]


# -------------------------------------------------------------------------------------------------------- each part


def test_every_slot_has_parts_and_those_that_it_names() -> None:
    assert {(slot, name) for parts in covering() for slot, name in parts.items()} == set(PARTS)
    for slot in SLOTS:
        assert len(slot.registry), slot.name
        named = {slot.default, slot.calm} - {None, ""}
        assert named <= set(slot.registry) | ({"none"} if slot.optional else set()), slot.name


@each_part
def test_it_keeps_the_rules_of_a_part(slot: str, name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("rotorfault.flight.rules.STEPS", STEPS)
    assert check_block(part_of(slot, name, tmp_path)).kept


@each_part
def test_its_settings_are_checked(slot: str, name: str, tmp_path: Path) -> None:
    model = SLOTS[slot].registry[name].Settings
    assert issubclass(model, BaseModel)
    part = part_of(slot, name, tmp_path)
    with pytest.raises(ValidationError, match="unknown key"):
        model.model_validate({**part.settings.model_dump(), "no such thing": 1.0})


@each_part
def test_its_numbers_are_no_structure(slot: str, name: str, tmp_path: Path) -> None:
    """Hence the flights of a batch may differ in them, and one compiled loop serves them all."""
    part = part_of(slot, name, tmp_path)
    before = structure(assemble(with_part(scenario(tmp_path, {}), part)).loop)
    for path in float_settings(part):
        after = assemble(with_part(scenario(tmp_path, {}), nudged(part, [path])))
        assert structure(after.loop) == before, path


def with_part(flown: Scenario, part: Any) -> Scenario:
    """The scenario with a part in its slot; what that needs of others is not asked."""
    parts: dict[str, Any] = {part.slot.name: (part,) if part.slot.many else part}
    if part.slot.name == "sensors":
        parts["estimator"] = part_from(SLOTS["estimator"], asked_for(SLOTS["estimator"], part))
    return flown.model_copy(update=parts)


# ------------------------------------------------------------------------------------------------- parts together


@each_flight
@pytest.mark.parametrize("engine", ["simd", "numpy"])
def test_every_engine_gives_the_same_numbers(engine: str, parts: Parts, tmp_path: Path) -> None:
    if engine == "simd" and not have_simd():
        pytest.skip("needs llvmlite")
    flown = scenario(tmp_path, parts)
    found, wanted = run(flown, engine), on_floats(tuple(parts.values()), flown)
    assert found.shape == wanted.shape
    size = np.maximum(1.0, np.abs(wanted).max(axis=0))
    worst = (np.abs(found - wanted) / size).max(axis=0)
    assert worst.max() <= 1e-9, assemble(flown).loop.layout.rows[int(np.argmax(worst))]


def all_nudged(flown: Scenario) -> Scenario:
    """The scenario with every float of its parts changed; the reference enters by its table."""
    for slot, part in list(flown.parts()):
        for path in float_settings(part) if slot.side != "task" else ():
            part = nudged(part, [path])
        flown = with_part(flown, part)
    return flown


def drives(batch: Batch) -> list[list[float]]:
    """The numbers that enter at each step."""
    return [row[:, 0].tolist() for _, rows in drive_rows(batch) for row in rows]


@each_flight
@pytest.mark.long
def test_traced_in_casadi_it_gives_the_same_numbers(parts: Parts, tmp_path: Path) -> None:
    """And no number of the settings is baked in: other settings' parameters, in the same trace, give their flight."""
    casadi = pytest.importorskip("casadi")
    flown = scenario(tmp_path, parts)
    batch = assemble(flown)
    template = drive_template(batch)
    record = (batch.state, template, batch.parameters)
    symbols = casadi.SX.sym("x", len(flatten(record)))
    state, drive, parameters = unflatten(record, casadi.vertsplit(symbols))
    trace = casadi.Function("step", [symbols], [casadi.vertcat(*flatten(batch.loop.step(state, drive, parameters)))])

    changed = assemble(all_nudged(flown))
    assert flatten(changed.parameters) != flatten(batch.parameters)
    for other in (batch, changed):
        assert structure(other.loop) == structure(batch.loop)
        state = other.state
        for k, row in enumerate(drives(other)):
            stepped = other.loop.step(state, unflatten(template, row), other.parameters)
            if k % 29 == 0 or 49 <= k <= 51:
                numbers = [float(x) for x in (*flatten(state), *row, *flatten(other.parameters))]
                wanted = np.array([float(x) for x in flatten(stepped)])
                found = np.array(trace(casadi.DM(numbers))).ravel()
                size = np.maximum(1.0, np.abs(wanted))
                assert (np.abs(found - wanted) / size).max() <= 1e-10, f"step {k}"
            state = stepped[0]


# --------------------------------------------------------------------------------------------- the true vehicle


MISMATCHES: list[dict[str, Any]] = [
    {"mass": 1.01},
    {"inertia": [1.01, 1.0, 1.0]},
    {"inertia": [1.0, 1.01, 1.0]},
    {"inertia": [1.0, 1.0, 1.01]},
    {"rotor_bandwidth": 1.01},
    {"rotor_gain": 1.01},
    {"linear_drag": 1.01},
    {"thrust_curve": 0.21},
    {"thrust_max": 0.6},
    {"thrust_coefficient": 1.1},
    {"torque_ratio": 1.01},
    {"centre_of_mass": [0.001, 0.0, 0.0]},
]


@pytest.mark.parametrize("name", list(PLANT.registry))
def test_the_numbers_of_a_plant_are_those_of_the_true_vehicle(name: str, tmp_path: Path) -> None:
    """Hence one compiled loop serves all vehicles; each number acts, and only on the truth."""
    tables = scenario(tmp_path, {PLANT.name: name}).as_tables()
    tables["vehicle"]["thrust_curve"] = {"value": 0.2, "unit": "1", "source": "test"}
    with pytest.raises(InputError, match="plant"):
        scenario_from(tables | {PLANT.name: {"kind": name, "mass": 1.0}}, "test")
    # How wrong the belief in the sensors is, is no number of the vehicle.
    assert {key for mismatch in MISMATCHES for key in mismatch} == set(Mismatch.model_fields) - {"sensor_noise"}
    flown = scenario_from(tables, "test")
    engine = default_engine(1)
    before, path = assemble(flown), run(flown, engine)
    for mismatch in MISMATCHES:
        other = scenario_from(tables | {"mismatch": mismatch}, "test")
        after = assemble(other)
        assert structure(after.loop) == structure(before.loop), mismatch
        assert flatten(after.parameters.belief) == flatten(before.parameters.belief), mismatch
        for slot in SLOTS:
            if slot.side == "belief":
                one, two = (getattr(batch.parameters.parts, slot.name) for batch in (after, before))
                assert flatten(one) == flatten(two), (mismatch, slot.name)
        assert np.abs(run(other, engine) - path).max() > 1e-6, mismatch
