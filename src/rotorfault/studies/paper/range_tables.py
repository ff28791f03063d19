"""The tables of `rotorfault.studies.paper.ranges`: least and largest of what pairs of gains flew."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import NamedTuple

from rotorfault.base.text_table import table_lines
from rotorfault.studies.paper.cases import CASES
from rotorfault.studies.paper.ranges import FULL, LAWS, SEARCHED_FOR, Cell, Flown, Gains, cells
from rotorfault.studies.paper.verdicts import MARGIN, below
from rotorfault.tuning.space import BOXES


class Pair(NamedTuple):
    """Both laws, searched the same way."""

    cell: Cell
    ours: Gains
    theirs: Gains

    def ratio(self, case: str, number: Callable[[Flown], float | None]) -> float | None:
        """ROISMC's number over SMC's; None where a flight was lost, or has none."""
        a, b = self.ours.cases[case], self.theirs.cases[case]
        over, under = number(a), number(b)
        return over / under if a.survived and b.survived and over is not None and under else None


def pairs(gains: Sequence[Gains]) -> list[Pair]:
    """Gains of both laws side by side."""
    found = {(one.cell, one.law): one for one in gains}
    return [
        Pair(cell, found[cell, "roismc"], found[cell, "smc"])
        for cell in dict.fromkeys(one.cell for one in gains)
        if all((cell, law) in found for law in LAWS)
    ]


def cost(flight: Flown) -> float:
    """J."""
    return flight.cost


def settle_time(flight: Flown) -> float | None:
    """Settling time in s."""
    return flight.settle_time


def position_mse(flight: Flown) -> float:
    """Mean square position error in m^2."""
    return flight.position_mse


def span(values: Iterable[float | None], digits: int = 2) -> str:
    """Least and largest value as text; how many have none."""
    given = list(values)
    numbers = [value for value in given if value is not None]
    if not numbers:
        return "-"
    low, high = (f"{value:.{digits}f}" if value < 100.0 else f"{value:.0f}" for value in (min(numbers), max(numbers)))
    text = low if low == high else f"{low} to {high}"
    return text if len(numbers) == len(given) else f"{text} ({len(given) - len(numbers)} without)"


def ratio_rows(found: Sequence[Pair]) -> list[tuple[str, ...]]:
    """Cost of ROISMC over that of SMC: a header, then the cases; a column for each objective and one for all."""
    rows: list[tuple[str, ...]] = [("case", "paper", *SEARCHED_FOR, "all")]
    for case in CASES.values():
        each = [[pair for pair in found if pair.cell.objective == name] for name in SEARCHED_FOR]
        spans = [span(pair.ratio(case.id, cost) for pair in some) for some in (*each, found)]
        paper = case.paper_cost["roismc"] / case.paper_cost["smc"]
        rows.append((case.title.lower(), f"{paper:.2f}", *spans))
    return rows


def number_rows(found: Sequence[Pair]) -> list[tuple[str, ...]]:
    """What both laws come to: a header, then a row per objective and case."""
    rows: list[tuple[str, ...]] = [
        ("searched for", "case", "J of ROISMC", "J of SMC", "lower J", "settles earlier", "lower MSE")
    ]
    for name in SEARCHED_FOR:
        some = [pair for pair in found if pair.cell.objective == name]
        for case in CASES.values():
            both = ([pair.ours for pair in some], [pair.theirs for pair in some])
            spans = [span(one.cases[case.id].cost for one in law) for law in both]
            won = [_won(some, case.id, number) for number in (cost, settle_time, position_mse)]
            rows.append((name, case.title.lower(), *spans, *won))
    return rows


def _won(found: Sequence[Pair], case: str, number: Callable[[Flown], float | None]) -> str:
    """In how many pairs ROISMC's number is the lower one."""
    ratios = [ratio for pair in found if (ratio := pair.ratio(case, number)) is not None]
    return f"{sum(ratio < 1.0 for ratio in ratios)} of {len(ratios)}" if ratios else "-"


def search_rows(gains: Sequence[Gains]) -> list[tuple[str, ...]]:
    """What searches came to: a header, then a row per objective and box; and which values lie at a bound."""
    rows: list[tuple[str, ...]] = [("searched for", "box", "ROISMC", "SMC", "at a bound")]
    for name in SEARCHED_FOR:
        for box in BOXES:
            some = [one for one in gains if (one.cell.objective, one.cell.box) == (name, box)]
            spans = [span(one.objective for one in some if one.law == law) for law in LAWS]
            bound = sorted({f"{one.law} {key.removeprefix('law.')}" for one in some for key in one.at_bounds})
            rows.append((name, box, *spans, ", ".join(bound) or "none"))
    return rows


def headline(found: Sequence[Pair]) -> str:
    """What the ratios say, in a sentence or two."""
    ratios = {case: [pair.ratio(case, cost) for pair in found] for case in CASES}
    known = [ratio for each in ratios.values() for ratio in each if ratio is not None]
    won = sum(ratio < 1.0 for ratio in known)
    clear = sum(below(ratio, 1.0) for ratio in known)
    return (
        f"These are {len(found)} pairs of gains, of the {len(cells(FULL.seeds))} that `rotorfault ranges` searches. "
        f"ROISMC's cost is the lower one in {won} of {len(known)} comparisons, by {100 * MARGIN:g} % or more in "
        f"{clear}. "
        f"How much lower is a matter of the search: {span(known)} over all cases."
    )


def text(gains: Sequence[Gains], presets_flown: Sequence[Gains]) -> str:
    """All tables, for the terminal."""
    found = pairs(gains)
    lines = ["Cost of ROISMC over that of SMC", *table_lines(ratio_rows(found), "<>>>>>", indent=2)]
    lines += ["", "What both come to", *table_lines(number_rows(found), "<<>>>>>", indent=2)]
    lines += ["", "Objectives that the searches came to", *table_lines(search_rows(gains), "<<>><", indent=2)]
    mine = pairs(presets_flown)
    ratios = [", ".join(f"{case.title.lower()} {pair.ratio(case.id, cost):.3f}" for case in CASES.values())
              for pair in mine if all(pair.ratio(case, cost) is not None for case in CASES)]  # fmt: skip
    lines += ["", headline(found), *(f"The shipped presets: {each}." for each in ratios)]
    return "\n".join(lines)
