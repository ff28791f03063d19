"""Where on a map the success rate crosses a level: curves with intervals, from counts on a grid.

Along each line of the grid, the success rate is taken as straight between the estimates (successes over flights) of
neighbouring cells. Estimates drawn towards one half, such as Wilson's centres, would shift a boundary of 99 % by
whole cells: of 24 successes in 24 flights they make 93 %.

The interval of a crossing reaches from it to where the line's lower bounds rise above the level, or its upper bounds
fall below it. It holds as each cell's interval does, crossing by crossing, not for the whole curve at once.

Success need not be monotone, so there may be several crossings. Where it is known to be, estimates and bounds can be
made so by the nearest monotone values in the sense of least squares, weighted with flights (M. Ayer et al., Ann.
Math. Stat. 26 (1955) 641-647). If a monotone curve lies between the bounds all along a line, it lies between those
made monotone as well (V. Chernozhukov, I. Fernández-Val and A. Galichon, Biometrika 96 (2009) 559-575).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import isotonic_regression

from rotorfault.base.errors import InputError, unknown
from rotorfault.campaigns.sampling.statistics import Array, Interval, check_level, clopper_pearson

MONOTONE = ("rising", "falling")


class Boundary(NamedTuple):
    """Crossings of a level, one row per line of the grid, one column per crossing; NaN where there is none.

    Attributes
    ----------
    position : ndarray, shape (lines, crossings)
        Ascending in each row.
    lower, upper : ndarray, shape (lines, crossings)
        Between which the crossing lies; NaN if that is as far as the map or a gap in it.
    direction : ndarray, shape (lines, crossings)
        1 where the success rate rises across the level, -1 where it falls.
    """

    position: Array
    lower: Array
    upper: Array
    direction: Array


def boundary(
    successes: ArrayLike,
    trials: ArrayLike,
    positions: ArrayLike,
    level: float,
    *,
    axis: int = -1,
    interval: Interval | None = None,
    monotone: str | None = None,
) -> Boundary:
    """Where the success rate crosses a level along the lines of a grid.

    Parameters
    ----------
    successes, trials : array_like of int, shape (rows, columns)
        Cells without trials are gaps, across which nothing is known.
    positions : array_like, shape (rows,) or (columns,)
        Of the cells along the axis, ascending.
    level : float
        Success rate, in (0, 1).
    axis : {-1, 0, 1}, optional
        Along which to look: 1 or -1 gives the crossings in each row, 0 those in each column.
    interval : Interval, optional
        Of each cell, such as `rotorfault.campaigns.sampling.refine.intervals` has it; that of Clopper and Pearson
        with 95 % if not given, which is for numbers of flights that were fixed beforehand.
    monotone : {"rising", "falling"}, optional
        What the success rate is known to do along the axis.

    Returns
    -------
    Boundary
        With no columns if no line crosses the level.

    Raises
    ------
    InputError
        If shapes do not fit, positions do not ascend, or an argument is out of its range.
    """
    check_level(level)
    if monotone is not None and monotone not in MONOTONE:
        raise InputError(unknown("way to be monotone", monotone, list(MONOTONE)))
    s, n = np.broadcast_arrays(np.asarray(successes, dtype=float), np.asarray(trials, dtype=float))
    if s.ndim != 2:
        raise InputError(f"successes: got {s.ndim} axes; allowed: 2")
    x = np.asarray(positions, dtype=float)
    bounds = clopper_pearson(s, n) if interval is None else interval
    if any(np.shape(bound) != s.shape for bound in bounds):
        raise InputError(
            f"interval: got bounds of shape {np.shape(bounds.lower)}; allowed: that of the counts, {s.shape}"
        )
    s, n, low, high = (np.moveaxis(np.asarray(each, dtype=float), axis, -1) for each in (s, n, *bounds))
    if x.shape != s.shape[1:] or not (np.diff(x) > 0.0).all():
        raise InputError(f"positions: got shape {x.shape}; allowed: {s.shape[1:]}, ascending")
    lines = [_line(x, s[i], n[i], low[i], high[i], level, monotone) for i in range(len(s))]
    table = np.full((4, len(s), max(map(len, lines), default=0)), np.nan)
    for i, crossings in enumerate(lines):
        table[:, i, : len(crossings)] = np.reshape(crossings, (-1, 4)).T
    return Boundary(*table)


def _line(
    x: Array, s: Array, n: Array, low: Array, high: Array, level: float, monotone: str | None
) -> list[tuple[float, float, float, float]]:
    """Position, interval and direction of each crossing."""
    crossings = []
    flown = np.flatnonzero(n > 0.0)
    for run in np.split(flown, np.flatnonzero(np.diff(flown) > 1) + 1):
        if len(run) < 2:
            continue
        curves = [s[run] / n[run], low[run], high[run]]
        if monotone is not None:
            # The same weights for all three: they stay in order.
            curves = [
                isotonic_regression(curve, weights=n[run], increasing=monotone == "rising").x for curve in curves
            ]
        middle, *ends = ([*_crossings(x[run], curve, level)] for curve in curves)
        exits = np.array([position for end in ends for position, _ in end])
        for position, direction in middle:
            left, right = exits[exits <= position], exits[exits >= position]
            crossings.append((position, left.max(initial=-np.inf), right.min(initial=np.inf), direction))
    return [
        (p, lower if np.isfinite(lower) else np.nan, upper if np.isfinite(upper) else np.nan, d)
        for p, lower, upper, d in crossings
    ]


def _crossings(x: Array, curve: Array, level: float) -> list[tuple[float, float]]:
    """Where a curve of straight pieces crosses the level, ascending, and in which direction."""
    above: NDArray[np.bool_] = curve >= level
    at = np.flatnonzero(above[:-1] != above[1:])
    part = (level - curve[at]) / (curve[at + 1] - curve[at])
    position = x[at] + part * (x[at + 1] - x[at])
    return list(zip(position.tolist(), np.where(above[at + 1], 1.0, -1.0).tolist(), strict=True))
