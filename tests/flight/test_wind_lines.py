"""A wind that is hardly meant is told, and one that is meant is not."""

from __future__ import annotations

from typing import Any

import pytest

import rotorfault as rf
from rotorfault.flight.wind_lines import wind_lines


def said(**wind: Any) -> list[str]:
    settings = {"duration": 10.0, "wind": {"kind": "constant", **wind}, "start.position": [0.0, 0.0, 5.0]}
    return [*wind_lines(rf.load_scenario("hover-fault", settings))]


@pytest.mark.parametrize(
    "wind",
    [
        {"velocity_W": [30.0, 0.0, 0.0]},
        {"velocity_W": [5.0, 0.0, 0.0], "shear": {}},
        {"velocity_W": [5.0, 0.0, 0.0], "shear": {"law": "power"}},
        {"velocity_W": [0.0, 0.0, 0.0], "front": {"arrival": 9.9}},
        {"velocity_W": [0.0, 0.0, 0.0], "front": {"arrival": -5.0, "shape": "step"}},
        {"kind": "dryden", "wind_at_6m": 20.0},
        {"kind": "none"},
    ],
)
def test_a_wind_that_may_be_meant_is_not_told(wind: dict[str, Any]) -> None:
    assert said(**wind) == []


@pytest.mark.parametrize(
    ("wind", "words"),
    [
        ({"velocity_W": [300.0, 0.0, 0.0]}, "wind.velocity_W: 300 m/s"),
        ({"kind": "dryden", "wind_at_6m": 200.0}, "wind.wind_at_6m: 200 m/s"),
        ({"velocity_W": [0.0, 0.0, 0.0], "front": {"velocity_W": [0.0, 0.0, 90.0]}}, "wind.front.velocity_W: 90 m/s"),
        ({"velocity_W": [0.0, 0.0, 0.0], "front": {"arrival": 15.0}}, "after the end of the flight at 10 s"),
        ({"velocity_W": [0.0, 0.0, 0.0], "front": {"arrival": -5.0}}, "has passed the origin before the flight"),
        ({"velocity_W": [15.0, 0.0, 0.0], "shear": {"reference_height": 0.06}}, "m/s at 10 m"),
        ({"velocity_W": [5.0, 0.0, 0.0], "shear": {"ground": 20.0}}, "15 m below it"),
    ],
)
def test_a_wind_that_is_hardly_meant_is_told_with_its_number(wind: dict[str, Any], words: str) -> None:
    (line,) = said(**wind)
    assert words in line


def test_a_flight_warns_of_it() -> None:
    settings = {"duration": 0.005, "wind": {"kind": "constant", "velocity_W": [300.0, 0.0, 0.0]}}
    with pytest.warns(rf.WindWarning, match="300 m/s"):
        rf.fly("hover-fault", settings=settings, engine="python")
