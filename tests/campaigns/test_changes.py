"""A study with other controllers and settings: what is compared, what is allowed to run, what is refused."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from campaign_studies import TINY
from gates import needs_simd
from places import EXAMPLES

import rotorfault as rf
from rotorfault.base.errors import InputError
from rotorfault.campaigns.changes import changed
from rotorfault.campaigns.study import Study, study_from

OWN = f"{EXAMPLES / 'controller.py'}:PdController"


def tiny(**tables: Any) -> Study:
    return study_from({**TINY, **tables}, "test")


def variants(study: Study) -> dict[str, dict[str, Any]]:
    return {one.label: one.settings for one in study.variant}


def test_controllers_take_the_place_of_the_studys() -> None:
    found = changed(tiny(), controllers=["smc", OWN])
    assert variants(found) == {"smc": {"controller.kind": "smc"}, "PdController": {"controller.kind": OWN}}
    assert found.name == "tiny-smc-PdController"
    assert [scenario.controller.kind for scenario in found.scenarios] == ["smc", OWN]  # type: ignore[attr-defined]


def test_a_preset_of_all_stays_with_those_that_have_presets_and_the_former_law_goes() -> None:
    study = tiny(
        settings={**TINY["settings"], "controller.preset": "gentle"},
        variant=[
            {"label": "a", "settings": {"controller.kind": "roismc", "controller.cascade.tilt_max": 0.4}},
            {"label": "b", "settings": {"controller.kind": "smc"}},
        ],
    )
    found = changed(study, controllers=["smc", OWN])
    assert variants(found)["smc"] == {"controller.kind": "smc", "controller.preset": "gentle"}
    assert variants(found)["PdController"] == {"controller.kind": OWN}
    assert "controller.preset" not in found.settings
    assert len(found.scenarios) == 2


def test_settings_of_a_law_that_all_variants_share_go_with_it() -> None:
    study = tiny(variant=[{"label": "a", "settings": {"controller.kind": "smc", "controller.preset": "matched"}}])
    assert variants(changed(study, controllers="roismc")) == {"roismc": {"controller.kind": "roismc"}}


def test_what_variants_change_besides_is_flown_with_each_controller() -> None:
    each = [("told", "oracle", "smc"), ("told too", "oracle", "roismc"), ("found", "luenberger", "smc")]
    study = tiny(
        variant=[
            {"label": label, "settings": {"controller.kind": law, "diagnosis.kind": kind}}
            for label, kind, law in each
        ],
        settings={"duration": 1.0},
    )
    found = variants(changed(study, controllers=["sdre", "smc"]))
    assert list(found) == ["sdre, told", "sdre, found", "smc, told", "smc, found"]
    assert found["smc, found"] == {"diagnosis.kind": "luenberger", "controller.kind": "smc"}


def test_labels_tell_classes_of_one_name_apart() -> None:
    found = changed(tiny(), controllers=["a.py:Mine", "b.py:Mine"])
    assert list(variants(found)) == ["Mine (a)", "Mine (b)"]
    found = changed(tiny(), controllers=["x/a.py:Mine", "y/a.py:Mine"])
    assert list(variants(found)) == ["1 Mine (a)", "2 Mine (a)"]


def test_settings_stand_over_all_that_the_study_says() -> None:
    study = tiny(variant=[{"label": "a", "settings": {"sensors": {"kind": "noisy", "position": 0.1}}}])
    (scenario,) = changed(study, settings={"sensors.kind": "ideal", "duration": 2.0}).scenarios
    assert scenario.sensors.kind == "ideal"  # type: ignore[attr-defined]
    assert scenario.duration == 2.0


def test_a_setting_in_place_of_what_variants_compare_leaves_one_called_by_it() -> None:
    each = [{"label": kind, "settings": {"diagnosis.kind": kind}} for kind in ("luenberger", "oracle")]
    (only,) = changed(tiny(variant=each), settings={"diagnosis": "glr", "duration": 2.0}).variant
    assert only.label == "glr"
    kept = changed(tiny(variant=each), settings={"duration": 2.0})
    assert [one.label for one in kept.variant] == ["luenberger", "oracle"]


def test_a_setting_that_makes_some_variants_the_same_is_refused() -> None:
    rates = [
        {"label": f"{rate} per hour", "settings": {"diagnosis": {"kind": "glr", "false_alarms": rate}}}
        for rate in (1, 10)
    ]
    study = tiny(variant=[*rates, {"label": "models", "settings": {"diagnosis": "multiple_model"}}])
    with pytest.raises(InputError, match="'1 per hour' and '10 per hour' differ by it alone"):
        changed(study, settings={"diagnosis.false_alarms": 0.1})


def test_what_is_named_here_may_run_and_nothing_else(tmp_path: Path) -> None:
    (tmp_path / "trap.py").write_text("raise RuntimeError('it ran')\n")
    trap = f"{tmp_path / 'trap.py'}:Part"
    strangers = tiny(settings={**TINY["settings"], "wind.kind": trap})
    with pytest.raises(InputError, match="allow it with --allow-code"):
        _ = changed(strangers, controllers=OWN).scenarios
    with pytest.raises(InputError, match="it ran"):
        _ = changed(strangers, controllers=OWN, settings={"wind.kind": trap}).scenarios
    assert len(changed(strangers, controllers=OWN, settings={"wind.kind": "none"}).scenarios) == 1


def test_places_are_kept_with_whole_paths(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "mine.py").write_text((EXAMPLES / "controller.py").read_text())
    monkeypatch.chdir(tmp_path)
    study = changed(tiny(), controllers="mine.py:PdController").resolved()
    assert set(study.own_sources) == {f"{tmp_path / 'mine.py'}:PdController"}


def test_files_are_laid_out_so_that_a_campaign_needs_none_of_them(tmp_path: Path) -> None:
    (tmp_path / "way.csv").write_text("t,x,y,z\n0,0,0,5\n1,0.1,0,5\n")
    settings = {"reference.kind": "csv", "reference.file": str(tmp_path / "way.csv")}
    study = changed(tiny(), settings=settings).resolved()
    (tmp_path / "way.csv").unlink()
    again = study_from(json.loads(json.dumps(study.as_tables())), "test")
    assert again.scenarios[0].reference.settings.text.startswith("t,x,y,z")  # type: ignore[attr-defined]


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({"controllers": ["smc", "smc"]}, "smc is given twice"),
        ({"controllers": object}, "a campaign is kept as data, so it takes no objects"),
        ({"controllers": [3]}, "allowed: names of controllers"),
        ({"settings": {"fault.0.loss": 0.3}}, "fault.0.loss: the study varies it, by its axis or draw 'loss'"),
        ({"settings": {"mismatch.mass": 1.1}}, "by its axis or draw 'mass'"),
        ({"settings": {"seed": 3}}, "give the seed of the study"),
        ({"settings": [1]}, "dotted keys and values"),
    ],
)
def test_what_cannot_be_is_refused(changes: dict[str, Any], named: str) -> None:
    with pytest.raises(InputError, match=named):
        changed(tiny(), **changes)


def test_a_controller_is_refused_where_the_study_varies_it() -> None:
    study = tiny(axis=[{"name": "controller", "values": ["smc", "roismc"]}], variant=[{"label": "x"}])
    with pytest.raises(InputError, match=r"controller\.kind: the study varies it, by its axis or draw 'controller'"):
        changed(study, controllers="sdre")


SMALL = {**TINY, "draw": TINY["draw"][:2], "axis": [{"name": "loss", "values": [0.1, 0.4]}]}
SMALL |= {"settings": {**TINY["settings"], "duration": 0.4}, "refine": {"initial": 2, "block": 2, "most": 2}}


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A campaign of SMC and a controller of one's own."""
    folder = tmp_path_factory.mktemp("flown") / "campaign"
    rf.campaign(SMALL, folder, controllers=["smc", OWN], settings={"duration": 0.3})
    return folder


