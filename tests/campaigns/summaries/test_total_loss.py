"""What a campaign of total losses writes: each number counted anew from the table of its flights."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest
from gates import needs_simd
from summary_studies import TOTAL_LOSS

import rotorfault
from rotorfault.analysis.least_height import least_height
from rotorfault.analysis.relaxed_hover import relaxed_hover
from rotorfault.autopilot.control import CONTROLLER
from rotorfault.base.errors import InputError
from rotorfault.campaigns import run
from rotorfault.campaigns.changes import changed
from rotorfault.campaigns.study import study_from

pytestmark = needs_simd

KEYS = {
    "vehicle", "rotors_lost", "controller", "sensors", "wind", "flights", "survived", "within_2m",
    "height_lost_median", "height_lost_p95",
}  # fmt: skip
VEHICLES = {"mueller-2014": "mueller-2014 (1,)", "paper": "paper (1, 2)"}


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return rotorfault.campaign(TOTAL_LOSS, tmp_path_factory.mktemp("total") / "campaign").folder


def rows_in(folder: Path) -> list[dict[str, Any]]:
    content: list[dict[str, Any]] = json.loads((folder / "total-loss.json").read_text())
    return content


def test_rows_have_their_keys_and_numbers(flown: Path) -> None:
    rows = rows_in(flown)
    assert len(rows) == 4  # two vehicles, two controllers; thrown flights, low ones and told ones stand elsewhere
    for row in rows:
        assert set(row) >= KEYS
        assert (row["sensors"], row["wind"]) == ("noisy", 5.0)
        assert row["rotors_lost"] == ([1] if row["vehicle"] == "mueller-2014" else [1, 2])
        assert {row["controller"] for row in rows} == {"roismc", "smc"}
        numbers = [row[key] for key in ("flights", "survived", "within_2m", "height_lost_median", "height_lost_p95")]
        assert all(isinstance(number, (int, float)) for number in numbers)


def test_each_number_is_that_of_the_table(flown: Path) -> None:
    table = pl.read_parquet(flown / "flights.parquet")
    square = sum(pl.col(f"position_error_end_{axis}") ** 2 for axis in "xyz")
    hover = table.filter(pl.col("diagnosis") == "luenberger", pl.col("start") == "hover", pl.col("height") == 6.0)
    label = {"roismc": "ours", "smc": "theirs"}
    for row in rows_in(flown):
        mine = hover.filter(pl.col("lost") == VEHICLES[row["vehicle"]], pl.col("variant") == label[row["controller"]])
        assert row["flights"] == mine.height == 3
        assert row["survived"] == mine["survived"].sum()
        assert row["within_2m"] == mine.filter("survived", square <= 4.0).height
        drop = mine["altitude_lost"].to_numpy()
        assert row["height_lost_median"] == pytest.approx(float(np.median(drop)))
        assert row["height_lost_p95"] == pytest.approx(float(np.percentile(drop, 95)))
        hovers = relaxed_hover(row["vehicle"], row["rotors_lost"])
        assert row["relaxed_hover"] == hovers.possible
        least = float(least_height(row["vehicle"], row["rotors_lost"]))
        assert row["least_height_upside_down"] == (pytest.approx(least) if np.isfinite(least) else None)


def test_cells_and_abort_heights_are_those_of_the_table(flown: Path) -> None:
    table = pl.read_parquet(flown / "flights.parquet")
    content = json.loads((flown / "total-loss-cells.json").read_text())
    assert sum(row["flights"] for row in content["cells"]) == table.height
    assert len(content["cells"]) == table.select("variant", "cell").unique().height
    for row in content["abort"]:
        mine = table.filter(
            pl.col("diagnosis") == row["diagnosis"], pl.col("start") == row["start"],
            pl.col("lost") == VEHICLES[row["vehicle"]],
        )  # fmt: skip
        alive = {h: mine.filter(pl.col("height") == h)["survived"].sum() for h in (0.5, 6.0)}
        none = 6.0 if not alive[0.5] and not alive[6.0] else 0.5 if not alive[0.5] else None
        assert row["none_survive_at"] == none


def test_what_is_drawn_in_a_case_is_drawn_there_alone(flown: Path) -> None:
    table = pl.read_parquet(flown / "flights.parquet")
    thrown = table.filter(pl.col("start") == "thrown")
    other = table.filter(pl.col("start") == "hover")
    assert other["start.body_rates.0"].is_nan().all()
    assert thrown["start.body_rates.0"].is_between(-10.0, 10.0).all()
    assert set(thrown["wind_speed"]) == {3.0}
    assert set(other["wind_speed"]) == {5.0}


def test_a_stopped_campaign_gives_the_same_files(
    flown: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("rotorfault.campaigns.rounds.FLIGHTS_IN_BLOCK", 6)
    whole, blocks = run.fly_block, []

    def stop_after_two(*given: Any, **named: Any) -> Any:
        if len(blocks) == 2:
            raise KeyboardInterrupt
        blocks.append(given)
        return whole(*given, **named)

    monkeypatch.setattr(run, "fly_block", stop_after_two)
    with pytest.raises(KeyboardInterrupt):
        rotorfault.campaign(TOTAL_LOSS, tmp_path / "campaign")
    monkeypatch.setattr(run, "fly_block", whole)
    resumed = rotorfault.campaign(TOTAL_LOSS, tmp_path / "campaign", resume=True)
    for name in ("total-loss.json", "total-loss-cells.json"):
        assert (resumed.folder / name).read_bytes() == (flown / name).read_bytes()
        (resumed.folder / name).unlink()
    resumed.write_summary()
    assert (resumed.folder / "total-loss.json").read_bytes() == (flown / "total-loss.json").read_bytes()


def test_a_flight_of_a_case_is_flown_again(flown: Path) -> None:
    campaign = rotorfault.Campaign(flown)
    table = campaign.table().to_polars()
    row = table.filter(pl.col("start") == "thrown", pl.col("lost") == "paper (1, 2)").row(0, named=True)
    flight = campaign.replay(row["id"])
    assert campaign.differences(row["id"], flight) == []
    assert flight.scenario is not None
    assert flight.scenario.vehicle.name == "paper"


def test_a_quick_run_keeps_what_the_study_says(tmp_path: Path) -> None:
    done = rotorfault.campaign(TOTAL_LOSS, tmp_path / "campaign", quick=True)
    table = done.table().to_polars()
    assert (table.height, set(table["height"]), set(table["start"])) == (8, {6.0}, {"hover"})
    assert done.study.name == "few-losses-quick"


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"summary": "totals"}, "unknown summary 'totals'"),
        ({"quick": {"keep": {"start": ["flying"]}}}, "unknown start 'flying'"),
        ({"success": ["quiet"]}, "unknown grade 'quiet'"),
    ],
)
def test_what_cannot_be_summed_up_is_refused(change: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        study_from(TOTAL_LOSS | change, "test")


def test_a_vehicle_of_cases_is_not_replaced(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="the study varies it, by its axis or draw 'lost'"):
        rotorfault.campaign(TOTAL_LOSS, tmp_path / "campaign", vehicle="hummingbird")


def test_a_law_takes_no_preset_of_a_case_that_it_has_not_got() -> None:
    study = changed(study_from(TOTAL_LOSS, "test"), controllers=["sdre"])
    assert study.scenario_of(0)[CONTROLLER].preset == "tuned"
    assert study.scenario_of(0)[CONTROLLER].kind == "sdre"
    kept = changed(study_from(TOTAL_LOSS, "test"), controllers=["smc"])
    assert kept.scenario_of(0)[CONTROLLER].preset == "quiet"
