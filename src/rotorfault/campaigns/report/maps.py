"""Numbers of a campaign's maps, from its table: success, grades, recovery, altitude lost, differences, limits.

A flight is a *success* if its grade is one of those that the study names; the *success rate* of a cell is the share
of its flights that are.

Only whole rounds of a cell count: the flights 0, 1, 2, ... of a cell up to a number at which sampling looks at it.
So an unfinished campaign has maps too, and every interval holds (`rotorfault.campaigns.sampling.refine`).

Means and shares over several cells give each cell the same weight, however many flights it has: there are most where
success is uncertain. Totals over the whole map take the first round's flights of each cell, whose number no result
has decided, in the cells that all variants have flown; their intervals put those of the cells together as Zou and
Donner do (`rotorfault.campaigns.sampling.paired`).
"""

from __future__ import annotations

import itertools
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from rotorfault.base.errors import InputError
from rotorfault.base.one_line import LONGEST, cut, record_line
from rotorfault.campaigns.axes import AXES, ROTOR_AXES
from rotorfault.campaigns.flight_set import Counts
from rotorfault.campaigns.grading import GRADINGS
from rotorfault.campaigns.report.limits import Limits, limits
from rotorfault.campaigns.rounds import next_round
from rotorfault.campaigns.sampling.paired import (
    Difference,
    PairCounts,
    difference_anytime,
    mcnemar_anytime,
    overall_difference,
)
from rotorfault.campaigns.sampling.refine import intervals, looks
from rotorfault.campaigns.sampling.statistics import Array, Interval, holm, wilson
from rotorfault.campaigns.study import Study
from rotorfault.campaigns.varied import GridAxis

PROBABILITIES = (0.1, 0.5, 0.9)
"""Of the quantiles: least values within which at least this share of flights stays."""
MOST_PAIRS = 6
MOST_UNEVEN = 6.0  # longest over shortest step of an axis that is drawn to scale


class View(NamedTuple):
    """One axis of the map, with its values in ascending order where they are numbers."""

    name: str
    unit: str
    values: list[Any]
    order: Counts  # place of each value in the study
    numeric: bool

    def __repr__(self) -> str:
        return record_line(self)

    @property
    def positions(self) -> Array:
        """Where the values stand on an axis: the numbers themselves, else 0, 1, 2, ..."""
        return np.array(self.values, dtype=float) if self.numeric else np.arange(float(len(self.values)))

    @property
    def even(self) -> bool:
        """Whether the values are numbers with about the same step, so that their cells can be drawn to scale."""
        steps = np.diff(self.positions)
        return self.numeric and (len(steps) == 0 or float(steps.max()) <= MOST_UNEVEN * float(steps.min()))

    def coordinates(self, values: Array) -> Array:
        """Where values are drawn: to scale, or as many cells on where a scale would hide the narrow ones."""
        places = np.arange(float(len(self.values)))
        return values if self.even or not self.numeric else np.interp(values, self.positions, places)

    def text(self, place: int) -> str:
        """One of the values."""
        value = self.values[place]
        return f"{value:g}" if isinstance(value, float) else str(value)

    @property
    def title(self) -> str:
        """Name of the axis as text."""
        return self.name.replace("_", " ")


class VariantMap(NamedTuple):
    """Numbers of one variant, each array of the shape of the map, with axes as the views have them."""

    label: str
    cell: Counts  # number of the cell in the study
    flights: Counts
    successes: Counts
    success_rate: Array  # NaN in cells without flights
    lower: Array  # with `upper`, the interval of the success rate
    upper: Array
    grades: Counts  # (grades, ...)
    recovery: Array  # s, (probabilities, ...); infinite where more do not recover, NaN where no rotor failed
    altitude: Array  # m, (probabilities, ...); infinite where more are no success, NaN where no rotor failed
    first_failure: Counts  # id of the first flight that was no success; -1 where all were
    possible: Limits | None  # whether hover can be controlled
    total: Difference  # success rate over the whole map; of the first round
    shares: Array  # grades along the first axis, (grades, first); NaN where nothing was flown
    recovery_along: Array  # s, (probabilities, first)
    altitude_along: Array  # m, (probabilities, first)

    def __repr__(self) -> str:
        return f"<map of {self.label}: {self.cell.size:,} cells, {int(self.flights.sum()):,} flights>"


