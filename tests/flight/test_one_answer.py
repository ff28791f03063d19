"""One flight has one set of numbers, however it is flown, whatever is recorded and how finely, and in its files."""

from __future__ import annotations

import functools
import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rotorfault as rf
from rotorfault.engine import have_simd
from rotorfault.flight import comparison
from rotorfault.results.outcome import finite_or_none
from rotorfault.results.score_table import nested
from rotorfault.results.text import UNTIL_LOST, rows
from rotorfault.scenario.scenario import Scenario, scenario_from

PERIOD = 0.005
BASE: dict[str, Any] = {
    "vehicle": "paper",
    "duration": 0.8,
    "period": PERIOD,
    "step": PERIOD,
    "start": {"position": [0.1, 0.0, 0.2], "attitude": [0.1, -0.2, 0.3]},
    "reference": {"kind": "set_point", "position": [0.2, -0.1, 0.3]},
    "controller": {"kind": "smc", "preset": "none"},
}
FAULT = {"kind": "step", "rotor": 2, "time": 0.233, "loss": 0.3}
SCENARIOS: dict[str, dict[str, Any]] = {
    # Flags come and go; the onset lies between two samples.
    "faulty": {"fault": [FAULT, {**FAULT, "rotor": 3, "time": 0.4}], "sensors": "noisy", "wind": "dryden"},
    "moving": {"reference": {"kind": "sinusoid", "amplitude": [0.5, 0.5, 0.2], "frequency": [1.0, 1.0, 2.0]}},
    # Ends between two of the seldom records.
    "lost": {"fault": [{"kind": "total", "rotor": 1, "time": 0.1}], "diagnosis": "off", "plant": "paper_model"},
    "landed": {
        "fault": [{**FAULT, "time": 0.05}],
        "ground": 0.0,
        "on_fault": {"kind": "land", "persistence": 0.05},
        "controller": {"kind": "smc", "preset": "gentle"},
        "vehicle": "hummingbird",
        "start": {"position": [0.0, 0.0, 0.03]},
        "reference": {"kind": "set_point", "position": [0.0, 0.0, 0.03]},
        "duration": 1.1,
    },
}
OUTCOMES = {
    "faulty": ("settled", "offset"),
    "moving": ("tracked", "offset"),
    "lost": ("tumbled",),
    "landed": ("landed",),
}
every_flight = pytest.mark.parametrize("name", SCENARIOS)


def scenario(name: str, every: int = 1) -> Scenario:
    tables = {"name": name, **BASE, **SCENARIOS[name]}
    return scenario_from({**tables, "record_period": every * tables["period"]}, "test")


@pytest.fixture(scope="module")
def flown() -> dict[str, rf.Flight]:
    """Each flight alone, everything recorded."""
    return {name: rf.fly(scenario(name)) for name in SCENARIOS}


def assert_same(found: Any, wanted: Any) -> None:
    """To the last bit; what there is no number of, there is none of in both."""
    assert list(found) == list(wanted)
    np.testing.assert_equal(found, wanted)


@every_flight
def test_the_flights_are_what_they_are_meant_to_be(flown: dict[str, rf.Flight], name: str) -> None:
    flight = flown[name]
    assert flight.outcome.kind in OUTCOMES[name]
    summary = flight.summary()
    assert len(summary["detections"]) == len(SCENARIOS[name].get("fault", []))
    if name == "lost":
        assert round(flight.outcome.time / PERIOD) % 10, "choose one that ends between two seldom records"
    if name == "faulty":
        assert all(hit["delay"] is not None for hit in summary["detections"])


@every_flight
@pytest.mark.parametrize("every", [1, 10])
def test_fly_and_fly_all(flown: dict[str, rf.Flight], name: str, every: int) -> None:
    one = scenario(name, every)
    alone = rf.fly(one)
    assert len(alone.data["time"]) <= 1 + len(flown[name].data["time"]) / every + 1
    other = rf.neighbour(one, seed=1)
    together = rf.fly_all([other, one, other])
    for flight in (alone, together[1]):
        assert_same(flight.scores, flown[name].scores)
        assert flight.summary() == flown[name].summary()
        assert flight.outcome == flown[name].outcome


@every_flight
@pytest.mark.parametrize(
    ("record", "every"), [((), 1), ((), 10), (("position", "thrust.r2"), 1), (("position",), 10)]
)
def test_fly_many(flown: dict[str, rf.Flight], name: str, record: tuple[str, ...], every: int) -> None:
    flights = rf.fly_many(scenario(name, every), {"seed": [5, 0, 7]}, record=record)
    assert len(flights.signals) == (0 if not record else math.ceil(flights.scenario.steps / every))
    assert_same(flights.table.row(1), flown[name].scores)
    assert_same(flights.replay(1).scores, flown[name].scores)


# Reading a file takes a hundred times as long as the flight: every flight in two ways, one here and one in `compare`.
SELDOM = dict(zip(SCENARIOS, (10, 1, 10, 1), strict=True))


