"""What a campaign that judges detectors writes: each number counted anew from the table of its flights."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import polars as pl
import pytest
from gates import needs_simd
from scipy.optimize import brentq
from scipy.stats import poisson
from summary_studies import DETECTION

import rotorfault
from rotorfault.campaigns.summaries.detection import garwood

KEYS = {
    "vehicle",
    "sensors",
    "detector",
    "loss",
    "flights",
    "right_rotor",
    "missed",
    "median_delay_ms",
    "p95_delay_ms",
}


@pytest.mark.parametrize("count", [0, 1, 7])
def test_the_interval_of_a_rate_is_where_its_tails_are(count: int) -> None:
    low, high = garwood(count, 2.0)
    upper = brentq(lambda mean: poisson.cdf(count, mean) - 0.025, 1e-9, 100.0)
    assert high == pytest.approx(upper / 2.0)
    lower = brentq(lambda mean: poisson.sf(count - 1, mean) - 0.025, 1e-9, 100.0) if count else 0.0
    assert low == pytest.approx(lower / 2.0)


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return rotorfault.campaign(DETECTION, tmp_path_factory.mktemp("detection") / "campaign").folder


def content_of(folder: Path) -> dict[str, Any]:
    content: dict[str, Any] = json.loads((folder / "detection.json").read_text())
    return content


@needs_simd
def test_false_alarms_are_those_of_healthy_flights(flown: Path) -> None:
    table = pl.read_parquet(flown / "flights.parquet")
    alarms = content_of(flown)["false_alarms"]
    assert {"hours", "count", "per_hour", "low", "high"} <= set(alarms)
    mine = table.filter(pl.col("loss") == 0.0, pl.col("variant") == "as it is")
    hours = mine["end_time"].sum() / 3600.0
    assert (alarms["count"], alarms["hours"]) == (mine["false_alarms"].sum(), pytest.approx(hours))
    assert alarms["low"] <= alarms["per_hour"] <= alarms["high"]
    # An eager detector is wrong at times, so that the count is not always that of nothing.
    assert table.filter(pl.col("loss") == 0.0, pl.col("variant") == "eager")["false_alarms"].sum() > 0


@needs_simd
def test_each_number_of_losses_is_that_of_the_table(flown: Path) -> None:
    table = pl.read_parquet(flown / "flights.parquet")
    rows = content_of(flown)["losses"]
    assert {(row["variant"], row["loss"]) for row in rows} == {
        (variant, loss) for variant in ("as it is", "eager") for loss in (0.06, 0.4)
    }
    for row in rows:
        assert set(row) >= KEYS
        mine = table.filter(pl.col("loss") == row["loss"], pl.col("variant") == row["variant"])
        assert (mine["struck"] == mine["rotor_of_four"].cast(int)).all()
        assert row["flights"] == mine.height
        quiet = mine.filter(pl.col("false_alarms") == 0)
        right = quiet.filter(pl.col("flagged_first") == pl.col("struck"))
        assert row["right_rotor"] == right.height
        assert row["missed"] == quiet.filter(pl.col("flagged_first") == 0).height
        if right.height:
            assert row["median_delay_ms"] == pytest.approx(1e3 * right["delay"].median())
            assert row["p95_delay_ms"] == pytest.approx(1e3 * right["delay"].quantile(0.95, "linear"))
        else:
            assert row["median_delay_ms"] is None


@needs_simd
def test_delays_and_rotors_are_those_of_the_flights_themselves(flown: Path) -> None:
    campaign = rotorfault.Campaign(flown)
    table = campaign.table().to_polars()
    row = table.filter(pl.col("grade") == "right rotor").row(0, named=True)
    flight = campaign.replay(row["id"])
    (found,) = [one for one in flight.summary()["detections"] if one["loss_true"] > 0.0]
    assert found["rotor"] == row["struck"] == row["flagged_first"]
    assert found["delay"] == pytest.approx(row["delay"])
    assert found["true_time"] == pytest.approx(row["onset"])


@needs_simd
def test_every_fault_is_in_the_confusion_matrix(flown: Path) -> None:
    table = pl.read_parquet(flown / "flights.parquet")
    for matrix in content_of(flown)["confusion"]:
        mine = table.filter(pl.col("variant") == matrix["variant"], pl.col("struck") > 0)
        assert sum(map(sum, matrix["counts"])) == mine.height
        for rotor, row in enumerate(matrix["counts"], start=1):
            first = mine.filter(pl.col("struck") == rotor)["flagged_first"].to_list()
            assert row == [first.count(named) for named in matrix["named"]]


@needs_simd
def test_grades_say_what_the_numbers_say(flown: Path) -> None:
    table = pl.read_parquet(flown / "flights.parquet")
    early = table.filter(pl.col("false_alarms") > 0)
    assert set(early["grade"]) <= {"false alarm"}
    assert set(table.filter(pl.col("loss") == 0.0)["grade"]) <= {"quiet", "false alarm", "lost"}
    right = table.filter(pl.col("grade") == "right rotor")
    assert right.height > 0
    assert (right["flagged_others"] == 0).all()
    assert set(table.filter("success")["grade"]) <= {"right rotor", "quiet"}
