"""Whatever users hold in their hands says in one readable line what it is."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from campaign_studies import TINY
from gates import needs_simd
from part_examples import PARTS, part_of
from places import EXAMPLES

import rotorfault as rf
from rotorfault.base.one_line import LONGEST
from rotorfault.campaigns.load import load_study
from rotorfault.engine import load_engine
from rotorfault.flight.assembly import assemble
from rotorfault.reference import REFERENCE
from rotorfault.scenario.slots import SLOTS


def assert_readable(thing: object) -> None:
    text = repr(thing)
    assert text.isprintable(), text
    assert len(text) <= LONGEST, text
    assert " object at 0x" not in text


@pytest.mark.parametrize("name", rf.__all__)
def test_a_public_name(name: str) -> None:
    assert_readable(getattr(rf, name))


SHORT = {**TINY["settings"], "duration": 0.3}
RECORDS = [name for name in rf.__all__ if hasattr(getattr(rf, name), "_fields")]


@pytest.mark.parametrize("name", RECORDS)
@pytest.mark.parametrize("value", [1.0 / 3.0, np.linspace(0.0, 1.0, 1000), rf.Vec3(0.1, 0.2, np.zeros(50))])
def test_a_record_whatever_it_holds(name: str, value: object) -> None:
    kind = getattr(rf, name)
    assert_readable(kind(*(value for _ in kind._fields)))


def test_values_keep_all_digits_and_arrays_are_told_by_their_shape() -> None:
    assert repr(rf.Vec3(1.0 / 3.0, 0.0, -1.0)) == "Vec3(x=0.3333333333333333, y=0.0, z=-1.0)"
    assert repr(rf.Vec3(np.zeros(9), 0.0, 0.0)) == "Vec3(x=array of 9, y=0.0, z=0.0)"


@pytest.mark.parametrize(("slot", "name"), PARTS)
def test_parts_settings_slots_and_registries(slot: str, name: str, tmp_path: Path) -> None:
    part = part_of(slot, name, tmp_path)
    for thing in (SLOTS, SLOTS[slot], SLOTS[slot].registry, part, part.settings, part.make()):
        assert_readable(thing)
    assert name in repr(part)


def flown() -> Iterator[Any]:
    scenario = rf.load_scenario("hover-fault", {"duration": 0.1})
    flight = rf.fly(scenario)
    yield from (scenario, scenario.vehicle, scenario.vehicle.vehicle, scenario.start, scenario.mismatch)
    yield from (flight, flight.summary(), flight.outcome, rf.neighbour(scenario, 1))
    many = rf.fly_many(scenario, {"fault.0.loss": [0.1, 0.2]})
    yield from (many, many.table, many.replay(0), rf.compare(flight, flight))
    batch = assemble(scenario)
    recording = load_engine("numpy")(batch, lambda done: False)
    yield from (batch, batch.loop, batch.loop.layout, recording)
    yield scenario[REFERENCE].make().table(np.zeros(5))
    report = rf.trim_report("paper")
    yield from (report, report.numbers, report.hover, report.linear, *report.margins.values())
    yield rf.check_block(f"{EXAMPLES / 'controller.py'}:PdController")
    yield rf.hover_margin(scenario.vehicle.vehicle, rf.PerRotor(0.1, 0.0, 0.0, 0.0))
    yield rf.torque_reserve(scenario.vehicle.vehicle, rf.PerRotor(0.1, 0.0, 0.0, 0.0))
    study = load_study("partial-loss-map")
    yield from (study, *study.axis, *study.draw, *study.variant, study.refine, *study.scenarios)


def test_what_public_functions_return() -> None:
    for thing in flown():
        assert_readable(thing)


@needs_simd
def test_a_campaign_and_its_maps(tmp_path: Path) -> None:
    small = {
        **TINY,
        "refine": {"initial": 2, "block": 2, "most": 2},
        "settings": TINY["settings"] | {"duration": 0.3},
    }
    campaign = rf.campaign(small, tmp_path / "campaign")
    maps = campaign.maps()
    for thing in (campaign.study, campaign.table(), maps, *maps.variants, *maps.pairings, *maps.views):
        assert_readable(thing)
    assert repr(campaign.table()).startswith(f"<table of {campaign.table().num_rows} flights")
    page = campaign._repr_html_()
    assert "roismc" in page
    assert "loss, wind_speed" in page


def test_long_names_do_not_make_long_lines() -> None:
    scenario = rf.load_scenario("hover-fault", {"name": "x" * 500, "duration": 0.1})
    for thing in (scenario, rf.fly(scenario), rf.fly(scenario).summary()):
        assert_readable(thing)
