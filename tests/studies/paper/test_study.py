"""The paper's study: measures, verdicts, tables; crashes are told and never raise; commands can be typed."""

from __future__ import annotations

import copy
import csv
import json
import shlex
from pathlib import Path
from typing import Any

import pytest
import typer
from figure_checks import check_nothing_covered
from matplotlib.text import Text

import rotorfault as rf
from rotorfault.autopilot.control.riccati import position_gain
from rotorfault.autopilot.control.sdre import Weights
from rotorfault.base.errors import InputError
from rotorfault.cli.main import app
from rotorfault.flight.fly import prepare
from rotorfault.results.outcome import finite_or_none
from rotorfault.scenario.library import load_scenario
from rotorfault.scenario.overrides import parse_overrides
from rotorfault.studies.paper import ablation, claims, judges, sensitivity, table1, wind_sweep
from rotorfault.studies.paper.cases import run_of
from rotorfault.studies.paper.measures import measure
from rotorfault.studies.paper.variations import variations
from rotorfault.studies.paper.verdicts import (
    CONFIRMED,
    LOST_IS_WORSE,
    NOT_CONFIRMED,
    Reading,
    lower,
    verdict,
)
from rotorfault.studies.runs import Result, Run

TYPES = {"set-point": "settled", "sinusoid": "tracked", "square": "offset"}


# ------------------------------------------------------------------------------------------------- verdicts by rules


@pytest.fixture(scope="module")
def template() -> dict[str, Result]:
    """A true flight of each case and law, short, whose numbers the tests replace."""
    found = {}
    for case, kind in TYPES.items():
        for law in ("smc", "roismc"):
            flight = rf.fly(f"paper-{case}", law, settings={"duration": 2.5, "record_period": 0.01})
            summary = dict(flight.summary()) | {"outcome": kind, "survived": True}
            extra = finite_or_none(measure(flight.data))
            found[f"{case}-{law}"] = Result(Run("", ""), summary, extra, 0.1, None)
    return found


def result_of(run: Run, template: dict[str, Result]) -> Result:
    words = dict(run.overrides)
    law = "smc" if words["controller.kind"] == "smc" else "roismc"
    case = run.scenario.removeprefix("paper-")
    given = copy.deepcopy(template[f"{case}-{law}"])
    return given._replace(run=run)


def crash(result: Result) -> Result:
    nobody = dict.fromkeys(("x", "y", "z", "overall"))
    mse = dict.fromkeys(("x", "y", "z"))
    changed = {"outcome": "tumbled", "survived": False, "end_time": 0.5, "settle_time": nobody, "position_mse": mse}
    return result._replace(summary={**result.summary, **changed, "cost": None})


@pytest.fixture(scope="module")
def results(template: dict[str, Result]) -> dict[str, Result]:
    runs = [*claims.runs(), *table1.runs(), *ablation.runs(), *sensitivity.runs()]
    return {run.id: result_of(run, template) for run in runs}


def test_first_reading_decides_and_others_are_named() -> None:
    yes, no = Reading("", "1", True), Reading("", "1", False)
    assert verdict([yes, Reading("X", "", False)]) == CONFIRMED
    assert verdict([no, Reading("X", "", True), Reading("Y", "", False)]) == "confirmed under reading 'X'"
    assert verdict([no, Reading("X", "", False)]) == NOT_CONFIRMED


@pytest.mark.parametrize(
    ("ours", "theirs", "holds"), [(1.0, 2.0, True), (2.0, 1.0, False), (None, 1.0, False), (1.0, None, True),
                                  (None, None, False), (1.0, 1.0, False), (0.0, 0.0, False),
                                  (0.96, 1.0, False), (0.94, 1.0, True), (8.597e-9, 8.599e-9, False)]
)  # fmt: skip
def test_lower_needs_the_margin_and_treats_never_as_larger(
    template: dict[str, Result], ours: float | None, theirs: float | None, holds: bool
) -> None:
    a, b = template["set-point-roismc"], template["set-point-smc"]
    (reading,) = lower("", a, b, lambda r: ours if r is a else theirs)
    assert reading.holds is holds


def test_crash_of_the_opponent_confirms_only_under_a_reading_of_its_own(template: dict[str, Result]) -> None:
    a, b = template["square-roismc"], template["square-smc"]
    readings = lower("", a, crash(b), lambda r: 1.0)
    assert verdict(readings) == f"confirmed under reading '{LOST_IS_WORSE}'"
    assert "tumbled at 0.50 s" in readings[0].measured
    assert verdict(lower("", crash(a), b, lambda r: 1.0)) == NOT_CONFIRMED
    assert verdict(lower("", crash(a), crash(b), lambda r: 1.0)) == NOT_CONFIRMED


