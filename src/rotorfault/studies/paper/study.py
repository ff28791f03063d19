"""The whole paper by one call: fly what is missing, then figures, tables, claims and the report.

Everything lands in one folder: ``report.html``, ``claims.json``, ``table1.csv``, ``ablation.csv``,
``sensitivity.csv``, ``figures/``, ``flights/*.nc``, a page per case in ``flights/*.html`` and ``runs/*.json``, the
records by which a second start knows what is done.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

from matplotlib.figure import Figure

from rotorfault.base.errors import InputError, unknown
from rotorfault.base.files import output_folder, write_atomically
from rotorfault.base.text_table import table_lines
from rotorfault.report import figures as drawing
from rotorfault.studies.paper import ablation, claims, figures, sensitivity, table1
from rotorfault.studies.paper.cases import CASES, CONTROLLERS, main_runs, matched_runs
from rotorfault.studies.paper.measures import LABEL, measure
from rotorfault.studies.paper.page import Page, render
from rotorfault.studies.paper.replays import replays
from rotorfault.studies.paper.verdicts import Claim, claims_json
from rotorfault.studies.pool import fly_missing
from rotorfault.studies.runs import Result, Run, RunStore


class Reproduced(NamedTuple):
    """What a reproduction gave."""

    folder: Path
    flown: int  # flights that were not there before
    results: Mapping[str, Result]
    claims: list[Claim]
    seconds: dict[str, float]  # per stage


def selected(case: str | None, controller: str | None) -> list[Run]:
    """The main flights, of one case or controller where that is asked for.

    Raises
    ------
    InputError
        If there is no such case or controller in the paper.
    """
    if case is not None and case not in CASES:
        raise InputError(unknown("case", case, list(CASES)))
    if controller is not None and controller not in CONTROLLERS:
        raise InputError(unknown("controller of the paper", controller, list(CONTROLLERS)))
    scenarios = {CASES[case].scenario} if case else {one.scenario for one in CASES.values()}
    return [
        run
        for run in main_runs()
        if run.scenario in scenarios and (controller is None or dict(run.overrides)["controller.kind"] == controller)
    ]


def fly_part(folder: Path, case: str | None, controller: str | None, workers: int | None = None) -> list[Result]:
    """Fly one case or controller alone, without report."""
    store = RunStore(output_folder(folder), measure, LABEL)
    runs = selected(case, controller)
    fly_missing(store, runs, "flying", workers)
    return [store.get(run) for run in runs]


def reproduce(folder: Path, quick: bool = False, workers: int | None = None) -> Reproduced:
    """Reproduce the paper.

    Parameters
    ----------
    folder : Path
    quick : bool
        Leave out ablation and sensitivity.
    workers : int, optional
        Processes; one per core if not given.
    """
    store = RunStore(output_folder(folder), measure, LABEL)
    wanted = [*main_runs(), *matched_runs(), *table1.runs(), *claims.runs()]
    if not quick:
        wanted += [*ablation.runs(), *sensitivity.runs()]
    seconds: dict[str, float] = {}

    def timed(stage: str, start: float) -> float:
        now = time.perf_counter()
        seconds[stage] = now - start
        return now

    clock = time.perf_counter()
    flown = fly_missing(store, wanted, "flying the paper", workers)
    results = {run.id: store.get(run) for run in wanted}
    clock = timed("flights", clock)

    verdicts = claims.claims(results)
    claims_json(verdicts, folder / "claims.json")
    table1.write_csv(results, folder / "table1.csv")
    extras: dict[str, Figure] = {"wind": claims.fig_wind(results)}
    if not quick:
        ablation.write_csv(results, folder / "ablation.csv")
        sensitivity.write_csv(results, folder / "sensitivity.csv")
        extras |= {"ablation": ablation.figure(results), "sensitivity": sensitivity.figure(results)}
    clock = timed("claims and tables", clock)

    drawn = {**figures.draw_all(results), **extras}
    drawing.save(drawn, folder / "figures", ("png", "svg"))
    clock = timed("figures", clock)

    pages = replays(results, folder)
    clock = timed("flight pages", clock)

    page = Page(folder, results, verdicts, quick, seconds, pages)
    text = render(page)
    write_atomically(folder / "report.html", lambda temporary: temporary.write_text(text, encoding="utf-8"))
    timed("report", clock)
    return Reproduced(folder, flown, results, verdicts, seconds)


def line(result: Result) -> str:
    """A flight in a few words."""
    s = result.summary
    settle = s["settle_time"]["overall"]
    settled = "" if settle is None else f", settled at {settle:.3g} s"
    cost = "-" if s["cost"] is None else f"{s['cost']:.5g}"
    return f"{s['outcome']} at {s['end_time']:.4g} s{settled}, cost {cost}"


def text(done: Reproduced) -> str:
    """What a reproduction gave, for the terminal."""
    claim_rows = [(claim.id, claim.verdict, claim.claim) for claim in done.claims]
    ratios: list[tuple[str, ...]] = [("", "paper", "matched", "equal effort")]
    for row in table1.rows(done.results):
        each = (row.paper.ratio, row.matched.ratio, row.equal.ratio)
        ratios.append((row.title, *("-" if ratio is None else f"{ratio:.3f}" for ratio in each)))
    lines = ["Claims", *table_lines(claim_rows, "><<", indent=2)]
    lines += ["", "Table 1, cost of ROISMC over that of SMC", *table_lines(ratios, "<>>>", indent=2)]
    took = ", ".join(f"{stage} {seconds:.0f} s" for stage, seconds in done.seconds.items())
    lines += ["", f"{len(done.results)} flights, {done.flown} flown now ({took}); see {done.folder / 'report.html'}"]
    return "\n".join(lines)
