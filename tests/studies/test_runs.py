"""Runs of a study: flown once, found again, flown anew when anything that matters has changed; the paper's cases."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from gates import needs_simd
from study_runs import ONE, SHORT, TWO, count

import rotorfault as rf
from rotorfault.studies.paper import study
from rotorfault.studies.paper.cases import CASES, CONTROLLERS, main_runs, run_of
from rotorfault.studies.pool import fly_missing
from rotorfault.studies.runs import Run, RunStore


def test_a_run_is_flown_once(tmp_path: Path) -> None:
    first = RunStore(tmp_path, count)
    result = first.get(ONE)
    assert (first.flown, result.extra) == (1, {"records": 5})
    again = RunStore(tmp_path, count)
    found = again.get(ONE)
    assert again.flown == 0
    assert found == result
    assert np.array_equal(found.data()["position"], result.data()["position"])
    assert sorted(path.name for path in (tmp_path / "flights").iterdir()) == ["one.nc"]


def test_summary_only_runs_keep_no_flight(tmp_path: Path) -> None:
    result = RunStore(tmp_path).get(TWO)
    assert not list((tmp_path / "flights").iterdir())
    with pytest.raises(rf.InputError, match="keeps no flight"):
        result.data()


@pytest.mark.parametrize("damage", ["overrides", "label", "record", "number", "flight", "signal"])
def test_what_changed_or_is_damaged_is_flown_anew(damage: str, tmp_path: Path) -> None:
    RunStore(tmp_path).get(ONE)
    run, store = ONE, RunStore(tmp_path)
    if damage == "overrides":
        run = ONE._replace(overrides=(*SHORT, ("fault.0.loss", 0.3)))
    elif damage == "label":
        store = RunStore(tmp_path, None, "2")
    elif damage == "record":
        (tmp_path / "runs" / "one.json").write_text('{"digest": "half')
    elif damage == "number":
        record = tmp_path / "runs" / "one.json"
        record.write_text(record.read_text().replace('"cost": ', '"cost": 1'))
    elif damage == "signal":
        flight = tmp_path / "flights" / "one.nc"
        flight.write_bytes(flight.read_bytes()[:-1] + b"x")
    else:
        (tmp_path / "flights" / "one.nc").unlink()
    assert store.find(run) is None
    store.get(run)
    assert store.flown == 1
    assert store.find(run) is not None


@pytest.mark.parametrize("workers", [1, 2])
def test_missing_runs_are_flown_on_any_number_of_processes(workers: int, tmp_path: Path) -> None:
    store = RunStore(tmp_path, count)
    assert fly_missing(store, [ONE, TWO, ONE], "flying", workers) == 2
    assert fly_missing(store, [ONE, TWO], "flying", workers) == 0
    found, alone = RunStore(tmp_path, count), RunStore(tmp_path / "alone", count)
    for run in (ONE, TWO):
        assert found.get(run).summary == alone.get(run).summary
    assert found.flown == 0


def test_an_interrupted_study_goes_on_where_it_was(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    store, flown = RunStore(tmp_path), []
    right = RunStore.get

    def stop_after_one(self: RunStore, run: Run) -> Any:
        if flown:
            raise KeyboardInterrupt
        flown.append(run.id)
        return right(self, run)

    monkeypatch.setattr(RunStore, "get", stop_after_one)
    with pytest.raises(KeyboardInterrupt):
        fly_missing(store, [ONE, TWO], "flying", 1)
    monkeypatch.setattr(RunStore, "get", right)
    left = [run.id for run in (ONE, TWO) if store.find(run) is None]
    assert len(left) == 1
    assert left[0] not in flown
    assert fly_missing(store, [ONE, TWO], "flying", 1) == 1


def test_command_of_a_run_is_what_the_command_line_takes() -> None:
    run = run_of("square", "smc", period=0.1, plant="rigid_body", preset="matched", wind__scale=0.5)
    assert run.command == (
        "rotorfault fly paper-square --controller smc --preset matched --set 'period=0.1' --set 'plant=rigid_body' "
        "--set 'wind.scale=0.5'"
    )


def test_main_runs_are_every_case_controller_period_and_plant() -> None:
    runs = main_runs()
    assert len({run.id for run in runs}) == len(runs) == 2 * 2 * (2 + 2 + 3)
    assert {run.scenario for run in runs} == {case.scenario for case in CASES.values()}


def test_one_case_and_controller_alone() -> None:
    runs = study.selected("sinusoid", "roismc")
    assert [run.id for run in runs] == [
        "sinusoid-roismc-1ms",
        "sinusoid-roismc-10ms",
        "sinusoid-roismc-1ms-rigid",
        "sinusoid-roismc-10ms-rigid",
    ]
    with pytest.raises(rf.InputError, match="did you mean 'sinusoid'"):
        study.selected("sinusiod", None)
    with pytest.raises(rf.InputError, match="roismc"):
        study.selected(None, "sdre")


@needs_simd  # up to 120,000 steps take minutes without it
@pytest.mark.parametrize("controller", CONTROLLERS)
@pytest.mark.parametrize("case", list(CASES))
def test_every_case_survives_with_both_faults_at_1_ms(case: str, controller: str, tmp_path: Path) -> None:
    summary = RunStore(tmp_path).get(run_of(case, controller)).summary
    assert summary["survived"] is True
    assert [hit["rotor"] for hit in summary["detections"]] == [1, 3]
    assert summary["false_alarms"] == 0
    assert json.dumps(summary, allow_nan=False)
