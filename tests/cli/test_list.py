"""`rotorfault list NAME`: all that can be set of a part, a vehicle, a scenario, a study; what a study may vary."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from command_line import assert_refused, run
from places import EXAMPLES

from rotorfault.campaigns.axes import AXES
from rotorfault.cli import catalogue, details
from rotorfault.model.vehicle_file import load_vehicle
from rotorfault.scenario.library import load_scenario
from rotorfault.scenario.part import Part
from rotorfault.scenario.setting_rows import settings
from rotorfault.scenario.slots import SLOTS

PARTS = [(slot.name, name) for slot in SLOTS for name in slot.registry]


def listed(*words: str) -> str:
    done = run("list", *words)
    assert done.returncode == 0, done.stderr
    return done.stdout


def rows(text: str) -> dict[str, str]:
    """Lines of tables by their first word."""
    return {line.split()[0]: line for line in text.splitlines() if line.startswith("  ") and line.strip()}


@pytest.mark.parametrize(("slot", "name"), PARTS)
def test_a_part_is_shown_with_each_of_its_settings(slot: str, name: str) -> None:
    text = catalogue.text((slot, name))
    kind = SLOTS[slot].registry[name]
    assert SLOTS[slot].registry.summary(name) in text
    shown = rows(text)
    prefix = f"{slot}.0." if SLOTS[slot].many else f"{slot}."
    for setting in settings(kind.Settings, prefix):
        line = shown[setting.key]
        assert setting.default.replace("`", "") in line
        assert setting.unit in line
    for preset in SLOTS[slot].presets(name) if SLOTS[slot].presets is not None else ():  # type: ignore[misc]
        assert re.search(rf"^presets.*\b{preset}\b", text, re.MULTILINE)


def test_units_and_ranges_stand_beside_the_defaults() -> None:
    shown = rows(listed("luenberger"))
    assert shown["diagnosis.poles"].split()[1:4] == ["[120.0,", "180.0]", "rad/s"]
    step = rows(listed("step"))
    assert "0 to 1" in step["fault.0.loss"]
    assert step["fault.0.time"].split()[1:3] == ["required", "s"]


def test_a_name_that_several_things_bear_shows_all_and_a_group_picks_one() -> None:
    both = listed("paper")
    assert both.startswith("vehicle paper: ")
    assert "\nwind paper: " in both
    assert "wind paper: " not in listed("vehicles", "paper")
    for group in ("wind", "winds"):
        assert listed(group, "paper").startswith("wind paper: ")


def test_everything_that_is_listed_has_its_own_page() -> None:
    for group, names in catalogue.entries().items():
        assert catalogue.text((group,)).startswith(group)
        for name in names:
            assert name in details.text(name, group).splitlines()[0]


def test_a_vehicle_is_shown_with_every_number_its_unit_and_source() -> None:
    text = listed("hummingbird")
    shown = rows(text)
    for key, quantity in load_vehicle("hummingbird").quantities():
        if not key.startswith("rotor."):
            assert shown[key].split()[1] == f"{quantity.value:g}"
            assert quantity.unit in shown[key]
    assert "RotorPy" in shown["mass"]
    assert "back, turns clockwise" in text


def test_a_scenario_is_shown_with_what_it_sets() -> None:
    shown = rows(listed("hover-fault"))
    scenario = load_scenario("hover-fault")
    assert shown["duration"].split()[1:3] == [str(scenario.duration), "s"]
    assert shown["fault.0.loss"].split()[1] == "0.4"
    controller = next(part for slot, part in scenario.parts() if slot.name == "controller")
    assert isinstance(controller, Part)
    assert str(controller.settings.cascade.tilt_max) in shown["controller.cascade.tilt_max"]


def test_every_key_that_a_scenario_shows_can_be_set() -> None:
    from rotorfault.scenario.overrides import override_all

    scenario = load_scenario("hover-fault")
    for key in rows(listed("hover-fault")):
        if key not in ("key", "vehicle") and not key.startswith("-"):
            override_all(scenario.as_tables(), {key: 1})


def test_a_study_is_shown_with_what_it_varies_and_compares() -> None:
    shown = rows(listed("mass-inertia"))
    assert "0.6 to 1.6, 21 values" in shown["mass"]
    assert "uniform, 0 to 5" in shown["wind_speed"]
    assert "controller.kind = 'smc'" in shown["smc"]
    assert shown["refine.budget"].split()[1] == "20000"


def test_quantities_are_the_axes_of_studies() -> None:
    shown = rows(listed("quantities"))
    assert set(shown) >= set(AXES)
    for name, axis in AXES.items():
        assert axis.unit in shown[name].split() or not axis.unit
    assert "0 to 1" in shown["loss"]


def test_a_part_of_ones_own_is_shown_too() -> None:
    text = listed(f"{EXAMPLES / 'controller.py'}:PdController")
    assert rows(text)["controller.stiffness"].split()[1:3] == ["4.0", "1/s^2"]


def test_a_file_is_shown_by_what_it_holds(tmp_path: Path) -> None:
    for what in ("vehicle", "scenario", "study"):
        assert run("new", what, what, "--out", str(tmp_path)).returncode == 0
        assert listed(str(tmp_path / f"{what}.toml")).startswith(f"{what} {what}: ")


@pytest.mark.parametrize("columns", ["60", "200"])
def test_lines_stay_within_the_terminal(columns: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", columns)
    lines = [line for line in listed("vehicles", "hummingbird").splitlines()[3:] if line.startswith("  ")]
    assert max(map(len, lines)) <= max(int(columns), 70)
    assert (max(map(len, lines)) > 118) == (columns == "200")


@pytest.mark.parametrize(
    ("words", "named"),
    [
        (("roismk",), ("unknown name 'roismk'", "did you mean 'roismc'?", "rotorfault list")),
        (("controlers",), ("did you mean 'controllers'?",)),
        (("controller", "smk"), ("unknown name in controllers 'smk'", "did you mean 'smc'?", "allowed: roismc")),
        (("smc", "roismc"), ("unknown group 'smc'", "controllers")),
        (("a", "b", "c"), ("takes a group, a name, or both",)),
        (("none.toml",), ("no such file",)),
        (("none.py:Mine",), ("no such file",)),
    ],
)
def test_a_name_that_does_not_exist_is_one_clear_line(words: tuple[str, ...], named: tuple[str, ...]) -> None:
    assert_refused(run("list", *words), *named)
