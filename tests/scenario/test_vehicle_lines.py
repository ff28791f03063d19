"""Vehicles that are hardly meant are told wherever they are checked or flown, to people and to programs."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import pytest
from command_line import run

import rotorfault as rf
from rotorfault.base.config import parse_toml
from rotorfault.model.vehicle_file import VEHICLE_TEMPLATE
from rotorfault.scenario.scenario import scenario_from
from rotorfault.scenario.vehicle_lines import vehicle_lines

WEAK = VEHICLE_TEMPLATE.replace("NAME", "weak").replace(
    "torque_ratio = { value = 0.016", "torque_ratio = { value = 1.6e-7"
)
SCENARIO = """
name = "weakly"
vehicle = "weak.toml"
duration = 0.02
period = 0.004
controller = { kind = "smc", preset = "gentle" }
reference = { kind = "set_point", position = [0.0, 0.0, 0.0] }
"""


def tables(vehicle: Any, **changes: Any) -> dict[str, Any]:
    return {**parse_toml(SCENARIO, "scenario"), "vehicle": vehicle, **changes}


def told(call: Any) -> list[str]:
    """The warnings about vehicles that a call gives, each to the line that calls."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        call()
    ours = [one for one in caught if issubclass(one.category, rf.VehicleWarning)]
    assert all(one.filename == __file__ for one in ours)
    return [str(one.message) for one in ours]


def test_python_is_warned_once_for_each_thing() -> None:
    vehicle = parse_toml(WEAK, "weak")
    lines = vehicle_lines(scenario_from(tables(vehicle), "scenario"))
    assert len(lines) == 2
    assert lines[0].startswith("vehicle 'weak': torque_ratio = 1.6e-07 m: ")
    assert lines[1].startswith("vehicle 'weak': yaw: hover leaves ")
    assert told(lambda: rf.fly(tables(vehicle))) == lines
    assert told(lambda: rf.fly_many(tables(vehicle), {"seed": [1, 2]})) == lines
    assert told(lambda: rf.fly(tables("hummingbird"))) == []


def test_the_true_vehicle_is_looked_at_too() -> None:
    scenario = scenario_from(tables("hummingbird", mismatch={"inertia": [100.0, 100.0, 100.0]}), "scenario")
    lines = vehicle_lines(scenario)
    assert lines
    assert all(line.startswith("vehicle 'hummingbird' with its mismatch: ") for line in lines)
    assert vehicle_lines(scenario_from(tables("hummingbird", mismatch={"mass": 1.2}), "scenario")) == []


@pytest.mark.parametrize(
    ("arguments", "ending"),
    [
        (["check", "weak.toml"], "; ok, with 2 warnings"),
        (["check", "flight.toml"], "; ok, with 4 warnings"),  # of the preset on this vehicle too, as `fly` has them
        (["fly", "flight.toml", "--no-figures", "--out", "out"], "to out"),
        (["trim", "weak.toml", "--controller", "smc", "--preset", "gentle"], ""),
    ],
    ids=["check vehicle", "check scenario", "fly", "trim"],
)
def test_the_command_line_tells_of_it(arguments: list[str], ending: str, tmp_path: Path) -> None:
    (tmp_path / "weak.toml").write_text(WEAK, encoding="utf-8")
    (tmp_path / "flight.toml").write_text(SCENARIO, encoding="utf-8")
    done = run(*arguments, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip().splitlines()[0 if arguments[0] == "check" else -1].endswith(ending)
    where = done.stdout if arguments[0] == "trim" else done.stderr
    lines = [line for line in where.splitlines() if line.startswith(("warning: ", "  - "))]
    for words in ("torque_ratio = 1.6e-07 m: ", "yaw: hover leaves an angular acceleration of 8.72e-05 rad/s^2"):
        assert sum(words in line for line in lines) == 1, where
    assert "VehicleWarning" not in done.stderr
