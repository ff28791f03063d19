"""Parts of one's own from the command line: flown, checked, and run only where the user names or allows them."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from command_line import assert_refused, run, started
from places import EXAMPLES
from typer.testing import CliRunner

import rotorfault as rf
from rotorfault.cli.main import app

CONTROLLER = """
from rotorfault import Vec3, Wrench

class Mine:
    def update(self, time, estimate, reference, vehicle):
        return Wrench(vehicle.mass * vehicle.gravity, Vec3(0.0, 0.0, 0.0))
"""
WIND = '''
from typing import NamedTuple
import rotorfault as rf
from pydantic import Field
from rotorfault.maths.scalar import Scalar

class Numbers(NamedTuple):
    speed: Scalar  # m/s

class Mine(rf.Wind[rf.Nothing, Numbers]):
    """Air that moves forward at a steady speed."""

    class Settings(rf.Settings):
        speed: float = Field({default}, description="of the air [m/s]")

    def parameters(self, context):
        return Numbers(self.settings.speed)

    def at(self, time, memory, parameters):
        return rf.Air(rf.Vec3({speed}, 0.0, 0.0), rf.Vec3(0.0, 0.0, 0.0))
'''
SCENARIO = """
name = "mine"
vehicle = "paper"
duration = 0.01

[reference]
kind = "set_point"
position = [0.0, 0.0, 1.0]

[wind]
kind = "{kind}"
"""
SHORT = ("--set", "duration=0.01", "--set", "fault=[]", "--no-figures")


def wind(folder: Path, speed: str = "parameters.speed", default: str = "3.0") -> str:
    (folder / "wind.py").write_text(WIND.format(speed=speed, default=default))
    return "wind.py:Mine"


def test_a_controller_s_file_shadows_no_module(tmp_path: Path) -> None:
    """A file of one's own may be called like a module of the library that the program needs after it."""
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "json.py").write_text(CONTROLLER)
    own = ("--controller", "mine/json.py:Mine", *SHORT)
    done = started("fly", "paper-set-point", *own, "--out", "out", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "flown by Mine" in done.stdout
    assert json.loads((tmp_path / "out" / "summary.json").read_text())["engine"] == "python"


def test_a_part_is_flown_with_its_settings(tmp_path: Path) -> None:
    own = ("--set", f"wind.kind={wind(tmp_path)}", "--set", "wind.speed=7.5")
    done = run("fly", "paper-set-point", *own, *SHORT, "--out", "out", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    flight = rf.load(tmp_path / "out" / "flight.nc")
    assert (flight.data["wind"].values[:, 0] == 7.5).all()


def test_code_that_a_file_names_runs_only_if_it_is_allowed(tmp_path: Path) -> None:
    """Of a scenario, and of a flight that is repeated."""
    (tmp_path / "mine.toml").write_text(SCENARIO.format(kind=wind(tmp_path)))
    for command in (("fly", "mine.toml", *SHORT), ("check", "mine.toml")):
        assert_refused(run(*command, cwd=tmp_path), "wind.py:Mine", "--allow-code")
        done = run(*command, "--allow-code", cwd=tmp_path)
        assert done.returncode == 0, done.stderr
    (file,) = (tmp_path / "results").glob("*/flight.nc")
    again = ("fly", "--repeat", str(file), "--no-figures")
    assert_refused(run(*again, cwd=tmp_path), "wind.py:Mine", "--allow-code")
    assert run(*again, "--allow-code", cwd=tmp_path).returncode == 0


@pytest.fixture
def short_checks(monkeypatch: pytest.MonkeyPatch) -> None:
    """Flights of a check that are just as long as the command line needs to say what comes of it."""
    monkeypatch.setattr("rotorfault.flight.rules.STEPS", 15)


@pytest.mark.usefixtures("short_checks")
def test_check_says_which_rules_a_part_keeps(tmp_path: Path) -> None:
    done = run("check", wind(tmp_path), cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    title, *rules = done.stdout.splitlines()
    assert title == "wind wind.py:Mine"
    assert len(rules) >= 8
    assert all("kept" in rule for rule in rules)


@pytest.mark.usefixtures("short_checks")
@pytest.mark.parametrize(
    ("speed", "default", "more", "named"),
    [
        ("self.settings.speed", "3.0", (), ("breaks the rules of a part", "no number of its settings is baked")),
        ("parameters.speed", "...", (), ("speed", "is missing")),
        ("parameters.sped", "3.0", (), ("breaks the rules of a part", "sped", "line 20")),
        ("parameters.speed", "3.0", ("--set", "sped=1.0"), ("sped", "did you mean 'speed'")),
    ],
)
def test_check_refuses_in_one_line(
    speed: str, default: str, more: tuple[str, ...], named: tuple[str, ...], tmp_path: Path
) -> None:
    assert_refused(run("check", wind(tmp_path, speed, default), *more, cwd=tmp_path), *named)


@pytest.mark.usefixtures("short_checks")
def test_check_gives_a_part_the_settings_that_it_needs(tmp_path: Path) -> None:
    done = run("check", wind(tmp_path, default="..."), "--set", "speed=2.0", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert_refused(run("check", "hummingbird", "--set", "speed=2.0", cwd=tmp_path), "--set speed", "is a vehicle")


def test_a_controller_of_ones_own_obeys_settings_and_presets_or_refuses_them(tmp_path: Path) -> None:
    """They were ignored once."""
    own = ["fly", "hover-fault", "--controller", f"{EXAMPLES / 'controller.py'}:PdController", "--no-figures"]
    own += ["--set", "duration=0.3", "--set", "start.position=[0.1,0,5]"]
    preset = tmp_path / "stiff.toml"
    preset.write_text("[stiff]\nstiffness = 9.0\n")
    ends = []
    for number, more in enumerate(
        (["--set", "controller.stiffness=3"], ["--set", "controller.stiffness=9"], ["--preset", str(preset)])
    ):
        result = CliRunner().invoke(app, [*own, *more, "--out", str(tmp_path / str(number))], catch_exceptions=False)
        assert result.exit_code == 0, result.output
        ends.append(rf.load(tmp_path / str(number) / "flight.nc").scores["position_error_end.x"])
    assert ends[0] != ends[1]
    assert ends[1] == ends[2]
    for wrong in (["--preset", "tuned"], ["--set", "controller.cascade.tilt_max=0.5"]):
        with pytest.raises(rf.InputError, match=r"allowed: (FILE\.toml|stiffness, damping)"):
            CliRunner().invoke(app, [*own, *wrong], catch_exceptions=False)