@every_flight
def test_files(flown: dict[str, rf.Flight], name: str, tmp_path: Path) -> None:
    rf.fly(scenario(name, SELDOM[name])).write(tmp_path, with_figures=False)
    loaded = rf.load(tmp_path / "flight.nc")
    assert_same(loaded.scores, flown[name].scores)
    assert loaded.summary() == flown[name].summary()
    assert loaded.outcome == flown[name].outcome
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary == flown[name].summary()
    numbers = finite_or_none(nested(flown[name].scores))
    assert {key: summary[key] for key in numbers} == numbers
    assert_same(rf.repeat(tmp_path / "flight.nc").scores, flown[name].scores)


def test_compare(flown: dict[str, rf.Flight], tmp_path: Path) -> None:
    """The table of `compare` has the numbers of the summaries, whatever was recorded."""
    files = []
    for name in SCENARIOS:
        (tmp_path / name).mkdir()
        files.append(rf.fly(scenario(name, 11 - SELDOM[name])).save(tmp_path / name / "flight.nc"))
    compared = rf.compare(files)
    loaded = compared.flights
    assert len(loaded) == len(files)
    for flight, wanted in zip(loaded.values(), flown.values(), strict=True):
        assert_same(flight.scores, wanted.scores)
        assert flight.outcome == wanted.outcome
    header, *lines = compared.rows()
    assert header == ["", *loaded]
    for column, name in enumerate(SCENARIOS, start=1):
        wanted = dict(rows(flown[name].summary()))
        for line in lines:
            assert line[column].removesuffix(f" {UNTIL_LOST}") == wanted.get(line[0], "-"), (name, line[0])
    assert "of a flight that was lost" in str(compared)


ENGINES = [name for name in ("simd", "numpy") if name != "simd" or have_simd()]


@functools.cache
def by_python(name: str) -> dict[str, Any]:
    return dict(rf.fly(scenario(name, 7), engine="python").scores)


@pytest.mark.parametrize("engine", ENGINES)
@every_flight
def test_engines_count_alike(name: str, engine: str) -> None:
    """Their numbers differ by rounding, what is counted by no more."""
    one, other = by_python(name), rf.fly(scenario(name, 7), engine=engine).scores
    assert list(one) == list(other)
    for key, value in one.items():
        if isinstance(value, float):
            np.testing.assert_allclose(other[key], value, rtol=1e-6, atol=1e-7, err_msg=key)
        else:
            assert other[key] == value, key


# ------------------------------------------------------------------------------------------------------- lost flights


def test_the_summary_of_a_lost_flight_says_so(flown: dict[str, rf.Flight]) -> None:
    lost, sound = flown["lost"].summary(), flown["faulty"].summary()
    end = f"{lost['end_time']:.4g} s"
    assert f"\n  lost: the numbers are those of the {end} before it tumbled\n" in str(lost)
    assert "lost: " not in str(sound)
    assert lost["survived"] is False
    assert lost["settle_time"] == dict.fromkeys(("x", "y", "z", "overall"))
    assert lost["late_position_rms"] is None
    assert lost["position_mse"]["x"] > 0.0


def test_numbers_of_a_lost_flight_are_marked_beside_those_of_others(flown: dict[str, rf.Flight]) -> None:
    _, *lines = comparison.comparison({name: flown[name].summary() for name in ("lost", "faulty")})
    assert len(lines) > 8
    for label, lost, sound in lines:
        marked = label != "outcome" and lost != "-"
        assert lost.endswith(f" {UNTIL_LOST}") == marked, label
        assert UNTIL_LOST not in sound, label


def test_an_interrupted_flight_says_so_too(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Its numbers are of what was flown: a fault that had not begun was not missed."""
    from rotorfault.base.progress import Bar
    from rotorfault.report import figures

    def stop(self: Bar, done: float, note: str = "") -> None:
        if done >= 500 * PERIOD:
            raise KeyboardInterrupt

    monkeypatch.setattr(Bar, "update", stop)
    flown = {"duration": 10.0, "fault": [{**FAULT, "time": 1.0}, {**FAULT, "rotor": 1, "time": 8.0}]}
    settings = {**SCENARIOS["faulty"], **flown}
    flight = rf.fly(scenario_from({"name": "stopped", **BASE, **settings}, "test"))
    assert flight.outcome == ("interrupted", pytest.approx(500 * PERIOD))
    assert flight.scores["outcome"] == "interrupted"
    summary = flight.summary()
    assert summary["survived"] is False
    assert [hit["rotor"] for hit in summary["detections"]] == [2]
    assert summary["late_position_rms"] is None
    assert "interrupted: the numbers are those of the 2.5 s that were flown" in str(summary)
    monkeypatch.undo()
    # All of its figures are drawn, and one of them written: writing is what takes time.
    assert set(figures.draw(flight.data)) > {"path", "position"}
    monkeypatch.setattr(figures, "FIGURES", {"path": figures.FIGURES["path"]})
    monkeypatch.setattr(figures, "detail", lambda drawn: None)
    loaded = rf.load(flight.write(tmp_path, with_figures=True)[0])
    assert loaded.summary() == summary
    assert (tmp_path / "path.png").exists()
