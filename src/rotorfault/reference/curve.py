r"""Smooth curves through tabulated values, for references from files. SciPy is loaded with this module alone.

A cubic spline through values alone is the best guess at a smooth motion that was sampled, and swings where the motion
was none: it dives below rows that stand still before and after a step. So a spline is kept only where it leaves the
range between two rows no further than the rows themselves show that there is a peak: by twice

.. math:: \frac{h^2}{8}\,\operatorname{minmod}(s_i, s_{i+1}), \qquad s_i = 2\,\frac{m_i - m_{i-1}}{h_{i-1} + h_i}

with m_i and h_i the slope and the time between rows i and i + 1: the height of a parabola whose curvature both ends
agree on (after Huynh 1993, who bounds cubic polynomials so). Between equal rows, which hold, and at both ends of the
table there is no such room. Where it goes further, its derivatives at the rows around are reduced until it does not.
Between rows it is then of fifth order, so position, velocity and acceleration stay continuous; elsewhere it stays the
cubic spline.
"""

from __future__ import annotations

from typing import Any, NamedTuple, final

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BPoly, CubicSpline

from rotorfault.base.errors import InputError
from rotorfault.maths.arrays import Array

Flags = NDArray[np.bool_]

PEAK = 2.0  # times the height of the parabola that two rows agree on: room for curvature that grows between them
UNSEEN = 1e-3  # m or rad: swings below it are left alone, as rows are rounded
EXACT = 1e-9  # relative to the span of the values
HALVINGS = 6  # of derivatives, before they are set to 0


@final
class Curve:
    """A smooth function of time through given values, and rates and accelerations where there are any.

    Without rates a cubic spline that does not swing, with rates a cubic and with accelerations a quintic polynomial
    between each two instants, so that the tabulated derivatives are always those of the tabulated values.

    Parameters
    ----------
    times, values : ndarray, shape (n,)
    rates, accelerations : ndarray, shape (n,), or None
        Accelerations only with rates.

    Raises
    ------
    InputError
        If the numbers are so large, or the times so close, that no curve can be computed.
    """

    def __init__(self, times: Array, values: Array, rates: Array | None, accelerations: Array | None) -> None:
        self._first, self._last = float(times[0]), float(times[-1])
        try:
            with np.errstate(all="ignore"):
                curve = _joined(times, values, rates, accelerations)
                self._derivatives = [curve, curve.derivative(1), curve.derivative(2)]
        except (ValueError, np.linalg.LinAlgError):
            raise InputError(
                "no smooth curve goes through the rows: their numbers are too large, or their times too close"
            ) from None

    def evaluate(self, times: Array) -> Array:
        """Value, rate and acceleration, shape (3, n); at rest before the first and after the last given instant."""
        inside = (times >= self._first) & (times <= self._last)
        result = np.stack([derivative(np.clip(times, self._first, self._last)) for derivative in self._derivatives])
        result[1:, ~inside] = 0.0
        return result


def _joined(times: Array, values: Array, rates: Array | None, accelerations: Array | None) -> Any:
    """The curve itself, of one of SciPy's kinds."""
    if rates is None:
        return _spline(times, values)
    columns = [values, rates] if accelerations is None else [values, rates, accelerations]
    return BPoly.from_derivatives(times, np.stack(columns, axis=1))


class _Rows(NamedTuple):
    """What a table says of each of its n - 1 intervals."""

    lengths: Array  # s
    low: Array  # least and
    high: Array  # largest value that the curve may have
    flat: Flags  # nothing moves there


def _spline(times: Array, values: Array) -> Any:
    """The cubic spline, or one of fifth order where it swings."""
    spline = CubicSpline(times, values)
    rows = _rows(times, values)
    swings = _swing(spline, rows) > UNSEEN
    if not swings.any():
        return spline
    return BPoly(_without_swings(spline, values, rows, swings), times)


