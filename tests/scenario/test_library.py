"""Scenarios by name and from files: what overrides them, what paths in them are relative to, whose code may run."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from foreign_parts import write_parts

import rotorfault as rf
from rotorfault.autopilot.control import CONTROLLER
from rotorfault.base.errors import InputError
from rotorfault.plant import FAULT, WIND
from rotorfault.reference import REFERENCE
from rotorfault.scenario.library import load_scenario, new_scenario, scenario_names
from rotorfault.scenario.overrides import override, override_all, parse_overrides

HEAD = 'name = "own"\nduration = 0.01\nvehicle = "paper"\n'
POINT = '[reference]\nkind = "set_point"\nposition = [0, 0, 1]\n'


def write(folder: Path, text: str) -> Path:
    path = folder / "own.toml"
    path.write_text(text)
    return path


# ------------------------------------------------------------------------------------------------------- names, files


@pytest.mark.parametrize("name", scenario_names())
def test_built_in_scenarios_are_right_and_say_what_they_are(name: str) -> None:
    made = load_scenario(name)
    assert made.name == name
    assert made.description


def test_names_and_files_that_are_not_there_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"^unknown scenario 'hover-falt'; did you mean 'hover-fault'\?"):
        load_scenario("hover-falt")
    with pytest.raises(InputError, match=r"none\.toml: no such file"):
        load_scenario(tmp_path / "none.toml")


def test_a_new_scenario_is_right_as_it_stands(tmp_path: Path) -> None:
    path = write(tmp_path, new_scenario("my first"))
    assert load_scenario(path).name == "my first"
    for name in ("", 'a"b', "a\\b", "a\nb"):
        with pytest.raises(InputError, match="scenario name"):
            new_scenario(name)


def test_paths_in_a_file_are_relative_to_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The vehicle's, a table's, those of code; wherever the process stands."""
    folder = tmp_path / "mine"
    folder.mkdir()
    (folder / "way.csv").write_text("t,x,y,z\n0,0,0,1\n1,0,0,1\n")
    write_parts(folder)
    vehicle = Path(rf.__file__).parent / "model" / "vehicles" / "paper.toml"
    (folder / "quad.toml").write_text(vehicle.read_text().replace('name = "paper"', 'name = "quad"', 1))
    text = 'name = "own"\nduration = 0.01\nvehicle = "quad.toml"\nwind = "mine.py:Breeze"\n'
    along_table = text + '[controller]\nkind = "mine.py:Hover"\n[reference]\nkind = "csv"\nfile = "way.csv"\n'
    along_function = text + 'controller = "smc"\n[reference]\nkind = "function"\nfunction = "mine.py:line"\n'
    monkeypatch.chdir(tmp_path)
    for where in (write(folder, along_table), Path("mine/own.toml")):
        made = load_scenario(where, allow_code=True)
        assert made.vehicle.name == "quad"
        assert made[WIND].make().settings.speed == 2.0
        assert made[CONTROLLER].source
        assert made[REFERENCE].make().table(np.array([0.5])).p_W.tolist() == [[0.0, 0.0, 1.0]]
    table = load_scenario(write(folder, along_function), allow_code=True)[REFERENCE].make().table(np.array([1.0]))
    assert table.v_W[0, 0] == pytest.approx(0.1)


# ---------------------------------------------------------------------------------------------------- whose code runs


def test_code_that_a_file_names_runs_only_where_it_is_allowed(tmp_path: Path) -> None:
    write_parts(tmp_path)
    path = write(tmp_path, HEAD + 'controller = "smc"\nwind = "mine.py:Breeze"\n' + POINT)
    with pytest.raises(InputError, match=r"own\.toml: wind: the wind is code of its own, .*mine\.py:Breeze"):
        load_scenario(path)
    assert load_scenario(path, allow_code=True)[WIND].settings.speed == 2.0


@pytest.mark.parametrize("form", ["kind", "name", "table", "function", "list"])
def test_code_that_the_user_names_may_run(tmp_path: Path, form: str) -> None:
    """However he names it; what the file names may not for all that."""
    place = write_parts(tmp_path)
    breeze = f"{place}:Breeze"
    overrides: dict[str, dict[str, Any]] = {
        "kind": {"wind.kind": breeze},
        "name": {"wind": breeze},
        "table": {"wind": {"kind": breeze, "speed": 2.0}},
        "function": {"reference": {"kind": "function", "function": f"{place}:line"}},
        "list": {"fault": [{"kind": f"{place}:Breeze", "rotor": 1}]},
    }
    path = write(tmp_path, HEAD + 'controller = "smc"\n' + POINT)
    if form == "list":
        with pytest.raises(InputError, match=r"fault 1: fault '.*:Breeze' is a wind"):  # it has been loaded
            load_scenario(path, overrides[form])
        return
    assert load_scenario(path, overrides[form]).as_tables()
    assert rf.fly(path, settings=overrides[form], engine="python").summary()
    stranger = write(tmp_path, HEAD + 'controller = "mine.py:Hover"\n' + POINT)
    with pytest.raises(InputError, match="the controller is code of its own"):
        load_scenario(stranger, overrides[form])


