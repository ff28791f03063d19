"""The report of a campaign as one HTML page that opens offline: interactive maps, tables, figures, commands."""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray
from plotly.offline import get_plotlyjs

from rotorfault.base.plain_text import argument
from rotorfault.campaigns.grading import GRADINGS
from rotorfault.campaigns.report import charts
from rotorfault.campaigns.report.answer import answer
from rotorfault.campaigns.report.axis_drawing import coarse
from rotorfault.campaigns.report.curves import slices
from rotorfault.campaigns.report.flown import flown
from rotorfault.campaigns.report.maps import Maps, VariantMap
from rotorfault.campaigns.sampling.statistics import Array
from rotorfault.campaigns.summaries.parts import Summary
from rotorfault.loop.scores import RECOVERED
from rotorfault.pages.style import environment, script_data

MOST_ROWS = 3000  # of the table of all cells; beyond, it would slow the page down


def render(
    maps: Maps,
    folder: Path,
    versions: Mapping[str, str],
    figures: Mapping[str, Path],
    summary: Summary | None = None,
    own: Sequence[Path] = (),
) -> str:
    """The page's HTML.

    Parameters
    ----------
    maps : Maps
    folder : Path
        Of the campaign, as commands are to name it.
    versions : mapping of str to str
        With which the campaign was flown.
    figures : mapping of str to Path
        SVG files to be shown: ``grades`` and ``recovery``.
    summary : Summary, optional
        What the study writes besides.
    own : sequence of Path
        SVG files of its figures.
    """
    template = (resources.files("rotorfault.campaigns.report") / "campaign.html.j2").read_text(encoding="utf-8")
    cells = [charts.variant_cells(maps, k, folder) for k in range(len(maps.variants))]
    sections = _sections(maps, folder, cells)
    rows = [
        {"variant": variant.label, "cell": int(variant.cell[at]), "note": notes[at]}
        for variant, notes in zip(maps.variants, cells, strict=True)
        for at in np.ndindex(*variant.cell.shape)
    ]
    return environment().from_string(template).render(
        study=maps.study,
        maps=maps,
        answer=answer(maps),
        flown=flown(maps, folder, versions),
        grading=GRADINGS[maps.study.grading],
        recovered=f"{RECOVERED:g}",
        possible=[_possible(variant) for variant in maps.variants],
        coarse=any(coarse(view) for view in maps.views[:2]),
        sections=[{k: v for k, v in section.items() if k != "spec"} for section in sections],
        specs=script_data([section["spec"] for section in sections]),
        slices=slices(maps),
        kept=sum(1 for notes in cells for note in notes.ravel().tolist() if note.page),
        error=f"{100.0 * (1.0 - maps.study.refine.level):.3g} %",
        rows=rows[:MOST_ROWS],
        cut=len(rows) - MOST_ROWS if len(rows) > MOST_ROWS else 0,
        folder=argument(folder),
        figures={name: base64.b64encode(path.read_bytes()).decode("ascii") for name, path in figures.items()},
        summary=summary,
        summary_figures=[(path.stem, base64.b64encode(path.read_bytes()).decode("ascii")) for path in own],
        plotly=Markup(get_plotlyjs()),
    )  # fmt: skip


def _sections(maps: Maps, folder: Path, cells: list[NDArray[np.object_]]) -> list[dict[str, Any]]:
    """The interactive charts, with a title each."""
    one = len(maps.views) == 1
    parts = [] if one else slices(maps)[0]
    sections: list[dict[str, Any]] = []
    for k, variant in enumerate(maps.variants):
        if one:
            sections.append(_section("success", variant.label, "", charts.success_lines_chart(maps, k, cells[k])))
        sections += [
            _section("success", variant.label, part.title, charts.success_chart(maps, k, part, cells[k]))
            for part in parts
        ]
    for k, pair in enumerate(maps.pairings):
        notes, title = charts.pairing_cells(maps, k, folder), f"{pair.first} less {pair.second}"
        if one:
            sections.append(_section("difference", title, "", charts.difference_lines_chart(maps, k, notes)))
        sections += [
            _section("difference", title, part.title, charts.difference_chart(maps, k, part, notes)) for part in parts
        ]
    return sections


def _section(kind: str, title: str, part: str, spec: charts.Spec) -> dict[str, Any]:
    return {"kind": kind, "title": f"{title}: {part}" if part else title, "spec": spec}


def _possible(variant: VariantMap) -> tuple[str, str]:
    """In how many cells hover can be controlled, with yaw held and with yaw given up."""
    if variant.possible is None:
        return "not known", "not known"
    held, free = (_cells(each) for each in variant.possible)
    return held, free


def _cells(possible: Array) -> str:
    """In how many cells hover can be controlled."""
    depends = int(np.isnan(possible).sum())
    return f"{int(np.nansum(possible))} cells" + (f", in {depends} it depends on what is drawn" if depends else "")