def row_of(campaign: rf.Campaign, label: str) -> dict[str, Any]:
    return next(row for row in campaign.table() if row["variant"] == label)


@needs_simd
def test_it_is_flown_and_resumed_and_kept_whole(flown: Path) -> None:
    before = (flown / "flights.parquet").read_bytes()
    rf.campaign(SMALL, flown, controllers=["smc", OWN], settings={"duration": 0.3}, resume=True)
    assert (flown / "flights.parquet").read_bytes() == before
    with pytest.raises(InputError, match=r"holds a campaign of another study \(.*duration"):
        rf.campaign(SMALL, flown, controllers=["smc", OWN], settings={"duration": 0.4}, resume=True)
    assert {row["variant"] for row in rf.Campaign(flown).table()} == {"smc", "PdController"}


@needs_simd
@pytest.mark.filterwarnings("error::rotorfault.campaigns.api.ReplayWarning")
def test_a_replay_asks_for_code_unless_it_is_named_again(flown: Path) -> None:
    stranger = rf.Campaign(flown)
    own, smc = row_of(stranger, "PdController"), row_of(stranger, "smc")
    with pytest.raises(InputError, match="--allow-code"):
        stranger.replay(own["id"])
    # A flight of another variant needs no code.
    assert stranger.replay(smc["id"]).scores["cost"] == smc["cost"] or smc["cost"] is None
    for flight in (
        stranger.replay(own["id"], controller=OWN),
        rf.Campaign(flown, allow_code=[OWN]).replay(own["id"]),
        rf.Campaign(flown, allow_code=True).replay(own["id"]),
    ):
        assert flight.scores["tilt_max"] == pytest.approx(own["tilt_max"], rel=1e-12)
    assert not stranger.is_changed(own["id"], {"controller.kind": OWN})


@needs_simd
@pytest.mark.filterwarnings("error::rotorfault.campaigns.api.ReplayWarning")
def test_a_replay_with_something_else_keeps_what_was_drawn(flown: Path) -> None:
    campaign = rf.Campaign(flown)
    row = row_of(campaign, "PdController")
    flight = campaign.replay(row["id"], controller="smc", settings={"wind": "none"})
    assert campaign.is_changed(row["id"], {"controller.kind": "smc"})
    assert flight.scenario is not None
    assert flight.scenario.seed == row["seed"]
    assert flight.scenario.mismatch.mass == row["mass"]
    assert flight.scenario.wind.kind == "none"  # type: ignore[attr-defined]
    assert flight.label.startswith("smc")
    own = campaign.replay(row["id"], controller="smc", settings={"mismatch.mass": 1.2})
    assert own.scenario is not None
    assert own.scenario.mismatch.mass == 1.2
