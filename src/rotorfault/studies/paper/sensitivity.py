"""Which conclusions move with what the paper leaves open.

Every variation is flown under both laws, with the tuned gains unless it says otherwise: nothing is re-tuned. Five
conclusions per case: both stay up and end within 10 m; ROISMC settles earlier (case 3: median time to be back after
a switch); its cost is lower; its mean square position error is lower; both faults are rightly detected. Case 2 is
cut at 20 s (the period of the wind (45)), case 3 at 40 s (six switches).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure

from rotorfault.base.csv_text import number, write_rows
from rotorfault.studies.paper.cases import CASES
from rotorfault.studies.paper.conclusion_figure import conclusion_figure
from rotorfault.studies.paper.judges import detected
from rotorfault.studies.paper.variations import Variation, variations
from rotorfault.studies.paper.verdicts import stays
from rotorfault.studies.runs import Result, Run

CONCLUSIONS = {
    "survive": "both stay up",
    "earlier": "ROISMC settles earlier",
    "cost": "ROISMC costs less",
    "error": "ROISMC errs less",
    "detected": "faults detected",
}


class Row(NamedTuple):
    """A variation in one case."""

    variation: Variation
    case: str
    ours: Result
    theirs: Result
    holds: dict[str, bool | None]  # by conclusion; None where there is nothing to compare
    moved: list[str]  # conclusions that differ from the baseline's


def runs() -> list[Run]:
    """Flights of the study, each once."""
    flown = (run for variation in variations() for case in variation.cases for run in variation.runs(case))
    return list({run.id: run for run in flown}.values())


def rows(results: Mapping[str, Result]) -> list[Row]:
    """All variations whose flights are there, with what moved against their baseline."""
    judged: dict[tuple[str, str], dict[str, bool | None]] = {}
    entries = []
    for variation in variations():
        for case in variation.cases:
            pair = variation.runs(case)
            if not all(run.id in results for run in pair):
                continue
            ours, theirs = (results[run.id] for run in pair)
            holds = conclusions(ours, theirs, variation.cost)
            judged[variation.id, case] = holds
            base = judged.get((variation.baseline, case), holds)
            moved = [name for name in CONCLUSIONS if {holds[name], base[name]} == {True, False}]
            entries.append(Row(variation, case, ours, theirs, holds, moved))
    return entries


def conclusions(ours: Result, theirs: Result, cost: str = "") -> dict[str, bool | None]:
    """The five conclusions from a pair of flights; `cost` names another reading of the cost."""
    both = stays(ours) and stays(theirs)
    answers: dict[str, bool | None] = dict.fromkeys(CONCLUSIONS)
    answers["survive"] = both
    answers["detected"] = all(detected(result)[0].holds for result in (ours, theirs))
    if both:
        answers["earlier"] = _less(settling(ours), settling(theirs))
        answers["cost"] = _less(cost_of(ours, cost), cost_of(theirs, cost))
        answers["error"] = _less(error_of(ours), error_of(theirs))
    return answers


def _less(a: float, b: float) -> bool | None:
    """Whether a < b; None where they are equal, as where neither settles."""
    return None if a == b else a < b


def settling(result: Result) -> float:
    """Settling time in s, for case 3 the median time to be back after a switch; infinite if it never is."""
    returns = result.extra["returns"]
    if returns and returns["position"]:
        return float(np.median([math.inf if time is None else time for time in returns["position"]]))
    overall = result.summary["settle_time"]["overall"]
    return math.inf if overall is None else float(overall)


def cost_of(result: Result, reading: str = "") -> float:
    """Cost J; infinite where it is no number."""
    value = result.extra["cost_readings"][reading] if reading else result.summary["cost"]
    return math.inf if value is None else float(value)


def error_of(result: Result) -> float:
    """Sum of the mean square position errors in m^2; infinite where it is no number."""
    each = result.summary["position_mse"].values()
    return float(sum(math.inf if value is None else value for value in each))


HEADER = (
    "variation", "group", "case", "law", "outcome", "smc_outcome", "settling_s", "smc_settling_s", "cost", "smc_cost",
    "cost_ratio", "position_mse_m2", "smc_position_mse_m2", "mse_ratio", *CONCLUSIONS, "moved",
)  # fmt: skip


def write_csv(results: Mapping[str, Result], path: Path) -> Path:
    """Write the table; no ratio and no comparison where a flight was lost."""
    lines = []
    for row in rows(results):
        values = [
            (value(row.ours), value(row.theirs))
            for value in (settling, lambda r, c=row.variation.cost: cost_of(r, c), error_of)
        ]
        (time, smc_time), (cost, smc_cost), (error, smc_error) = values
        lines.append(
            [
                row.variation.id, row.variation.group, row.case, row.variation.law,
                row.ours.summary["outcome"], row.theirs.summary["outcome"], number(time), number(smc_time),
                number(cost), number(smc_cost), _ratio(row, cost, smc_cost),
                number(error), number(smc_error), _ratio(row, error, smc_error),
                *(_word(row.holds[name]) for name in CONCLUSIONS), " ".join(row.moved),
            ]
        )  # fmt: skip
    return write_rows(path, HEADER, lines)


def _ratio(row: Row, a: float, b: float) -> float | None:
    return number(a / b) if row.holds["survive"] and b > 0.0 else None


def _word(holds: bool | None) -> str:
    return {True: "yes", False: "no", None: ""}[holds]


def findings(results: Mapping[str, Result]) -> list[str]:
    """A line per conclusion: how often it holds, and under which variations it moves."""
    entries = rows(results)
    lines = []
    for name, title in CONCLUSIONS.items():
        decided = [row for row in entries if row.holds[name] is not None]
        count = sum(bool(row.holds[name]) for row in decided)
        moved: dict[str, list[str]] = {}
        for row in decided:
            if name in row.moved:
                moved.setdefault(row.variation.label, []).append(str(CASES[row.case].number))
        moves = "; ".join(f"{label} (case {', '.join(cases)})" for label, cases in moved.items())
        line = f"{title[0].upper()}{title[1:]}: in {count} of {len(decided)} variations and cases"
        lines.append(f"{line}. Moves with: {moves}." if moves else f"{line}; nothing moves it.")
    return lines


def figure(results: Mapping[str, Result]) -> Figure:
    """Conclusions by variation and case: which hold, which do not, which moved."""
    entries = rows(results)
    table = {(row.variation.label, row.case): row for row in entries}
    labels = list(dict.fromkeys((row.variation.group, row.variation.label) for row in entries))
    cells: list[list[tuple[bool | None, bool] | None]] = []
    for _, label in labels:
        line: list[tuple[bool | None, bool] | None] = []
        for name in CONCLUSIONS:
            for case in CASES:
                row = table.get((label, case))
                line.append(None if row is None else (row.holds[name], name in row.moved))
        cells.append(line)
    titles = [title.replace("ROISMC ", "ROISMC\n").replace(" ", "\n", 1) for title in CONCLUSIONS.values()]
    return conclusion_figure(cells, labels, titles, [str(case.number) for case in CASES.values()])
