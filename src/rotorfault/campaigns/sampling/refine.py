"""How many more flights each cell of a map gets: many where survival is uncertain, few elsewhere.

Sampling goes in rounds. The first flies a few flights in every cell; after each round, every cell whose interval is
still too wide gets another block, up to a limit per cell. With a budget for all cells together, those at a boundary
go first: cells whose interval holds a survival of interest, or whose estimate lies on the other side of it than that
of a neighbour. Nothing is drawn at random, so the same counts give the same next round.

`intervals` covers with its level whatever the rule, the neighbours and the budget do; how, and what it was compared
with, is said in `rotorfault.campaigns.sampling.sampling_plan`. What it needs is that the flights of one controller in one cell
are independent of each other, and flown in an order of seeds that was fixed beforehand. Cells and controllers may
share seeds: what they have in common decides when a cell is left, but not whether its own flights mislead.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rotorfault.base.errors import InputError
from rotorfault.campaigns.sampling.sampling_plan import Plan, sampling_plan
from rotorfault.campaigns.sampling.statistics import Array, Interval, wilson

Counts = NDArray[np.int64]
Flags = NDArray[np.bool_]


class Refinement(NamedTuple):
    """What a campaign asks for.

    Attributes
    ----------
    initial : int
        Flights in every cell in the first round.
    block : int
        Further flights of a cell in a round, at least.
    growth : float
        Further flights as a share of those there are, at least, in whole blocks: fewer rounds, some more flights.
    width : float
        Of a cell's interval, in (0, 1), at which the cell is done.
    level : float
        Chance, in (0, 1), with which a cell's interval covers.
    most : int
        Flights in a cell.
    budget : int or None
        Flights in all cells and of all controllers together.
    survivals : tuple of float
        In (0, 1), whose boundaries are of interest.
    reserve : float
        Share, in [0, 1), of the error that is kept for cells that the budget leaves unfinished.
    """

    initial: int = 24
    block: int = 24
    growth: float = 0.1
    width: float = 0.1
    level: float = 0.95
    most: int = 600
    budget: int | None = None
    survivals: tuple[float, ...] = (0.5,)
    reserve: float = 0.1


def looks(settings: Refinement) -> tuple[int, ...]:
    """Numbers of flights that a cell can have after a round, ascending.

    Raises
    ------
    InputError
        If a setting is out of its range.
    """
    for name in ("initial", "block"):
        if (value := getattr(settings, name)) < 1:
            raise InputError(f"{name}: got {value}; allowed: 1 or more")
    if settings.most < settings.initial:
        raise InputError(f"most: got {settings.most}; allowed: at least initial, {settings.initial}")
    if settings.growth < 0.0:
        raise InputError(f"growth: got {settings.growth}; allowed: 0 or more")
    found = [settings.initial]
    while found[-1] < settings.most:
        blocks = max(round(settings.growth * found[-1] / settings.block), 1)
        found.append(min(found[-1] + blocks * settings.block, settings.most))
    return tuple(found)


def intervals(successes: ArrayLike, trials: ArrayLike, settings: Refinement) -> Interval:
    """Interval of survival in each cell after any round of refinement.

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
        If a setting is out of its range, or a cell has counts that refinement does not lead to: part of a block, or
        flights beyond the round in which the cell was done.
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
    wanted = np.where(n == 0, first, np.where(finished(s, n, settings), 0, following))
    if settings.budget is None:
        return wanted
    bounds = wilson(s, n, settings.level)  # only to choose by
    boundary = _at_boundary(s, n, bounds, settings.survivals) | (n == 0)
    if (boundary & (wanted > 0)).any():
        wanted = np.where(boundary, wanted, 0)
    # Widest first; of equal ones the first, so that the order is certain: rounding must not decide.
    order = np.argsort(-np.round(bounds.upper - bounds.lower, 9).ravel(), kind="stable")
    order = order[wanted.ravel()[order] > 0]
    flat = np.zeros(n.size, dtype=np.int64)
    affordable = np.cumsum(wanted.ravel()[order]) <= settings.budget - n.sum()
    flat[order[affordable]] = wanted.ravel()[order[affordable]]
    return flat.reshape(n.shape)


def _plan(settings: Refinement) -> Plan:
    return sampling_plan(looks(settings), settings.width, settings.level, settings.reserve)


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
            f"cell {cell} has {s[cell]} survivals of {n[cell]} flights, to which these settings do not lead; "
            "count whole blocks only, and keep the settings of the first round"
        )
    return s, n, (look, s)


def _at_boundary(s: Counts, n: Counts, bounds: Interval, survivals: tuple[float, ...]) -> Flags:
    """Whether a cell may have a survival of interest, or lies next to one on the other side of it."""
    estimate: Array = s / np.maximum(n, 1)
    found = np.zeros(n.shape, dtype=bool)
    for survival in survivals:
        found |= (bounds.lower <= survival) & (survival <= bounds.upper)
        above = estimate >= survival
        for axis in range(1, n.ndim):  # the first is that of the controllers, who are not neighbours
            differs = np.diff(above, axis=axis)  # exclusive or
            padding = [(0, 0)] * n.ndim
            for padding[axis] in ((0, 1), (1, 0)):
                found |= np.pad(differs, padding)
    return found
