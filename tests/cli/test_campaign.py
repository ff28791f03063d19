"""Campaigns from the command line: what is written, resumed, replayed, and refused in one line with exit code 2."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest
from command_line import assert_refused, run, started
from gates import needs_simd
from places import EXAMPLES

pytestmark = needs_simd
STUDY = """
name = "tiny"
scenario = "hover-fault"
settings = { duration = 1.0, period = 0.004, step = 0.004, "fault.0.time" = 0.2, "diagnosis.poles" = [60.0, 80.0] }

[[axis]]
name = "loss"
values = [0.1, 0.9]

[[axis]]
name = "wind_speed"
values = [0.0, 8.0]

[[draw]]
name = "mass"
uniform = [0.95, 1.05]

[[variant]]
label = "roismc"
settings = { "controller.kind" = "roismc" }

[[variant]]
label = "smc"
settings = { "controller.kind" = "smc" }

[refine]
initial = 4
block = 4
most = 8
width = 0.5
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    here = tmp_path_factory.mktemp("campaigns")
    (here / "tiny.toml").write_text(STUDY)
    done = started("campaign", "tiny.toml", "--no-report", cwd=here)
    assert done.returncode == 0, done.stderr
    assert "success over the map" in done.stdout
    assert "50 % success along loss" in done.stdout.splitlines()[-5]
    assert not (here / "campaigns" / "tiny" / "report.html").exists()
    return here


def test_it_writes_a_table_with_one_row_per_flight(folder: Path) -> None:
    table = pq.read_table(folder / "campaigns" / "tiny" / "flights.parquet")
    assert table.num_rows >= 2 * 4 * 4
    assert set(table["variant"].to_pylist()) == {"roismc", "smc"}
    assert len(set(table["id"].to_pylist())) == table.num_rows
    assert json.loads((folder / "campaigns" / "tiny" / "study.json").read_text())["study"]["name"] == "tiny"


def test_a_complete_campaign_says_so_and_is_not_flown_again(folder: Path) -> None:
    before = (folder / "campaigns" / "tiny" / "flights.parquet").read_bytes()
    for options in ([], ["--resume"]):
        again = run("campaign", "tiny.toml", "--no-report", *options, cwd=folder)
        assert again.returncode == 0, again.stderr
        assert "tiny is complete, nothing is left to fly" in again.stderr
        assert again.stdout.startswith("tiny: ")
        assert (folder / "campaigns" / "tiny" / "flights.parquet").read_bytes() == before


def test_an_interrupted_campaign_asks_for_resume(folder: Path) -> None:
    there = folder / "campaigns" / "tiny"
    half = folder / "half"
    shutil.copytree(there, half)
    (half / "flights.parquet").unlink()
    assert_refused(run("campaign", "tiny.toml", "--out", "half", cwd=folder), "complete it with --resume")


