"""The diagnosis of made-up logs, whose rotors, pushes and noise are known."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from made_up_logs import flown, log_of, write_csv

import rotorfault as rf
from rotorfault.base.errors import InputError
from rotorfault.logs.baseline import learned, read_baseline, write_baseline
from rotorfault.logs.diagnose import diagnosis_of
from rotorfault.logs.log import Log
from rotorfault.logs.recorded import log_of as recorded
from rotorfault.logs.sentences import wind_words
from rotorfault.logs.trim import Trim
from rotorfault.logs.verdict import LogDiagnosis

UNEVEN = (0.12, -0.1, 0.03, -0.05)


def healthy(count: int, seconds: float = 12.0) -> list[Log]:
    """Flights of one uneven vehicle, whose trim varies by 2 % from one to the next."""
    rng = np.random.default_rng(5)
    return [
        log_of(flown(seed=k, seconds=seconds, imbalance=tuple(np.array(UNEVEN) + 0.01 * rng.normal(size=4))))
        for k in range(count)
    ]


@pytest.mark.parametrize(("rotor", "loss"), [(0, 0.15), (1, 0.3), (2, 0.6), (3, 1.0)])
def test_a_sudden_loss_is_named_with_its_rotor_and_time(rotor: int, loss: float) -> None:
    found = diagnosis_of(log_of(flown(seed=rotor, rotor=rotor, loss=loss, seconds=26.0)))
    first = found.probable
    assert (first.cause, first.rotor) == ("rotor loss", rotor + 1)
    assert first.probability > 0.95
    assert first.onset == pytest.approx(30.0, abs=0.1)
    assert found.alarm is not None
    assert found.alarm - 30.0 < (0.5 if loss > 0.5 else 2.0)
    assert first.loss is not None
    if loss < 0.5:  # the vehicle flies on, and its commands say how much is gone
        assert first.loss == pytest.approx(loss, abs=0.04)


@pytest.mark.parametrize("seed", range(4))
def test_a_healthy_flight_is_not_blamed(seed: int) -> None:
    found = diagnosis_of(log_of(flown(seed=seed, imbalance=UNEVEN)))
    assert found.probable.cause == "healthy"
    assert all(scan.alarm is None for scan in found.scans)


@pytest.mark.parametrize("push", [(0.1, -0.1, 0.0), (0.0, 0.15, 0.02)])
def test_a_push_from_outside_is_laid_to_no_rotor(push: tuple[float, float, float]) -> None:
    found = diagnosis_of(log_of(flown(seed=3, push=push)))
    assert found.rotor is None


def test_a_lasting_loss_is_seen_against_the_vehicles_own_baseline() -> None:
    baseline = learned(healthy(5), [""] * 5)
    weak = log_of(flown(seed=9, seconds=12.0, imbalance=UNEVEN, rotor=3, loss=0.25, onset=-1.0))
    lost = diagnosis_of(weak, baseline)
    assert (lost.probable.cause, lost.rotor) == ("rotor loss", 4)
    assert lost.probable.onset is None
    assert lost.probable.interval is not None
    low, high = lost.probable.interval
    assert low < 0.25 < high
    sound = diagnosis_of(log_of(flown(seed=10, seconds=12.0, imbalance=UNEVEN)), baseline)
    assert sound.probable.cause == "healthy"
    # Without the baseline the vehicle's own unevenness hides it, and the limits say so.
    alone = diagnosis_of(weak)
    assert alone.probable.cause == "healthy"
    assert any("no baseline" in limit for limit in alone.limits)


def test_weight_and_a_shifted_load_are_not_rotors() -> None:
    baseline = learned(healthy(5), [""] * 5)
    log = healthy(1)[0]
    heavier = dict(log.series)
    heavier["command"] = log.series["command"]._replace(values=np.clip(1.2 * log.series["command"].values, 0.0, 1.0))
    both = ("added weight", "battery sag")  # without a voltage nothing tells them apart
    assert diagnosis_of(Log("a", "made up", log.layout, heavier), baseline).probable.cause in both
    tilted = dict(log.series)
    shift = 1.0 + np.array([0.15, -0.15, 0.15, -0.15])  # to the front
    tilted["command"] = log.series["command"]._replace(values=log.series["command"].values * shift)
    assert diagnosis_of(Log("a", "made up", log.layout, tilted), baseline).probable.cause == "centre of mass shifted"


def test_probabilities_are_one_together_and_json_has_what_is_promised(tmp_path: Path) -> None:
    path = write_csv(flown(seed=2, rotor=1, loss=0.4, seconds=24.0), tmp_path / "a.csv")
    found = rf.diagnose(path)
    assert isinstance(found, LogDiagnosis)
    tables = json.loads(json.dumps(found.json(), allow_nan=False))
    assert {"causes", "verdict", "limits", "read"} <= set(tables)
    assert set(tables["read"]) == {"lost", "reason"}
    keys = {"cause", "rotor", "loss", "onset", "probability", "evidence"}
    assert all(keys <= set(cause) for cause in tables["causes"])
    assert sum(cause["probability"] for cause in tables["causes"]) == pytest.approx(1.0, abs=1e-4)
    ranked = [cause["probability"] for cause in tables["causes"]]
    assert ranked == sorted(ranked, reverse=True)
    assert "rotor 2 (rear left) lost about" in tables["verdict"]


def test_slow_logs_and_logs_without_flight_say_what_they_lack() -> None:
    log = log_of(flown(seed=1, seconds=12.0))
    slow = {name: one._replace(time=one.time[::100], values=one.values[::100]) for name, one in log.series.items()}
    limits = diagnosis_of(Log("slow", "made up", log.layout, slow)).limits
    assert any("too slowly" in limit and "20 Hz" in limit for limit in limits)
    idle = {**log.series, "command": log.series["command"]._replace(values=0.0 * log.series["command"].values)}
    found = diagnosis_of(Log("idle", "made up", log.layout, idle))
    assert "cannot tell" in found.verdict
    assert found.rotor is None


def test_a_baseline_is_the_same_from_its_file(tmp_path: Path) -> None:
    made = learned(healthy(3), ["a", "b", "c"])
    read = read_baseline(write_baseline(made, tmp_path / "b.json"))
    log = log_of(flown(seed=9, seconds=12.0, imbalance=UNEVEN, rotor=0, loss=0.3, onset=-1.0))
    assert diagnosis_of(log, read).json() == diagnosis_of(log, made).json()
    assert [one.sha256 for one in read.flights] == ["a", "b", "c"]
    (tmp_path / "b.json").write_text('{"format": "rotorfault baseline 1"}')
    with pytest.raises(InputError, match="is no baseline"):
        read_baseline(tmp_path / "b.json")


def test_a_sudden_loss_raises_no_alarm_in_healthy_flights() -> None:
    """Minutes of noise with the memory of gusts; once in ten hours is what the threshold accepts."""
    alarms = [
        scan.alarm
        for seed in range(8)
        for scan in diagnosis_of(log_of(flown(seed=100 + seed, seconds=40.0, noise=0.03))).scans
    ]
    assert len(alarms) == 8
    assert alarms == [None] * 8


@pytest.mark.filterwarnings("ignore")
def test_a_loss_after_which_yaw_cannot_be_held_is_laid_to_its_rotor() -> None:
    settings = {
        "vehicle": "x500", "controller.preset": "midsize", "duration": 14.0, "record_period": 0.01,
        "fault": [{"kind": "step", "rotor": 3, "time": 10.0, "loss": 0.5}], "sensors.kind": "noisy",
    }  # fmt: skip
    flight = rf.fly("hover-fault", settings=settings, seed=77)
    assert abs(float(flight.records()["body_rates"].values[-1, 2])) > 3.0  # rad/s: it spins
    found = diagnosis_of(recorded(flight.records(), "spins"))
    assert (found.probable.cause, found.rotor) == ("rotor loss", 3)
    assert found.probable.probability > 0.95
    assert found.probable.onset == pytest.approx(10.0, abs=0.1)
    assert found.probable.loss == pytest.approx(0.5, abs=0.05)


def test_the_wind_that_a_vehicle_leans_against_has_a_speed_and_a_side() -> None:
    lean = np.radians(8.0)
    trim = Trim(np.zeros(4), np.zeros(4), 10, 15.0, np.array([0.0, np.sin(lean)]))
    assert wind_words(trim) == " of 6 m/s (3 to 13) from the left"
    assert wind_words(trim._replace(tilt=-trim.tilt)).endswith("from the right")
    assert wind_words(trim._replace(tilt=trim.tilt[::-1])).endswith("from the front")
    assert "0.5 deg only" in wind_words(trim._replace(tilt=np.array([np.radians(0.5), 0.0])))
    assert wind_words(trim._replace(tilt=np.full(2, np.nan))) == ""


def test_a_log_is_not_compared_with_itself(tmp_path: Path) -> None:
    paths = [write_csv(flown(seed=k, seconds=12.0, imbalance=UNEVEN), tmp_path / f"{k}.csv") for k in range(3)]
    weak = write_csv(flown(seed=9, seconds=12.0, imbalance=UNEVEN, rotor=3, loss=0.3, onset=-1.0), tmp_path / "w.csv")
    found = rf.diagnose(weak, baseline=[*paths, weak])
    assert isinstance(found, LogDiagnosis)
    assert found.rotor == 4
    assert any("compared with the others" in limit for limit in found.limits)
    alone = rf.diagnose(weak, baseline=weak)
    assert isinstance(alone, LogDiagnosis)
    assert any("itself the baseline" in limit for limit in alone.limits)
