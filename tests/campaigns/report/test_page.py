"""The page of a campaign: whole, with the numbers and commands of every cell."""

from __future__ import annotations

import json
import re
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from campaign_tables import FIRST, LOSS, STUDIES, WIND, falling, table_of

from rotorfault.campaigns.grades import GRADES
from rotorfault.campaigns.report import charts, curves, report
from rotorfault.campaigns.report.maps import Maps, maps


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
            where, said, (command,), _, _ = heat["customdata"][j][i]
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
        for spec in specs:
            graph_objects.Figure(json.loads(json.dumps(spec, allow_nan=False)))
