"""Who follows a flight sees each record once, as the flight has it, on every engine."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from engine_flights import set_chunk

import rotorfault as rf
from rotorfault.results.flight_data import FlightData

SHORT: dict[str, Any] = {"duration": 1.2}
LOST: dict[str, Any] = {
    "duration": 8.0,
    "fault": [{"kind": "total", "rotor": 1, "time": 0.1}],
    "diagnosis": "off",
}


@pytest.mark.parametrize("engine", ["python", "simd"])
@pytest.mark.parametrize("every", [1, 8])
def test_all_records_are_handed_over_in_order(engine: str, every: int, monkeypatch: pytest.MonkeyPatch) -> None:
    set_chunk(monkeypatch, 60)
    if engine == "simd":
        pytest.importorskip("llvmlite")
    pieces: list[FlightData] = []
    settings = {"duration": 0.15} | ({"record_period": every * 1e-3} if every > 1 else {})
    flight = rf.fly("paper-set-point", settings=settings, engine=engine, follow=pieces.append)
    assert len(pieces) == 3
    assert pieces[0].attrs["title"] == "paper-set-point flown by roismc"
    for name in ("time", "position", "loss_true", "controller.sigma_attitude"):
        whole = np.concatenate([piece[name].values for piece in pieces])
        assert np.array_equal(whole, flight.data[name].values), name


def test_the_numbers_are_those_of_a_flight_that_nobody_follows() -> None:
    alone = rf.fly("paper-set-point", settings=SHORT)
    followed = rf.fly("paper-set-point", settings=SHORT, follow=lambda piece: None)
    assert alone.data.equals(followed.data)


@pytest.mark.filterwarnings("ignore::UserWarning")
def test_nothing_is_shown_after_the_end_of_a_lost_flight() -> None:
    pieces: list[FlightData] = []
    flight = rf.fly("hover-fault", settings=LOST, follow=pieces.append)
    assert not flight.outcome.survived
    times = np.concatenate([piece["time"].values for piece in pieces])
    assert np.array_equal(times, flight.data["time"].values)


def test_whoever_interrupts_ends_the_flight_and_keeps_it() -> None:
    seen: list[float] = []

    def stop(piece: FlightData) -> None:
        seen.append(float(piece["time"].values[-1]))
        if seen[-1] > 0.6:
            raise KeyboardInterrupt

    flight = rf.fly("paper-set-point", settings={"duration": 5.0}, follow=stop)
    assert flight.outcome.kind == "interrupted"
    assert flight.data["time"].values[-1] >= seen[-1]
    assert flight.outcome.time < 5.0


def test_who_interrupts_at_the_end_keeps_the_whole_flight() -> None:
    def stop(piece: FlightData) -> None:
        if piece["time"].values[-1] > 1.15:
            raise KeyboardInterrupt

    flight = rf.fly("paper-set-point", settings=SHORT, follow=stop)
    assert flight.outcome.kind != "interrupted"
    assert len(flight.data["time"]) == 1200
