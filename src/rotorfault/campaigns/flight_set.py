"""The flights of a campaign: what names each of them, its seed and its draws.

A flight is named by its variant, its cell and its number within the cell. Its draws and its seed depend on the cell
and that number alone, so that flight 17 of a cell meets the same wind under every variant: differences are paired.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri

from rotorfault.base.errors import InputError
from rotorfault.base.one_line import record_line
from rotorfault.campaigns.axes import Columns, axis, columns
from rotorfault.campaigns.study import Cases, Study
from rotorfault.campaigns.varied import Draw
from rotorfault.engine.noise import threefry

SEEDS = 10**12
_SEED_WORD, _DRAW_WORD = 1 << 40, 2 << 40  # second words of the counter: apart from those of sensor noise and gusts

Counts = NDArray[np.int64]


class FlightSet(NamedTuple):
    """The names of some flights, as arrays of one length.

    Attributes
    ----------
    variant : ndarray of int, shape (N,)
        Place of the variant in the study.
    cell : ndarray of int, shape (N,)
        Of the map, counted row by row.
    number : ndarray of int, shape (N,)
        Of the flight within its cell, from 0: flights of the same cell and number are paired between variants.
    """

    variant: Counts
    cell: Counts
    number: Counts

    def __repr__(self) -> str:
        return record_line(self)

    @property
    def size(self) -> int:
        """How many."""
        return int(self.variant.size)

    def part(self, which: slice | NDArray[Any]) -> FlightSet:
        """Some of them."""
        return FlightSet(self.variant[which], self.cell[which], self.number[which])


def identifiers(study: Study, flights: FlightSet) -> Counts:
    """An integer for each flight, unique in the campaign, that `flight_of` takes apart: ``id`` of the table."""
    return (flights.number * study.cells + flights.cell) * len(study.variant) + flights.variant


def flight_of(study: Study, identifier: int) -> FlightSet:
    """The one flight that has an identifier.

    Raises
    ------
    InputError
        If no flight of the study has it.
    """
    rest, variant = divmod(identifier, len(study.variant))
    number, cell = divmod(rest, study.cells)
    if identifier < 0 or number >= study.refine.most:
        most = study.refine.most * study.cells * len(study.variant) - 1
        raise InputError(
            f"there is no flight {identifier} in {study.name}; allowed: 0 to {most}, column 'id' of its table"
        )
    return FlightSet(*(np.array([part], dtype=np.int64) for part in (variant, cell, number)))


def values_of(study: Study, flights: FlightSet) -> dict[str, NDArray[Any]]:
    """Values of axes and draws of each flight, by name."""
    return {**study.cell_values(flights.cell), **draws(study, flights)}


def seeds(study: Study, flights: FlightSet) -> Counts:
    """Seed of each flight, below 10^12: the same for every variant."""
    word, _ = threefry(
        flights.number.astype(np.uint64), np.array(_SEED_WORD, dtype=np.uint64),
        np.array(study.seed, dtype=np.uint64), flights.cell.astype(np.uint64),
    )  # fmt: skip
    return (word % np.uint64(SEEDS)).astype(np.int64)


def draws(study: Study, flights: FlightSet) -> dict[str, NDArray[Any]]:
    """Values of the study's draws for each flight; of what is drawn in some cases alone, NaN or no text elsewhere."""
    every = study.every_draw
    if not every:
        return {}
    shares = _independent(study, flights) if study.design == "independent" else _designed(study, flights)
    found = {draw.name: _value(draw, share) for draw, share in zip(study.draw, shares.T, strict=False)}
    if len(every) == len(study.draw):
        return found
    # Every block has the same columns, whatever its cells draw.
    for number, draw in enumerate(every[len(study.draw) :], start=len(study.draw)):
        value = _value(draw, shares[:, number])
        blank = np.full(flights.size, np.nan) if value.dtype.kind == "f" else np.full(flights.size, "", value.dtype)
        found.setdefault(draw.name, blank)
    for which, _, cases in alike(study, flights):
        for name, (number, draw) in study.draws_of(cases).items():
            if number >= len(study.draw):
                value = _value(draw, shares[which, number])
                found[name] = found[name].astype(np.promote_types(found[name].dtype, value.dtype))
                found[name][which] = value
    return found


class Alike(NamedTuple):
    """Flights that have one scenario, before anything varies."""

    which: NDArray[np.intp]  # of the flights
    variant: int
    cases: Cases

    def __repr__(self) -> str:
        return record_line(self)


def alike(study: Study, flights: FlightSet) -> list[Alike]:
    """Flights by what they fly: variant, and the case of each axis that has cases.

    Parameters
    ----------
    study : Study
    flights : FlightSet
    """
    codes = np.stack([flights.variant, *case_numbers(study, flights.cell)], axis=1)
    kinds, place = np.unique(codes, axis=0, return_inverse=True)
    place = place.reshape(-1)
    axes = study.case_axes
    return [
        Alike(
            np.flatnonzero(place == number),
            int(variant),
            tuple(part.case[k] for part, k in zip(axes, chosen, strict=True)),
        )
        for number, (variant, *chosen) in enumerate(kinds.tolist())
    ]


def case_numbers(study: Study, cells: Counts) -> list[Counts]:
    """For each axis of cases, which of them some cells have.

    Parameters
    ----------
    study : Study
    cells : ndarray of int, shape (N,)
    """
    places = np.unravel_index(cells, study.shape)
    return [place for part, place in zip(study.axis, places, strict=True) if part.case]


def columns_of(study: Study, values: Mapping[str, NDArray[Any]], cases: Cases) -> Columns:
    """Columns of the scenario for flights of the same cases.

    Parameters
    ----------
    study : Study
    values : mapping of str to ndarray, shape (N,)
        Of axes and draws, those flights alone; labels of cases, and draws of others, are left out.
    cases : tuple of Case
    """
    known = {part.name for part in study.axis if not part.case} | set(study.draws_of(cases))
    return columns({name: column for name, column in values.items() if name in known})


def _independent(study: Study, flights: FlightSet) -> NDArray[np.float64]:
    """Independent uniform numbers, shape (flights, draws)."""
    shares = []
    for k in range(len(study.every_draw)):
        word, _ = threefry(
            flights.number.astype(np.uint64), np.array(_DRAW_WORD + k, dtype=np.uint64),
            np.array(study.seed, dtype=np.uint64), flights.cell.astype(np.uint64),
        )  # fmt: skip
        shares.append(((word >> np.uint64(11)).astype(np.float64) + 0.5) * 2.0**-53)
    return np.column_stack(shares)


def _designed(study: Study, flights: FlightSet) -> NDArray[np.float64]:
    """Numbers that fill the unit cube evenly within each cell, shape (flights, draws)."""
    shares = np.empty((flights.size, len(study.every_draw)))
    for cell in np.unique(flights.cell):
        which = flights.cell == cell
        points = _points(study.design, study.seed, int(cell), len(study.every_draw), study.refine.most)
        shares[which] = points[flights.number[which]]
    return shares


@lru_cache(maxsize=100_000)
def _points(design: str, seed: int, cell: int, dimensions: int, count: int) -> NDArray[np.float64]:
    """All points of a cell, however many of them are flown: a prefix of them must not depend on the rest."""
    from scipy.stats import qmc  # takes most of the time that a campaign loads, and most have no such design

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
    if draw.sine is not None:
        low, high = np.sin(draw.sine)
        return np.asarray(np.arcsin(low + (high - low) * share))
    choices = np.array(draw.choice)
    return np.asarray(choices[np.minimum((share * len(choices)).astype(int), len(choices) - 1)])
