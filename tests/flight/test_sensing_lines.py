"""A flight whose ground flow and range do not read is told, with what mends it, wherever it is begun."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

import rotorfault as rf
from rotorfault.base.errors import InputError
from rotorfault.campaigns.check import out_of_reach
from rotorfault.campaigns.load import study_from
from rotorfault.cli import catalogue
from rotorfault.flight.sensing_lines import sensing_lines

LOW = {"start.position": [0.0, 0.0, 1.0], "reference.position": [0.0, 0.0, 1.0]}
MEND = "try --set start.position=[0,0,1] --set reference.position=[0,0,1]"


def said(**settings: Any) -> list[str]:
    return [*sensing_lines(rf.load_scenario("hover-fault", {"sensors": "crazyflie", **settings}))]


@pytest.mark.parametrize(
    "settings",
    [LOW, {"sensors": "mocap"}, {"sensors": "gps-consumer"}, {"sensors": "noisy"}, {"ground": 3.0},
     {"sensors": {"kind": "crazyflie", "range": {"farthest": 6.0}}},
     {"start.position": [0.0, 0.0, 0.0], "reference.position": [0.0, 0.0, 1.0]}],
)  # fmt: skip
def test_a_flight_within_reach_is_not_told(settings: dict[str, Any]) -> None:
    assert said(**settings) == []


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({}, "the flight starts 5 m above it and the reference is 5 m above it, for 100 %"),
        (LOW | {"reference.position": [0.0, 0.0, 4.5]}, "but the reference is 4.5 m"),
        (LOW | {"start.position": [0.0, 0.0, 4.5]}, "but the flight starts 4.5 m"),
        ({"ground": None, "start.position": [0.0, 0.0, 0.0], "reference.position": [0.0, 0.0, 0.0]}, "starts 0 m"),
    ],
)
def test_a_flight_out_of_reach_is_told_with_numbers_and_what_mends_it(settings: dict[str, Any], words: str) -> None:
    [line] = said(**settings)
    assert words in line
    assert "from 0.05 to 4 m" in line
    assert MEND in line


def test_a_flight_through_heights_out_of_reach_is_told_for_how_long() -> None:
    [line] = sensing_lines(rf.load_scenario("paper-square", {"sensors": "crazyflie", "ground": -3.5}))
    assert "the reference is 1.5 to 5.5 m above it, for 50 % of the flight" in line


def test_a_flight_that_begins_in_motion_unknown_to_the_filter_is_told() -> None:
    moving = LOW | {"start.velocity": [9.0, 0.0, 0.0]}
    [line] = said(**moving)
    assert "0 to within 0.1 m/s" in line
    assert "starts at 9 m/s; try --set estimator.kind=eskf --set estimator.start_speed=9" in line
    assert said(**moving, **{"estimator": {"kind": "eskf", "start_speed": 9.0}}) == []
    assert said(**moving, sensors="gps-consumer") == []
    assert said(**LOW, **{"start.velocity": [0.2, 0.0, 0.0]}) == []


def test_fly_fly_many_and_check_tell_it() -> None:
    settings = {"sensors": "crazyflie", "duration": 0.01, "fault": []}
    with pytest.warns(rf.SensorWarning, match="flow and range read the ground"):
        rf.fly("hover-fault", settings=settings)
    with pytest.warns(rf.SensorWarning, match="flow and range read the ground"):
        rf.fly_many("hover-fault", {"seed": [1, 2]}, settings=settings)
    _, warnings = catalogue.check(Path("hover-fault"), settings=settings)
    assert any("flow and range read the ground" in line for line in warnings)


def test_a_study_tells_it_of_a_case_and_not_where_heights_vary() -> None:
    sensors = {
        "name": "sensors",
        "case": [{"label": one, "settings": {"sensors": one}} for one in ("mocap", "crazyflie")],
    }
    variant = [{"label": "roismc", "settings": {"controller.kind": "roismc"}}]
    tables: dict[str, Any] = {"name": "reach", "scenario": "hover-fault", "variant": variant, "axis": [sensors]}
    [line] = out_of_reach(study_from(tables, "reach"))
    assert MEND in line
    tables["axis"] = [sensors, {"name": "start.position.2", "values": [1.0, 2.0]}]
    assert out_of_reach(study_from(tables, "reach")) == []


def test_check_takes_settings_of_scenarios_and_says_where_there_are_none() -> None:
    line, _ = catalogue.check(Path("hover-fault"), settings={"duration": 3.0})
    assert "3 s of paper" in line
    with pytest.raises(InputError, match=r"x500 is a vehicle; --set goes with a scenario, a study or FILE.py:NAME"):
        catalogue.check(Path("x500"), settings={"mass": 3})
