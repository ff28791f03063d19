"""Curves on a map: where the success rate crosses a level, with intervals, and where hover stops being possible.

A map of three or four axes is looked at in slices, one for each combination of the further axes.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from contourpy import contour_generator
from numpy.typing import NDArray

from rotorfault.campaigns.report.limits import Limits, limits
from rotorfault.campaigns.report.maps import Maps, VariantMap, View
from rotorfault.campaigns.sampling.boundary import Boundary, boundary
from rotorfault.campaigns.sampling.statistics import Array, Interval

LEVELS = (0.5, 0.99)
MOST_SLICES = 6
FINE = 81  # points along an axis at which limits are looked for
HALVINGS = 12  # of the way between two of these points


class Slice(NamedTuple):
    """One map, or one line, out of a campaign."""

    title: str  # values of the further axes; empty where there are none
    at: tuple[Any, ...]  # index of arrays of the shape of the map

    def of(self, values: NDArray[Any]) -> NDArray[Any]:
        """The part of an array, shape (first, second) or (first,)."""
        return np.asarray(values[self.at])


class Crossings(NamedTuple):
    """Where the success rate crosses a level.

    Attributes
    ----------
    level : float
    lines : list of ndarray, shape (points, 2)
        Between cells straight, as `rotorfault.campaigns.sampling.boundary` has it; none on maps with names on an
        axis, and for a study with one axis.
    points : ndarray, shape (crossings, 2)
        On lines of the grid; where the success rate changes along both axes alike, on both.
    lower, upper : ndarray, shape (crossings,)
        Interval along the crossing's axis, from cell to cell (`to_cells`); NaN where it is open.
    along : ndarray of int, shape (crossings,)
        Axis, 0 or 1, along which it crosses the level: of the two the one on which it changes faster there, so
        that intervals lie across the boundary and not beside it.
    """

    level: float
    lines: list[Array]
    points: Array
    lower: Array
    upper: Array
    along: NDArray[np.int64]


class Edges(NamedTuple):
    """Where hover stops being possible: curves, or for a study with one axis places on it as lists of one point."""

    with_yaw: list[Array]
    without_yaw: list[Array]


def slices(maps: Maps) -> tuple[list[Slice], int]:
    """The slices that are shown, evenly picked if there are too many, and how many there are."""
    flat = min(len(maps.views), 2)
    further = maps.views[flat:]
    every = [
        Slice(
            ", ".join(_value(view, i) for view, i in zip(further, places, strict=True)),
            (slice(None),) * flat + places,
        )
        for places in itertools.product(*(range(len(view.values)) for view in further))
    ]
    if len(every) <= MOST_SLICES:
        return every, len(every)
    return [every[i] for i in np.linspace(0, len(every) - 1, MOST_SLICES).round().astype(int)], len(every)


def _value(view: View, place: int) -> str:
    return f"{view.title} {view.text(place)}{f' {view.unit}' if view.unit not in ('', '1') else ''}"


def crossings(maps: Maps, variant: VariantMap, part: Slice, level: float) -> Crossings:
    """Where a variant's success rate crosses a level in a slice."""
    x = maps.views[0]
    successes, flights = part.of(variant.successes), part.of(variant.flights)
    bounds = Interval(part.of(variant.lower), part.of(variant.upper))
    if successes.ndim == 1:
        if not x.numeric:
            return _nothing(level)
        row = Interval(bounds.lower[None], bounds.upper[None])
        found = boundary(successes[None], flights[None], x.positions, level, axis=1, interval=row)
        crossed = to_cells(found, x.positions)
        return Crossings(level, [], *_points(crossed, np.array([level]), 0))
    views, rate = maps.views[:2], part.of(variant.success_rate)
    parts = []
    for axis, view in enumerate(views):
        if view.numeric:
            found = boundary(successes, flights, view.positions, level, axis=axis, interval=bounds)
            crossed = to_cells(found, view.positions)
            points, lower, upper, along = _points(crossed, views[1 - axis].positions, axis)
            across = _faster(views, rate, points, axis)
            parts.append((points[across], lower[across], upper[across], along[across]))
    if not parts:
        return _nothing(level)
    to_scale = all(view.numeric and len(view.values) > 1 for view in views)
    x_positions, y_positions = (view.positions for view in views)
    lines = _contours(x_positions, y_positions, rate, level) if to_scale else []
    return Crossings(level, lines, *(np.concatenate(each) for each in zip(*parts, strict=True)))


