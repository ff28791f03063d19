r"""What the sources of diagnosis that were run over a log speak for: one witness beside the test of the log itself.

A source is right about a log only where the vehicle's numbers and the noise that it believes are those of the log.
Whether they are is not known before (:math:`P(M) = 1/2`), and the log tells: a source that fits flags nobody while
nothing happens, one that does not flags somebody every few seconds. So what a source o says of a cause c is

.. math:: P(o \mid c) = P(M)\,p_0(n)\,p(o \mid c, M) + (1 - P(M))\,p_1(n)\,p(o \mid \neg M)

with n rotors flagged before the onset, in as much time as there was, by Poisson's law with the rate of either. A
source that flagged others before then speaks for nothing.

All sources look at the same records as the test that found the onset. Therefore they count as one witness together
(the geometric mean of their likelihoods), and only among what may have begun there: that something began is not shown
twice. For an alarm that is false, as for a push, they are taken to flag somebody half of the time, any rotor alike.

Source of pooling by the geometric mean: C. Genest, J. V. Zidek, "Combining probability distributions", *Statistical
Science* 1 (1), 1986.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from rotorfault.logs.detectors import EARLY, Said
from rotorfault.maths.arrays import Array

FITS = 0.5  # probability that the vehicle's numbers are those of the log
# 1/s: flags of a source that fits, ten times what it is set to (0.1 per hour), and of one that does not: four rotors
# in 5 to 30 s, in healthy flights of NanoBench and in flights with noise that the sources do not believe.
RATES = (1.0 / 3600.0, 0.1)
# First flagged after a loss of 15, 30 or 50 %: the right rotor, another, of four sources over 36 held-out flights
# (`benchmarks/log_detectors.py`).
RIGHT, WRONG = 84.0 / 144.0, 3.0 / 144.0
PUSHED = 0.5  # that somebody is flagged where no rotor lost anything, though something was seen: not known
LATE = 2.0  # s after an onset in which a flag is of it


class Heard(NamedTuple):
    """Likelihoods of what was said, relative to that under a push."""

    rotors: Array  # (N,)
    before: int  # sources that flagged somebody before the onset, when nothing had begun


def heard(said: Sequence[Said], begin: float, onset: float, rotors: int) -> Heard | None:
    """Weigh what sources say about an onset; None where none ran.

    Parameters
    ----------
    said : sequence of Said
    begin, onset : float, s
        When they begin to look, in the flight with the onset, and the onset.
    rotors : int
    """
    logs, astray, ran = np.zeros(rotors), 0, 0
    quiet = max(onset - EARLY - begin, 0.0)
    for one in said:
        if one.note:
            continue
        ran += 1
        early = sum(begin - 1e-9 <= flag[1] < onset - EARLY for flag in one.flags)
        near = [flag for flag in one.flags if onset - EARLY <= flag[1] <= onset + LATE]
        astray += bool(early)
        fits, errs = (
            share * _poisson(early, rate * quiet) for share, rate in zip((FITS, 1.0 - FITS), RATES, strict=True)
        )
        chance = 1.0 - math.exp(-RATES[1] * (EARLY + LATE))
        first = near[0][0] - 1 if near else None
        push = fits * (1.0 - PUSHED if first is None else PUSHED / rotors)
        by_chance = errs * (1.0 - chance if first is None else chance / rotors)
        for k in range(rotors):
            loss = 1.0 - RIGHT - WRONG if first is None else RIGHT if first == k else WRONG / max(rotors - 1, 1)
            logs[k] += math.log((fits * loss + by_chance) / (push + by_chance))
    return Heard(np.exp(logs / ran), astray) if ran else None


def _poisson(count: int, mean: float) -> float:
    """Probability of so many."""
    return math.exp(-mean) * mean**count / math.factorial(count)
