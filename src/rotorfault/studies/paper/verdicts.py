"""Verdicts on the paper's claims: a rule per claim, which flies runs and decides from their numbers.

A claim is *confirmed* if it holds under the project's own reading, the first one; *confirmed under reading X* if it
holds only under others; else *not confirmed*. A rule never raises on a lost flight: that is a result.

Three things keep verdicts from being kind:

- **One margin.** A number counts as lower than another, or as within a bound, if it is so by `MARGIN` at least; what
  differs by less is the same number. The paper's own differences are of 7 % and more.
- **A reading reads the paper.** It takes a word, a formula or a number of the paper in another sense that it could
  have. Another threshold, or another quantity than the sentence is about, is another rule and no reading.
- **A way to fail.** Where a flight would pass that has nothing to do with what the claim credits, the rule flies a
  control that must fail; if that passes too, the claim is not confirmed. The tests feed each judge numbers that
  contradict it.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from rotorfault.base.files import write_atomically
from rotorfault.studies.runs import Result, Run

CONFIRMED, NOT_CONFIRMED, UNDER = "confirmed", "not confirmed", "confirmed under reading "
LOST_IS_WORSE = "a lost flight counts as worse"
FAR = 10.0  # m
# Of the larger number. Less than that nobody would call lower, and a change of a model's details or of the search for
# the gains moves most numbers by more.
MARGIN = 0.05


class Reading(NamedTuple):
    """What came out under one reading of the paper."""

    name: str  # empty for the project's own
    measured: str
    holds: bool


class Claim(NamedTuple):
    """A claim with its verdict."""

    id: str
    claim: str
    paper: str
    measured: str
    unit: str
    verdict: str
    command: str
    note: str


class Rule(NamedTuple):
    """How a claim is decided."""

    id: str
    claim: str  # in our own words
    paper: str  # the paper's number or words
    unit: str
    rule: str  # when it counts as confirmed, with threshold and reason
    runs: tuple[Run, ...]
    judge: Callable[..., Sequence[Reading]]  # takes the results of `runs`, in order

    @property
    def command(self) -> str:
        """The commands that fly what the claim needs."""
        return " && ".join(run.command for run in self.runs)


def verdict(readings: Sequence[Reading]) -> str:
    """Verdict from readings, the project's own first."""
    if readings[0].holds:
        return CONFIRMED
    others = [reading.name for reading in readings[1:] if reading.holds]
    return UNDER + "; ".join(f"'{name}'" for name in others) if others else NOT_CONFIRMED


def decide(rule: Rule, results: Mapping[str, Result]) -> Claim:
    """The claim with its verdict, from results that hold all of the rule's runs."""
    readings = list(rule.judge(*(results[run.id] for run in rule.runs)))
    measured = "; ".join(f"[{r.name}] {r.measured}" if r.name else r.measured for r in readings)
    return Claim(
        rule.id, rule.claim, rule.paper, measured, rule.unit, verdict(readings), rule.command, f"Rule: {rule.rule}"
    )


def decide_all(rules: Iterable[Rule], results: Mapping[str, Result]) -> list[Claim]:
    """All claims whose runs are there."""
    return [decide(rule, results) for rule in rules if all(run.id in results for run in rule.runs)]


def claims_json(claims: Sequence[Claim], path: Path) -> Path:
    """Write the claims as a list of objects."""
    text = json.dumps([claim._asdict() for claim in claims], indent=1, ensure_ascii=False) + "\n"
    write_atomically(path, lambda temporary: temporary.write_text(text, encoding="utf-8"))
    return path


# ---------------------------------------------------------------------------------------- what judges have in common


def survived(result: Result) -> bool:
    """Whether the vehicle was flying at the end."""
    return bool(result.summary["survived"])


def stays(result: Result) -> bool:
    """Whether a flight stays in the air and ends within 10 m of its reference; one that drifts off is no use."""
    end = [value for value in result.summary["position_error_end"].values() if value is not None]
    return survived(result) and len(end) == 3 and max(map(abs, end)) <= FAR


def fate(result: Result) -> str:
    """How a flight ended, such as "tumbled at 2.10 s"."""
    return f"{result.summary['outcome']} at {result.summary['end_time']:.2f} s"


def lost(results: Iterable[Result]) -> str:
    """Names and ends of those flights that were lost; empty if there is none."""
    return ", ".join(f"{result.run.id} {fate(result)}" for result in results if not survived(result))


def text(value: float | None, digits: int = 3) -> str:
    """A number in a few figures, or "never"."""
    return "never" if value is None else f"{value:.{digits}g}"


def below(value: float | None, bound: float | None) -> bool:
    """Whether a number lies below another, or within a bound, by the margin; None is larger than any number.

    Parameters
    ----------
    value, bound : float or None
        Of the same unit, 0 or more.
    """
    return value is not None and (bound is None or value <= (1.0 - MARGIN) * bound) and value != bound


def lower(name: str, ours: Result, theirs: Result, value: Callable[[Result], float | None]) -> list[Reading]:
    """Whether a number of ROISMC's flight lies below SMC's by the margin.

    A value of None (never settled, no number) is larger than any number. Numbers of flights of different length are
    not compared: with SMC lost and ROISMC flying on, the claim holds only as "a lost flight counts as worse".
    """
    if not survived(ours):
        return [Reading(name, f"ROISMC {fate(ours)}", False)]
    if not survived(theirs):
        label = f"{name}, {LOST_IS_WORSE}" if name else LOST_IS_WORSE
        measured = f"SMC {fate(theirs)}, ROISMC flies on"
        return [Reading(name, measured, False), Reading(label, "ROISMC flies on, SMC does not", True)]
    a, b = value(ours), value(theirs)
    if a is None or b is None:
        return [Reading(name, f"ROISMC {text(a)}, SMC {text(b)}", below(a, b))]
    ratio = f", ratio {a / b:.3f}" if b > 0.0 else ""
    return [Reading(name, f"ROISMC {a:.4g}, SMC {b:.4g}{ratio}", below(a, b))]


def extra(*keys: str) -> Callable[[Result], Any]:
    """A number of `Result.extra` by its keys; None where there is none."""

    def number(result: Result) -> Any:
        value: Any = result.extra
        for key in keys:
            value = None if value is None else value[key]
        return value

    return number
