"""What the reproduction comes to, in two sentences whose numbers are computed: how the report opens."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from rotorfault.studies.paper.cases import run_of
from rotorfault.studies.paper.table1 import Row
from rotorfault.studies.paper.verdicts import CONFIRMED, NOT_CONFIRMED, UNDER, Claim
from rotorfault.studies.runs import Result


class Count(NamedTuple):
    """How many claims have a verdict."""

    number: int
    verdict: str
    look: str  # class of the page's style


def counts(claims: Sequence[Claim]) -> list[Count]:
    """Claims by verdict, the best first."""
    kinds = ((CONFIRMED, "confirmed"), (UNDER, "partly"), (NOT_CONFIRMED, "not"))
    looks = [look_of(claim) for claim in claims]
    titles = {UNDER: "confirmed under another reading"}
    return [Count(looks.count(look), titles.get(kind, kind), look) for kind, look in kinds]


def look_of(claim: Claim) -> str:
    """The class of the page's style that a claim's verdict has."""
    if claim.verdict.startswith(UNDER):
        return "partly"
    return "confirmed" if claim.verdict == CONFIRMED else "not"


def sentences(claims: Sequence[Claim], table: Sequence[Row], results: Mapping[str, Result]) -> list[str]:
    """What became of the claims; what became of cost and settling.

    Parameters
    ----------
    claims : sequence of Claim
    table : sequence of Row
        Table 1.
    results : mapping of str to Result
        By run id; what is not in it is not spoken of.
    """
    held, partly, refused = (count.number for count in counts(claims))
    said = [
        f"Of the paper's claims, taken apart into {len(claims)}, {held} are confirmed, {partly} only under another "
        f"reading of the paper, and {refused} are not."
    ]
    parts = [part for part in (_cost(table), _settling(results)) if part]
    if parts:
        text = "; ".join(parts)
        said.append(f"{text[0].upper()}{text[1:]}.")
    return said


def _cost(table: Sequence[Row]) -> str:
    """Ratios of the costs after equal tuning effort, beside the paper's."""
    both = [(row.equal.ratio, row.paper.ratio) for row in table if row.equal.ratio is not None]
    if not both:
        return ""
    ours = [ours for ours, _ in both if ours is not None]
    papers = [paper for _, paper in both if paper is not None]
    won = sum(ratio < 1.0 for ratio in ours)
    return (
        f"tuned with equal effort, ROISMC costs less than SMC in {won} of {len(ours)} cases, {_range(ours)} times as "
        f"much (paper: {_range(papers)})"
    )


def _range(ratios: Sequence[float]) -> str:
    ends = [f"{min(ratios):.2f}", f"{max(ratios):.2f}"]
    return " to ".join(dict.fromkeys(ends))


def _settling(results: Mapping[str, Result]) -> str:
    """How the first case went under ROISMC."""
    result = results.get(run_of("set-point", "roismc").id)
    if result is None:
        return ""
    if not result.summary["survived"]:
        return f"in case 1 it is lost ({result.summary['outcome']} at {result.summary['end_time']:.3g} s)"
    settled = result.summary["settle_time"]["overall"]
    how = "does not settle" if settled is None else f"settles within 2 % after {settled:.2f} s"
    return f"in case 1, with thrust lost on two rotors at 1.8 s, it {how} (paper: under 2 s)"