def test_a_replay_writes_the_whole_flight(folder: Path) -> None:
    row: dict[str, Any] = pq.read_table(folder / "campaigns" / "tiny" / "flights.parquet").to_pylist()[5]
    quiet = ("--no-figures", "--out", "again")
    done = started("replay", "campaigns/tiny", "--flight", str(row["id"]), *quiet, cwd=folder)
    assert done.returncode == 0, done.stderr
    summary = json.loads((folder / "again" / "summary.json").read_text())
    assert summary["cost"] == pytest.approx(row["cost"], rel=1e-12)
    assert summary["seed"] == row["seed"]
    place = ("--cell", str(row["cell"]), "--variant", row["variant"], "--number", str(row["number"]))
    by_cell = run("replay", "campaigns/tiny", *place, *quiet, cwd=folder)
    assert by_cell.returncode == 0, by_cell.stderr
    assert json.loads((folder / "again" / "summary.json").read_text())["cost"] == summary["cost"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["campaign"], "no study was given"),
        (["campaign", "partial-los-map"], "did you mean 'partial-loss-map'"),
        (["campaign", "none.toml"], "no such file"),
        (["campaign", "tiny.toml", "--out", "tiny.toml"], "is a file"),
        (["campaign", "tiny.toml", "--out", "."], "holds files that are not of a campaign"),
        (["campaign", "tiny.toml", "--budget", "3"], "allowed: at least"),
        (["campaign", "tiny.toml", "--vehicle", "papr", "--out", "new"], "did you mean 'paper'"),
        (["campaign", "tiny.toml", "--preset", "tund", "--out", "new"], "did you mean 'tuned'"),
        (["campaign", "tiny.toml", "--resume", "--out", "nowhere"], "no such folder"),
        (["campaign", "tiny.toml", "--seed", "5", "--resume"], "seed"),
        (["campaign", "tiny.toml", "--controller", "smk"], "did you mean 'smc'"),
        (["campaign", "tiny.toml", "--set", "fault.0.loss=0.2"], "the study varies it, by its axis or draw 'loss'"),
        (["campaign", "--report-only", "--out", "campaigns/tiny", "--set", "duration=1"], "give it alone"),
        (["replay", "campaigns/tiny", "--flight", "1", "--set", "nope=1"], "nope"),
        (["replay", "nowhere", "--flight", "1"], "no such folder"),
        (["replay", "campaigns/tiny"], "give the flight by --flight ID, or by --cell and --variant"),
        (["replay", "campaigns/tiny", "--flight", "99999999"], "tiny has flown no flight 99999999; allowed: the"),
        (["replay", "campaigns/tiny", "--cell", "1"], "--cell needs --variant"),
        (
            ["replay", "campaigns/tiny", "--cell", "1", "--variant", "smx"],
            "'smx'; did you mean 'smc'",
        ),
        (["replay", "campaigns/tiny", "--cell", "77", "--variant", "smc"], "there is no cell 77"),
    ],
)
def test_bad_input_is_one_clear_line(folder: Path, arguments: list[str], message: str) -> None:
    assert_refused(run(*arguments, cwd=folder), message)
    assert not (folder / "new").exists()


OWN = f"{EXAMPLES / 'controller.py'}:PdController"


def test_controllers_of_ones_own_are_compared_resumed_reported_and_replayed(folder: Path) -> None:
    own = ("campaign", "tiny.toml", "--controller", "smc", "--controller", OWN, "--set", "duration=0.4")
    for more in ((), ("--resume",)):
        done = run(*own, "--no-report", *more, cwd=folder)
        assert done.returncode == 0, done.stderr
        assert "PdController" in done.stderr
    here = folder / "campaigns" / "tiny-smc-PdController"
    table = pq.read_table(here / "flights.parquet")
    assert set(table["variant"].to_pylist()) == {"smc", "PdController"}
    assert max(table["end_time"].to_pylist()) == pytest.approx(0.4)
    report = ("campaign", "--report-only", "--out", str(here))
    assert_refused(run(*report), "allow it with --allow-code")
    assert run(*report, "--controller", OWN).returncode == 0
    flight = ("replay", str(here), "--cell", "1", "--variant", "PdController", "--no-figures")
    assert_refused(run(*flight), "allow it with --allow-code")
    for allowed in (("--allow-code",), ("--controller", OWN)):
        done = run(*flight, *allowed)
        assert done.returncode == 0, done.stderr
        assert "its numbers are those of the campaign's table" in done.stdout
    done = run(*flight, "--controller", "sdre", "--set", "wind.kind=none")
    assert done.returncode == 0, done.stderr
    assert "not the flight of the table, but with controller.kind = 'sdre', wind.kind = 'none'" in done.stdout
    assert "flown by sdre" in done.stdout


def test_no_scheduler_is_one_clear_line(folder: Path) -> None:
    """In a process of its own: what Dask logs would stand among the errors. It waits no longer than it must."""
    pytest.importorskip("distributed")
    impatient = "import rotorfault.base.dask_executor as dask\ndask.PATIENCE = 0.2"
    nowhere = ("--scheduler", "tcp://127.0.0.1:1", "--out", "new")
    assert_refused(started("campaign", "tiny.toml", *nowhere, cwd=folder, before=impatient), "cannot be reached")
    assert not (folder / "new").exists()


def test_pages_that_are_kept_are_counted_in_words(folder: Path) -> None:
    done = run("campaign", "--report-only", "--out", "campaigns/tiny", "--keep-flights", "1", cwd=folder)
    assert done.returncode == 0, done.stderr
    said = "2 flight pages in campaigns/tiny/flights: one for each variant in the cell nearest to 50 %"
    assert said in done.stdout
