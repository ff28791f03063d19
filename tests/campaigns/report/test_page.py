"""The page of a campaign: whole, with the numbers and commands of every cell."""

from __future__ import annotations

import itertools
import json
import re
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from campaign_tables import FIRST, LOSS, STUDIES, WIND, falling, study_of, table_of

from rotorfault.campaigns.grades import GRADES
from rotorfault.campaigns.report import charts, curves, report
from rotorfault.campaigns.report.answer import answer
from rotorfault.campaigns.report.maps import Maps, maps
from rotorfault.pages.style import STYLE


class Parsed(HTMLParser):
    """Elements that are open, and what refers to elsewhere."""

    VOID = ("meta", "img", "br")

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.references: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.references += [value or "" for key, value in attrs if key in ("src", "href")]
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> str:
    study = STUDIES["plane"]
    folder = tmp_path_factory.mktemp("a campaign")
    paths = report.write(study, table_of(study, falling), folder, {"rotorfault": "0.0"})
    assert [path.name for path in paths[:3]] == ["report.html", "success.png", "success.svg"]
    assert all(path.stat().st_size > 1000 for path in paths)
    text = paths[0].read_text(encoding="utf-8")
    assert f"rotorfault replay '{folder}'" in text.replace("&#39;", "'")
    return text


def test_page_is_whole_and_needs_nothing_else(page: str) -> None:
    parsed = Parsed()
    parsed.feed(page)
    assert parsed.open == []
    assert all(reference.startswith("data:") for reference in parsed.references)
    assert len(parsed.references) == 2
    assert page.count("<script") - page.count('type="application/json"') == 2
    assert "plotly.js v" in page


def test_page_has_the_numbers_and_commands_of_every_cell(page: str, plane: Maps) -> None:
    specs = json.loads(re.search(r'<script type="application/json" id="specs">(.*?)</script>', page, re.DOTALL)[1])
    assert len(specs) == 3
    for spec, variant in zip(specs[:2], plane.variants, strict=True):
        heat = spec["data"][0]
        np.testing.assert_allclose(np.array(heat["z"], dtype=float), variant.success_rate.T, atol=1e-5)
        for (i, j), successes in np.ndenumerate(variant.successes):
            where, said, (command,), _, _, _ = heat["customdata"][j][i]
            assert where == f"loss {LOSS['values'][i]:g}, wind speed {WIND['values'][j]:g} m/s"
            assert f"success {successes} of {FIRST}" in said
            failure = f"--flight {variant.first_failure[i, j]}"
            none = f"--cell {variant.cell[i, j]} --variant {variant.label}"
            assert command.endswith(none if successes == FIRST else failure)
    table = page[page.index('id="cells"') :]
    assert table.count("<code>rotorfault replay") == 2 * 15
    pair = specs[2]["data"][0]["customdata"][0][1]
    assert len(pair[2]) == 2
    for grade in GRADES:
        assert f"<dt>{grade}" in page


def test_page_says_what_was_found_in_the_words_of_the_terminal(page: str, plane: Maps) -> None:
    told = answer(plane)
    shown = page.replace("\u00a0", " ")
    for text in (*(variant.share for variant in told.variants), told.pairs[0].difference, told.pairs[0].verdict):
        assert text in shown
    for variant in told.variants:
        for line in variant.lines:
            assert f'{line.text} <span class="soft">at {line.where}</span>' in page


def test_page_is_for_light_and_dark_and_for_a_telephone(page: str) -> None:
    assert STYLE in page
    assert "prefers-color-scheme: dark" in page
    for table in re.findall(r"<table[^>]*>", page):
        assert 'class="stacked"' in table


def test_charts_are_what_plotly_takes() -> None:
    graph_objects = pytest.importorskip("plotly.graph_objects")
    for name, study in STUDIES.items():
        found = maps(study, table_of(study, falling))
        cells = charts.variant_cells(found, 0, Path("campaign"))
        if len(found.views) == 1:
            specs = [charts.success_lines_chart(found, 0, cells)]
            specs += [charts.difference_lines_chart(found, 0, cells)] if found.pairings else []
        else:
            parts = curves.slices(found)[0]
            specs = [charts.success_chart(found, 0, part, cells) for part in parts]
            specs += [charts.difference_chart(found, 0, part, cells) for part in parts]
            assert len(specs) == 2 * (2 if name == "space" else 1)
        assert not any(trace["name"] == "not flown" for spec in specs for trace in spec["data"])
        for spec in specs:
            graph_objects.Figure(json.loads(json.dumps(spec, allow_nan=False)))


def test_cells_without_flights_are_hatched_and_those_without_success_are_not() -> None:
    """None of eight flights in the first cells succeeds; the others were not flown."""
    study = STUDIES["plane"]
    found = maps(study, table_of(study, lambda *_: 0.0, lambda _, cell: 8 if cell < 8 else 0))
    chart = charts.success_chart(
        found, 0, curves.slices(found)[0][0], charts.variant_cells(found, 0, Path("campaign"))
    )
    heat, hatched = chart["data"][:2]
    assert np.array(heat["z"], dtype=float)[0, 0] == 0.0
    assert heat["colorscale"][0][1] != chart["layout"]["plot_bgcolor"]
    assert hatched["name"] == "not flown"
    assert hatched["fillpattern"]["shape"] == "/"
    assert hatched["x"].count(None) == np.isnan(found.variants[0].success_rate).sum() == 7


def test_lines_join_cells_only_where_what_lies_between_is_known() -> None:
    def joined(values: list[float], flights: int) -> dict[str, int]:
        """Joints between neighbours by kind of line."""
        study = study_of([{"name": "loss", "values": values}], refine={"initial": flights, "most": flights})
        found = maps(study, table_of(study, lambda _, place: float(place[0] < 4), lambda *_: flights))
        chart = charts.success_lines_chart(found, 0, charts.variant_cells(found, 0, Path("campaign")))
        lines = [trace for trace in chart["data"] if trace["mode"] == "lines"]
        return {
            trace["line"].get("dash", "solid"): sum(
                a is not None and b is not None for a, b in itertools.pairwise(trace["x"])
            )
            for trace in lines
        }

    fine = [0.1 * k for k in range(11)]
    assert joined(fine, 4) == {"solid": 10}  # nothing is sure of four flights
    assert joined(fine, 100) == {"solid": 9, "dash": 1}  # between the last success and the first failure
    assert joined(fine[:5], 4) == {"dash": 4}  # coarse