def to_cells(crossed: Boundary, positions: Array) -> Boundary:
    """The same crossings with intervals that reach to cells.

    A cell's interval holds at the cell. Between two cells nothing was flown, and that bounds go straight from one to
    the next is no more than a way to draw them: the crossing may lie anywhere between the last cell that is surely
    on one side of the level and the first that is surely on the other.

    Parameters
    ----------
    crossed : Boundary
    positions : ndarray, shape (cells,)
        Of the cells, ascending.
    """
    slack = 1e-9 * (positions[-1] - positions[0])  # for ends that are cells but for rounding
    below = np.searchsorted(positions, crossed.lower + slack, side="right") - 1
    above = np.searchsorted(positions, crossed.upper - slack, side="left")
    last = len(positions) - 1
    return crossed._replace(
        lower=np.where(np.isnan(crossed.lower), np.nan, positions[below.clip(0, last)]),
        upper=np.where(np.isnan(crossed.upper), np.nan, positions[above.clip(0, last)]),
    )


def _faster(views: tuple[View, ...], rate: Array, points: Array, axis: int) -> NDArray[np.bool_]:
    """Which crossings along an axis lie across the boundary: the rate changes there no faster along the other one."""
    other = views[1 - axis]
    if not other.numeric or len(other.values) < 2:
        return np.ones(len(points), dtype=bool)
    beside = np.nan_to_num(np.gradient(rate, axis=1 - axis))
    below = (
        np.searchsorted(views[axis].positions, points[:, axis], side="left").clip(1, len(views[axis].values) - 1) - 1
    )
    line = np.searchsorted(other.positions, points[:, 1 - axis])
    low, high = ((at, line) if axis == 0 else (line, at) for at in (below, below + 1))
    step = np.abs(rate[high] - rate[low])
    return np.asarray(step >= 0.5 * np.abs(beside[low] + beside[high]))


def _points(crossed: Boundary, other: Array, axis: int) -> tuple[Array, Array, Array, NDArray[np.int64]]:
    """Points, intervals and axes of crossings."""
    line, crossing = np.nonzero(np.isfinite(crossed.position))
    points = np.empty((len(line), 2))
    points[:, axis], points[:, 1 - axis] = crossed.position[line, crossing], other[line]
    return points, crossed.lower[line, crossing], crossed.upper[line, crossing], np.full(len(line), axis)


def _nothing(level: float) -> Crossings:
    return Crossings(level, [], np.empty((0, 2)), np.empty(0), np.empty(0), np.empty(0, dtype=np.int64))


