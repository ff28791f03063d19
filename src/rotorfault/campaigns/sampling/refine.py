"""How many more flights each cell of a map gets: many where success is uncertain, few elsewhere.

Sampling goes in rounds. The first flies a few flights in every cell; after each round, every cell whose interval is
still too wide gets another block, up to a limit per cell. With a budget for all cells together, those at a boundary
go first: cells whose interval holds a success rate of one half, or whose estimate lies on the other side of it than
that of a neighbour. Nothing is drawn at random, so the same counts give the same next round.

`intervals` covers with its level whatever the rule, the neighbours and the budget do; how, and what it was compared
with, is said in `rotorfault.campaigns.sampling.sampling_plan`. What it needs is that the flights of one controller
in one cell are independent of each other, and flown in an order of seeds that was fixed beforehand. Cells and
controllers may share seeds: what they have in common decides when a cell is left, but not whether its own flights
mislead.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import Field, model_validator

from rotorfault.base.config import Strict, refusal
from rotorfault.base.errors import InputError
from rotorfault.campaigns.sampling.sampling_plan import Plan, sampling_plan
from rotorfault.campaigns.sampling.statistics import Interval, wilson

Counts = NDArray[np.int64]
Flags = NDArray[np.bool_]

BOUNDARY = 0.5  # success rate near which cells go first where a budget does not suffice for all


# Of a sampling plan: a few GB and some ten seconds.
MOST_POINTS = 25_000  # numbers of flights and successes at which a cell is looked at
MOST_PAIRS = 15_000_000  # from one look to the next


class Refinement(Strict):
    """How many flights a cell gets."""

    initial: int = Field(default=24, ge=1, description="flights of a variant in each cell in the first round")
    block: int = Field(default=24, ge=1, description="further flights in a round, at least")
    growth: float = Field(default=0.5, ge=0.0, description="further flights as a share of those there are, at least")
    width: float = Field(default=0.2, gt=0.0, lt=1.0, description="width of the interval at which a cell is done")
    level: float = Field(default=0.95, gt=0.0, lt=1.0, description="chance with which an interval covers")
    most: int = Field(default=240, ge=1, description="flights of a variant in a cell, at most")
    budget: int | None = Field(default=None, ge=1, description="flights of all variants in all cells, at most")

    @model_validator(mode="after")
    def _consistent(self) -> Refinement:
        if self.most < self.initial:
            raise refusal("most", f"got {self.most}; allowed: at least initial, {self.initial}")
        reached, work = _reached(self), "whose intervals take more time and memory than there is"
        if not reached:
            most = math.isqrt(MOST_PAIRS) - 1
            raise refusal("initial", f"got {self.initial}, {work}; allowed: up to {most}")
        if reached < self.most:
            rule = f"initial = {self.initial}, block = {self.block} and growth = {self.growth:g}"
            raise refusal("most", f"got {self.most}, {work}; with {rule}, {reached} is allowed")
        return self


def looks(settings: Refinement) -> tuple[int, ...]:
    """Numbers of flights that a cell can have after a round, ascending."""
    return tuple(_looks(settings))


def _looks(settings: Refinement) -> Iterator[int]:
    count = settings.initial
    yield count
    while count < settings.most:
        # Whole blocks: fewer rounds, some more flights.
        blocks = max(round(min(settings.growth * count / settings.block, settings.most)), 1)
        count = min(count + blocks * settings.block, settings.most)
        yield count


def _reached(settings: Refinement) -> int:
    """Flights in a cell up to which the sampling plan can be made, `most` at most."""
    points, before = 0, 0
    for count in _looks(settings):
        points += count + 1
        if points > MOST_POINTS or (count + 1) * (count - before + 1) > MOST_PAIRS:
            return before
        before = count
    return before


def intervals(successes: ArrayLike, trials: ArrayLike, settings: Refinement) -> Interval:
    """Interval of the success rate in each cell after any round of refinement.

    Parameters
    ----------
    successes, trials : array_like of int, shape (...)
    settings : Refinement
        With which all rounds were decided.

    Returns
    -------
    Interval
        [0, 1] in cells without flights.

    Raises
    ------
    InputError
        If a cell has counts that refinement does not lead to: part of a block, or flights beyond the round in which
        the cell was done.
    """
    plan = _plan(settings)
    _, n, at = _place(successes, trials, plan)
    return Interval(np.where(n == 0, 0.0, plan.lower[at]), np.where(n == 0, 1.0, plan.upper[at]))


def finished(successes: ArrayLike, trials: ArrayLike, settings: Refinement) -> Flags:
    """Which cells are done: narrow enough, or with as many flights as allowed. Arguments as of `intervals`."""
    plan = _plan(settings)
    _, n, at = _place(successes, trials, plan)
    return np.asarray((n > 0) & plan.done[at])


def further_flights(successes: ArrayLike, trials: ArrayLike, settings: Refinement) -> Counts:
    """Flights to fly in each cell in the next round.

    Parameters
    ----------
    successes, trials : array_like of int, shape (controllers, ...)
        So far, over a grid of any number of axes.
    settings : Refinement

    Returns
    -------
    ndarray of int, shape (controllers, ...)
        All 0 once the campaign is over: every cell done, or less of the budget left than the next block takes.

    Raises
    ------
    InputError
        As `intervals`, and if the budget does not suffice for the first round.
    """
    plan = _plan(settings)
    s, n, (look, _) = _place(successes, trials, plan)
    first = plan.looks[0]
    if settings.budget is not None and settings.budget < first * n.size:
        raise InputError(
            f"budget: got {settings.budget}; allowed: at least {first * n.size}, the first {first} flights of "
            f"{n.size} cells; give fewer initial flights or a coarser map"
        )
    following = plan.looks[np.minimum(look + 1, len(plan.looks) - 1)] - plan.looks[look]
    further = np.where(n == 0, first, np.where(finished(s, n, settings), 0, following))
    if settings.budget is None:
        return further
    bounds = wilson(s, n, settings.level)  # only to choose by
    boundary = _at_boundary(s, n, bounds) | (n == 0)
    if (boundary & (further > 0)).any():
        further = np.where(boundary, further, 0)
    # Widest first; of equal ones the first, so that the order is certain: rounding must not decide.
    order = np.argsort(-np.round(bounds.upper - bounds.lower, 9).ravel(), kind="stable")
    order = order[further.ravel()[order] > 0]
    flat = np.zeros(n.size, dtype=np.int64)
    affordable = np.cumsum(further.ravel()[order]) <= settings.budget - n.sum()
    flat[order[affordable]] = further.ravel()[order[affordable]]
    return flat.reshape(n.shape)


def _plan(settings: Refinement) -> Plan:
    return sampling_plan(looks(settings), settings.width, settings.level)


def _place(successes: ArrayLike, trials: ArrayLike, plan: Plan) -> tuple[Counts, Counts, tuple[Any, Any]]:
    """Counts, and where in the plan each cell is; cells without flights are put at the first look."""
    s, n = np.broadcast_arrays(np.asarray(successes, dtype=np.int64), np.asarray(trials, dtype=np.int64))
    if not ((s >= 0) & (s <= n)).all():
        raise InputError("successes: fewer than 0 or more than there are trials")
    look = np.minimum(np.searchsorted(plan.looks, n), len(plan.looks) - 1)
    wrong = (n > 0) & ((plan.looks[look] != n) | ~plan.reachable[look, s])
    if wrong.any():
        cell = tuple(int(i) for i in np.argwhere(wrong)[0])
        raise InputError(
            f"cell {cell} has {s[cell]} successes of {n[cell]} flights, to which these settings do not lead; "
            "count whole blocks only, and keep the settings of the first round"
        )
    return s, n, (look, s)


def _at_boundary(s: Counts, n: Counts, bounds: Interval) -> Flags:
    """Whether a cell's success rate may be `BOUNDARY`, or lies on the other side of it than that of a neighbour."""
    near: Flags = (bounds.lower <= BOUNDARY) & (bounds.upper >= BOUNDARY)
    above = s / np.maximum(n, 1) >= BOUNDARY
    for axis in range(1, n.ndim):  # the first is that of the controllers, which are not neighbours
        differs = np.diff(above, axis=axis)  # exclusive or
        padding = [(0, 0)] * n.ndim
        for padding[axis] in ((0, 1), (1, 0)):
            near |= np.pad(differs, padding)
    return near
