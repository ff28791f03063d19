"""Parts of one's own from the command line: flown, checked, and run only where the user names or allows them."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

import rotorfault as rf

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


def run(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "rotorfault.cli.main", *arguments]
    return subprocess.run(command, capture_output=True, text=True, cwd=folder, check=False, timeout=300)


def assert_refused(done: subprocess.CompletedProcess[str], *named: str) -> None:
    assert done.returncode == 2, done.stderr + done.stdout
    assert len(done.stderr.strip().splitlines()) == 1, done.stderr
    for word in named:
        assert word in done.stderr


def test_a_controller_s_file_shadows_no_module(tmp_path: Path) -> None:
    """A file of one's own may be called like a module of the library that the program needs after it."""
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "json.py").write_text(CONTROLLER)
    done = run(tmp_path, "fly", "paper-set-point", "--controller", "mine/json.py:Mine", *SHORT, "--out", "out")
    assert done.returncode == 0, done.stderr
    assert "flown by Mine" in done.stdout
    assert json.loads((tmp_path / "out" / "summary.json").read_text())["engine"] == "python"


def test_a_part_is_flown_with_its_settings(tmp_path: Path) -> None:
    own = ("--set", f"wind.kind={wind(tmp_path)}", "--set", "wind.speed=7.5")
    done = run(tmp_path, "fly", "paper-set-point", *own, *SHORT, "--out", "out")
    assert done.returncode == 0, done.stderr
    flight = rf.load(tmp_path / "out" / "flight.nc")
    assert (flight.data["wind"].values[:, 0] == 7.5).all()


def test_code_that_a_file_names_runs_only_if_it_is_allowed(tmp_path: Path) -> None:
    """Of a scenario, and of a flight that is repeated."""
    (tmp_path / "mine.toml").write_text(SCENARIO.format(kind=wind(tmp_path)))
    for command in (("fly", "mine.toml", *SHORT), ("check", "mine.toml")):
        assert_refused(run(tmp_path, *command), "wind.py:Mine", "--allow-code")
        done = run(tmp_path, *command, "--allow-code")
        assert done.returncode == 0, done.stderr
    (file,) = (tmp_path / "results").glob("*/flight.nc")
    again = ("fly", "--repeat", str(file), "--no-figures")
    assert_refused(run(tmp_path, *again), "wind.py:Mine", "--allow-code")
    assert run(tmp_path, *again, "--allow-code").returncode == 0


def test_check_says_which_rules_a_part_keeps(tmp_path: Path) -> None:
    done = run(tmp_path, "check", wind(tmp_path))
    assert done.returncode == 0, done.stderr
    title, *rules = done.stdout.splitlines()
    assert title == "wind wind.py:Mine"
    assert len(rules) >= 8
    assert all("kept" in rule for rule in rules)


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
    assert_refused(run(tmp_path, "check", wind(tmp_path, speed, default), *more), *named)


def test_check_gives_a_part_the_settings_that_it_needs(tmp_path: Path) -> None:
    done = run(tmp_path, "check", wind(tmp_path, default="..."), "--set", "speed=2.0")
    assert done.returncode == 0, done.stderr
    (tmp_path / "mine.toml").write_text("")
    assert_refused(run(tmp_path, "check", "mine.toml", "--set", "speed=2.0"), "--set")
