"""A part as a scenario names it: by name, by table, by a place in code, with presets, and back again."""

from __future__ import annotations

import importlib
from pathlib import Path
from typing import Any

import pytest
from foreign_parts import BASE, write_parts

from rotorfault.autopilot.control import CONTROLLER
from rotorfault.autopilot.control.python_controller import PythonController
from rotorfault.base.errors import InputError
from rotorfault.plant import FAULT, GROUND, SENSORS, WIND
from rotorfault.plant.wind import ConstantWind
from rotorfault.reference import REFERENCE
from rotorfault.scenario.part import Part, part_from
from rotorfault.scenario.scenario import scenario_from


def scenario(allow_code: Any = False, **tables: Any) -> Any:
    return scenario_from(BASE | tables, "case.toml", allow_code)


# ------------------------------------------------------------------------------------------------------ names, tables


def test_a_name_is_a_table_with_that_kind() -> None:
    part = part_from(WIND, "constant")
    assert part == part_from(WIND, {"kind": "constant"})
    assert part == part_from(WIND, {"kind": "constant", "velocity_W": [-3.33, 1.36, 0.0]})
    assert part != part_from(WIND, {"kind": "constant", "velocity_W": [0.0, 0.0, 0.0]})
    assert part_from(WIND, part) is part
    assert hash(part) == hash(part_from(WIND, "constant"))
    assert isinstance(part.make(), ConstantWind)
    assert part.make().settings is part.settings
    assert part.source == ""


def test_a_table_without_kind_is_of_the_default_kind_where_there_is_one() -> None:
    assert part_from(SENSORS, {}).kind == "ideal"
    assert part_from(GROUND, {"height": 1.0}).kind == "level"
    with pytest.raises(InputError, match=r"^fault: kind: is missing; allowed: step, ramp, interm"):
        part_from(FAULT, {"rotor": 1})


@pytest.mark.parametrize(
    ("slot", "value", "message"),
    [
        (WIND, "constnt", r"wind: kind: unknown wind 'constnt'; did you mean 'constant'\? \(allowed: none, constant"),
        (WIND, {"kind": 3}, "wind: kind: unknown wind '3'"),
        (WIND, 3, "wind: got 3; allowed: a table with 'kind', or a name: none, constant, paper, dryden"),
        (WIND, {"kind": "paper", "scale": -1.0}, r"wind: scale: must be greater than or equal to 0; got -1\.0"),
        (
            WIND,
            {"kind": "paper", "velocity_W": [0, 0, 0]},
            r"wind: velocity_W: unknown key \(allowed: scale\), as this",
        ),
        (WIND, {"kind": "none", "wind_at_6m": 3.0}, "wind: wind_at_6m: .*allowed: none.* kind 'dryden'"),
        (WIND, {"kind": "none", "preset": "tuned"}, "wind: preset: unknown key"),
        (CONTROLLER, {"kind": "roismc", "preset": "tund"}, "controller: preset: unknown preset 'tund'; did you mean"),
        (CONTROLLER, {"kind": "roismc", "preset": 3}, "controller: preset: got 3; allowed: the name of a preset"),
    ],
)
def test_what_is_no_part_is_refused_in_one_line(slot: Any, value: Any, message: str) -> None:
    with pytest.raises(InputError, match=f"^{message}") as caught:
        part_from(slot, value)
    assert "\n" not in str(caught.value)


def test_a_part_becomes_the_table_that_it_is_read_from() -> None:
    for slot, value in ((WIND, "dryden"), (CONTROLLER, {"kind": "roismc"}), (GROUND, 2.0), (SENSORS, "noisy")):
        part: Part[Any] = part_from(slot, value)
        table = part.as_table()
        assert table["kind"] == part.kind
        assert set(table) - {"kind", "preset"} == set(type(part.settings).model_fields)
        again: Part[Any] = part_from(slot, table)
        assert again == part
        assert again.preset == part.preset


def test_other_settings_make_another_part_of_the_same_kind() -> None:
    part = part_from(WIND, "paper")
    other = part.with_settings(type(part.settings)(scale=2.0))
    assert (other.kind, other.settings.scale, part.settings.scale) == ("paper", 2.0, 1.0)
    assert other.make().settings.scale == 2.0


# ------------------------------------------------------------------------------------------------------------ presets


def test_settings_start_from_a_preset_and_are_put_over_it() -> None:
    tuned, printed = part_from(CONTROLLER, "roismc"), part_from(CONTROLLER, {"kind": "roismc", "preset": "paper"})
    assert (tuned.preset, printed.preset) == ("tuned", "paper")
    assert tuned.settings != printed.settings
    mine = part_from(CONTROLLER, {"kind": "roismc", "preset": "paper", "cascade": {"tilt_max": 0.5}}).as_table()
    assert mine["cascade"] == printed.as_table()["cascade"] | {"tilt_max": 0.5}
    assert mine["law"] == printed.as_table()["law"]
    bare = part_from(CONTROLLER, {"kind": "roismc", "preset": "none"})
    assert bare.preset == "none"
    assert bare.settings == CONTROLLER.registry["roismc"].Settings()


