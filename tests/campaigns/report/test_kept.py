"""Flights of a campaign whose pages are kept: that each is the flight of the table, and that the map opens it."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pytest
from browsers import NEEDED, READY, Opened, chromium

import rotorfault as rf

STUDY: dict[str, Any] = {
    "name": "tiny",
    "scenario": "hover-fault",
    "settings": {"duration": 1.5, "period": 0.002, "fault.0.time": 0.1},
    "variant": [{"label": "ours"}, {"label": "theirs", "settings": {"controller": "smc"}}],
    "description": "<script>alert(1)</script> </title> '\"> {{ 7 * 7 }} 🚁",
    "axis": [{"name": "loss", "values": [0.0, 0.55, 0.9]}],
    "refine": {"initial": 4, "block": 4, "most": 4},
}


# Where on the screen the point of a chart is whose flight was kept.
KEPT = """(() => {
  const chart = document.querySelector('.chart');
  const trace = chart.data.find((one) => one.customdata?.some((cell) => cell?.[5]));
  const at = trace.customdata.findIndex((cell) => cell?.[5]);
  const { xaxis, yaxis } = chart._fullLayout;
  const { left, top } = chart.getBoundingClientRect();
  return [left + xaxis._offset + xaxis.d2p(trace.x[at]), top + yaxis._offset + yaxis.d2p(trace.y[at])];
})()"""


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> rf.Campaign:
    return rf.campaign(STUDY, tmp_path_factory.mktemp("kept") / "campaign")


def test_kept_pages_show_the_flight_of_the_table_beside_that_of_the_other_variant(flown: rf.Campaign) -> None:
    (page, *others) = flown.keep_flights(1)
    assert len(others) == 1
    identifier = int(page.stem)
    row = next(row for row in flown.table().to_polars().iter_rows(named=True) if row["id"] == identifier)
    html = page.read_text(encoding="utf-8")
    labels = re.findall(r'class="flight-name"><span data-flight="\d">■</span> \d · (\w+)', html)
    assert labels[0] == row["variant"]
    assert set(labels) == {"ours", "theirs"}
    first = json.loads(re.search(r'id="data">(.*?)</script>', html, re.DOTALL)[1])["flights"][0]
    assert first["events"][-1]["text"] == row["outcome"]
    assert first["events"][-1]["time"] == pytest.approx(row["end_time"])


def test_the_map_opens_what_was_kept_and_nothing_else(flown: rf.Campaign) -> None:
    flown.keep_flights(1)
    page = flown.report()[0].read_text(encoding="utf-8")
    links = set(re.findall(r'<a href="(flights/\d+\.html)">', page))
    assert links == {f"flights/{path.name}" for path in (flown.folder / "flights").iterdir()}
    specs = json.loads(re.search(r'id="specs">(.*?)</script>', page, re.DOTALL)[1])
    named = set(re.findall(r"flights/\d+\.html", json.dumps(specs)))
    assert named == links


def test_pages_that_are_there_are_not_made_anew(flown: rf.Campaign) -> None:
    before = {path: path.stat().st_mtime_ns for path in flown.keep_flights(1)}
    assert {path: path.stat().st_mtime_ns for path in flown.keep_flights(1)} == before


def test_a_campaign_with_kept_flights_goes_on(flown: rf.Campaign) -> None:
    flown.keep_flights(1)
    again = rf.campaign(STUDY, flown.folder, resume=True)
    assert len(again.table()) == len(flown.table())


@pytest.mark.parametrize("cells", [0, 4, 1.5, "two", True])
def test_how_many_cells_is_a_whole_number(flown: rf.Campaign, cells: Any) -> None:
    with pytest.raises(rf.InputError, match="cells: got"):
        flown.keep_flights(cells)
    assert isinstance(flown.folder, Path)


@NEEDED
def test_a_click_on_the_map_opens_the_flight(flown: rf.Campaign) -> None:
    """On a telephone: without complaint or network, and with the words of the study as text."""
    flown.keep_flights(1)
    page = flown.report()[0]
    with chromium() as browser:
        shown = Opened(browser, page, width=390, scheme="dark", ready=".chart .main-svg")
        shown.page.wait_for_timeout(200)
        assert shown.complaints == shown.elsewhere == []
        assert shown.ask("document.documentElement.scrollWidth") <= 390
        assert STUDY["description"] in shown.page.inner_text("body")
        shown.ask("document.querySelector('.chart').scrollIntoView({ block: 'center' })")
        shown.page.mouse.click(*shown.ask(KEPT))
        shown.page.click("#replay a")
        shown.page.wait_for_selector(READY)
        assert shown.ask("rotorfault.flights.length") == 2
        assert shown.complaints == shown.elsewhere == []
        shown.context.close()
