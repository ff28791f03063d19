"""Table 1 as ranges: numbers that come with the package can be flown again, searches go on where they were."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from click.testing import Result as CliResult
from gates import needs_simd
from typer.testing import CliRunner

import rotorfault as rf
from rotorfault.base.errors import InputError
from rotorfault.cli.main import app
from rotorfault.scenario.library import load_scenario
from rotorfault.studies.paper import range_tables, ranges
from rotorfault.studies.paper.cases import CASES
from rotorfault.studies.paper.ranges import Cell, Flown, Gains
from rotorfault.tuning import training
from rotorfault.tuning.space import SPACES, candidate, settings_at

SHORT = (("paper-set-point", {"duration": 2.0}, 1), ("paper-sinusoid", {"duration": 2.0}, 1))


def gains(law: str, cost: float, seed: int = 1, survived: bool = True, objective: str = "cost") -> Gains:
    cases = {case: Flown("settled" if survived else "tumbled", survived, cost, 1.0, 0.1) for case in CASES}
    return Gains(Cell(objective, "standard", seed), law, {}, 1.5, (), cases)


def run(*words: str) -> CliResult:
    return CliRunner().invoke(app, list(words))


@needs_simd
def test_numbers_that_come_with_the_package_are_flown_by_its_gains() -> None:
    """One row anew; and what is the same for all rows."""
    kept = ranges.kept()
    assert {one.law for one in kept.gains} == set(ranges.LAWS)
    assert len(range_tables.pairs(kept.gains)) == len(kept.gains) / 2, "always both laws, by the same search"
    chosen = kept.gains[:2]
    for old, new in zip(chosen, ranges.flown(chosen, ["set-point"]), strict=True):
        assert new.cases["set-point"].outcome == old.cases["set-point"].outcome
        assert new.cases["set-point"].cost == pytest.approx(old.cases["set-point"].cost, rel=0.01)


@needs_simd
def test_shipped_presets_fly_here_as_they_do_by_themselves() -> None:
    ours, theirs = ranges.flown([one._replace(cases={}) for one in ranges.kept().shipped], ["set-point"])
    for one, law in ((ours, "roismc"), (theirs, "smc")):
        summary = rf.fly("paper-set-point", law).summary()
        assert one.law == law
        assert one.cases["set-point"].cost == pytest.approx(summary["cost"], rel=1e-5)
        assert one.cases["set-point"].settle_time == pytest.approx(summary["settle_time"]["overall"])


def test_ratios_are_least_and_largest_and_a_lost_flight_has_none() -> None:
    found = [gains("roismc", 1.0), gains("smc", 2.0), gains("roismc", 3.0, 2), gains("smc", 2.0, 2)]
    (row,) = [row for row in range_tables.ratio_rows(range_tables.pairs(found)) if row[0] == "sinusoid"]
    assert row == ("sinusoid", "0.93", "-", "0.50 to 1.50", "-", "0.50 to 1.50")
    lost = [*found, gains("roismc", 0.1, 3), gains("smc", 2.0, 3, survived=False)]
    (row,) = [row for row in range_tables.ratio_rows(range_tables.pairs(lost)) if row[0] == "sinusoid"]
    assert row[3] == "0.50 to 1.50 (1 without)"
    (row,) = [row for row in range_tables.number_rows(range_tables.pairs(lost)) if row[:2] == ("cost", "sinusoid")]
    assert row[2:5] == ("0.10 to 3.00", "2.00", "1 of 2")
    said = range_tables.headline(range_tables.pairs(found))
    assert said.startswith("These are 2 pairs of gains, of the 18 that")
    assert "ROISMC's cost is the lower one in 3 of 6 comparisons, by 5 % or more in 3." in said


def test_what_is_written_is_read_again_and_nothing_else_is() -> None:
    found = [gains("roismc", 1.0), gains("smc", 2.0)]
    kept = ranges.read(ranges.as_json(found, ranges.QUICK, found), "here")
    assert kept.gains == found
    assert kept.budget == ranges.QUICK
    for text in ("", "[]", "{}", json.dumps({"version": "1", "budget": {}, "shipped": [], "gains": []})):
        with pytest.raises(InputError, match="here: is no file that `rotorfault ranges` wrote"):
            ranges.read(text, "here")


def test_both_laws_get_the_same_budget_and_go_on_where_they_were(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    pytest.importorskip("cma")
    monkeypatch.setattr(training, "GROUPS", SHORT)
    monkeypatch.setattr(ranges, "GROUPS", SHORT)
    monkeypatch.setattr(ranges, "SEARCHED_FOR", ("cost",))
    monkeypatch.setattr(ranges, "BOXES", ("standard",))
    monkeypatch.setattr(ranges, "flown", lambda found, only=(): found)
    searched: list[str] = []
    real = ranges._searched

    def counted(search: Any) -> Any:
        searched.append(search.key)
        return real(search)

    monkeypatch.setattr(ranges, "_searched", counted)
    budget = ranges.Budget((1,), 1, 4, 1)
    assert budget.flights == 8
    first = ranges.search_all(tmp_path, budget, 1)
    assert searched == ["cost-standard-1-roismc", "cost-standard-1-smc"]
    assert all(set(one.settings["cascade"]) == set(first[0].settings["cascade"]) for one in first)
    assert ranges.search_all(tmp_path, budget, 1) == first
    assert len(searched) == 2, "nothing is searched twice"
    (tmp_path / "searches" / "cost-standard-1-smc.json").write_text("{")
    assert ranges.search_all(tmp_path, budget._replace(seeds=(1, 2)), 1)[:2] == first
    assert sorted(searched[2:]) == ["cost-standard-1-smc", "cost-standard-2-roismc", "cost-standard-2-smc"]


def test_gains_keep_what_the_scenario_chose() -> None:
    """Such as how attitude is tracked, which is no gain."""
    scenario = load_scenario("paper-set-point", {"controller.kind": "smc", "controller.cascade.cos_min": 0.2})
    tables = settings_at("smc", {entry[0]: entry[2] for entry in SPACES["smc"]})
    part = candidate(scenario, "smc", tables)
    assert part.settings.cascade.cos_min == 0.2
    assert part.settings.cascade.tilt_max == tables["cascade"]["tilt_max"]
    assert list(part.settings.law.position.K) == tables["law"]["position"]["K"]


def test_the_command_says_what_does_not_go_together(tmp_path: Path) -> None:
    done = run("ranges", "--again", "--seeds", "2", "--out", str(tmp_path))
    assert isinstance(done.exception, InputError)
    assert "--again flies gains that are there" in str(done.exception)