def edges(maps: Maps, variant: int, part: Slice) -> Edges | None:
    """Where hover stops being possible in a slice, between cells too, for the middle of what is drawn.

    Returns
    -------
    Edges or None
        None where that is not known, or no axis of the slice has numbers. Beside names it is a line for each of them.
    """
    flat = maps.views[:2]
    if maps.variants[variant].possible is None or not any(view.numeric and len(view.values) > 1 for view in flat):
        return None
    further = {view.name: view.values[place] for view, place in zip(maps.views[2:], part.at[2:], strict=True)}

    def told(values: dict[str, NDArray[Any]]) -> Limits | None:
        count = len(next(iter(values.values())))
        others = {name: np.full(count, value) for name, value in further.items()}
        return limits(maps.study, variant, {**values, **others}, middle=True)

    def possible(points: Array) -> Limits | None:
        return told({view.name: column for view, column in zip(flat, points.T, strict=True)})

    if not all(view.numeric and len(view.values) > 1 for view in flat):
        return _edges_beside_names(flat, told)
    fine = [np.linspace(view.positions[0], view.positions[-1], FINE) for view in flat]
    grid = np.stack(np.meshgrid(*fine, indexing="ij"), axis=-1)
    if (indicators := possible(grid.reshape(-1, len(flat)))) is None:
        return None
    lines = []
    for k, field in enumerate(indicators):
        shaped = field.reshape(grid.shape[:-1])
        coarse = _steps(fine[0], shaped) if len(flat) == 1 else _contours(fine[0], fine[1], shaped, 0.5)
        lines.append([_refined(line, fine, partial(_indicator, possible, k)) for line in coarse])
    return Edges(lines[0], lines[1])


def _edges_beside_names(
    flat: Sequence[View], told: Callable[[dict[str, NDArray[Any]]], Limits | None]
) -> Edges | None:
    """Limits along the one axis that has numbers, as a short line across each cell of the other."""
    axis = 0 if flat[0].numeric and len(flat[0].values) > 1 else 1
    view, names = flat[axis], flat[1 - axis]
    named = np.array(names.values)

    def at(x: Array, row: NDArray[np.intp]) -> Limits | None:
        return told({view.name: x, names.name: named[row]})

    x = np.linspace(view.positions[0], view.positions[-1], FINE)
    rows = np.arange(len(named))
    if (indicators := at(np.tile(x, len(named)), np.repeat(rows, FINE))) is None:
        return None
    lines: list[list[Array]] = []
    for k, field in enumerate(indicators):
        shaped = field.reshape(len(named), FINE)
        row, place = np.nonzero(np.diff(shaped, axis=1))
        inner, outer, inside = x[place], x[place + 1], shaped[row, place]
        for _ in range(HALVINGS if len(row) else 0):
            middle = 0.5 * (inner + outer)
            there = at(middle, row)
            assert there is not None  # as it was for the whole grid
            same = there[k] == inside
            inner, outer = np.where(same, middle, inner), np.where(same, outer, middle)
        ends = [np.array([[e, p - 0.5], [e, p + 0.5]]) for e, p in zip(outer, names.positions[row], strict=True)]
        lines.append([line if axis == 0 else line[:, ::-1] for line in ends])
    return Edges(lines[0], lines[1])


def _indicator(possible: Callable[[Array], Limits | None], k: int, points: Array) -> Array:
    indicators = possible(points)
    assert indicators is not None  # as it was for the whole grid
    return indicators[k]


def _steps(x: Array, field: Array) -> list[Array]:
    """Places half way where a row of indicators changes, as lines of one point."""
    return [np.array([[0.5 * (x[i] + x[i + 1])]]) for i in np.flatnonzero(np.diff(field))]


def _contours(x: Array, y: Array, values: Array, level: float) -> list[Array]:
    """Contour lines of values of shape (x, y)."""
    return [np.asarray(line) for line in contour_generator(x, y, np.ma.masked_invalid(values.T)).lines(level)]


def _refined(line: Array, fine: list[Array], possible: Callable[[Array], Array]) -> Array:
    """A contour of indicators moved to where they change, by halving along the edge of the grid it crosses."""
    step = np.array([each[1] - each[0] for each in fine])
    place = (line - np.array([each[0] for each in fine])) / step
    across = np.abs(place - place.round()) > 0.25  # half way between two points of the grid, along one axis
    inner, outer = line - 0.5 * step * across, line + 0.5 * step * across
    inside = possible(inner)
    for _ in range(HALVINGS):
        middle = 0.5 * (inner + outer)
        same = np.equal(possible(middle), inside)[:, None]
        inner, outer = np.where(same, middle, inner), np.where(same, outer, middle)
    return np.asarray(0.5 * (inner + outer))