class Pairing(NamedTuple):
    """First variant less second, on the flights that both flew, each array of the shape of the map."""

    first: str
    second: str
    counts: PairCounts
    difference: Difference  # holds however the number of pairs came about
    p_value: Array  # corrected for the number of cells; NaN in cells without pairs
    significant: NDArray[np.bool_]
    first_apart: Counts  # number of the first flight in which only one was successful; -1 where there is none
    total: Difference  # over the whole map; of the first round

    def __repr__(self) -> str:
        return record_line(self)


class Maps(NamedTuple):
    """All numbers of a campaign's pictures."""

    study: Study
    views: tuple[View, ...]
    variants: tuple[VariantMap, ...]
    pairings: tuple[Pairing, ...]
    flights: int  # that count
    left_out: int  # of rounds that are not complete
    compared: int  # cells that all variants have flown: those of the totals
    complete: bool  # whether sampling asks for no further flight

    def __repr__(self) -> str:
        axes, labels = ", ".join(view.name for view in self.views), ", ".join(one.label for one in self.variants)
        about = f"{self.study.cells:,} cells ({axes}), variants {labels}, {self.flights:,} flights"
        return cut(f"<maps of {cut(self.study.name)}: {about}>", LONGEST)


class _Sample(NamedTuple):
    """The flights of one variant that count, sorted by cell and number."""

    place: Counts  # of the cell in the map as the views order it
    number: Counts
    columns: dict[str, NDArray[Any]]


def maps(study: Study, table: pa.Table) -> Maps:
    """All numbers of a campaign's pictures.

    Parameters
    ----------
    study : Study
    table : pyarrow.Table
        Flights, as `rotorfault.campaigns.block.fly_block` makes them; all of a campaign, or those there are so far.

    Raises
    ------
    InputError
        If no cell has a whole round yet.
    """
    views = tuple(_view(part) for part in study.axis)
    names = ("variant", "cell", "number", "id", "success", "grade", "recovery_time", "altitude_lost")
    columns = {name: table[name].to_numpy(zero_copy_only=False) for name in names}
    cell = np.arange(study.cells).reshape(study.shape)[np.ix_(*(view.order for view in views))]
    place_of = np.empty(study.cells, dtype=np.int64)
    place_of[cell.ravel()] = np.arange(study.cells)
    samples = [_sample(study, columns, variant.label, place_of) for variant in study.variant]
    flights = sum(len(sample.place) for sample in samples)
    if not flights:
        raise InputError(f"{study.name}: no cell has a whole round of flights yet; go on with --resume")
    # Totals of variants over different cells could not be compared.
    common = np.all([np.bincount(sample.place, minlength=study.cells) > 0 for sample in samples], axis=0)
    variants = tuple(_variant(study, k, sample, cell, common) for k, sample in enumerate(samples))
    pairs = list(itertools.combinations(range(len(samples)), 2))
    if len(pairs) > MOST_PAIRS:
        pairs = [(0, k) for k in range(1, len(samples))]
    return Maps(
        study=study,
        views=views,
        variants=variants,
        pairings=tuple(_pairing(study, a, b, samples, common) for a, b in pairs),
        flights=flights,
        left_out=table.num_rows - flights,
        compared=int(common.sum()),
        complete=_complete(study, variants),
    )


def _view(part: GridAxis) -> View:
    name, grid = part.name, part.grid
    numeric = name not in ROTOR_AXES and all(isinstance(value, float) for value in grid)
    order = np.argsort(np.array(grid, dtype=float), kind="stable") if numeric else np.arange(len(grid))
    return View(
        name, AXES[name].unit if name in AXES and not part.case else "", [grid[i] for i in order], order, numeric
    )


def _sample(study: Study, columns: dict[str, NDArray[Any]], label: str, place_of: Counts) -> _Sample:
    rows = np.flatnonzero(columns["variant"] == label)
    rows = rows[np.lexsort((columns["number"][rows], columns["cell"][rows]))]
    cell, number = columns["cell"][rows], columns["number"][rows]
    start = np.searchsorted(cell, cell, side="left")
    in_a_row = number == np.arange(len(cell)) - start  # numbers differ, so beyond a gap none is its rank
    length = np.bincount(cell[in_a_row], minlength=study.cells)
    steps = np.array([0, *looks(study.refine)])
    whole = steps[np.searchsorted(steps, length, side="right") - 1]
    keep = in_a_row & (number < whole[cell])
    rows = rows[keep]
    return _Sample(place_of[cell[keep]], number[keep], {name: column[rows] for name, column in columns.items()})


