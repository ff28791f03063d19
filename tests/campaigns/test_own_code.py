"""Campaigns with code of one's own: asked for before it runs, known by its source, also when flown once more."""

from __future__ import annotations

import json
import os
import re
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from gates import needs_simd
from places import EXAMPLES
from typer.testing import CliRunner

import rotorfault
from rotorfault.base.errors import InputError
from rotorfault.campaigns.api import ReplayWarning
from rotorfault.campaigns.load import load_study
from rotorfault.campaigns.study import study_from
from rotorfault.cli.main import app

STUDY: dict[str, Any] = {
    "name": "own",
    "scenario": "hover-fault",
    "settings": {"duration": 0.3, "period": 0.005, "fault.0.time": 0.1, "diagnosis.poles": [60.0, 80.0]},
    "axis": [{"name": "loss", "values": [0.1, 0.4]}],
    "variant": [{"label": "only"}],
    "refine": {"initial": 2, "block": 2, "most": 2},
}


# --------------------------------------------------------------------------------------------------------- permission


def hover(**changes: object) -> dict[str, Any]:
    return {**rotorfault.load_scenario("hover-fault").as_tables(), **changes}


@pytest.fixture
def trap(tmp_path: Path) -> str:
    """A place in code that says so when it runs."""
    (tmp_path / "trap.py").write_text("raise RuntimeError('it ran')\n")
    return f"{tmp_path / 'trap.py'}:Part"


NAMED = {
    "the scenario": lambda place: {"scenario": hover(controller={"kind": place})},
    "a function": lambda place: {"scenario": hover(reference={"kind": "function", "function": place})},
    "settings": lambda place: {"settings": {**STUDY["settings"], "wind.kind": place}},
    "a table in settings": lambda place: {"settings": {**STUDY["settings"], "controller": {"kind": place}}},
    "a variant": lambda place: {"variant": [{"label": "x", "settings": {"diagnosis.kind": place}}]},
    "an axis": lambda place: {"axis": [{"name": "controller", "values": ["smc", place]}]},
    "a draw": lambda place: {"draw": [{"name": "allocation.kind", "choice": ["effectiveness", place]}]},
}


@pytest.mark.parametrize("where", list(NAMED))
def test_code_that_a_study_names_runs_only_where_it_is_allowed(where: str, trap: str, tmp_path: Path) -> None:
    tables, folder = {**STUDY, **NAMED[where](trap)}, tmp_path / "campaign"
    asked = rf"code of its own, {re.escape(trap)}, which would run; read it, then allow it with --allow-code"
    with pytest.raises(InputError, match=asked):
        rotorfault.campaign(tables, folder)
    with pytest.raises(InputError, match=asked):
        _ = study_from(tables, "test").scenarios
    with pytest.raises(InputError, match="it ran"):
        rotorfault.campaign(tables, folder, allow_code=True)
    assert not folder.exists()


# ------------------------------------------------------------------------------------------------------------- source


