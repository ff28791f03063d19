"""The paper's report: it opens with its answer, with the study's numbers; every table fits a telephone."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest

from rotorfault.base.files import write_atomically
from rotorfault.pages.style import STYLE
from rotorfault.studies.paper import answer
from rotorfault.studies.paper.cases import CASES, run_of
from rotorfault.studies.paper.page import PICTURE, Page, render
from rotorfault.studies.paper.replays import Replay
from rotorfault.studies.paper.table1 import Costs, Row
from rotorfault.studies.paper.verdicts import CONFIRMED, NOT_CONFIRMED, UNDER, Claim
from rotorfault.studies.runs import Result

PIXEL = b"\x89PNG made up"


def claim(name: str, verdict: str) -> Claim:
    return Claim(name, "ROISMC <beats> SMC", "0.8", "0.9", "1", verdict, "rotorfault fly x", "Rule: by 5 %")


CLAIMS = [claim("a", CONFIRMED), claim("b", f"{UNDER}'other'"), claim("c", NOT_CONFIRMED), claim("d", CONFIRMED)]


def flight(case: str, law: str, cost: float, **summary: Any) -> Result:
    run = run_of(case, law)
    told = {
        "outcome": "settled",
        "survived": True,
        "end_time": 20.0,
        "cost": cost,
        "tilt_max": 0.3,
        "false_alarms": 0,
    }
    return Result(run, told | {"settle_time": {"overall": 1.253}} | summary, {}, 1.0, None)


@pytest.fixture
def page(tmp_path: Path) -> Page:
    results = {}
    for case in CASES:
        for law, cost in (("smc", 2.0), ("roismc", 1.5 if case == "square" else 1.0)):
            made = flight(case, law, cost)
            results[made.run.id] = made
        matched = run_of(case, "smc", preset="matched")
        results[matched.id] = flight(case, "smc", 4.0)._replace(run=matched)
    (tmp_path / "figures").mkdir()
    for name in (PICTURE, "fig04"):
        write_atomically(tmp_path / "figures" / f"{name}.png", lambda path: path.write_bytes(PIXEL))
    return Page(tmp_path, results, CLAIMS, True, {"flights": 1.0}, [Replay("Case 1", "flights/set-point.html")])


def test_it_opens_with_its_answer_and_one_picture_before_all_tables(page: Page) -> None:
    text = render(page)
    order = [text.index(part) for part in ('id="answer"', "<img", "<table", 'id="claims"', 'id="figures"')]
    assert order == sorted(order)
    assert text.index("<table") > text.index('id="table1"')
    assert text.count("<img") == 2  # the one at the top is not shown again
    said = text[order[0] : order[1]]
    assert "taken apart into 4, 2 are confirmed, 1 only under another reading of the paper, and 1 are not" in said
    assert "in 3 of 3 cases, 0.50 to 0.75 times as much" in said
    assert "settles within 2 % after 1.25 s" in said


def test_the_answer_speaks_of_what_was_flown_alone() -> None:
    paper = Costs(3.0, 2.0, "", "")
    lost = Row("square", "Square wave", paper, paper, Costs(2.0, 1.0, "tumbled", "settled"))
    assert len(answer.sentences(CLAIMS, [lost], {})) == 1
    worse = Row("square", "Square wave", paper, paper, Costs(1.0, 2.0, "settled", "settled"))
    assert "costs less than SMC in 0 of 1 cases, 2.00 times as much" in answer.sentences(CLAIMS, [worse], {})[1]
    fell = flight("set-point", "roismc", 1.0, survived=False, outcome="tumbled", end_time=1.9)
    assert "it is lost (tumbled at 1.9 s)" in answer.sentences(CLAIMS, [], {fell.run.id: fell})[1]
    never = flight("set-point", "roismc", 1.0, settle_time={"overall": None})
    assert "it does not settle" in answer.sentences(CLAIMS, [], {never.run.id: never})[1]


def test_every_table_scrolls_alone_and_rows_of_verdicts_stack(page: Page) -> None:
    text = render(page)
    assert text.count("<table") == len(re.findall(r'<div class="scroll"[^>]*><table', text)) > 3
    table = text[text.index('aria-label="Claims"') :].partition("</table>")[0]
    assert 'class="stacked"' in table
    # The verdict is the first cell of its row: it is in sight without scrolling, and on top of a stacked row.
    rows = table.partition("<tbody>")[2].split("<tr>")[1:]
    verdicts = [re.match(r'<td class="verdict (\w+)">([^<]*)</td>', row) for row in rows]
    looks = [found.groups() for found in verdicts if found]
    assert [look for look, _ in looks] == ["confirmed", "partly", "not", "confirmed"]
    assert "ROISMC &lt;beats&gt; SMC" in table


def test_its_style_knows_dark_mode_and_telephones(page: Page) -> None:
    assert STYLE in render(page)
    for media in ("prefers-color-scheme: dark", "max-width: 40rem"):
        assert f"@media ({media})" in STYLE
    assert STYLE.count("{") == STYLE.count("}")
    # Each colour that is used is defined for both.
    light, dark = (STYLE.split(":root")[k].partition("}")[0] for k in (1, 2))
    used = set(re.findall(r"var\((--\w+)\)", STYLE))
    assert used <= set(re.findall(r"(--\w+):", light)) == set(re.findall(r"(--\w+):", dark))


def test_the_flights_of_each_case_can_be_looked_at(page: Page) -> None:
    assert '<a href="flights/set-point.html">Case 1</a>' in render(page)
    assert "replayed in 3-D" not in render(page._replace(replays=[]))
