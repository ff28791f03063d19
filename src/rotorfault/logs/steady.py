"""What steady hover says in a log: each of its flights against a baseline, or against the flights before it.

A log may hold several flights, from arming to disarming each. A propeller that breaks at a landing shows in the next
of them: then the flights before are the baseline, whether or not another one is given.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from rotorfault.logs.baseline import Baseline, trim_of
from rotorfault.logs.log import Log
from rotorfault.logs.segments import Hover
from rotorfault.logs.trim import Evidence, Trim, directions_of, spread_of, weigh


class Steady(NamedTuple):
    """What hover says."""

    trim: Trim
    evidence: Evidence
    against: str  # what it is compared with, in words
    since: float | None  # s, begin of the flight that is off those before it; None if there is no such flight


def steady_of(
    log: Log, hover: Hover, spans: Sequence[tuple[float, float]], baseline: Baseline | None
) -> Steady | None:
    """Weigh the trim of hover; None where there is none.

    Parameters
    ----------
    log : Log
    hover : Hover
    spans : sequence of (float, float), s
        Of its flights.
    baseline : Baseline or None
        Of healthy flights of the same vehicle.
    """
    trims = [] if baseline is None else baseline.trims
    against = "its baseline" if trims else "an even share"
    each = [
        (begin, trim)
        for begin, end in spans
        if (trim := trim_of(Hover(*(part[(hover.time > begin) & (hover.time < end)] for part in hover)))) is not None
    ]
    together = trim_of(hover)
    if together is None:
        return None
    whole = Steady(together, _weighed(log, together, trims), against, None)
    if len(each) < 2:
        return whole
    # Any of the flights may be the one that changed: what speaks for a rotor in one is shared among all.
    found = [whole]
    for k, (begin, trim) in enumerate(each[1:], start=1):
        before = [one for _, one in each[:k]]
        evidence = _weighed(log, trim, [*trims, *before], len(each) - 1)
        found.append(Steady(trim, evidence, "the flights before", begin))
    return max(found, key=lambda one: _blamed(one.evidence))


def _blamed(evidence: Evidence) -> float:
    """Probability of the rotor that is the most probable."""
    return max((value for (_, rotor), value in evidence.causes.items() if rotor is not None), default=0.0)


def _weighed(log: Log, trim: Trim, trims: Sequence[Trim], flights: int = 1) -> Evidence:
    """The trim of hover against that of healthy flights."""
    layout = log.layout
    assert layout is not None
    sagged: float | None = None
    voltages = [one.voltage for one in trims if math.isfinite(one.voltage)]
    if voltages and math.isfinite(trim.voltage) and trim.voltage > 0.0:
        sagged = max(float(np.mean(voltages)) / trim.voltage - 1.0, 0.0)
    return weigh(layout, trim, spread_of(layout, trims), directions_of(layout)[1], sagged, flights)