def test_cost_verdict_follows_the_costs(template: dict[str, Result]) -> None:
    def costing(value: float, readings: float) -> Result:
        given = copy.deepcopy(template["set-point-roismc"])
        given.extra["cost_readings"] = dict.fromkeys(given.extra["cost_readings"], readings)
        return given._replace(summary={**given.summary, "cost": value})

    assert verdict(judges.cost(costing(1.0, 1.0), costing(2.0, 2.0), costing(0.5, 0.5))) == CONFIRMED
    matched = verdict(judges.cost(costing(1.0, 1.0), costing(0.9, 0.9), costing(2.0, 2.0)))
    assert matched == "confirmed under reading 'matched bandwidth'"
    assert "virtual" in verdict(judges.cost(costing(1.0, 0.5), costing(0.9, 0.9), costing(0.8, 0.8)))
    assert verdict(judges.cost(costing(1.0, 1.0), costing(0.9, 0.9), costing(0.8, 0.8))) == NOT_CONFIRMED


def test_errors_need_the_sum_and_most_coordinates(template: dict[str, Result]) -> None:
    def erring(x: float, y: float, z: float, angle: float) -> Result:
        given = template["sinusoid-roismc"]
        angles = dict.fromkeys(("roll", "pitch", "yaw"), angle)
        mse = {"position_mse": {"x": x, "y": y, "z": z}, "attitude_mse": angles}
        demand = {"attitude_demand_mse": angles}
        return given._replace(summary={**given.summary, **mse}, extra={**given.extra, **demand})

    base = erring(1.0, 1.0, 1.0, 1.0)
    assert verdict(judges.errors(erring(0.5, 0.5, 0.5, 0.9), base)) == CONFIRMED
    assert verdict(judges.errors(erring(0.5, 0.5, 0.5, 1.1), base)) == "confirmed under reading 'position axes only'"
    assert verdict(judges.errors(erring(0.9, 0.9, 5.0, 0.5), base)) == NOT_CONFIRMED


def test_detection_needs_both_rotors_right_losses_and_no_false_alarm(template: dict[str, Result]) -> None:
    good = template["set-point-roismc"]
    assert verdict(judges.detected(good)) == CONFIRMED
    assert verdict(judges.detected(good, crash(good))) == NOT_CONFIRMED
    false = good._replace(summary={**good.summary, "false_alarms": 1})
    one = good._replace(summary={**good.summary, "detections": good.summary["detections"][:1]})
    wrong = copy.deepcopy(good)
    wrong.summary["detections"][0]["loss_estimated"] += 0.06
    assert [verdict(judges.detected(bad)) for bad in (false, one, wrong)] == [NOT_CONFIRMED] * 3


def test_growth_with_the_wind(results: dict[str, Result]) -> None:
    def swept(ways: list[float], times: list[float | None]) -> list[Result]:
        found = []
        for run, way, time in zip(wind_sweep.sweep("roismc"), ways, times, strict=True):
            given = copy.deepcopy(results[run.id])
            given.extra["attitude_path"] = [way, 0.0, 0.0]
            given.summary["settle_time"]["overall"] = time
            found.append(given)
        return found

    up, down = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0], [6.0, 5.0, 4.0, 3.0, 2.0, 1.0]
    grows, falls = swept(up, [1.0, 1.1, 1.2, 1.3, None, None]), swept(up, down)
    assert verdict(wind_sweep.growth(*grows, *falls)) == CONFIRMED
    assert verdict(wind_sweep.growth(*falls, *grows)).startswith("confirmed under reading 'k_d")
    assert verdict(wind_sweep.growth(*[crash(r) for r in grows], *falls)) == NOT_CONFIRMED
    hardly = swept([1.0, 1.01, 1.02, 1.03, 1.04, 1.04], [1.0, 1.1, 1.2, 1.3, 1.4, 1.5])
    assert verdict(wind_sweep.growth(*hardly, *falls)) == NOT_CONFIRMED
    assert wind_sweep.rank_correlation(up) == pytest.approx(1.0)
    assert wind_sweep.rank_correlation([2.0] * 6) == 0.0


# ------------------------------------------------------------------------------------------------------ all claims