def _rows(times: Array, values: Array) -> _Rows:
    h, change = np.diff(times), np.diff(values)
    slope = change / h
    s = np.concatenate([[0.0], 2.0 * np.diff(slope) / (h[1:] + h[:-1]), [0.0]])
    a, b = s[:-1], s[1:]
    # Two equal rows are a hold, not a peak that lies between them.
    agreed = np.where((a * b > 0.0) & (change != 0.0), np.sign(a) * np.minimum(np.abs(a), np.abs(b)), 0.0)
    room = PEAK * agreed * h * h / 8.0
    low = np.minimum(values[1:], values[:-1]) - np.maximum(room, 0.0)
    high = np.maximum(values[1:], values[:-1]) - np.minimum(room, 0.0)
    return _Rows(h, low, high, change == 0.0)


def _swing(spline: CubicSpline, rows: _Rows) -> Array:
    """How far a cubic spline leaves the allowed range in each interval."""
    a, b, c, d = spline.c
    worst: Array = np.zeros_like(d)
    with np.errstate(all="ignore"):
        root = np.sqrt(b * b - 3.0 * a * c)
        # Both roots of 3 a u^2 + 2 b u + c without cancellation.
        q = -(b + np.copysign(root, b))
        for u in (q / (3.0 * a), c / q):
            inside = (u > 0.0) & (u < rows.lengths)
            value = ((a * u + b) * u + c) * u + d
            out = np.maximum(value - rows.high, rows.low - value)
            worst = np.where(inside, np.fmax(worst, out), worst)
    return worst


def _without_swings(spline: CubicSpline, values: Array, rows: _Rows, swings: Flags) -> Array:
    """Coefficients of Bernstein polynomials of fifth order, shape (6, n - 1), that stay in range where it swings.

    A curve lies within the hull of its coefficients. These are those of the spline wherever nothing was reduced.
    """
    times = spline.x
    rate, curvature = spline(times, 1), spline(times, 2)
    halved = np.zeros(len(times), dtype=int)
    slack = EXACT * float(np.ptp(values))
    # Rows that stand still beside a swing have none of their own.
    touched = swings | _beside(rows.flat, swings)
    still = np.zeros(len(times), dtype=bool)
    still[:-1] |= touched & rows.flat
    still[1:] |= touched & rows.flat
    rate[still] = curvature[still] = 0.0
    while True:
        hull = _coefficients(values, rate, curvature, rows.lengths)
        out = (hull.max(axis=0) > rows.high + slack) | (hull.min(axis=0) < rows.low - slack)
        near = touched.copy()
        near[1:] |= touched[:-1]
        near[:-1] |= touched[1:]
        wrong = out & near
        if not wrong.any():
            return hull
        touched |= wrong
        ends = np.zeros(len(times), dtype=bool)
        ends[:-1] |= wrong
        ends[1:] |= wrong
        halved += ends
        # As if time went half as fast there; in the end the curve is at rest in the row.
        factor = np.where(ends, np.where(halved > HALVINGS, 0.0, 0.5), 1.0)
        rate, curvature = rate * factor, curvature * factor * factor


def _beside(flat: Flags, swings: Flags) -> Flags:
    """Flat intervals that follow each other up to one that swings, or up to one beside it."""
    run = np.cumsum(np.concatenate([[False], flat[1:] != flat[:-1]]))
    near = swings.copy()
    near[1:] |= swings[:-1]
    near[:-1] |= swings[1:]
    return np.asarray(flat & np.isin(run, run[near & flat]))


def _coefficients(values: Array, rate: Array, curvature: Array, h: Array) -> Array:
    y0, y1, d0, d1, s0, s1 = values[:-1], values[1:], rate[:-1], rate[1:], curvature[:-1], curvature[1:]
    square = h * h / 20.0
    return np.stack(
        [
            y0,
            y0 + 0.2 * h * d0,
            y0 + 0.4 * h * d0 + square * s0,
            y1 - 0.4 * h * d1 + square * s1,
            y1 - 0.2 * h * d1,
            y1,
        ]
    )
