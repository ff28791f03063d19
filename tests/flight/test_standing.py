"""A vehicle on the ground stands there, takes off or comes to it gently; only what breaks it is a crash."""

from __future__ import annotations

from typing import Any

import pytest

import rotorfault as rf
from rotorfault.engine import have_simd

ENGINE = "simd" if have_simd() else "python"
STANDING: dict[str, Any] = {
    "name": "standing", "vehicle": "hummingbird", "duration": 1.0, "period": 0.002, "ground": 0.0,
    "controller": {"kind": "smc", "preset": "gentle"},
    "reference": {"kind": "set_point", "position": [0.0, 0.0, 0.0]},
}  # fmt: skip


def flown(**settings: Any) -> rf.Flight:
    return rf.fly(STANDING, settings=settings, engine=ENGINE)


@pytest.mark.parametrize("mass", [1.0, 1.01])
@pytest.mark.parametrize("law", ["smc", "roismc"])
def test_who_wants_to_stand_stands(mass: float, law: str) -> None:
    flight = flown(**{"mismatch.mass": mass, "controller": {"kind": law, "preset": "gentle"}, "duration": 2.0})
    assert flight.outcome.kind == "settled"
    assert flight.outcome.time == 2.0
    # Sinks by what the rotors do not carry of the weight: no more than 2 mm.
    assert flight.scores["lowest"] > -0.002
    assert flight.scores["tilt_max"] < 1e-6


@pytest.mark.parametrize("mass", [1.01, 1.1])
def test_a_vehicle_heavier_than_believed_takes_off(mass: float) -> None:
    flight = flown(**{"mismatch.mass": mass, "reference.position": [0.0, 0.0, 0.5], "duration": 6.0})
    height = flight.data["position"].values[:, 2]
    assert flight.data["ground_force"].values[1] > 0.0, "it stands before it flies"
    assert flight.data["ground_force"].values[-1] == 0.0
    assert flight.outcome.survived
    # Without integral action the law stays low by what it does not know of the weight.
    assert 0.4 < height[-1] < 0.5


@pytest.mark.parametrize(("speed", "survives"), [(0.5, True), (0.9, True), (1.2, False)])
def test_coming_down_is_a_crash_above_a_speed(speed: float, survives: bool) -> None:
    """With rotors that carry less than half of what is believed: it bounces, and stays, or breaks."""
    start = {"start.position": [0.0, 0.0, 0.001], "start.velocity": [0.0, 0.0, -speed]}
    flight = flown(**start, **{"mismatch.rotor_gain": 0.4})
    assert flight.outcome.survived is survives
    assert flight.outcome.kind == ("offset" if survives else "ground")


def test_sliding_over_the_ground_is_a_crash_and_passing_above_it_is_not() -> None:
    start = {"start.velocity": [2.0, 0.0, 0.0], "reference.position": [1.0, 0.0, 0.0]}
    assert flown(**start, **{"start.position": [0.0, 0.0, 0.0], "mismatch.mass": 1.2}).outcome.kind == "ground"
    above = {"start.position": [0.0, 0.0, 0.3], "reference.position": [1.0, 0.0, 0.3]}
    assert flown(**(start | above)).outcome.survived


def test_a_vehicle_without_thrust_stays_on_its_legs() -> None:
    dead = [{"kind": "total", "rotor": rotor, "time": 0.5} for rotor in (1, 2, 3, 4)]
    flight = flown(fault=dead, diagnosis="off")
    assert flight.outcome.kind == "settled"
    weight = 0.5 * 9.81
    assert flight.data["ground_force"].values[-1] == pytest.approx(weight, rel=1e-3)