def test_every_claim_of_the_paper_has_rules_and_ids_are_unique() -> None:
    ids = [rule.id for rule in claims.rules()]
    assert len(set(ids)) == len(ids)
    assert {int("".join(c for c in name.partition(".")[0] if c.isdigit())) for name in ids} >= set(range(1, 14))
    runs = [*claims.runs(), *ablation.runs(), *sensitivity.runs()]
    assert len({run.id for run in runs}) == len(runs)


@pytest.mark.parametrize("what", ["sound", "ROISMC lost", "SMC lost", "all lost"])
def test_verdicts_never_raise_and_a_lost_flight_confirms_nothing(results: dict[str, Result], what: str) -> None:
    gone = {"sound": (), "ROISMC lost": ("roismc",), "SMC lost": ("smc",), "all lost": ("roismc", "smc")}[what]
    given = {name: crash(r) if dict(r.run.overrides)["controller.kind"] in gone else r for name, r in results.items()}
    found = claims.claims(given)
    assert len(found) == len(claims.rules())
    for claim in found:
        assert claim.verdict in (CONFIRMED, NOT_CONFIRMED) or claim.verdict.startswith("confirmed under reading '")
        assert claim.measured
    if "roismc" in gone:
        # 11, 12 and 13 are about quantities that a lost flight has too.
        assert {c.verdict for c in found if c.id[:2] not in ("11", "12", "13")} == {NOT_CONFIRMED}
        assert any("tumbled at 0.50 s" in claim.measured for claim in found)


def test_claims_without_their_flights_are_left_out(results: dict[str, Result]) -> None:
    only = {name: r for name, r in results.items() if r.run.scenario == "paper-sinusoid"}
    assert {claim.id for claim in claims.claims(only)} >= {"1.sinusoid", "3.sinusoid.1ms", "4a.sinusoid"}
    assert not [claim for claim in claims.claims(only) if "square" in claim.id]


def test_claims_are_written_as_a_list_of_objects(results: dict[str, Result], tmp_path: Path) -> None:
    path = claims.claims_json(claims.claims(results), tmp_path / "claims.json")
    content = json.loads(path.read_text(encoding="utf-8"))
    needed = {"id", "claim", "paper", "measured", "unit", "verdict", "command"}
    assert content
    assert all(needed <= set(entry) for entry in content)


COMMANDS: dict[str, Any] = typer.main.get_command(app).commands  # type: ignore[attr-defined]


def understood(command: str) -> None:
    _, name, *arguments = shlex.split(command)
    given = COMMANDS[name].make_context(name, list(arguments)).params
    pairs = parse_overrides(given["assignments"] or [])
    if given["preset"]:
        pairs = {"controller.preset": given["preset"], **pairs}
    prepare(given["scenario"], given["controller"], pairs)


def test_every_command_can_be_typed() -> None:
    assert all(rule.command for rule in claims.rules())
    for run in [*claims.runs(), *ablation.runs()[::5], *sensitivity.runs()[::3]]:
        understood(run.command)


# ------------------------------------------------------------------------------------------------- tables and figures


