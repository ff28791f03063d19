"""Scores counted in flight: those of the records, on every engine, whatever is recorded."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from engine_flights import every_engine, run, short
from record_scores import from_records

import rotorfault
from rotorfault.engine import have_simd
from rotorfault.flight.assembly import assemble
from rotorfault.loop.scores import SURVIVED
from rotorfault.results.score_table import ANGLES, AXES, GIVEN_UP, LANDING, score_table
from rotorfault.scenario.scenario import Scenario

MEMBERS = {
    "position_mse": AXES,
    "attitude_mse": ANGLES,
    "position_error_end": AXES,
    "velocity_end": AXES,
    "attitude_end": ANGLES,
    "given_up_fraction": GIVEN_UP,
    "settle_time": (*AXES, "overall"),
    "landing": LANDING,
} | dict.fromkeys(("onset", "detected", "loss_true", "loss_believed", "loss_error"), ("1", "2", "3", "4"))

LANDS = {"ground": -0.4, "on_fault": "land", "duration": 3.0, "sensors": "ideal"}
MOVING = {"kind": "sinusoid", "amplitude": [0.2, 0.1, 0.1], "frequency": [3.0, 4.0, 5.0], "yaw": 0.4}
FLIGHTS = {
    "set point": short(),
    "landing": short(**LANDS),
    "lost": short(diagnosis="off", duration=1.5, fault=[{"kind": "total", "rotor": 2, "time": 0.1}]),
    "moving": short(reference=MOVING, controller={"kind": "roismc"}, sensors="ideal", duration=0.6),
    "crash": short(ground=-0.05, start={"velocity": [0.0, 0.0, -2.0]}, duration=0.6, fault=[]),
}


FASTEST = "simd" if have_simd() else "python"


def table_row(scenario: Scenario, engine: str) -> dict[str, Any]:
    batch = assemble(scenario)
    return score_table(batch, run(batch, engine).state).row(0)


def columns(nested: dict[str, Any]) -> dict[str, Any]:
    """Numbers of `record_scores` under the names of a table's columns."""
    found: dict[str, Any] = {}
    for name, value in nested.items():
        if name in MEMBERS:
            found |= {f"{name}.{member}": x for member, x in zip(MEMBERS[name], value, strict=True)}
        else:
            found[name] = value
    return found


each_flight = pytest.mark.parametrize("name", list(FLIGHTS))


@each_flight
def test_scores_are_those_of_the_records(name: str) -> None:
    """Every number, against a second computation from the records of all instants."""
    scenario = FLIGHTS[name]
    flight = rotorfault.fly(scenario, engine=FASTEST)
    row = flight.scores
    signals = {str(key): flight.data[key].values for key in (*flight.data.data_vars, "time")}
    wanted = columns(from_records(scenario, signals, flight.outcome.kind))
    assert set(row) == set(wanted) | {"outcome", "survived", "end_time"}
    for key, value in wanted.items():
        assert row[key] == pytest.approx(value, rel=1e-9, abs=1e-12, nan_ok=True), key
    assert (row["outcome"], row["survived"]) == (flight.outcome.kind, flight.outcome.kind in SURVIVED)
    lasted = len(signals["time"]) == scenario.steps
    assert row["end_time"] == pytest.approx(scenario.duration if lasted else signals["time"][-1])


@every_engine
def test_every_engine_counts_alike(engine: str) -> None:
    wanted, found = table_row(FLIGHTS["set point"], FASTEST), table_row(FLIGHTS["set point"], engine)
    assert list(found) == list(wanted)
    for key, value in wanted.items():
        close = value if isinstance(value, str | bool) else pytest.approx(value, rel=1e-6, abs=1e-9, nan_ok=True)
        assert found[key] == close, key


def test_the_flights_end_in_different_ways() -> None:
    """So that the tests of scores look at each way."""
    ends = {name: table_row(scenario, FASTEST)["outcome"] for name, scenario in FLIGHTS.items()}
    assert ends == {
        "set point": "offset", "landing": "landed", "lost": "tumbled", "moving": "offset", "crash": "ground",
    }  # fmt: skip


# --------------------------------------------------------------------------- one flight, one answer, whatever is kept


def same(one: dict[str, Any], other: dict[str, Any]) -> None:
    """To the last bit; what is no number in one is none in the other."""
    assert list(one) == list(other)
    for key, value in one.items():
        assert value == other[key] or (np.isnan(value) and np.isnan(other[key])), key


@each_flight
def test_scores_do_not_depend_on_what_is_recorded(name: str) -> None:
    """Every instant, every seventh, one in a hundred, nothing."""
    scenario = FLIGHTS[name]
    wanted = rotorfault.fly(scenario, engine=FASTEST).scores
    for periods in (7, 100):
        seldom = rotorfault.fly(scenario, settings={"record_period": 0.005 * periods}, engine=FASTEST)
        same(dict(seldom.scores), dict(wanted))
    batch = assemble(scenario)
    nothing = run(batch._replace(every=0), FASTEST)
    assert nothing.signals.size == 0
    same(score_table(batch, nothing.state).row(0), dict(wanted))


@each_flight
def test_a_flight_of_many_has_the_numbers_that_it_has_alone(name: str) -> None:
    """In `fly_many`, where nothing is recorded, beside a neighbour that starts elsewhere."""
    scenario = FLIGHTS[name]
    wanted = rotorfault.fly(scenario, engine=FASTEST).scores
    z = scenario.start.position[2]
    many = rotorfault.fly_many(scenario, {"start.position.2": [z, z + 0.01]}, engine=FASTEST)
    same(many.table.row(0), dict(wanted))
    assert many.table.row(1)["position_mse.z"] != wanted["position_mse.z"]
    few = rotorfault.fly_many(
        scenario, {"start.position.2": [z]}, record=["position.z"], record_period=0.05, engine=FASTEST
    )
    same(few.table.row(0), dict(wanted))


@each_flight
def test_a_file_holds_the_numbers_of_its_flight(name: str, tmp_path: Path) -> None:
    flight = rotorfault.fly(FLIGHTS[name], settings={"record_period": 0.05}, engine=FASTEST)
    flight.write(tmp_path, with_figures=False)
    loaded = rotorfault.load(tmp_path / "flight.nc")
    same(dict(loaded.scores), dict(flight.scores))
    assert loaded.summary() == flight.summary()
    assert json.loads((tmp_path / "summary.json").read_text()) == flight.summary()


def test_the_summary_is_the_row_in_other_words() -> None:
    """Nothing is counted anew, and nothing left out."""
    for scenario in (FLIGHTS["set point"], FLIGHTS["landing"]):
        flight = rotorfault.fly(scenario, engine=FASTEST)
        summary, row = flight.summary(), dict(flight.scores)
        by_rotor = {str(detection["rotor"]): detection for detection in summary["detections"]}
        assert set(by_rotor) == {rotor for rotor in ("1", "2", "3", "4") if np.isfinite(row[f"onset.{rotor}"])}
        names = {"onset": "true_time", "detected": "detected_time", "loss_believed": "loss_estimated"}
        for key, value in row.items():
            group, _, member = key.partition(".")
            if group in ("onset", "detected", "loss_true", "loss_believed", "loss_error"):
                found = by_rotor[member][names.get(group, group)] if member in by_rotor else None
            else:
                found = summary[group][member] if member else summary[group]
            assert found == (None if isinstance(value, float) and np.isnan(value) else value), key
