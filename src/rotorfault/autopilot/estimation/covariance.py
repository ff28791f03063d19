r"""Covariances of error states, moved and corrected one scalar at a time.

What most entries of a transition matrix are is known when the filter is written: zero. A step :math:`x_i \leftarrow
x_i + \sum_j c_{ij} x_j` of some states by some others therefore says only the :math:`c_{ij}` that there are, and
costs no more than those. A measurement is a scalar :math:`y = h^T x + n`, :math:`n` of variance :math:`r`, with

.. math:: s = h^T P h + r, \quad k = P h\,v / s, \quad x \leftarrow x + k\,(y - h^T x), \quad
          P \leftarrow P - k\,(P h)^T

where :math:`v` is 1 if the measurement is valid and 0 if not. The upper triangle alone is computed, so that
:math:`P` stays symmetric.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import final

from rotorfault.maths.scalar import Scalar

Rows = Mapping[int, Mapping[int, Scalar]]
"""For each state that moves, by which others, and how much."""


@final
class Filter:
    """Error states and their covariance at one instant.

    Parameters
    ----------
    triangle : sequence of scalar
        Upper triangle of the covariance, row by row.
    states : int
    """

    def __init__(self, triangle: Sequence[Scalar], states: int) -> None:
        numbers = iter(triangle)
        self.states = states
        self._upper = {(i, j): next(numbers) for i in range(states) for j in range(i, states)}
        self.error: list[Scalar] = [0.0] * states
        self.squares: Scalar = 0.0  # sum of the normalised squared innovations
        self.measured: Scalar = 0.0  # how many there were

    @classmethod
    def independent(cls, variances: Sequence[Scalar]) -> Filter:
        """States that have nothing to do with each other.

        Parameters
        ----------
        variances : sequence of scalar
        """
        count = len(variances)
        return cls([variances[i] if i == j else 0.0 for i in range(count) for j in range(i, count)], count)

    def __getitem__(self, place: tuple[int, int]) -> Scalar:
        """Covariance of two states."""
        return _upper_of(self._upper, *place)

    def _at(self, i: int, j: int) -> Scalar:
        return _upper_of(self._upper, i, j)

    @property
    def triangle(self) -> tuple[Scalar, ...]:
        """Upper triangle of the covariance, row by row."""
        return tuple(self._upper[i, j] for i in range(self.states) for j in range(i, self.states))

    def move(self, rows: Rows) -> None:
        """Let states move by others.

        Parameters
        ----------
        rows : mapping of int to mapping of int to scalar
            No state may both move and be moved by.
        """
        after = dict(self._upper)

        def put(i: int, j: int, value: Scalar) -> None:
            after[(i, j) if i <= j else (j, i)] = value

        for i, by in rows.items():
            for k in range(self.states):
                if k not in rows:
                    put(i, k, _sum(self[i, k], by, partial(self._at, k)))
        moving = sorted(rows)
        for place, i in enumerate(moving):
            for k in moving[place:]:
                half = _sum(self[i, k], rows[i], partial(self._at, k))
                put(i, k, _sum(half, rows[k], partial(_upper_of, after, i)))
        self._upper = after

    def blur(self, state: int, variance: Scalar) -> None:
        """Add noise to a state."""
        self._upper[state, state] = self._upper[state, state] + variance

    def scale(self, state: int, factor: Scalar) -> None:
        """Multiply a state by a factor."""
        for k in range(self.states):
            place = (state, k) if state <= k else (k, state)
            self._upper[place] = self._upper[place] * (factor * factor if k == state else factor)

    def correct(self, row: Mapping[int, Scalar], value: Scalar, variance: Scalar, valid: Scalar) -> Scalar:
        """Take in a measurement.

        Parameters
        ----------
        row : mapping of int to scalar
            What it is of which states.
        value : scalar
            Measured less predicted, before any correction of this instant.
        variance : scalar
            Of its noise.
        valid : scalar
            1 if there is one, else 0.

        Returns
        -------
        scalar
            The innovation, over its standard deviation, squared; 0 where there is none.
        """
        places = [*row]
        first, *others = places
        column = []
        for k in range(self.states):
            total = self[k, first] * row[first]
            for j in others:
                total = total + self[k, j] * row[j]
            column.append(total)
        spread, innovation = variance, value
        for j in places:
            spread = spread + row[j] * column[j]
            innovation = innovation - row[j] * self.error[j]
        weight = valid / spread
        gain = [one * weight for one in column]
        for i in range(self.states):
            self.error[i] = self.error[i] + gain[i] * innovation
            for j in range(i, self.states):
                self._upper[i, j] = self._upper[i, j] - gain[i] * column[j]
        square = weight * innovation * innovation
        self.squares, self.measured = self.squares + square, self.measured + valid
        return square


def _upper_of(upper: Mapping[tuple[int, int], Scalar], i: int, j: int) -> Scalar:
    return upper[(i, j) if i <= j else (j, i)]


def _sum(start: Scalar, by: Mapping[int, Scalar], of: Callable[[int], Scalar]) -> Scalar:
    total = start
    for j, factor in by.items():
        total = total + factor * of(j)
    return total
