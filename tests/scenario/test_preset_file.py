"""Presets from files: wherever a preset is named a file of one will do, and what is wrong with it is said."""

from __future__ import annotations

from pathlib import Path

import pytest

import rotorfault as rf
from rotorfault.autopilot.control import CONTROLLER
from rotorfault.campaigns.changes import changed
from rotorfault.campaigns.load import load_study
from rotorfault.campaigns.study import study_from
from rotorfault.scenario.library import load_scenario

PRESET = """
[mine.cascade]
tilt_max = 0.55
fall_share = 0.25

[mine.record]
controller = "roismc"
rotor_bandwidth = 20.0
"""
SCENARIO = """
name = "hop"
vehicle = "paper"
duration = 1.0
reference = { kind = "set_point", position = [0.0, 0.0, 1.0] }
controller = { kind = "roismc", preset = "gains/mine.toml" }
"""
SHORT = {"duration": 0.1}


@pytest.fixture
def file(tmp_path: Path) -> Path:
    (tmp_path / "gains").mkdir()
    path = tmp_path / "gains" / "mine.toml"
    path.write_text(PRESET)
    return path


def test_a_scenario_takes_a_preset_beside_it(file: Path, tmp_path: Path) -> None:
    (tmp_path / "hop.toml").write_text(SCENARIO)
    part = load_scenario(tmp_path / "hop.toml")[CONTROLLER]
    assert part.settings.cascade.tilt_max == 0.55
    assert part.settings.cascade.fall_share == 0.25
    assert part.preset_label == "mine"


def test_settings_go_before_it_and_another_preset_takes_its_place(file: Path) -> None:
    own = load_scenario("hover-fault", {"controller.preset": str(file), "controller.cascade.tilt_max": 0.6})
    assert own[CONTROLLER].settings.cascade.tilt_max == 0.6
    assert own[CONTROLLER].settings.cascade.fall_share == 0.25
    again = rf.fly(own, settings={"controller.preset": "tuned", **SHORT}).scenario
    assert again is not None
    tuned = load_scenario("hover-fault")[CONTROLLER].settings
    assert again[CONTROLLER].settings.cascade.fall_share == tuned.cascade.fall_share
    assert again[CONTROLLER].settings.cascade.tilt_max == 0.6, "what stood beside the preset stays"


def test_a_flight_holds_the_gains_and_not_the_file(file: Path, tmp_path: Path) -> None:
    flight = rf.fly("hover-fault", "roismc", settings={"controller.preset": str(file), **SHORT})
    assert flight.label == "roismc (mine)"
    flight.save(tmp_path / "flight.nc")
    file.unlink()
    again = rf.repeat(tmp_path / "flight.nc")
    assert again.scores == pytest.approx(flight.scores, nan_ok=True)
    assert again.label == flight.label


def test_one_of_several_is_named(file: Path) -> None:
    file.write_text(PRESET + "\n[other.cascade]\ntilt_max = 0.3\n")
    part = load_scenario("hover-fault", {"controller.preset": f"{file}:other"})[CONTROLLER]
    assert (part.settings.cascade.tilt_max, part.preset_label) == (0.3, "other")
    with pytest.raises(rf.InputError, match=r"holds the presets mine, other; name one, such as .*mine\.toml:mine"):
        load_scenario("hover-fault", {"controller.preset": str(file)})
    with pytest.raises(rf.InputError, match=r"unknown preset 'othr'; did you mean 'other'"):
        load_scenario("hover-fault", {"controller.preset": f"{file}:othr"})


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("x = 1\n", "is no file of presets"),
        ("", "is no file of presets"),
        ("[mine]\nnonsense = 1\n", "controller.nonsense: unknown key"),
        ("[mine]\nrecord = 3\n", "mine.record is 3; allowed: a table"),
        ("[mine\n", "mine.toml"),
        ('[mine.record]\ncontroller = "smc"\n', "is one of controller 'smc', not of 'roismc'"),
    ],
)
def test_what_is_wrong_is_said(text: str, message: str, file: Path) -> None:
    file.write_text(text)
    with pytest.raises(rf.InputError, match=message) as caught:
        load_scenario("hover-fault", {"controller.preset": str(file)})
    assert "\n" not in str(caught.value)


def test_a_file_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(rf.InputError, match=r"none\.toml"):
        load_scenario("hover-fault", {"controller.preset": str(tmp_path / "none.toml")})
    with pytest.raises(rf.InputError, match=r"none\.toml"):
        rf.trim_report("paper", "roismc", str(tmp_path / "none.toml"))


def test_trim_takes_it(file: Path) -> None:
    assert "roismc" in rf.trim_report("paper", "roismc", str(file)).text()


def test_a_study_keeps_the_gains_themselves(file: Path) -> None:
    """The folder of a campaign depends on no file beside it."""
    tables = {
        "name": "own", "scenario": "hover-fault", "settings": {"duration": 0.1, "controller.cascade.tilt_max": 0.61},
        "axis": [{"name": "loss", "values": [0.1, 0.2]}],
        "variant": [{"label": "mine", "settings": {"controller.preset": str(file)}}, {"label": "tuned"}],
    }  # fmt: skip
    study = study_from(tables, "own").resolved()
    file.unlink()
    mine, tuned = (scenario[CONTROLLER] for scenario in study_from(study.as_tables(), "own").scenarios)
    assert (mine.settings.cascade.fall_share, mine.settings.cascade.tilt_max) == (0.25, 0.61)
    assert (tuned.settings.cascade.tilt_max, tuned.preset) == (0.61, "tuned")
    varied = {**tables, "axis": [{"name": "preset", "values": ["tuned", str(file)]}], "variant": [{"label": "a"}]}
    with pytest.raises(rf.InputError, match="preset files cannot be varied; give each to a variant"):
        study_from(varied, "own")


def test_a_campaign_gives_each_controller_the_presets_that_are_for_it(file: Path, tmp_path: Path) -> None:
    study = load_study("partial-loss-map")
    given = changed(study, controllers=["roismc", "smc"], preset=str(file))
    assert [scenario[CONTROLLER].preset_label for scenario in given.scenarios] == ["mine", "tuned"]
    with pytest.raises(rf.InputError, match=r"is one of controller 'roismc'; the study flies smc"):
        changed(study, controllers="smc", preset=str(file))
    other = tmp_path / "other.toml"
    other.write_text("[other.cascade]\ntilt_max = 0.3\n")
    both = changed(study, controllers=["roismc", "smc"], preset=[str(other), str(file)])
    assert [scenario[CONTROLLER].preset_label for scenario in both.scenarios] == ["mine", "other"]