def _complete(study: Study, variants: tuple[VariantMap, ...]) -> bool:
    counts = np.zeros((2, len(variants), study.cells), dtype=np.int64)
    for k, variant in enumerate(variants):
        counts[:, k, variant.cell.ravel()] = variant.successes.ravel(), variant.flights.ravel()
    return not next_round(study, counts[0], counts[1]).size


def _variant(study: Study, k: int, sample: _Sample, cell: Counts, common: NDArray[np.bool_]) -> VariantMap:
    shape, count, place = cell.shape, cell.size, sample.place
    success = sample.columns["success"].astype(bool)
    trials, successes = np.bincount(place, minlength=count), np.bincount(place[success], minlength=count)
    bounds = intervals(successes, trials, study.refine)
    with np.errstate(invalid="ignore"):
        success_rate = np.where(trials > 0, successes / np.maximum(trials, 1), np.nan)
    names = GRADINGS[study.grading].names
    index_of = {name: i for i, name in enumerate(names)}
    grade = np.array([index_of[name] for name in sample.columns["grade"]], dtype=np.int64)
    by_grade = np.bincount(grade * count + place, minlength=len(names) * count).reshape(len(names), count)
    failure = np.full(count, -1)
    places, first = np.unique(place[~success], return_index=True)  # sorted by number within a cell
    failure[places] = sample.columns["id"][~success][first]
    recovery, altitude = _costs(sample, success)
    alike, weight = np.ones(len(place)), 1.0 / np.maximum(trials, 1)[place]
    along, rows = place // (count // shape[0]), shape[0]
    quantiles = [
        weighted_quantiles(values, weights, groups, n).reshape(-1, *form)
        for values in (recovery, altitude)
        for weights, groups, n, form in ((alike, place, count, shape), (weight, along, rows, (rows,)))
    ]
    bounded = GRADINGS[study.grading].hover_bounds
    possible = limits(study, k, study.cell_values(cell.ravel())) if bounded else None
    return VariantMap(
        label=study.variant[k].label,
        cell=cell,
        flights=trials.reshape(shape),
        successes=successes.reshape(shape),
        success_rate=success_rate.reshape(shape),
        lower=bounds.lower.reshape(shape),
        upper=bounds.upper.reshape(shape),
        grades=by_grade.reshape(-1, *shape),
        recovery=quantiles[0],
        altitude=quantiles[2],
        first_failure=failure.reshape(shape),
        possible=None if possible is None else Limits(*(each.reshape(shape) for each in possible)),
        total=_total(study, sample, success, common),
        shares=_shares(by_grade.reshape(len(names), rows, -1)),
        recovery_along=quantiles[1],
        altitude_along=quantiles[3],
    )


def _costs(sample: _Sample, success: NDArray[np.bool_]) -> tuple[Array, Array]:
    """Recovery time and altitude lost of each flight, infinite where it never recovered, or was no success.

    Left out, such flights would make a variant look the better the more of them it has; and one that tumbles is
    over before it has fallen far. NaN is kept for flights without a loss.
    """
    recovery, altitude = (sample.columns[name].astype(float) for name in ("recovery_time", "altitude_lost"))
    faulty = ~np.isnan(altitude)  # has a number from the first loss of thrust on
    return np.where(np.isnan(recovery) & faulty, np.inf, recovery), np.where(success | ~faulty, altitude, np.inf)


def _shares(by_grade: Counts) -> Array:
    """Mean over the cells of a row of the grades' shares in each cell."""
    trials = by_grade.sum(axis=0)
    with np.errstate(invalid="ignore"):
        shares = np.where(trials > 0, by_grade / np.maximum(trials, 1), 0.0)
        return np.asarray(shares.sum(axis=-1) / np.where((cells := (trials > 0).sum(axis=-1)) > 0, cells, np.nan))


