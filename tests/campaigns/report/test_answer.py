"""What a campaign found is told with the same numbers everywhere, and no more surely than it is known."""

from __future__ import annotations

import pytest
from campaign_tables import FIRST, LOSS, STUDIES, WIND, falling, study_of, table_of

from rotorfault.campaigns.report.answer import Answer, answer
from rotorfault.campaigns.report.maps import Maps, maps

FINE = {"name": "loss", "start": 0.0, "stop": 1.0, "count": 21}
MANY = {"initial": 200, "block": 200, "most": 400, "width": 0.1}


def found(*axes: dict[str, object], share: object = falling, **tables: object) -> tuple[Answer, Maps]:
    study = study_of(list(axes), **tables)
    numbers = maps(study, table_of(study, share, lambda *_: study.refine.initial))
    return answer(numbers), numbers


def test_shares_and_differences_are_those_of_the_maps() -> None:
    told, numbers = found(LOSS, WIND)
    for variant, of_map in zip(told.variants, numbers.variants, strict=True):
        low, high = (100.0 * float(each) for each in (of_map.total.lower, of_map.total.upper))
        assert variant.share == f"{100.0 * of_map.total.estimate:.1f} % ({low:.1f} % to {high:.1f} %)"
    (pair,) = told.pairs
    total = numbers.pairings[0].total
    assert pair.difference.startswith(f"{100.0 * float(total.estimate):+.1f} % (")
    said = str(told)
    for text in (
        told.variants[0].share,
        told.variants[1].share,
        pair.pair,
        pair.verdict,
        told.variants[0].lines[0].text,
    ):
        assert text in said
    assert "−" not in said


def test_a_verdict_follows_from_the_interval() -> None:
    ahead, _ = found(LOSS, share=lambda label, _: float(label == "two"))
    behind, _ = found(LOSS, share=lambda label, _: float(label == "one"))
    alike, _ = found(LOSS, share=lambda *_: 0.5)
    verdicts = [each.pairs[0].verdict for each in (ahead, behind, alike)]
    assert verdicts == ["two succeeds more often", "one succeeds more often", "no difference over the map is shown"]


def test_the_boundary_lies_between_cells_that_are_surely_on_its_sides() -> None:
    """All succeed up to a loss of 0.45, none from 0.5 on: of 200 flights a cell, all in doubt lies between."""
    told, _ = found(FINE, share=lambda _, place: float(place[0] < 10), refine=MANY, variant=[{"label": "one"}])
    assert told.along == "loss"
    assert told.spacing == "0.05"
    assert told.variants[0].lines[0].text == "0.475 (0.45 to 0.5)"


def test_coarse_cells_have_no_place_between_them() -> None:
    told, _ = found(
        {"name": "loss", "values": [0.0, 0.4, 0.8]}, share=lambda _, place: float(place[0] < 2), refine=MANY
    )
    assert told.variants[0].lines[0].text == "between 0.4 and 0.8 (0.4 to 0.8)"


@pytest.mark.parametrize(
    ("share", "words"),
    [
        (lambda *_: 0.0, "nowhere: no flight was successful"),
        (lambda *_: 0.25, "nowhere: below 50 % in every cell"),
        (lambda *_: 1.0, "nowhere: 50 % or more in every cell"),
    ],
)
def test_without_a_boundary_it_says_on_which_side_all_is(share: object, words: str) -> None:
    told, _ = found(LOSS, WIND, share=share)
    assert [line.text for line in told.variants[0].lines] == [words, words]
    assert [line.where for line in told.variants[0].lines] == ["wind speed 0 m/s", "wind speed 8 m/s"]


def test_the_axis_is_the_one_that_the_boundary_crosses() -> None:
    told, _ = found(LOSS, WIND, share=lambda _, place: float(place[1] < 1))
    assert told.along == "wind speed"
    assert told.variants[0].lines[0].text.startswith("between 0 and 4 m/s")
    assert not answer(maps(STUDIES["names"], table_of(STUDIES["names"], falling))).along


def test_what_is_not_flown_is_said() -> None:
    study = study_of([LOSS, WIND])
    told = answer(maps(study, table_of(study, falling, lambda _, cell: FIRST if cell % 3 == 0 else 0)))
    assert (told.complete, told.compared) == (False, 5)
    assert [line.text for line in told.variants[0].lines][1] == "not flown"
    assert "not complete" in str(told)
    assert "5 of 15 cells" in str(told)
