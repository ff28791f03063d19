"""`rotorfault check` and `new` of studies, and how files of vehicles, scenarios and studies are told apart."""

from __future__ import annotations

from pathlib import Path

import pytest
from command_line import assert_refused, run

from rotorfault.campaigns.load import load_study
from rotorfault.campaigns.studies import new_study
from rotorfault.cli.kinds_of_file import kind_of


def study(folder: Path, old: str = "", new: str = "") -> str:
    text = new_study("mine")
    assert old in text
    (folder / "mine.toml").write_text(text.replace(old, new, 1) if old else text)
    return "mine.toml"


def test_a_study_is_told_in_one_line(tmp_path: Path) -> None:
    done = run("check", study(tmp_path), cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    (line,) = done.stdout.splitlines()
    checked = load_study(tmp_path / "mine.toml")
    for word in (
        f"{checked.cells} cells (loss, wind_speed)",
        "2 variant(s) (roismc, smc)",
        "480 flights at most; ok",
    ):
        assert word in line
    assert checked.most_flights == 480


def test_warnings_of_its_vehicle_are_told(tmp_path: Path) -> None:
    heavy = '[settings]\n"vehicle.inertia_z.value" = 0.004\n"vehicle.torque_ratio.value" = 0.0004'
    done = run("check", study(tmp_path, "[settings]", heavy), cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "ok, with" in done.stdout
    assert "warning: vehicle 'paper'" in done.stderr


@pytest.mark.parametrize(
    ("old", "new", "named"),
    [
        ('name = "loss"', 'name = "los"', ("did you mean 'loss'?",)),
        ("stop = 0.6", "stop = 1.6", ("allowed: 0 to 1",)),
        ('"controller.kind" = "smc"', '"controller.kind" = "smk"', ("variant 'smc'", "did you mean 'smc'?")),
        ('scenario = "hover-fault"', 'scenario = "hover-falt"', ("did you mean 'hover-fault'?",)),
        ('name = "wind_speed"', 'name = "wind.speed"', ("wind.speed",)),
        ("most = 24", "most = 4", ("refine", "most")),
        ("duration = 4.0", 'duration = "long"', ("duration",)),
    ],
)
def test_what_is_wrong_is_one_line_that_says_what_it_was_read_as(
    old: str, new: str, named: tuple[str, ...], tmp_path: Path
) -> None:
    done = run("check", study(tmp_path, old, new), cwd=tmp_path)
    assert_refused(done, "(read as a study, for it has ", *named)


def test_code_that_a_study_names_is_asked_for(tmp_path: Path) -> None:
    (tmp_path / "trap.py").write_text("raise RuntimeError('it ran')\n")
    file = study(tmp_path, '"controller.kind" = "smc"', '"controller.kind" = "trap.py:Mine"')
    assert_refused(run("check", file, cwd=tmp_path), "allow it with --allow-code")
    assert_refused(run("check", file, "--allow-code", cwd=tmp_path), "it ran")


@pytest.mark.parametrize(
    ("tables", "kind"),
    [
        ({"name": "x", "mass": 3}, "vehicle"),
        ({"name": "x", "rotor": [], "duration": 1}, "vehicle"),
        ({"vehicle": "paper"}, "scenario"),
        ({"vehicle": "paper", "duration": 1, "reference": {}, "mass": 1}, "scenario"),
        ({"scenario": "hover-fault"}, "study"),
        ({"vehicle": "paper", "axis": [], "variant": []}, "study"),
        ({"scenario": "hover-fault", "design": "sobol"}, "study"),
    ],
)
def test_a_file_is_what_it_has_most_keys_of(tables: dict[str, object], kind: str) -> None:
    assert kind_of(tables, "file")[0] == kind


def test_a_file_that_is_none_of_them_says_so(tmp_path: Path) -> None:
    (tmp_path / "other.toml").write_text("colour = 3\n")
    done = run("check", "other.toml", cwd=tmp_path)
    assert_refused(done, "is no vehicle, scenario or study (it has colour)", "'rotorfault new' writes one")


@pytest.mark.parametrize("name", ["a b", "-x", "", "ä", "x" * 101])
def test_the_name_of_a_study_is_that_of_a_folder(name: str, tmp_path: Path) -> None:
    assert_refused(run("new", "study", "--", name, cwd=tmp_path), "name")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("name", "words"), [("hummingbird", "vehicle"), ("hover-fault", "scenario"), ("partial-loss-map", "study")]
)
def test_what_is_built_in_is_checked_by_its_name(name: str, words: str) -> None:
    from rotorfault.cli import catalogue

    line, _ = catalogue.check(Path(name))
    assert line.startswith(f"{name}: {words} '{name}'")