def weighted_quantiles(values: Array, weights: Array, groups: Counts, count: int) -> Array:
    """Least values within which at least a share of a group's weight lies, for `PROBABILITIES`.

    Parameters
    ----------
    values, weights : ndarray, shape (N,)
        Values that are NaN are left out; infinite ones are not.
    groups : ndarray of int, shape (N,)
        0 to count - 1.
    count : int

    Returns
    -------
    ndarray, shape (probabilities, count)
        NaN in groups without values.
    """
    numbers = ~np.isnan(values)
    values, weights, groups = values[numbers], weights[numbers], groups[numbers]
    order = np.lexsort((values, groups))
    values, weights, groups = values[order], weights[order], groups[order]
    sums = np.concatenate([[0.0], np.cumsum(weights)])
    ends = np.searchsorted(groups, np.arange(count + 1))
    start, total = sums[ends[:-1]], np.diff(sums[ends])
    quantiles = np.full((len(PROBABILITIES), count), np.nan)
    some = total > 0.0
    for k, probability in enumerate(PROBABILITIES):
        # Less a bit, so that rounding of sums does not ask for the next value.
        place = np.searchsorted(sums[1:], start + (probability - 1e-9) * total)
        quantiles[k, some] = values[np.clip(place, ends[:-1], ends[1:] - 1)[some]]
    return quantiles


def _total(study: Study, sample: _Sample, success: NDArray[np.bool_], common: NDArray[np.bool_]) -> Difference:
    """Success rate over the cells that all variants have flown, on the first round's flights."""
    first = (sample.number < study.refine.initial) & common[sample.place]
    trials = np.bincount(sample.place[first], minlength=study.cells)
    successes = np.bincount(sample.place[first & success], minlength=study.cells)
    some = trials > 0
    if not some.any():
        return Difference(*(np.asarray(np.nan) for _ in range(3)))
    estimate = successes[some] / trials[some]
    bounds = wilson(successes[some], trials[some], study.refine.level)
    return _together(estimate, bounds)


def _together(estimate: Array, bounds: Interval) -> Difference:
    """Mean of independent estimates, with an interval from theirs."""
    middle = estimate.mean()
    down, up = (np.sqrt(((bound - estimate) ** 2).sum()) / len(estimate) for bound in bounds)
    return Difference(middle, middle - down, middle + up)


def _pairing(study: Study, first: int, second: int, samples: list[_Sample], common: NDArray[np.bool_]) -> Pairing:
    a, b = samples[first], samples[second]
    keys = [each.place * study.refine.most + each.number for each in (a, b)]
    _, at_a, at_b = np.intersect1d(keys[0], keys[1], assume_unique=True, return_indices=True)
    place, number = a.place[at_a], a.number[at_a]
    by_a, by_b = (each.columns["success"].astype(bool)[at] for each, at in ((a, at_a), (b, at_b)))

    def counts(which: NDArray[np.bool_]) -> PairCounts:
        return PairCounts(
            *(
                np.bincount(place[which & kind], minlength=study.cells)
                for kind in (by_a & ~by_b, ~by_a & by_b, np.ones(len(place), dtype=bool))
            )
        )

    shape = tuple(study.shape)
    everything = counts(np.ones(len(place), dtype=bool))
    early = counts((number < study.refine.initial) & common[place])
    difference = difference_anytime(*everything, study.refine.level)
    p_value = holm(np.where(everything.pairs > 0, mcnemar_anytime(*everything[:2]), np.nan))
    with np.errstate(invalid="ignore"):
        significant = p_value < 1.0 - study.refine.level
    apart = np.full(study.cells, -1)
    places, first_of = np.unique(place[by_a != by_b], return_index=True)  # sorted by number within a cell
    apart[places] = number[by_a != by_b][first_of]
    total = (
        overall_difference(*early, study.refine.level)
        if early.pairs.any()
        else Difference(*(np.asarray(np.nan) for _ in range(3)))
    )
    return Pairing(
        first=study.variant[first].label,
        second=study.variant[second].label,
        counts=PairCounts(*(each.reshape(shape) for each in everything)),
        difference=Difference(*(each.reshape(shape) for each in difference)),
        p_value=p_value.reshape(shape),
        significant=significant.reshape(shape),
        first_apart=apart.reshape(shape),
        total=total,
    )
