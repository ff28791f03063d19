"""Which flights a round has, and in which blocks: from the study and the results of earlier rounds, nothing else."""

from __future__ import annotations

import numpy as np
import pyarrow as pa

from rotorfault.campaigns.flight_set import Counts, FlightSet, case_numbers
from rotorfault.campaigns.sampling.refine import further_flights
from rotorfault.campaigns.study import Study

FLIGHTS_IN_BLOCK = 2048


class Tally:
    """Flights and successes of each variant in each cell, as far as they are counted.

    Attributes
    ----------
    successes, trials : ndarray of int, shape (variants, cells)
    """

    def __init__(self, study: Study) -> None:
        self.successes: Counts = np.zeros((len(study.variant), study.cells), dtype=np.int64)
        self.trials = self.successes.copy()
        self._variants = {variant.label: k for k, variant in enumerate(study.variant)}

    def add(self, table: pa.Table) -> None:
        """Count the flights of a block."""
        variant = np.array([self._variants[label] for label in table["variant"].to_pylist()], dtype=np.intp)
        cell, success = table["cell"].to_numpy(), table["success"].to_numpy(zero_copy_only=False)
        np.add.at(self.trials, (variant, cell), 1)
        np.add.at(self.successes, (variant, cell), success.astype(np.int64))


def next_round(study: Study, successes: Counts, trials: Counts) -> FlightSet:
    """The flights of the round that follows; none when the campaign is over.

    Parameters
    ----------
    study : Study
    successes, trials : ndarray of int, shape (variants, cells)
        Of all rounds so far.
    """
    grid = (len(study.variant), *study.shape)
    further = further_flights(successes.reshape(grid), trials.reshape(grid), study.refine)
    flights = _in_order(further.reshape(trials.shape), trials)
    if not study.case_axes:
        return flights
    # Cells of the same cases together: a block has fewer loops then. What order they are flown in changes no number.
    keys = (flights.number, flights.cell, *reversed(case_numbers(study, flights.cell)), flights.variant)
    return flights.part(np.lexsort(keys))


def _in_order(further: Counts, trials: Counts) -> FlightSet:
    """Variant by variant, cell by cell, in the order of their numbers."""
    variant, cell = (np.repeat(index.ravel(), further.ravel()) for index in np.indices(further.shape))
    first = np.repeat(trials.ravel(), further.ravel())
    start = np.repeat(np.cumsum(further.ravel()) - further.ravel(), further.ravel())
    return FlightSet(variant, cell, first + np.arange(len(variant)) - start)


def blocks(flights: FlightSet) -> list[FlightSet]:
    """The flights of a round in units of work."""
    return [
        flights.part(slice(first, first + FLIGHTS_IN_BLOCK)) for first in range(0, flights.size, FLIGHTS_IN_BLOCK)
    ]
