"""Axes over all rotors: as many as the vehicle has that is flown."""

from __future__ import annotations

import pickle
from typing import Any

import pytest

from rotorfault.base.errors import InputError
from rotorfault.campaigns.changes import changed
from rotorfault.campaigns.load import load_study
from rotorfault.campaigns.study import MOST_CELLS, Study, study_from


def study(vehicle: str = "x8", axes: list[dict[str, Any]] | None = None, **own: Any) -> Study:
    tables = {
        "name": "rotors", "scenario": "hover-fault", "settings": {"vehicle": vehicle},
        "axis": axes or [{"name": "rotor", "values": "all"}, {"name": "loss", "values": [0.5, 1.0]}],
        "variant": [{"label": "one"}], **own,
    }  # fmt: skip
    return study_from(tables, "rotors")


@pytest.mark.parametrize(("vehicle", "rotors"), [("paper", 4), ("y6", 6), ("x8", 8)])
def test_an_axis_of_all_rotors_has_those_of_the_vehicle(vehicle: str, rotors: int) -> None:
    made = study(vehicle)
    assert made.shape == (rotors, 2)
    assert made.axis[0].grid == [float(k) for k in range(1, rotors + 1)]


def test_it_follows_the_vehicle_that_the_user_names_and_goes_to_other_processes() -> None:
    other = changed(study("x8"), vehicle="du-pnpnpn").resolved()
    assert other.shape == (6, 2)
    assert pickle.loads(pickle.dumps(other)).shape == (6, 2)
    assert study_from(other.as_tables(), "again").shape == (6, 2)


def test_the_built_in_one_flies_every_rotor() -> None:
    assert load_study("frame-loss-map").shape[1] == 6
    assert changed(load_study("frame-loss-map"), vehicle="octa-x").shape[1] == 8


@pytest.mark.parametrize(
    ("wrong", "says"),
    [
        ({"axes": [{"name": "loss", "values": "all"}]}, "rotor and second_rotor alone"),
        (
            {"axes": [{"name": "rotor", "values": "all"}, {"name": "vehicle", "values": ["x8", "y6"]}]},
            "needs one vehicle",
        ),
        (
            {"variant": [{"label": "a"}, {"label": "b", "settings": {"vehicle": "y6"}}]},
            "6 and 8 rotors",
        ),
        (
            {
                "axes": [
                    {"name": "rotor", "values": "all"},
                    {"name": "loss", "start": 0.0, "stop": 1.0, "count": 200},
                    {"name": "mass", "start": 0.5, "stop": 1.5, "count": MOST_CELLS // 1600 + 50},
                ],
            },
            "allowed: up to 100,000",
        ),
    ],
)
def test_what_it_cannot_be_is_refused_in_words(wrong: dict[str, Any], says: str) -> None:
    with pytest.raises(InputError, match=says):
        study(**wrong)