def test_a_complete_table_keeps_the_name_of_a_preset_that_is_gone() -> None:
    """As a flight file of another version may hold it; a table with holes needs the preset itself."""
    table = part_from(CONTROLLER, "roismc").as_table() | {"preset": "of old"}
    assert part_from(CONTROLLER, table).preset == "of old"
    table.pop("cascade")
    with pytest.raises(InputError, match="unknown preset 'of old'"):
        part_from(CONTROLLER, table)


# -------------------------------------------------------------------------------------------------- code of one's own


def test_a_place_in_code_is_refused_unless_it_is_allowed(tmp_path: Path) -> None:
    """Before anything of it runs."""
    path = write_parts(tmp_path)
    path.write_text(f"open({str(tmp_path / 'ran')!r}, 'w').close()\n" + path.read_text())
    place = f"{path}:Breeze"
    for allow in (False, {"other.py:Breeze"}):
        with pytest.raises(InputError, match=r"^case\.toml: wind: the wind is code of its own, .*mine\.py:Breeze"):
            scenario(allow, wind=place)
        with pytest.raises(InputError, match=r"^case\.toml: reference: the reference function is code of its own"):
            scenario(allow, reference={"kind": "function", "function": f"{path}:line"})
    assert not (tmp_path / "ran").exists()
    for allow in (True, {place}):
        assert scenario(allow, wind=place)[WIND].make().at(0.0, (), ()).velocity_W.x == 2.0
    assert (tmp_path / "ran").exists()


def test_settings_of_a_part_of_ones_own_are_checked_like_any_others(tmp_path: Path) -> None:
    kind = f"{write_parts(tmp_path)}:Breeze"
    assert scenario(True, wind={"kind": kind, "speed": 5.0})[WIND].settings.speed == 5.0
    with pytest.raises(InputError, match=r"^case\.toml: wind\.sped: unknown key; did you mean 'speed'"):
        scenario(True, wind={"kind": kind, "sped": 5.0})


def test_it_is_the_same_from_its_own_tables(tmp_path: Path) -> None:
    made = scenario(True, wind={"kind": f"{write_parts(tmp_path)}:Breeze", "speed": 5.0})
    tables = made.as_tables()
    assert scenario_from(tables, "again", True) == made
    with pytest.raises(InputError, match="--allow-code"):
        scenario_from(tables, "again")


def test_a_plain_python_controller_is_named_by_its_place(tmp_path: Path) -> None:
    path = write_parts(tmp_path)
    part = scenario(True, controller=f"{path}:Hover")[CONTROLLER]
    assert isinstance(part.make(), PythonController)
    assert part.preset == ""
    assert len(part.source) == 64
    with pytest.raises(InputError, match="unknown key"):
        scenario(True, controller={"kind": f"{path}:Hover", "gain": 1.0})


@pytest.mark.parametrize(
    ("slot", "name", "message"),
    [
        ("controller", "Breeze", r"is a wind; allowed: a class that derives from rotorfault\.Controller"),
        ("wind", "Hover", "Hover derives from no kind of part"),
        ("wind", "Nothing", "Nothing derives from no kind of part; derive it from rotorfault"),
        ("wind", "line", "line derives from no kind of part"),
        ("wind", "Brize", r"has no 'Brize' \(it has: Breeze, Hover, Nothing, line\)"),
    ],
)
def test_a_place_that_is_no_such_part_is_refused(tmp_path: Path, slot: str, name: str, message: str) -> None:
    with pytest.raises(InputError, match=message) as caught:
        scenario(True, **{slot: f"{write_parts(tmp_path)}:{name}"})
    assert str(caught.value).startswith(f"case.toml: {slot}: ")
    assert "\n" not in str(caught.value)


def test_the_source_of_what_runs_changes_with_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a part, and of a function that a part of the package runs."""
    monkeypatch.syspath_prepend(str(tmp_path))
    path = write_parts(tmp_path)
    wind, way = {"kind": f"{path}:Breeze"}, {"kind": "function", "function": f"{path}:line"}

    def sources() -> tuple[str, str]:
        importlib.invalidate_caches()
        made = scenario(True, wind=wind, reference=way)
        return made[WIND].source, made[REFERENCE].source

    first = sources()
    assert all(len(source) == 64 for source in first)
    assert first == sources()
    path.write_text(path.read_text() + "# more\n")
    assert all(a != b for a, b in zip(first, sources(), strict=True))
    assert scenario()[WIND].source == scenario()[REFERENCE].source == ""
