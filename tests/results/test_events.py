"""What happened in a flight, in words."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest

import rotorfault as rf
from rotorfault.results.events import Event, events, isolation_time, onsets, spins
from rotorfault.results.flight_data import FlightData, Variable

TIME = np.arange(1000) * 0.001


def made_up(signals: dict[str, Any], scores: dict[str, Any], **attributes: Any) -> FlightData:
    """A flight of a second at 1 kHz with three rotors, of which nothing is recorded but what is given."""
    variables = {
        name: Variable(("time", "rotor") if np.ndim(values) == 2 else ("time",), np.asarray(values, dtype=float), {})
        for name, values in signals.items()
    }
    return FlightData(
        variables, {"time": Variable(("time",), TIME, {})}, {"scores": json.dumps(scores), **attributes}
    )


def flags(*spans: tuple[int, int, int]) -> np.ndarray[Any, Any]:
    """Flags of three rotors, each raised from one record to another."""
    values = np.zeros((1000, 3))
    for rotor, first, last in spans:
        values[first:last, rotor - 1] = 1.0
    return values


def texts(data: FlightData, *kinds: str) -> list[str]:
    return [event.text for event in events(data) if event.kind in kinds]


def test_alarms_are_right_or_false_by_the_onset_of_the_fault() -> None:
    scores = {"onset.1": 0.3, "onset.2": None, "onset.3": None}
    data = made_up({"fault_flag": flags((1, 100, 150), (1, 320, 1000), (3, 400, 450))}, scores)
    assert texts(data, "false_alarm") == ["false alarm: rotor 1 flagged", "false alarm: rotor 3 flagged"]
    assert texts(data, "alarm") == ["rotor 1 flagged, 20 ms after its fault"]
    assert texts(data, "cleared") == ["rotor 1 cleared", "rotor 3 cleared"]


def test_isolated_is_when_the_faulty_rotors_are_flagged_and_no_others() -> None:
    scores = {"onset.1": 0.3, "onset.3": 0.35}
    data = made_up({"fault_flag": flags((1, 320, 1000), (2, 330, 500), (3, 360, 1000))}, scores)
    assert isolation_time(data, onsets(scores)) == pytest.approx(0.5)
    never = made_up({"fault_flag": flags((1, 320, 1000))}, scores)
    assert isolation_time(never, onsets(scores)) is None
    assert "isolated" not in [event.kind for event in events(never)]


def test_a_spin_is_a_whole_turn_at_more_than_one_a_second() -> None:
    """Two turns in half a second are one; a swerve of a third of a turn is none, however fast."""
    rates = np.zeros((1000, 3))
    rates[100:600] = [0.0, 0.6 * 8.0 * np.pi, 0.8 * 8.0 * np.pi]  # about any axis
    rates[700:735] = [0.0, 0.0, 20.0 * np.pi]
    data = made_up({"body_rates": rates}, {})
    assert texts(data, "spin") == ["spins for 500 ms, up to 4 turns a second"]
    assert spins(data)
    assert not spins(made_up({"body_rates": np.where(TIME[:, None] < 0.7, 0.0, rates)}, {}))
    assert not spins(made_up({}, {}))


def test_a_limit_is_told_once_with_short_breaks_and_anew_after_long_ones() -> None:
    command = np.full((1000, 3), 1.0)
    command[100:200, 0] = command[210:300, 0] = command[600:640, 0] = 5.0
    command[700:750, 1] = 0.0
    data = made_up({"thrust_command": command}, {}, thrust_max=5.0, thrust_min=0.0)
    assert texts(data, "saturation") == [
        "command of rotor 1 at its upper limit on and off for 200 ms",
        "command of rotor 1 at its upper limit for 40 ms",
        "command of rotor 2 at its lower limit for 50 ms",
    ]


def test_a_burst_is_told_to_a_bound_with_the_number_of_what_is_left_out() -> None:
    values = np.zeros((1000, 3))
    values[:, 1] = (np.arange(1000) // 20) % 2
    found = texts(made_up({"fault_flag": values}, {}), "false_alarm")
    assert len(found) == 12
    assert found[-1].endswith("(and 13 times more)")


def test_modes_that_parts_record_are_told_when_they_change() -> None:
    stage = np.repeat([0.0, 1.0, 2.0], [300, 300, 400])
    data = made_up({"on_fault.stage": stage}, {})
    assert texts(data, "switch") == ["on_fault.stage: 0 to 1", "on_fault.stage: 1 to 2"]


def test_events_are_in_order_and_end_with_the_outcome() -> None:
    flight = rf.fly("land-after-fault", settings={"duration": 9.0})
    found = events(flight.records())
    assert [event.time for event in found] == sorted(event.time for event in found)
    assert found[-1] == Event(flight.outcome.time, "end", "landed")
    words = [event.text for event in found]
    assert "rotor 1 loses 25 % of its thrust" in words
    assert any(text.startswith("touch-down at 0.4") for text in words)


def test_a_fault_of_another_kind_is_told_with_its_settings() -> None:
    fault = {"kind": "total", "rotor": 2, "time": 0.5}
    flight = rf.fly("hover-fault", settings={"duration": 1.0, "fault": [fault]})
    (begins,) = (event for event in events(flight.records()) if event.kind == "fault")
    assert begins == Event(0.5, "fault", "fault of rotor 2 begins: total", 2)


def test_a_flight_that_recorded_nothing_has_no_events() -> None:
    assert events(made_up({}, {})) == []