@pytest.fixture(scope="module")
def here(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a controller and a wind of one's own, a study of them, and its campaign, complete."""
    here = tmp_path_factory.mktemp("own")
    for name in ("controller", "wind"):
        (here / f"{name}.py").write_text((EXAMPLES / f"{name}.py").read_text())
    (here / "study.toml").write_text(
        """
        name = "own"
        scenario = "hover-fault"
        settings = { duration = 0.3, period = 0.005, "fault.0.time" = 0.1, "wind.kind" = "wind.py:GustFront" }
        axis = [{ name = "loss", values = [0.1, 0.4] }]
        variant = [
          { label = "own", settings = { "controller.kind" = "controller.py:PdController" } },
          { label = "smc", settings = { "controller.kind" = "smc" } },
        ]
        refine = { initial = 2, block = 2, most = 2 }
        """
    )
    rotorfault.campaign(here / "study.toml", here / "campaign", allow_code=True)
    return here


@pytest.fixture
def controller(here: Path) -> Iterator[Path]:
    """The file of the controller, which a test may edit; put back afterwards."""
    path = here / "controller.py"
    before = path.read_text()
    yield path
    path.write_text(before)


def edit(path: Path) -> None:
    text = path.read_text()
    assert "Field(4.0," in text
    path.write_text(text.replace("Field(4.0,", "Field(9.0,"))


def own_row(campaign: rotorfault.Campaign) -> dict[str, Any]:
    return next(row for row in campaign.table().to_pylist() if row["variant"] == "own")


@needs_simd
def test_a_campaign_knows_the_source_of_its_own_parts(here: Path) -> None:
    kept = json.loads((here / "campaign" / "study.json").read_text())["own_parts"]
    assert set(kept) == {f"{here / 'controller.py'}:PdController", f"{here / 'wind.py'}:GustFront"}
    assert load_study(here / "study.toml", allow_code=True).own_sources == kept


@needs_simd
def test_an_edited_controller_is_noticed_on_resume_in_one_line(here: Path, controller: Path) -> None:
    def resume() -> None:
        rotorfault.campaign(here / "study.toml", here / "campaign", resume=True, allow_code=True)

    table, source = here / "campaign" / "flights.parquet", controller.read_text()
    before = table.read_bytes()
    (here / "campaign" / "parts" / "round-000-block-00000.parquet").unlink()
    edit(controller)
    with pytest.raises(InputError) as refused:
        resume()
    assert re.search(r"campaign: was flown with other source of \S*controller\.py:PdController;", str(refused.value))
    assert "wind.py" not in str(refused.value)
    assert "\n" not in str(refused.value)
    assert not list((here / "campaign" / "parts").iterdir())
    controller.write_text(source)
    resume()
    assert table.read_bytes() == before


@needs_simd
def test_code_on_an_axis_is_known_by_its_source(controller: Path, tmp_path: Path) -> None:
    place = f"{controller}:PdController"
    tables = {**STUDY, "axis": [{"name": "controller", "values": ["smc", place]}]}
    campaign = rotorfault.campaign(tables, tmp_path / "campaign", allow_code=True)
    assert set(campaign.study.own_sources) == {place}
    identifier = next(row["id"] for row in campaign.table().to_pylist() if row["controller"] == place)
    with warnings.catch_warnings():
        warnings.simplefilter("error", ReplayWarning)
        campaign.replay(identifier)
    edit(controller)
    with pytest.raises(InputError, match=rf"other source of {re.escape(place)}"):
        rotorfault.campaign(tables, tmp_path / "campaign", resume=True, allow_code=True)


def test_the_source_of_a_reference_function_counts(tmp_path: Path) -> None:
    path = tmp_path / "path.py"
    place = f"{path}:here"
    tables = {**STUDY, "scenario": hover(reference={"kind": "function", "function": place})}
    digests = set()
    for height in (5.0, 6.0):
        path.write_text(f"def here(time):\n    return 0.0, 0.0, {height}, 0.0\n")
        (found,) = study_from(tables, "test", allow_code=True).own_sources.items()
        assert found[0] == place
        digests.add(found[1])
    assert len(digests) == 2


# ------------------------------------------------------------------------------------------------------------- replay


@needs_simd
def test_a_replay_needs_permission_too(here: Path) -> None:
    campaign = rotorfault.Campaign(here / "campaign")
    row = own_row(campaign)  # the table may be read by anybody
    with pytest.raises(InputError, match="--allow-code"):
        campaign.replay(row["id"])


@needs_simd
def test_a_replay_with_edited_source_says_what_differs(here: Path, controller: Path, tmp_path: Path) -> None:
    row = own_row(rotorfault.Campaign(here / "campaign"))

    def replayed() -> list[str]:
        campaign = rotorfault.Campaign(here / "campaign", allow_code=True)
        with warnings.catch_warnings(record=True) as told:
            warnings.simplefilter("always")
            campaign.replay(row["id"])
        return [str(one.message) for one in told if issubclass(one.category, ReplayWarning)]

    assert replayed() == []
    edit(controller)
    first, *others = replayed()
    assert first == f"source of {controller}:PdController has changed since the campaign was flown"
    assert any(re.fullmatch(rf"tilt_max is \S+ here and {row['tilt_max']!r} in the table", line) for line in others)
    arguments = ["replay", str(here / "campaign"), "--flight", str(row["id"]), "--no-figures", "--allow-code"]
    done = CliRunner().invoke(app, [*arguments, "--out", os.fspath(tmp_path / "again")], catch_exceptions=False)
    assert f"warning: {first}\n" in done.stderr
    assert "warning: this is not the flight of the table; its numbers are above" in done.stderr
