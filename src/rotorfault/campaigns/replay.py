"""Flying one flight of a campaign once more: the same numbers, with all records."""

from __future__ import annotations

from typing import Any

from rotorfault.base.errors import InputError
from rotorfault.campaigns.axes import columns
from rotorfault.campaigns.flight_set import FlightSet, flight_of, seeds, values_of
from rotorfault.campaigns.study import Study
from rotorfault.flight.flight import Flight
from rotorfault.flight.fly import fly


def settings_of(study: Study, flight: FlightSet) -> dict[str, Any]:
    """All that one flight has in place of its variant's scenario."""
    settings = {key: column[0].item() for key, column in columns(values_of(study, flight)).items()}
    return {**settings, "seed": int(seeds(study, flight)[0])}


def replay(study: Study, identifier: int) -> Flight:
    """Fly a flight of a campaign once more.

    Parameters
    ----------
    study : Study
    identifier : int
        Column ``id`` of the campaign's table.

    Raises
    ------
    InputError
        If there is no such flight.
    """
    flight = flight_of(study, identifier)
    return fly(study.scenarios[int(flight.variant[0])], settings=settings_of(study, flight))


def identifier_of(study: Study, label: str, cell: int, number: int) -> int:
    """Identifier of a flight by the variant's label, the cell and the number within it.

    Raises
    ------
    InputError
        If there is no such variant, cell or number.
    """
    labels = [variant.label for variant in study.variant]
    if label not in labels:
        raise InputError(f"there is no variant '{label}' in {study.name}; allowed: {', '.join(labels)}")
    if not 0 <= cell < study.cells:
        raise InputError(f"there is no cell {cell} in {study.name}; allowed: 0 to {study.cells - 1}")
    if not 0 <= number < study.refine.most:
        raise InputError(f"there is no flight number {number} in a cell; allowed: 0 to {study.refine.most - 1}")
    return (number * study.cells + cell) * len(labels) + labels.index(label)
