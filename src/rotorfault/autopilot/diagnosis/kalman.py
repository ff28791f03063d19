r"""A Kalman filter on scalars, for a state of which only a few elements move by themselves.

.. math:: \bar x = \Phi\hat x + u, \quad \bar P = \Phi P\Phi^T + Q, \qquad
          S = h\bar Ph^T + R, \quad K = \bar Ph^T/S, \quad \hat x = \bar x + K\nu, \quad P = \bar P - KSK^T

with one number measured at a time, :math:`\nu = y - h\bar x`, so that nothing has to be inverted; numbers measured
together must have independent noise. Rows of :math:`\Phi - I` and h are sparse: they name the elements that count.
Only the upper triangle of P is kept, so it stays symmetric.

Source: R. E. Kalman, "A new approach to linear filtering and prediction problems", J. Basic Eng. 82, 1960; one number
at a time: D. Simon, "Optimal State Estimation", 2006, section 6.1.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from rotorfault.maths.scalar import Scalar

Sparse = Mapping[int, Scalar]
"""Elements of a row that are not zero, by their place."""


class Belief(NamedTuple):
    """Mean and covariance of a state."""

    mean: tuple[Scalar, ...]
    covariance: tuple[tuple[Scalar, ...], ...]  # row i from the diagonal on: elements i, i + 1, ...

    def of(self, i: int, j: int) -> Scalar:
        """An element of the covariance."""
        return self.covariance[i][j - i] if i <= j else self.covariance[j][i - j]


def diagonal(mean: Sequence[Scalar], variances: Sequence[Scalar]) -> Belief:
    """Elements that are known independently of each other.

    Parameters
    ----------
    mean, variances : sequence of scalar
    """
    n = len(mean)
    rows = (tuple(variances[i] if i == j else 0.0 for j in range(i, n)) for i in range(n))
    return Belief(tuple(mean), tuple(rows))


def dot(row: Sparse, values: Sequence[Scalar]) -> Scalar:
    """A sparse row times a vector."""
    total: Scalar = 0.0
    for k, factor in row.items():
        total = total + factor * values[k]
    return total


def predict(belief: Belief, rows: Mapping[int, Sparse], known: Mapping[int, Scalar], noise: Sparse) -> Belief:
    """One period further.

    Parameters
    ----------
    belief : Belief
    rows : mapping of int to Sparse
        What an element changes by, for each that moves: a row of Phi - I.
    known : mapping of int to scalar
        What is added to an element besides.
    noise : Sparse
        Variance that is added to an element.
    """
    n = len(belief.mean)
    moved = {i: [dot(row, [belief.of(k, j) for k in range(n)]) for j in range(n)] for i, row in rows.items()}
    covariance: list[tuple[Scalar, ...]] = []
    for i in range(n):
        line = []
        for j in range(i, n):
            value = belief.of(i, j)
            if i in moved:
                value = value + moved[i][j]
            if j in moved:
                value = value + moved[j][i]
            if i in moved and j in moved:
                value = value + dot(rows[j], moved[i])
            if i == j and i in noise:
                value = value + noise[i]
            line.append(value)
        covariance.append(tuple(line))
    mean = list(belief.mean)
    for i, row in rows.items():
        mean[i] = mean[i] + dot(row, belief.mean)
    for i, added in known.items():
        mean[i] = mean[i] + added
    return Belief(tuple(mean), tuple(covariance))


class Innovation(NamedTuple):
    """What one measured number says."""

    value: Scalar  # measured less expected
    variance: Scalar  # of it
    gain: tuple[Scalar, ...]  # by which each element of the state follows it


def innovation(belief: Belief, row: Sparse, measured: Scalar, noise: Scalar) -> Innovation:
    """What a measured number says of the state.

    Parameters
    ----------
    belief : Belief
    row : Sparse
        What is measured of the state, h.
    measured : scalar
    noise : scalar
        Its variance.
    """
    n = len(belief.mean)
    reach = [dot(row, [belief.of(k, j) for k in range(n)]) for j in range(n)]
    variance = dot(row, reach) + noise
    over = 1.0 / variance
    return Innovation(measured - dot(row, belief.mean), variance, tuple(r * over for r in reach))


def follow(belief: Belief, seen: Innovation) -> Belief:
    """The state after a measured number.

    Parameters
    ----------
    belief : Belief
    seen : Innovation
    """
    n, gain = len(belief.mean), seen.gain
    scaled = [g * seen.variance for g in gain]
    mean = tuple(x + g * seen.value for x, g in zip(belief.mean, gain, strict=True))
    rows = (
        tuple(value - gain[i] * scaled[i + k] for k, value in enumerate(row))
        for i, row in enumerate(belief.covariance)
    )
    assert n == len(gain)
    return Belief(mean, tuple(rows))


class Hypothesis(NamedTuple):
    """That something moves the state that the filter does not know of.

    Of an input of size 1 the innovations have the mean g; of their variance S follow score d and information C.
    """

    error: tuple[Scalar, ...]  # of the filter's state
    score: Scalar  # d, the sum of g nu / S
    information: Scalar  # C, the sum of g^2 / S
    last: Scalar = 0.0  # the part of d that the last of the measured numbers has


def follow_hypothesis(
    hypothesis: Hypothesis,
    rows: Mapping[int, Sparse],
    added: Sparse,
    seen: Sequence[tuple[Sparse, Innovation]],
    felt: Scalar,
) -> Hypothesis:
    """A hypothesis after one sampling instant of the filter.

    Parameters
    ----------
    hypothesis : Hypothesis
    rows : mapping of int to Sparse
        Of Phi - I, as in `predict`.
    added : Sparse
        What the input adds to elements that move.
    seen : sequence of (Sparse, Innovation)
        Rows of what was measured, one after another, and what that said.
    felt : scalar
        What the input adds to the last of the measured numbers.
    """
    error = list(hypothesis.error)
    for i, row in rows.items():
        moved = error[i] + dot(row, hypothesis.error)
        error[i] = moved + added[i] if i in added else moved
    score, information, of_last = hypothesis.score, hypothesis.information, hypothesis.last
    *_, last = seen
    for pair in seen:
        row, one = pair
        shown = dot(row, error)
        if pair is last:
            shown = shown + felt
        over = shown / one.variance
        if pair is last:
            of_last = of_last + over * one.value
        score = score + over * one.value
        information = information + over * shown
        error = [x - gain * shown for x, gain in zip(error, one.gain, strict=True)]
    return Hypothesis(tuple(error), score, information, of_last)


def learned_elsewhere(belief: Belief, place: int, change: Scalar, left: Scalar, start: Scalar) -> Belief:
    r"""A state of which somebody else learns an element from other measurements, and keeps what he has learned.

    He began with the variance p that the element had at the start, over which it is counted. Where his mean moves by
    :math:`\Delta` and the share l of his standard deviation is left, he has measured, with
    :math:`\epsilon = 1 - l^2`, :math:`\Delta/\epsilon` with the variance :math:`pl^2/\epsilon`. After that the
    element is what is left of it, over l.

    Parameters
    ----------
    belief : Belief
    place : int
        Of the element.
    change : scalar
        Delta.
    left : scalar
        l, greater than 0.
    start : scalar
        p.
    """
    told = 1.0 - left * left
    spread = told * belief.of(place, place) + start * left * left
    gain = [belief.of(k, place) / spread for k in range(len(belief.mean))]
    beyond = change - told * belief.mean[place]
    over = [1.0 / left if k == place else 1.0 for k in range(len(gain))]
    moved = [x + g * beyond for x, g in zip(belief.mean, gain, strict=True)]
    moved[place] = (moved[place] - change) * over[place]
    rows = (
        tuple((x - told * gain[i] * gain[i + k] * spread) * over[i] * over[i + k] for k, x in enumerate(row))
        for i, row in enumerate(belief.covariance)
    )
    return Belief(tuple(moved), tuple(rows))
