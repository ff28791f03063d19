r"""Intervals of success rates from counts, and the correction for many tests.

With :math:`s` successes of :math:`n` flights:

=================  ===================================================================================================
wilson             E. B. Wilson, J. Am. Stat. Assoc. 22 (1927) 209-212
clopper_pearson    C. J. Clopper and E. S. Pearson, Biometrika 26 (1934) 404-413: covers for every probability
holm               S. Holm, Scand. J. Stat. 6 (1979) 65-70
=================  ===================================================================================================

The intervals are for a number of flights that was fixed beforehand. Where earlier results decided how many flights
there are, those of `rotorfault.campaigns.sampling.refine` hold.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import betaincinv, ndtri

from rotorfault.base.errors import InputError

Array = NDArray[np.float64]


class Interval(NamedTuple):
    """Two bounds, each of the shape of the counts."""

    lower: Array
    upper: Array


def check_level(level: float) -> None:
    """Refuse a chance to cover that is none.

    Raises
    ------
    InputError
        If it is not between 0 and 1.
    """
    if not 0.0 < level < 1.0:
        raise InputError(f"level: got {level}; allowed: between 0 and 1")


def wilson(successes: ArrayLike, trials: ArrayLike, level: float = 0.95) -> Interval:
    """Score interval of a proportion; covers its level on average over proportions, not for each.

    Parameters
    ----------
    successes, trials : array_like of int
        Broadcast; 0 <= successes <= trials. Of no trials the interval is [0, 1].
    level : float, optional
        In (0, 1).

    Raises
    ------
    InputError
        If there are more successes than trials, or negative ones, or the level is out of range.
    """
    s, n = _counts(successes, trials, level)
    square = float(ndtri(0.5 + level / 2.0)) ** 2
    with np.errstate(divide="ignore", invalid="ignore"):
        middle = (s + square / 2.0) / (n + square)
        half = np.sqrt(square * (s * (n - s) / n + square / 4.0)) / (n + square)
    # At 0 and n one bound is known; computed, it misses by rounding.
    return Interval(np.where(s == 0, 0.0, middle - half), np.where(s == n, 1.0, middle + half))


def clopper_pearson(successes: ArrayLike, trials: ArrayLike, level: float = 0.95) -> Interval:
    """Exact interval of a proportion: covers at least its level, for every proportion. Arguments as of `wilson`."""
    s, n = _counts(successes, trials, level)
    tail = (1.0 - level) / 2.0
    some, missing = np.maximum(s, 1.0), np.maximum(n - s, 1.0)  # where they are 0, the bound is known
    lower = np.where(s == 0, 0.0, betaincinv(some, n - s + 1.0, tail))
    upper = np.where(s == n, 1.0, betaincinv(s + 1.0, missing, 1.0 - tail))
    return Interval(lower, upper)


def holm(p_values: ArrayLike) -> Array:
    """P-values corrected for their number, so that the chance of any false one below a level is at most that level.

    Parameters
    ----------
    p_values : array_like
        Of any shape. NaN stays NaN and does not count.
    """
    p = np.asarray(p_values, dtype=float)
    flat = p.ravel()
    order = np.argsort(flat)[: int((~np.isnan(flat)).sum())]  # NaN comes last
    corrected = np.full(flat.shape, np.nan)
    steps = np.arange(len(order), 0, -1)
    corrected[order] = np.minimum(np.maximum.accumulate(steps * flat[order]), 1.0)
    return corrected.reshape(p.shape)


def _counts(successes: ArrayLike, trials: ArrayLike, level: float) -> tuple[Array, Array]:
    s, n = np.broadcast_arrays(np.asarray(successes, dtype=float), np.asarray(trials, dtype=float))
    check_level(level)
    if not ((s >= 0) & (s <= n)).all():
        raise InputError("successes: fewer than 0 or more than there are trials")
    return s, n
