"""Rules that end the flights of a cell once its interval is narrow: do they cover, and what do they cost?

    python benchmarks/coverage.py [--width 0.1] [--most 2000] [--level 0.95]

Chances are computed, not sampled: of each number of survivals at each look, from look to look by binomial steps.
Per probability of survival: coverage in %, mean width of the interval, mean number of flights. ``least`` is the
lowest coverage of 999 probabilities. All rules look after the numbers of flights of
`rotorfault.campaigns.sampling.refine`, with a growth of 0.1.

fixed            not a rule: as many flights as Clopper-Pearson needs at this probability, known beforehand
wilson, exact    ends when Wilson's or Clopper-Pearson's interval of a fixed number is narrow: what does not hold
two-stage        the first block decides the number of further flights, and only these count
bonferroni       Clopper-Pearson with the error divided by the number of looks
simultaneous     Clopper-Pearson with the largest error for which all looks hold together
mixture          likelihood ratio against a beta mixture (Robbins): holds after any number of flights
plan             `rotorfault.campaigns.sampling.sampling_plan`: what is used
"""

from __future__ import annotations

import argparse
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.special import betaln, xlog1py, xlogy
from scipy.stats import binom

from rotorfault.campaigns.sampling.refine import Refinement, looks
from rotorfault.campaigns.sampling.sampling_plan import Plan, sampling_plan
from rotorfault.campaigns.sampling.statistics import Interval, clopper_pearson, wilson
from rotorfault.maths.arrays import Array

Rule = tuple[list[NDArray[np.bool_]], list[Interval]]  # by look: where it ends, intervals

SURVIVALS = (0.01, 0.1, 0.5, 0.9, 0.99, 0.999)
GRID = np.arange(1, 1000) / 1000.0


def narrow(at: tuple[int, ...], width: float, interval: Callable[[Array, int], Interval]) -> Rule:
    """Ends when the interval is narrow enough, or at the last look."""
    found = [interval(np.arange(n + 1.0), n) for n in at]
    return [(each.upper - each.lower <= width) | (n == at[-1]) for n, each in zip(at, found, strict=True)], found


def planned(plan: Plan) -> Rule:
    rows = [(k, slice(n + 1)) for k, n in enumerate(plan.looks)]
    return [plan.done[row] | ~plan.reachable[row] for row in rows], [
        Interval(plan.lower[row], plan.upper[row]) for row in rows
    ]


def mixture(s: Array, n: int, level: float) -> Interval:
    """Probabilities whose likelihood is at least 1 - level times that of a Beta(1/2, 1/2) mixture."""
    least = betaln(s + 0.5, n - s + 0.5) - betaln(0.5, 0.5) + np.log1p(-level)
    bounds = []
    for end in (0.0, 1.0):
        inside, outside = s / n, np.full(s.shape, end)
        for _ in range(50):
            middle = 0.5 * (inside + outside)
            good = xlogy(s, middle) + xlog1py(n - s, -middle) >= least
            inside, outside = np.where(good, middle, inside), np.where(good, outside, middle)
        bounds.append(np.where(s / n == end, end, outside))
    return Interval(*bounds)


def measure(at: tuple[int, ...], rule: Rule, p: Array) -> Array:
    """Coverage, mean width, mean flights, chance that any look fails; shape (4, len(p))."""
    done, intervals = rule
    found, safe = np.zeros((4, len(p))), np.ones((len(p), 1))
    going = sound = safe  # chances by survivals so far: of those not ended, of those that no look has failed
    before = 0
    for n, ended, (lower, upper) in zip(at, done, intervals, strict=True):
        step = binom.pmf(np.arange(n - before + 1), n - before, p[:, None])
        going, sound = (
            np.array([np.convolve(a, b) for a, b in zip(each, step, strict=True)]) for each in (going, sound)
        )
        covers = ~((lower > p[:, None]) | (upper < p[:, None]))
        ends = np.where(ended, going, 0.0)
        width = np.nan_to_num(upper - lower)
        found[:3] += [(ends * covers).sum(axis=1), (ends * width).sum(axis=1), n * ends.sum(axis=1)]
        going, sound = np.where(ended, 0.0, going), np.where(covers, sound, 0.0)
        before = n
    found[3] = 1.0 - sound.sum(axis=1)
    return found


