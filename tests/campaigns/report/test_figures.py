"""Figures of a campaign cover nothing and are no more than can be looked at."""

from __future__ import annotations

import pytest
from campaign_tables import LOSS, STUDIES, WIND, falling, study_of, table_of
from figure_checks import check_nothing_covered
from matplotlib.figure import Figure

from rotorfault.campaigns.report import curves, figures
from rotorfault.campaigns.report.maps import Maps, maps


@pytest.fixture(scope="module", params=list(STUDIES))
def made(request: pytest.FixtureRequest) -> tuple[str, Maps, dict[str, Figure]]:
    study = STUDIES[request.param]
    found = maps(study, table_of(study, falling))
    return request.param, found, figures.draw(found)


def test_figures_cover_nothing(made: tuple[str, Maps, dict[str, Figure]]) -> None:
    name, _, drawn = made
    wanted = {
        "plane": {"success", "difference", "grades", "recovery"},
        "line": {"success", "difference", "grades", "recovery"},
        "names": {"success", "grades", "recovery"},
        "space": {"success-one", "success-two", "difference-one-two", "grades", "recovery"},
        "odd": {"success", "difference", "grades", "recovery"},
    }
    assert set(drawn) == wanted[name]
    for title, figure in drawn.items():
        check_nothing_covered(f"{name} {title}", figure)


def test_no_more_slices_than_can_be_looked_at() -> None:
    study = study_of(
        [LOSS, WIND, {"name": "mass", "start": 0.8, "stop": 1.2, "count": 9}], variant=[{"label": "one"}]
    )
    found = maps(study, table_of(study, falling))
    parts, count = curves.slices(found)
    assert (len(parts), count) == (curves.MOST_SLICES, 9)
    assert (parts[0].title, parts[-1].title) == ("mass 0.8", "mass 1.2")
    assert "6 of 9" in figures.draw(found)["success-one"].legends[0].get_title().get_text()


def test_numbers_of_flights_have_a_map_where_they_differ() -> None:
    study = STUDIES["plane"]
    alike = figures.draw(maps(study, table_of(study, falling)))["success"]
    assert "each cell: 8 flights" in [text.get_text() for text in alike.legends[0].get_texts()]
    refined = figures.draw(maps(study, table_of(study, falling, lambda _, cell: 8 if cell else 16)))["success"]
    labels = [[axes.get_ylabel() for axes in one.axes] for one in (alike, refined)]
    assert ["flights (–)" in one for one in labels] == [False, True]
    check_nothing_covered("refined", refined)
