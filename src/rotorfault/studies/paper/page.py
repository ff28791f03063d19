"""The report as one HTML page that opens offline: figures inside, tables, claims, readings, versions, times."""

from __future__ import annotations

import base64
import csv
from collections.abc import Mapping
from importlib import resources
from pathlib import Path
from typing import Any, NamedTuple

from rotorfault.autopilot.presets import record as record_of
from rotorfault.base.versions import versions
from rotorfault.pages.style import environment
from rotorfault.studies.paper import ablation, answer, figures, range_tables, ranges, sensitivity, table1
from rotorfault.studies.paper.cases import main_runs
from rotorfault.studies.paper.replays import Replay
from rotorfault.studies.paper.verdicts import Claim
from rotorfault.studies.runs import Result

PICTURE = "fig03"  # opens the page: position and error of case 1 under both laws
EXTRA_CAPTIONS = {
    "wind": "Claim 5: settling time and oscillation of case 1 against wind speed.",
    "ablation": "What each part of the method is worth, case by case.",
    "sensitivity": "Which conclusions move with what the paper leaves open.",
}


class Page(NamedTuple):
    """All that the report shows."""

    folder: Path
    results: Mapping[str, Result]
    claims: list[Claim]
    quick: bool
    seconds: dict[str, float]
    replays: list[Replay]  # pages of the cases


def render(page: Page) -> str:
    """The page's HTML."""
    template = (resources.files("rotorfault.studies.paper") / "report.html.j2").read_text(encoding="utf-8")
    made = environment()
    made.filters["number"] = _number
    table = table1.rows(page.results)
    drawn = _figures(page, figures.CAPTIONS)
    return made.from_string(template).render(
        answer=answer.sentences(page.claims, table, page.results),
        counts=answer.counts(page.claims),
        look=answer.look_of,
        picture=next((figure for figure in drawn if figure["name"] == PICTURE), None),
        table=table,
        ranges=_ranges(),
        claims=page.claims,
        figures=drawn,
        extras={name: block[0] for name in EXTRA_CAPTIONS if (block := _figures(page, {name: EXTRA_CAPTIONS[name]}))},
        flights=_flights(page.results),
        replays=page.replays,
        ablation=[] if page.quick else _rows(page.folder / "ablation.csv"),
        sensitivity=[] if page.quick else _rows(page.folder / "sensitivity.csv"),
        findings={}
        if page.quick
        else {"ablation": ablation.findings(page.results), "sensitivity": sensitivity.findings(page.results)},
        records=_records(),
        versions=versions(),
        seconds=page.seconds,
        flying=sum(result.seconds for result in page.results.values()),
        count=len(page.results),
    )


def _figures(page: Page, captions: Mapping[str, str]) -> list[dict[str, str]]:
    blocks = []
    for name, caption in captions.items():
        path = page.folder / "figures" / f"{name}.png"
        if path.is_file():
            data = base64.b64encode(path.read_bytes()).decode("ascii")
            title = f"Fig. {int(name[3:])}" if name.startswith("fig") else ""
            blocks.append({"name": name, "title": title, "caption": caption, "data": data})
    return blocks


def _flights(results: Mapping[str, Result]) -> list[dict[str, Any]]:
    """The main flights, a row each."""
    rows = []
    for run in main_runs():
        if run.id not in results:
            continue
        result = results[run.id]
        rows.append({"id": run.id, "command": run.command, "seconds": result.seconds, **result.summary})
    return rows


def _ranges() -> dict[str, Any]:
    """Table 1 as ranges, from the numbers that come with the package."""
    kept = ranges.kept()
    found = range_tables.pairs(kept.gains)
    return {
        "pairs": len(found),
        "ratios": range_tables.ratio_rows(found),
        "numbers": range_tables.number_rows(found),
        "searches": range_tables.search_rows(kept.gains),
        "said": range_tables.headline(found),
        "version": kept.version,
    }


def _rows(path: Path) -> list[list[str]]:
    with path.open(encoding="utf-8", newline="") as file:
        return [[_shown(text) for text in row] for row in csv.reader(file)]


def _shown(text: str) -> str:
    """What stands in a table, with as many digits as a reader looks at."""
    try:
        return f"{float(text):.5g}" if "." in text else text
    except ValueError:
        return text


def _records() -> list[dict[str, Any]]:
    """How the presets that were flown were found."""
    records = []
    for controller in ("smc", "roismc"):
        record = record_of(controller, "tuned")
        if record:
            records.append({"controller": controller, **record})
    return records


def _number(value: float | None, digits: int = 4) -> str:
    return "–" if value is None else f"{value:.{digits}g}"
