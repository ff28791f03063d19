"""Presets: settings of controllers under a name; what a scenario adds to one, and where its name goes."""

from __future__ import annotations

import copy
import json
from importlib import resources
from pathlib import Path
from typing import Any

import pytest
from engine_flights import short

import rotorfault
from rotorfault.autopilot.control import CONTROLLER
from rotorfault.autopilot.control.cascade import CascadeKind
from rotorfault.autopilot.presets import presets, record
from rotorfault.base.errors import InputError
from rotorfault.model.block import Context
from rotorfault.model.vehicle import Vehicle
from rotorfault.scenario.part import DEFAULT_PRESET, part_from

LAWS = [name for name, kind in CONTROLLER.registry.items() if isinstance(kind, CascadeKind)]
EACH = [(kind, name) for kind in CONTROLLER.registry for name in presets(kind)]
each_preset = pytest.mark.parametrize(("kind", "name"), EACH, ids=[f"{kind}-{name}" for kind, name in EACH])


def leaves(table: Any, path: str = "") -> dict[str, Any]:
    """Every single value by its dotted key."""
    if isinstance(table, dict):
        return {key: x for name, inner in table.items() for key, x in leaves(inner, f"{path}.{name}").items()}
    return {path.removeprefix("."): table}


def test_every_file_is_of_a_controller_and_every_law_has_a_tuned_one() -> None:
    files = {
        file.name.removesuffix(".toml")
        for file in resources.files("rotorfault.autopilot.presets").iterdir()
        if file.name.endswith(".toml")
    }
    assert files == {kind for kind, _ in EACH}
    assert files <= set(CONTROLLER.registry)
    for kind in files & set(LAWS):
        assert DEFAULT_PRESET in presets(kind)
    assert presets("a controller without a file") == {}


@each_preset
def test_a_preset_says_nothing_but_settings_of_its_controller(kind: str, name: str, paper_vehicle: Vehicle) -> None:
    part = part_from(CONTROLLER, {"kind": kind, "preset": name})
    settings = leaves(part.settings.model_dump(mode="json"))
    for key, value in leaves(dict(presets(kind)[name])).items():
        assert settings[key] == value, key
    part.make().parameters(Context(paper_vehicle, 1e-3))


@each_preset
def test_how_it_was_made_is_no_setting(kind: str, name: str) -> None:
    assert "record" not in presets(kind)[name]
    made = record(kind, name)
    if name == DEFAULT_PRESET:
        assert made["version"]
    assert record(kind, "no such preset") == {}


def test_a_scenario_changes_single_settings_of_one() -> None:
    tuned = part_from(CONTROLLER, {"kind": "smc", "preset": "tuned"})
    changed = part_from(CONTROLLER, {"kind": "smc", "preset": "tuned", "cascade": {"tilt_max": 0.123}})
    before, after = (leaves(part.settings.model_dump(mode="json")) for part in (tuned, changed))
    assert {key for key in before if before[key] != after[key]} == {"cascade.tilt_max"}
    assert after["cascade.tilt_max"] == 0.123
    assert changed.preset == "tuned"


def test_the_default_is_tuned_and_none_is_what_the_classes_say() -> None:
    assert part_from(CONTROLLER, "smc").preset == DEFAULT_PRESET
    bare = part_from(CONTROLLER, {"kind": "smc", "preset": "none"})
    kind = CONTROLLER.registry["smc"]
    assert (bare.preset, bare.settings) == ("none", kind.Settings())
    assert part_from(CONTROLLER, "smc").settings != bare.settings


@pytest.mark.parametrize(
    ("preset", "message"),
    [
        ("tund", r"unknown preset 'tund'; did you mean 'tuned'\? \(allowed: .*tuned.*, none, FILE\.toml\)"),
        (3, r"preset: got 3; allowed: the name of a preset"),
        (["tuned"], r"preset: got \['tuned'\]; allowed: the name of a preset"),
    ],
)
def test_what_is_no_preset_is_refused(preset: Any, message: str) -> None:
    with pytest.raises(InputError, match=message):
        part_from(CONTROLLER, {"kind": "smc", "preset": preset})
    with pytest.raises(InputError, match=rf"controller.*{message.removeprefix('preset: ')}"):
        short(controller={"kind": "smc", "preset": preset})


def test_using_one_changes_none() -> None:
    before = copy.deepcopy({kind: dict(presets(kind)) for kind in CONTROLLER.registry})
    for kind, name in EACH:
        if kind not in LAWS:
            continue
        table = part_from(CONTROLLER, {"kind": kind, "preset": name, "cascade": {"tilt_max": 0.2}}).as_table()
        table["cascade"]["tilt_max"] = 0.1
    assert {kind: dict(presets(kind)) for kind in CONTROLLER.registry} == before


def test_its_name_goes_with_the_flight(tmp_path: Path) -> None:
    """Into label, summary and file; and a file flies again with the settings that it holds."""
    table = {"kind": "smc", "preset": "paper", "cascade": {"tilt_max": 0.3}}
    flight = rotorfault.fly(short(controller=table, duration=0.05), engine="python")
    assert flight.label == "smc (paper)"
    assert flight.summary()["preset"] == "paper"
    loaded = rotorfault.load(flight.save(tmp_path / "flight.nc"))
    assert loaded.label == "smc (paper)"
    (part,) = (part for part in json.loads(loaded.data.attrs["parts"]) if part["slot"] == "controller")
    assert (part["kind"], part["preset"]) == ("smc", "paper")
    again = rotorfault.repeat(tmp_path / "flight.nc")
    assert again.label == "smc (paper)"
    assert again.scenario is not None
    assert flight.scenario is not None
    assert again.scenario[CONTROLLER] == flight.scenario[CONTROLLER]


def test_a_table_that_holds_every_setting_needs_no_preset_to_be_looked_up() -> None:
    """As in the file of a flight whose preset has another name now."""
    table = part_from(CONTROLLER, {"kind": "smc", "preset": "tuned"}).as_table()
    table["preset"] = "of yesterday"
    table["cascade"]["tilt_max"] = 0.321
    part = part_from(CONTROLLER, table)
    assert (part.preset, part.settings.cascade.tilt_max) == ("of yesterday", 0.321)
    del table["law"]
    with pytest.raises(InputError, match="unknown preset 'of yesterday'"):
        part_from(CONTROLLER, table)


def test_a_controller_without_presets_has_none() -> None:
    class Own(rotorfault.Controller):
        """Nothing."""

    CONTROLLER.registry.add("own", Own)
    try:
        part = part_from(CONTROLLER, "own")
        assert part.preset == ""
        assert "preset" not in part.as_table()
        with pytest.raises(InputError, match=r"unknown preset 'tuned' \(allowed: FILE\.toml\)"):
            part_from(CONTROLLER, {"kind": "own", "preset": "tuned"})
    finally:
        CONTROLLER.registry.remove("own")