def two_stage(first: int, most: int, width: float, level: float, p: Array) -> Array:
    """Coverage, mean width and mean flights if only those after the first block count."""
    found = np.zeros((4, len(p)))
    for s in range(first + 1):
        n = fixed((s + 0.5) / (first + 1.0), width, level, most - first)
        t = np.arange(n + 1)
        lower, upper = clopper_pearson(t, n, level)
        chance = binom.pmf(s, first, p)[:, None] * binom.pmf(t, n, p[:, None])
        covers = (lower <= p[:, None]) & (p[:, None] <= upper)
        found[:3] += [(chance * x).sum(axis=1) for x in (covers, upper - lower, np.full(n + 1, first + n))]
    return found


def fixed(p: float, width: float, level: float, most: int) -> int:
    """The least number of flights with which Clopper-Pearson's interval is narrow enough at p on average."""
    low, high = 1, most
    while low < high:
        n = (low + high) // 2
        t = np.arange(n + 1)
        lower, upper = clopper_pearson(t, n, level)
        if (binom.pmf(t, n, p) * (upper - lower)).sum() <= width:
            high = n
        else:
            low = n + 1
    return low


def simultaneous(at: tuple[int, ...], level: float) -> float:
    """Level of each look with which all hold together: by halving, against the worst of 99 probabilities."""
    good, bad = 1.0 - (1.0 - level) / len(at), level
    for _ in range(12):
        middle = 0.5 * (good + bad)
        rule = narrow(at, 0.0, lambda s, n, level=middle: clopper_pearson(s, n, level))  # type: ignore[misc]
        if measure(at, rule, GRID[9::10])[3].max() <= 1.0 - level:
            good = middle
        else:
            bad = middle
    return good


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--width", type=float, default=0.1)
    parser.add_argument("--most", type=int, default=2000)
    parser.add_argument("--level", type=float, default=0.95)
    asked = parser.parse_args()
    width, level, most = asked.width, asked.level, asked.most
    at = looks(Refinement(growth=0.1, width=width, level=level, most=most))
    each, together = 1.0 - (1.0 - level) / len(at), simultaneous(at, level)
    rules: dict[str, Rule] = {
        "wilson": narrow(at, width, lambda s, n: wilson(s, n, level)),
        "exact": narrow(at, width, lambda s, n: clopper_pearson(s, n, level)),
        "bonferroni": narrow(at, width, lambda s, n: clopper_pearson(s, n, each)),
        "simultaneous": narrow(at, width, lambda s, n: clopper_pearson(s, n, together)),
        "mixture": narrow(at, width, lambda s, n: mixture(s, n, level)),
        "plan": planned(sampling_plan(at, width, level)),
    }
    print(f"{level:.0%} intervals no wider than {width}, {len(at)} looks after {at[0]} to {at[-1]} flights")
    print(f"{'':12}  least " + "".join(f"|       p = {p:<9}" for p in SURVIVALS))
    known = np.array(SURVIVALS)
    row = []
    for p in SURVIVALS:
        n = fixed(p, width, level, most)
        interval = clopper_pearson(np.arange(n + 1), n, level)
        row.append(measure((n,), ([np.ones(n + 1, dtype=bool)], [interval]), np.array([p]))[:, 0])
    show("fixed", np.nan, np.array(row).T)
    show("two-stage", *(f(two_stage(at[0], most, width, level, p)) for f, p in ((least, GRID), (whole, known))))
    for name, rule in rules.items():
        show(name, *(f(measure(at, rule, p)) for f, p in ((least, GRID), (whole, known))))


def least(found: Array) -> float:
    return float(found[0].min())


def whole(found: Array) -> Array:
    return found


def show(name: str, lowest: float, found: Array) -> None:
    cells = "".join(f"| {100 * c:5.2f} {w:6.4f} {n:6.0f}" for c, w, n, _ in found.T)
    print(f"{name:12}  {100 * lowest:5.2f} {cells}", flush=True)


if __name__ == "__main__":
    main()