def read(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def test_table_one_has_the_papers_numbers_and_no_ratio_of_a_lost_flight(
    results: dict[str, Result], tmp_path: Path
) -> None:
    lost = run_of("square", "smc").id
    table = read(table1.write_csv({**results, lost: crash(results[lost])}, tmp_path / "table1.csv"))
    assert [row["case"] for row in table] == ["set-point", "sinusoid", "square"]
    assert [float(row["paper_ratio"]) for row in table] == pytest.approx([0.824, 0.925, 0.931], abs=5e-4)
    assert table[2]["equal_ratio"] == ""
    assert table[2]["equal_smc_outcome"] == "tumbled"
    ours, smc = (results[run_of("set-point", law).id].summary["cost"] for law in ("roismc", "smc"))
    assert float(table[0]["equal_ratio"]) == ours / smc


def test_ablation_has_all_parts_and_says_what_is_lost(results: dict[str, Result], tmp_path: Path) -> None:
    gone = ablation.Variant("square", False, "smooth", "off").run.id
    given = {**results, gone: crash(results[gone])}
    table = read(ablation.write_csv(given, tmp_path / "ablation.csv"))
    assert len(table) == 3 * 2 * 3 * 3
    lost = [row for row in table if row["survived"] == "no"]
    assert [(row["case"], row["sdre"], row["switching"], row["diagnosis"]) for row in lost] == [
        ("square", "off", "smooth", "off")
    ]
    assert lost[0]["settle_time_s"] == ""
    assert len(ablation.findings(given)) == 5
    texts = {text.get_text() for text in ablation.figure(given).findobj(Text)}
    assert "lost" in texts


def test_constant_gain_is_sdre_at_the_floor() -> None:
    weights = Weights(error_floor=(0.1, 0.2, 0.3))
    found = ablation.constant_gains(weights)
    k1, k2 = position_gain(0.3 / 0.2, 0.005, 0.2 * 0.2**2)
    assert found["position_gain.error"][1] == pytest.approx(k1, rel=1e-5)
    assert found["position_gain.rate"][1] == pytest.approx(k2, rel=1e-5)
    assert found["attitude_gain.error"] == pytest.approx([10.66] * 3, rel=1e-3)
    assert found["attitude_gain.rate"] == pytest.approx([11.62] * 3, rel=1e-3)


def test_ablation_changes_the_named_part_alone() -> None:

    def controller(scenario: str, overrides: dict[str, Any]) -> dict[str, Any]:
        table: dict[str, Any] = load_scenario(scenario, overrides).as_tables()["controller"]
        return {key: value for key, value in table.items() if key != "preset"}  # where its numbers come from

    tables = {
        v: controller(v.run.scenario, dict(v.run.overrides))
        for v in ablation.variants()
        if v.case == "set-point" and v.diagnosis == "luenberger"
    }
    assert all(table["cascade"] == next(iter(tables.values()))["cascade"] for table in tables.values())
    tuned = controller("paper-set-point", {"controller.kind": "roismc"})
    assert tables[ablation.Variant("set-point", True, "smooth", "luenberger")] == tuned
    plain = tables[ablation.Variant("set-point", False, "none", "luenberger")]["law"]
    assert plain["attitude"]["gamma_0"] == plain["position"]["gamma_0"] == 0.0


def test_sensitivity_marks_what_moves_against_its_baseline(results: dict[str, Result], tmp_path: Path) -> None:
    names = [variation.id for variation in variations()]
    assert len(set(names)) == len(names)
    changed = next(v for v in variations() if v.id == "rotor-15")
    ours, _ = changed.runs("square")
    given = {**results, ours.id: crash(results[ours.id])}
    table = read(sensitivity.write_csv(given, tmp_path / "sensitivity.csv"))
    (row,) = [r for r in table if r["variation"] == "rotor-15" and r["case"] == "square"]
    assert (row["survive"], row["cost"], row["cost_ratio"], row["outcome"]) == ("no", "", "", "tumbled")
    assert "survive" in row["moved"]
    still = [r for r in table if r["variation"] == "baseline" or r["variation"] == "poles-60"]
    assert all(r["moved"] == "" for r in still)
    assert len(sensitivity.findings(given)) == len(sensitivity.CONCLUSIONS)


def test_cost_readings_need_no_flights_of_their_own() -> None:
    base, reading = variations()[0], next(v for v in variations() if v.id == "cost-1")
    assert base.runs("square") == reading.runs("square")


@pytest.mark.parametrize("draw", [ablation.figure, sensitivity.figure, wind_sweep.fig_wind])
def test_figures_have_no_overlapping_text(results: dict[str, Result], draw: Any) -> None:
    check_nothing_covered(draw.__name__, draw(results))


# ------------------------------------------------------------------------------------------------ vehicle overrides


def test_single_numbers_of_a_named_vehicle_can_be_set() -> None:
    base = load_scenario("paper-set-point")
    changed = load_scenario("paper-set-point", {"vehicle.rotor_bandwidth.value": 30.0, "vehicle.mass.value": 1.9})
    assert changed.vehicle.vehicle == base.vehicle.vehicle._replace(rotor_bandwidth=30.0, mass=1.9)
    other = load_scenario("paper-set-point", {"vehicle": "hummingbird", "vehicle.mass.value": 0.6})
    assert other.vehicle.name == "hummingbird"
    assert other.vehicle.vehicle.mass == 0.6
    arm = load_scenario("paper-set-point", {"vehicle.rotor.0.x.value": 0.3, "vehicle.rotor.1.x.value": -0.3})
    assert arm.vehicle.vehicle.rotor_x.r1 == 0.3


@pytest.mark.parametrize(
    ("key", "value", "said"),
    [
        ("vehicle.mas.value", 1.0, "did you mean 'mass'"),
        ("vehicle.mass.value", -1.0, "greater than 0"),
        ("vehicle.mass", 1.0, "vehicle.mass"),
        ("vehicle.mass.value.x", 1.0, "single value"),
    ],
)
def test_wrong_vehicle_overrides_are_refused_in_one_line(key: str, value: float, said: str) -> None:
    with pytest.raises(InputError, match=said) as error:
        load_scenario("paper-set-point", {key: value})
    assert "\n" not in str(error.value)
