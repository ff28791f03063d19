"""What a campaign that judges detectors writes: each number counted anew from the table of its flights."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest
from gates import needs_simd
from scipy.optimize import brentq
from scipy.stats import binom, poisson
from summary_studies import DETECTION

import rotorfault
from rotorfault.campaigns.axes import BEYOND, columns
from rotorfault.campaigns.load import load_study
from rotorfault.campaigns.study import study_from
from rotorfault.campaigns.summaries.detection import detection, garwood
from rotorfault.campaigns.summaries.parts import Curves

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


@needs_simd
def test_a_row_counts_the_flights_found_within_a_time(flown: Path) -> None:
    table = pl.read_parquet(flown / "flights.parquet")
    for row in content_of(flown)["losses"]:
        mine = table.filter(
            pl.col("loss") == row["loss"],
            pl.col("variant") == row["variant"],
            pl.col("grade").is_in(["right rotor", "others too"]),
        )
        within = {f"{ms} ms": mine.filter(pl.col("delay") <= ms / 1000.0).height for ms in (45, 130, 300, 2000)}
        assert row["within"] == within


@needs_simd
def test_isolation_is_predicted_by_what_is_told_apart_and_measured_by_the_table(flown: Path) -> None:
    table = pl.read_parquet(flown / "flights.parquet")
    told = {one.rotor: one for one in rotorfault.told_apart("hummingbird").singles}
    rows = content_of(flown)["isolation"]
    assert {row["rotor"] for row in rows} == set(told)
    for row in rows:
        mine = table.filter(pl.col("variant") == "as it is", pl.col("struck") == row["rotor"])
        named = mine["flagged_first"].to_list()
        assert row["flights"] == mine.height
        assert row["measured"] == pytest.approx([named.count(k) / mine.height for k in range(5)])
        found = mine.filter(pl.col("loss") >= told[row["rotor"]].least_loss).height
        assert row["predicted"][row["rotor"]] == pytest.approx(found / mine.height)
        assert sum(row["predicted"]) == pytest.approx(1.0)


@needs_simd
def test_a_wanted_rate_stands_beside_the_one_that_was_had(flown: Path) -> None:
    table = pl.read_parquet(flown / "flights.parquet").to_arrow()
    healthy = pl.from_arrow(table).filter(pl.col("loss") == 0.0, pl.col("variant") == "eager")  # type: ignore[union-attr]
    had = healthy["false_alarms"].sum() / (healthy["end_time"].sum() / 3600.0)
    for wanted, said in ((0.01, "more"), (3600.0, "no more" if had < 1000.0 else "within the interval")):
        settings = {"diagnosis": {"kind": "glr", "false_alarms": wanted}}
        variants = [{"label": label, "settings": settings} for label in ("as it is", "eager")]
        study = study_from(DETECTION | {"variant": variants}, "study")
        rows = detection(study, table).files["detection.json"]["wanted"]
        row = next(one for one in rows if one["variant"] == "eager")
        assert (row["wanted"], row["per_hour"], row["so"]) == (wanted, pytest.approx(had), said)


def test_a_loss_that_comes_and_goes_takes_the_place_of_the_one_that_lasts() -> None:
    values = {
        "loss": np.array([0.25, 0.25, 0.0]),
        "ramp": np.zeros(3),
        "flicker": np.array([0.5, 0.0, 0.5]),
        "rotor_of_four": np.array([2.0, 2.0, 2.0]),
        "onset": np.array([1.5, 1.5, 1.5]),
    }
    found = columns(values)
    for rotor in range(4):
        lost = [0.25, 0.25, 0.0] if rotor == 1 else [0.0, 0.0, 0.0]
        assert found[f"fault.{rotor}.loss"].tolist() == found[f"fault.{rotor + 4}.loss"].tolist() == lost
        lasts, comes = found[f"fault.{rotor}.start"], found[f"fault.{rotor + 4}.start"]
        assert (lasts < BEYOND).tolist() == [False, True, False]
        assert (comes < BEYOND).tolist() == [True, False, False]
        assert (found[f"fault.{rotor + 4}.end"] > comes).all()
    assert found["fault.4.period"][0] == 0.5


def test_a_loss_cannot_come_and_go_without_a_rotor() -> None:
    with pytest.raises(rotorfault.InputError, match="'flicker' needs 'onset' and a rotor"):
        columns({"loss": np.array([0.2]), "flicker": np.array([0.5]), "onset": np.array([1.0])})


@needs_simd
def test_each_detector_is_drawn_by_how_soon_it_names_the_right_rotor(flown: Path) -> None:
    table = pl.read_parquet(flown / "flights.parquet")
    summary = detection(study_from(DETECTION, "study"), table.to_arrow())
    figure = next(one for one in summary.figures if one.name == "detectors")
    assert isinstance(figure, Curves)
    assert set(figure.lines) == {"as it is", "eager"}
    for variant, (times, share, low, high) in figure.lines.items():
        mine = table.filter(pl.col("variant") == variant, pl.col("loss") > 0.0)
        named = mine.filter(pl.col("grade").is_in(["right rotor", "others too"]))
        soon = [(named["delay"] <= 1e-3 * time).sum() / mine.height for time in times]
        assert share == pytest.approx(soon)
        assert (low <= share).all()
        assert (share <= high).all()
    # Of two the one with the lower threshold is sooner somewhere, so that the lines are not one.
    assert (figure.lines["as it is"][1] != figure.lines["eager"][1]).any()


@needs_simd
def test_two_detectors_are_compared_on_the_same_flights(flown: Path) -> None:
    table = pl.read_parquet(flown / "flights.parquet").with_columns(
        right=pl.col("grade").is_in(["right rotor", "others too", "quiet"])
        | ((pl.col("loss") == 0.0) & (pl.col("false_alarms") == 0))
    )
    first, second = (table.filter(pl.col("variant") == one) for one in ("as it is", "eager"))
    both = first.join(second, on=["cell", "number"], suffix="_other")
    assert (both["seed"] == both["seed_other"]).all()
    rows = content_of(flown)["paired"]
    assert [(row["first"], row["second"]) for row in rows] == [("as it is", "eager")] * 3
    unlike = 0
    for row in rows:
        loss = 0.0 if row["fault"] == "healthy" else float(row["fault"])
        mine = both.filter(pl.col("loss") == loss)
        one, other = mine["right"], mine["right_other"]
        assert row["flights"] == mine.height
        counts = ((one & other).sum(), (one & ~other).sum(), (~one & other).sum(), (~one & ~other).sum())
        assert counts == tuple(row[name] for name in ("both", "first_only", "second_only", "neither"))
        least, most = sorted((row["first_only"], row["second_only"]))
        unlike += least + most
        assert row["p"] == pytest.approx(min(1.0, 2.0 * binom.cdf(least, least + most, 0.5)))
    assert unlike > 0


@needs_simd
def test_with_and_without_speeds_are_two_lines_of_the_roc(flown: Path) -> None:
    table = pl.read_parquet(flown / "flights.parquet").to_arrow()
    off = {"diagnosis": {"kind": "glr"}, "sensors": {"kind": "mocap"}}
    variants = [
        {"label": "as it is", "settings": off},
        {"label": "eager", "settings": off | {"sensors": {"kind": "mocap", "rotor_speeds": {"on": True}}}},
    ]
    content = detection(study_from(DETECTION | {"variant": variants}, "study"), table).files["detection.json"]
    assert {row["variant"]: row["rotor_speeds"] for row in content["roc"]} == {"as it is": False, "eager": True}


@needs_simd
def test_with_and_without_speeds_stand_beside_each_other_at_one_threshold(flown: Path) -> None:
    table = pl.read_parquet(flown / "flights.parquet").filter(pl.col("variant") == "as it is")
    later = {"kind": "luenberger", "decision": {"threshold": 0.35, "clear_threshold": 0.2}}
    speeds = {"sensors": {"kind": "mocap", "rotor_speeds": {"on": True}}}
    off = {"diagnosis": {"kind": "luenberger"}, "sensors": {"kind": "mocap"}}
    settings = {
        "off": off,
        "on": off | speeds,
        "later": off | {"diagnosis": later},
        "later, on": off | speeds | {"diagnosis": later},
    }
    variants = [{"label": label, "settings": one} for label, one in settings.items()]
    of_all = pl.concat([table.with_columns(variant=pl.lit(label)) for label in settings])
    page = detection(study_from(DETECTION | {"variant": variants}, "study"), of_all.to_arrow()).tables
    (beside,) = [one for one in page if one.title == "Detectors on the same flights"]
    pairs = {(row[1], row[2]) for row in beside.rows}
    assert pairs == {("off", "on"), ("off", "later"), ("off", "later, on"), ("later", "later, on")}


@needs_simd
def test_isolation_of_a_detector_that_is_foreseen_is_its_own(flown: Path) -> None:
    """The same table read as if `glr` had flown: predicted shares follow its windows, what was measured stays."""
    table = pl.read_parquet(flown / "flights.parquet").to_arrow()
    settings = {"diagnosis": {"kind": "glr", "least": 0.05}}
    variants = [{"label": label, "settings": settings} for label in ("as it is", "eager")]
    rows = detection(study_from(DETECTION | {"variant": variants}, "study"), table).files["detection.json"][
        "isolation"
    ]
    assert [row["measured"] for row in rows] == [row["measured"] for row in content_of(flown)["isolation"]]
    for row in rows:
        mine = pl.from_arrow(table).filter(pl.col("variant") == "as it is", pl.col("struck") == row["rotor"])  # type: ignore[union-attr]
        large = mine.filter(pl.col("loss") == 0.4).height / mine.height
        # A loss of 0.4 is always named; one of 0.06 seldom, by who counts 0.05 for sound.
        assert large - 1e-9 <= row["predicted"][row["rotor"]] <= large + 0.5 * (1.0 - large)
        assert 1.0 <= row["predicted_among"] < 1.5


def test_frames_of_all_numbers_of_rotors_are_flown() -> None:
    study = load_study("detection-frames")
    first = {axis.name: axis.case[0] for axis in study.case_axes}
    vehicles = next(axis.case for axis in study.case_axes if axis.name == "vehicle")
    scenarios = [study.scenario_of(0, tuple({**first, "vehicle": one}.values())) for one in vehicles]
    assert {len(one.vehicle.rotor) for one in scenarios} == {4, 6, 8}
    assert {one.estimator.kind for one in scenarios} == {"eskf"}
    places = [{(rotor.x.value, rotor.y.value) for rotor in one.vehicle.rotor} for one in scenarios]
    assert sum(len(some) < len(one.vehicle.rotor) for some, one in zip(places, scenarios, strict=True)) == 2


@pytest.mark.parametrize("name", ["detection", "detection-rate"])
def test_all_vehicles_meet_all_manoeuvres_with_real_sensors(name: str) -> None:
    study = load_study(name)
    first = {axis.name: axis.case[0] for axis in study.case_axes}
    vehicles = next(axis.case for axis in study.case_axes if axis.name == "vehicle")
    sets = set()
    for vehicle in vehicles:
        scenario = study.scenario_of(0, tuple({**first, "vehicle": vehicle}.values()))
        sets.add((str(scenario.vehicle.name), scenario.sensors.kind, scenario.estimator.kind))
    assert {one[1] for one in sets} == {"mocap", "gps-consumer", "crazyflie"}
    assert {one[2] for one in sets} == {"eskf"}
    assert len(sets) == 6


@pytest.mark.parametrize("name", ["detection", "detection-rate", "detection-speeds", "detection-frames"])
def test_the_air_turns_every_vehicle(name: str) -> None:
    """Gusts that differ over it, drag beside its centre of mass, and a moment as of drag above its rotors."""
    study = load_study(name)
    first = {axis.name: axis.case[0] for axis in study.case_axes}
    for vehicle in next(axis.case for axis in study.case_axes if axis.name == "vehicle"):
        scenario = study.scenario_of(0, tuple({**first, "vehicle": vehicle}.values()))
        assert scenario.wind.settings.gradients
        drag = scenario.vehicle.air.number("rotor_drag")
        drawn = next(draw for draw in vehicle.draw if draw.name == "vehicle.air.flapping.value")
        lever = 0.01 if scenario.vehicle.name == "crazyflie-2.1" else 0.03
        assert drawn.uniform == pytest.approx((0.0, lever * drag), rel=0.01)


def test_each_detector_flies_with_speeds_and_without() -> None:
    study = load_study("detection-speeds")
    first = tuple(axis.case[0] for axis in study.case_axes)
    flown = [study.scenario_of(variant, first) for variant in range(len(study.variant))]
    told = [(str(one.diagnosis.settings), one.sensors.settings.rotor_speeds.on) for one in flown]
    assert sorted(told) == sorted((kind, on) for kind in {one[0] for one in told} for on in (False, True))
    # Two thresholds of each of the four: a line of the ROC is more than a point.
    kinds = [one.diagnosis.kind for one in flown]
    assert len(set(kinds)) == 4
    assert {kinds.count(kind) for kind in kinds} == {4}


@needs_simd
def test_its_page_does_not_ask_whether_hover_can_be_controlled(flown: Path) -> None:
    """That bounds what flights survive, and takes minutes where a study has many cases."""
    done = rotorfault.Campaign(flown)
    assert all(variant.possible is None for variant in done.maps().variants)
    done.report()
    page = (flown / "report.html").read_text(encoding="utf-8")
    assert "Faults found" in page
    assert "hover controlled" not in page
    assert "hover can be controlled" not in page
