"""Which flights a round has, and what each of them is: from the study and what came of earlier rounds, nothing else.

A flight is named by its variant, its cell and its number within the cell. Its draws and its seed depend on the cell
and that number alone, so that flight 17 of a cell meets the same wind under every variant: differences are paired.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri
from scipy.stats import qmc

from rotorfault.base.errors import InputError
from rotorfault.campaigns.sampling.axes import axis
from rotorfault.campaigns.sampling.refine import further_flights
from rotorfault.campaigns.study import Draw, Study
from rotorfault.engine.noise import threefry

FLIGHTS_IN_BLOCK = 2048
SEEDS = 10**12
_SEED_WORD, _DRAW_WORD = 1 << 40, 2 << 40  # second words of the counter: apart from those of sensor noise and gusts

Counts = NDArray[np.int64]


class Flights(NamedTuple):
    """Some flights of a campaign, as arrays of one length."""

    variant: NDArray[np.int64]
    cell: NDArray[np.int64]
    number: NDArray[np.int64]  # within the cell: what is paired between variants

    @property
    def size(self) -> int:
        """How many."""
        return int(self.variant.size)

    def part(self, which: slice | NDArray[Any]) -> Flights:
        """Some of them."""
        return Flights(self.variant[which], self.cell[which], self.number[which])


def next_round(study: Study, successes: Counts, trials: Counts) -> Flights:
    """The flights of the round that follows; none when the campaign is over.

    Parameters
    ----------
    study : Study
    successes, trials : ndarray of int, shape (variants, cells)
        Of all rounds so far.
    """
    grid = (len(study.variant), *study.shape)
    more = further_flights(successes.reshape(grid), trials.reshape(grid), study.refine.refinement())
    return _listed(more.reshape(trials.shape), trials)


def _listed(more: Counts, trials: Counts) -> Flights:
    """Variant by variant, cell by cell, in the order of their numbers."""
    variant, cell = (np.repeat(index.ravel(), more.ravel()) for index in np.indices(more.shape))
    first = np.repeat(trials.ravel(), more.ravel())
    start = np.repeat(np.cumsum(more.ravel()) - more.ravel(), more.ravel())
    return Flights(variant, cell, first + np.arange(len(variant)) - start)


def identifier(study: Study, flights: Flights) -> Counts:
    """A number for each flight, unique in the campaign, from which `identified` tells what it is."""
    return (flights.number * study.cells + flights.cell) * len(study.variant) + flights.variant


def identified(study: Study, number: int) -> Flights:
    """The one flight of an identifier.

    Raises
    ------
    InputError
        If no flight of the study has it.
    """
    rest, variant = divmod(number, len(study.variant))
    within, cell = divmod(rest, study.cells)
    if number < 0 or within >= study.refine.most:
        most = study.refine.most * study.cells * len(study.variant) - 1
        raise InputError(
            f"there is no flight {number} in {study.name}; allowed: 0 to {most}, column 'id' of its table"
        )
    return Flights(*(np.array([part], dtype=np.int64) for part in (variant, cell, within)))


def blocks(flights: Flights) -> Iterator[tuple[int, Flights]]:
    """Units of work: number of the block, and its flights."""
    for number, first in enumerate(range(0, flights.size, FLIGHTS_IN_BLOCK)):
        yield number, flights.part(slice(first, first + FLIGHTS_IN_BLOCK))


def seeds(study: Study, flights: Flights) -> NDArray[np.int64]:
    """Seed of each flight, below 10^12: the same for every variant."""
    word, _ = threefry(
        flights.number.astype(np.uint64), np.array(_SEED_WORD, dtype=np.uint64),
        np.array(study.seed, dtype=np.uint64), flights.cell.astype(np.uint64),
    )  # fmt: skip
    return (word % np.uint64(SEEDS)).astype(np.int64)


def drawn(study: Study, flights: Flights) -> dict[str, NDArray[Any]]:
    """Values of the study's draws for each flight."""
    if not study.draw:
        return {}
    shares = _independent(study, flights) if study.design == "independent" else _designed(study, flights)
    return {draw.name: _value(draw, share) for draw, share in zip(study.draw, shares.T, strict=True)}


def _independent(study: Study, flights: Flights) -> NDArray[np.float64]:
    """Independent uniform numbers, shape (flights, draws)."""
    columns = []
    for k in range(len(study.draw)):
        word, _ = threefry(
            flights.number.astype(np.uint64), np.array(_DRAW_WORD + k, dtype=np.uint64),
            np.array(study.seed, dtype=np.uint64), flights.cell.astype(np.uint64),
        )  # fmt: skip
        columns.append(((word >> np.uint64(11)).astype(np.float64) + 0.5) * 2.0**-53)
    return np.column_stack(columns)


def _designed(study: Study, flights: Flights) -> NDArray[np.float64]:
    """Numbers that fill the unit cube evenly within each cell, shape (flights, draws)."""
    shares = np.empty((flights.size, len(study.draw)))
    for cell in np.unique(flights.cell):
        mine = flights.cell == cell
        points = _points(study.design, study.seed, int(cell), len(study.draw), study.refine.most)
        shares[mine] = points[flights.number[mine]]
    return shares


@lru_cache(maxsize=100_000)
def _points(design: str, seed: int, cell: int, dimensions: int, count: int) -> NDArray[np.float64]:
    """All points of a cell, however many of them are flown: a prefix of them must not depend on the rest."""
    generator = np.random.default_rng([seed, cell])
    if design == "sobol":
        sampler = qmc.Sobol(dimensions, scramble=True, rng=generator)
        power = max(1, int(np.ceil(np.log2(count))))
        return np.asarray(sampler.random_base2(power)[:count])
    return np.asarray(qmc.LatinHypercube(dimensions, rng=generator).random(count))


def _value(draw: Draw, share: NDArray[np.float64]) -> NDArray[Any]:
    """What a number in (0, 1) stands for."""
    if draw.uniform is not None:
        low, high = draw.uniform
        return low + (high - low) * share
    if draw.normal is not None:
        mean, deviation = draw.normal
        low, high = axis(draw.name).range
        return np.asarray(np.clip(mean + deviation * ndtri(np.clip(share, 1e-16, 1.0 - 1e-16)), low, high))
    choices = np.array(draw.choice)
    return np.asarray(choices[np.minimum((share * len(choices)).astype(int), len(choices) - 1)])
