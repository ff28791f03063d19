"""The headline of a flight's page."""

from __future__ import annotations

import pytest

import rotorfault as rf
from rotorfault.pages.verdict import headline


def facts(**settings: object) -> dict[str, str]:
    flight = rf.fly("hover-fault", settings=settings)
    return {fact.term.split(",")[0]: fact.value for fact in headline(flight.records())}


def step(loss: float) -> list[dict[str, object]]:
    return [{"kind": "step", "rotor": 1, "time": 0.5, "loss": loss}]


def test_the_margin_is_what_hover_has_left() -> None:
    """With yaw held, all rotors give what the weakest can."""
    vehicle = rf.load_vehicle("paper").vehicle
    sound = 4.0 * vehicle.thrust_max
    calm = {"wind": "none", "duration": 1.0}
    margin = facts(fault=step(0.3), **calm)["least margin"]
    assert margin == f"{0.7 * sound / vehicle.mass - vehicle.gravity:.2g} m/s²"
    assert facts(fault=[], **calm)["least margin"] == f"{sound / vehicle.mass - vehicle.gravity:.2g} m/s²"


def test_a_flight_without_faults_tells_its_false_alarms() -> None:
    found = facts(fault=[], duration=1.0)
    assert found["false alarms"] == "0"
    assert "to detect" not in found


def test_a_fault_that_nobody_sees_is_missed() -> None:
    found = facts(fault=step(0.3), duration=1.0, diagnosis="off")
    assert found["to detect"] == "missed"
    assert found["to isolate"] == "never"


def test_a_stuck_rotor_has_no_margin_that_a_loss_would_tell() -> None:
    found = facts(fault=[{"kind": "stuck", "rotor": 2, "time": 0.5, "thrust": 3.0}], duration=1.0)
    assert "least margin" not in found


def test_a_flight_that_only_a_spin_keeps_up_tells_how_fast_it_must_turn(spinning: rf.Flight) -> None:
    """Of a vehicle whose printed solution turns once in 0.30 s, about what the flight does."""
    found = {fact.term: fact.value for fact in headline(spinning.records())}
    turns = float(found["needed to hover"].removesuffix(" turns/s"))
    assert turns == pytest.approx(1.0 / rf.relaxed_hover("mueller-2014", [1]).period, rel=0.02)
    assert "least margin" not in found
