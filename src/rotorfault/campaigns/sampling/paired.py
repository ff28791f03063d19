r"""Two controllers that flew the same seeds, compared pair by pair.

Of the pairs of flights, one by each controller with the same seed, :math:`b` are those in which only the first was
successful and :math:`c` those in which only the second was.

====================  ================================================================================================
paired_difference     T. Tango, Stat. Med. 17 (1998) 891-908: the score interval
overall_difference    G. Y. Zou and A. Donner, Stat. Med. 27 (2008) 1693-1702: variances recovered from intervals
mcnemar_anytime,      H. Robbins, Ann. Math. Stat. 41 (1970) 1397-1409: likelihood ratio against a mixture, with the
difference_anytime    prior of Jeffreys; hold at all numbers of pairs together
====================  ================================================================================================

All but the ``anytime`` functions are meant for a number of pairs that was fixed beforehand. Refined sampling ends a
controller's flights in a cell by their results, so the number of seeds that both flew depends on these: compare with
the ``anytime`` functions there, or on the first block of every cell, whose size is fixed.

Pairs must be independent. Cells that share their seeds have pairs that are not: there, compare cell by cell and
correct with `rotorfault.campaigns.sampling.statistics.holm`; sums over cells and `overall_difference` need seeds of
its own in each cell.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import betaln, gammaln, ndtri, xlogy

from rotorfault.base.errors import InputError
from rotorfault.campaigns.sampling.statistics import Array, check_level

HALVINGS = 60  # of an interval of length 2: to rounding


class Difference(NamedTuple):
    """First controller less second, with an interval."""

    estimate: Array
    lower: Array
    upper: Array


class PairCounts(NamedTuple):
    """Pairs of flights by what came of them."""

    only_first: NDArray[np.int64]
    only_second: NDArray[np.int64]
    pairs: NDArray[np.int64]


def mcnemar_anytime(only_first: ArrayLike, only_second: ArrayLike) -> Array:
    """P-value of equal success rates that holds however the number of pairs came about.

    Pairs in which one of the two was successful count, each as likely either way if the controllers are equal.

    Parameters
    ----------
    only_first, only_second : array_like of int
        Pairs in which only one of the controllers was successful.

    Raises
    ------
    InputError
        If a count is negative.
    """
    b, c = np.broadcast_arrays(np.asarray(only_first, dtype=float), np.asarray(only_second, dtype=float))
    if not ((b >= 0) & (c >= 0)).all():
        raise InputError("pairs in which only one was successful: fewer than 0")
    evidence = betaln(b + 0.5, c + 0.5) - betaln(0.5, 0.5) + (b + c) * np.log(2.0)
    return np.asarray(np.exp(-np.maximum(evidence, 0.0)))


def paired_difference(
    only_first: ArrayLike, only_second: ArrayLike, pairs: ArrayLike, level: float = 0.95
) -> Difference:
    """Difference of success rates with Tango's score interval.

    Parameters
    ----------
    only_first, only_second, pairs : array_like of int
        Broadcast; the first two sum up to at most the third. Of no pairs the estimate is NaN, the interval [-1, 1].
    level : float, optional
        In (0, 1).

    Raises
    ------
    InputError
        If the counts do not fit together or the level is out of range.
    """
    b, c, n = _pairs(only_first, only_second, pairs, level)
    z = float(ndtri(0.5 + level / 2.0))

    def holds(d: Array) -> NDArray[np.bool_]:
        variance = n * (2.0 * _second_alone(b, c, n, d) + d * (1.0 - d))
        return np.asarray((b - c - n * d) ** 2 <= z**2 * variance)

    return _searched(b, c, n, holds)


def difference_anytime(
    only_first: ArrayLike, only_second: ArrayLike, pairs: ArrayLike, level: float = 0.95
) -> Difference:
    """Difference of success rates with an interval that holds however the number of pairs came about.

    Parameters
    ----------
    only_first, only_second, pairs, level
        As of `paired_difference`.

    Notes
    -----
    A difference is ruled out if its highest likelihood is below 1 - level times that of the mixture of all
    probabilities (b, c, rest) with a Dirichlet(1/2, 1/2, 1/2) prior.
    """
    b, c, n = _pairs(only_first, only_second, pairs, level)
    mixture = gammaln(1.5) - gammaln(n + 1.5) + sum(gammaln(x + 0.5) - gammaln(0.5) for x in (b, c, n - b - c))
    least = mixture + np.log1p(-level)

    def holds(d: Array) -> NDArray[np.bool_]:
        q = _second_alone(b, c, n, d)
        rest, p = np.maximum(1.0 - 2.0 * q - d, 0.0), np.maximum(q + d, 0.0)
        return np.asarray(xlogy(b, p) + xlogy(c, q) + xlogy(n - b - c, rest) >= least)

    return _searched(b, c, n, holds)


def overall_difference(
    only_first: ArrayLike,
    only_second: ArrayLike,
    pairs: ArrayLike,
    level: float = 0.95,
    weights: ArrayLike | None = None,
) -> Difference:
    """Difference of success rates over all cells, with an approximate interval.

    Parameters
    ----------
    only_first, only_second, pairs : array_like of int
        By cell. Cells without pairs are left out.
    level : float, optional
        In (0, 1).
    weights : array_like, optional
        Of the cells, at least 0; equal if not given. Sums over cells would weigh each by its number of flights, which
        is highest where success is most uncertain.

    Raises
    ------
    InputError
        As `paired_difference`, and if no cell that counts has a pair.
    """
    estimate, lower, upper = paired_difference(only_first, only_second, pairs, level)
    share = np.ones(1) if weights is None else np.asarray(weights, dtype=float)
    share = np.where(np.isnan(estimate), 0.0, np.broadcast_to(share, estimate.shape))
    if not share.sum() > 0.0 or (share < 0.0).any():
        raise InputError("weights: no cell with pairs has any weight, or one is negative; allowed: 0 or more")
    share, estimate = share / share.sum(), np.nan_to_num(estimate)
    middle = (share * estimate).sum()
    down, up = (np.sqrt(((share * (bound - estimate)) ** 2).sum()) for bound in (lower, upper))
    return Difference(middle, middle - down, middle + up)


def _second_alone(b: Array, c: Array, n: Array, d: Array) -> Array:
    """Likeliest probability that only the second is successful, if the difference is d: Tango's equation for q21."""
    linear = -b - c + (2.0 * n - b + c) * d
    root = np.sqrt(np.maximum(linear**2 + 8.0 * n * c * d * (1.0 - d), 0.0))
    with np.errstate(divide="ignore", invalid="ignore"):
        # Never less than what the probability of the other kind of pair, q + d, leaves.
        return np.asarray(np.maximum((root - linear) / (4.0 * n), np.maximum(-d, 0.0)))


def _searched(b: Array, c: Array, n: Array, holds: Callable[[Array], NDArray[np.bool_]]) -> Difference:
    """The interval of differences that hold, around the estimate, by halving on each side."""
    with np.errstate(divide="ignore", invalid="ignore"):
        estimate = (b - c) / n
    bounds = []
    for end in (-1.0, 1.0):
        inside, outside = np.nan_to_num(estimate), np.full(estimate.shape, end)
        for _ in range(HALVINGS):
            middle = 0.5 * (inside + outside)
            good = holds(middle)
            inside, outside = np.where(good, middle, inside), np.where(good, outside, middle)
        bounds.append(np.where(n == 0, end, np.where(estimate == end, end, outside)))
    return Difference(estimate, bounds[0], bounds[1])


def _pairs(b: ArrayLike, c: ArrayLike, n: ArrayLike, level: float) -> tuple[Array, Array, Array]:
    check_level(level)
    first, second, pairs = np.broadcast_arrays(*(np.asarray(x, dtype=float) for x in (b, c, n)))
    if not ((first >= 0) & (second >= 0) & (first + second <= pairs)).all():
        raise InputError("pairs: some count is negative, or more pairs had one success than there are")
    return first, second, pairs