# ---------------------------------------------------------------------------------------------------------- overrides


def test_overrides_are_dotted_keys() -> None:
    made = load_scenario("hover-fault", {"duration": 3.0, "fault.0.loss": 0.12, "wind": "paper", "seed": 7})
    assert (made.duration, made.seed, made[WIND].kind) == (3.0, 7, "paper")
    assert made.all(FAULT)[0].settings.loss == 0.12


def test_a_number_of_the_vehicle_lays_out_its_file() -> None:
    made = load_scenario("hover-fault", {"vehicle": "paper", "vehicle.mass.value": 2.0})
    assert made.vehicle.vehicle.mass == 2.0
    assert made.vehicle.vehicle.gravity == 9.81


def test_another_kind_drops_the_settings_of_the_former_in_any_order() -> None:
    for changes in (
        {"wind.velocity_W": [1.0, 0.0, 0.0], "wind.kind": "constant"},
        {"wind.kind": "constant", "wind.velocity_W": [1.0, 0.0, 0.0]},
    ):
        tables: dict[str, Any] = {"wind": {"kind": "paper", "scale": 2.0}}
        override_all(tables, changes)
        assert tables == {"wind": {"kind": "constant", "velocity_W": [1.0, 0.0, 0.0]}}


@pytest.mark.parametrize(
    ("tables", "key", "value", "after"),
    [
        ({}, "wind.scale", 2.0, {"wind": {"scale": 2.0}}),
        ({"wind": "paper"}, "wind.scale", 2.0, {"wind": {"kind": "paper", "scale": 2.0}}),
        ({"wind": {"kind": "paper", "scale": 2.0}}, "wind.kind", "paper", {"wind": {"kind": "paper", "scale": 2.0}}),
        ({"wind": {"kind": "paper", "scale": 2.0}}, "wind", "none", {"wind": "none"}),
        ({"fault": [{"loss": 0.1}, {"loss": 0.2}]}, "fault.1.loss", 0.3, {"fault": [{"loss": 0.1}, {"loss": 0.3}]}),
        ({"start": {"position": [0, 1, 2]}}, "start.position.2", 5, {"start": {"position": [0, 1, 5]}}),
        (
            {"reference": {"kind": "csv", "file": "a.csv", "text": "t,x"}}, "reference.file", "b.csv",
            {"reference": {"kind": "csv", "file": "b.csv"}},
        ),
    ],
)  # fmt: skip
def test_override(tables: dict[str, Any], key: str, value: Any, after: dict[str, Any]) -> None:
    override(tables, key, value)
    assert tables == after


@pytest.mark.parametrize(
    ("key", "message"),
    [
        ("fault.2.loss", "fault.2.loss: '2' is no index into a list of 2; allowed: 0 to 1"),
        ("fault.x.loss", "fault.x.loss: 'x' is no index into a list of 2"),
        ("fault.5", "fault.5: '5' is no index"),
        ("duration.value", "duration.value: 'duration' is a single value; it has no key 'value'"),
        ("duration.value.unit", "duration.value.unit: 'duration' is a single value; it has no key 'value'"),
    ],
)
def test_a_key_that_leads_nowhere_is_refused(key: str, message: str) -> None:
    with pytest.raises(InputError) as caught:
        override({"duration": 2.0, "fault": [{"loss": 0.1}, {"loss": 0.2}]}, key, 1.0)
    assert str(caught.value).startswith(message)


def test_overrides_from_the_command_line_are_toml_or_text() -> None:
    assert parse_overrides(["a.b=0.3", "c=[1, 2]", "d=true", 'e="x"', "f=roismc", "g = mine.py:Mine", "h=a=b"]) == {
        "a.b": 0.3, "c": [1, 2], "d": True, "e": "x", "f": "roismc", "g": "mine.py:Mine", "h": "a=b",
    }  # fmt: skip
    for pair in ("a", "=1", "a..b=1", ".a=1", " =1"):
        with pytest.raises(InputError, match="allowed: key=value with a dotted key"):
            parse_overrides([pair])
