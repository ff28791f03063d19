"""Table 1: the cost of SMC and ROISMC in each case, the paper's numbers beside ours.

Two comparisons: (a) matched bandwidth, SMC with its in-layer poles at ROISMC's nominal poles; (b) equal tuning
effort, both at what the same optimiser found with the same budget. Absolute values depend on much that the paper
does not print; the ratios can be compared.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

from rotorfault.base.csv_text import number, write_rows
from rotorfault.studies.paper.cases import CASES, run_of
from rotorfault.studies.runs import Result, Run


class Costs(NamedTuple):
    """Cost of both laws in one comparison; a lost flight has the cost up to its end, and then no ratio."""

    smc: float
    roismc: float
    smc_outcome: str
    roismc_outcome: str

    @property
    def ratio(self) -> float | None:
        """ROISMC's cost over SMC's; None where a flight was lost, for it ended early."""
        lost = {"tumbled", "diverged", "ground"} & {self.smc_outcome, self.roismc_outcome}
        return None if lost or not self.smc > 0.0 else self.roismc / self.smc


class Row(NamedTuple):
    """One case."""

    case: str
    title: str
    paper: Costs
    matched: Costs  # comparison (a)
    equal: Costs  # comparison (b)


def runs() -> list[Run]:
    """Flights that the table needs."""
    return [
        run
        for case in CASES
        for run in (
            run_of(case, "smc", keep=True),
            run_of(case, "roismc", keep=True),
            run_of(case, "smc", preset="matched"),
        )
    ]


def rows(results: Mapping[str, Result]) -> list[Row]:
    """The table, one row per case whose flights are all there."""
    entries = []
    for case in CASES.values():
        ids = (
            run_of(case.id, "smc", preset="matched").id,
            run_of(case.id, "smc").id,
            run_of(case.id, "roismc").id,
        )
        if all(name in results for name in ids):
            matched, smc, roismc = (results[name] for name in ids)
            paper = Costs(case.paper_cost["smc"], case.paper_cost["roismc"], "", "")
            entries.append(Row(case.id, case.title, paper, _costs(matched, roismc), _costs(smc, roismc)))
    return entries


def _costs(smc: Result, roismc: Result) -> Costs:
    a, b = smc.summary, roismc.summary
    return Costs(_number(a["cost"]), _number(b["cost"]), str(a["outcome"]), str(b["outcome"]))


def _number(cost: float | None) -> float:
    return float("inf") if cost is None else float(cost)


def write_csv(results: Mapping[str, Result], path: Path) -> Path:
    """Write the table; costs in the cost's own unit, ratios without one, empty where there is none."""
    parts = ("paper", "matched", "equal")
    header = ["case"]
    for part in parts:
        header += [f"{part}_smc", f"{part}_roismc", f"{part}_ratio"]
    outcomes = ["matched_smc_outcome", "equal_smc_outcome", "roismc_outcome"]
    lines = []
    for row in rows(results):
        costs = [
            number(cost)
            for part in (row.paper, row.matched, row.equal)
            for cost in (part.smc, part.roismc, part.ratio)
        ]
        ends = (row.matched.smc_outcome, row.equal.smc_outcome, row.equal.roismc_outcome)
        lines.append([row.case, *costs, *ends])
    return write_rows(path, [*header, *outcomes], lines)
