"""Flying one flight of a campaign once more: the same numbers, with all records."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from typing import Any

import numpy as np

from rotorfault.base.errors import InputError, unknown
from rotorfault.campaigns.block import METRICS
from rotorfault.campaigns.flight_set import FlightSet, columns_of, flight_of, seeds, values_of
from rotorfault.campaigns.study import Study, study_from
from rotorfault.flight.flight import Flight
from rotorfault.flight.fly import fly
from rotorfault.scenario.overrides import override_all
from rotorfault.scenario.scenario import Scenario, allowed_with
from rotorfault.scenario.slots import SLOTS

AGREE = 1e-9  # relative: what a number may differ by on another processor


def settings_of(study: Study, flight: FlightSet) -> dict[str, Any]:
    """All that one flight has in place of its variant's scenario."""
    found = columns_of(study, values_of(study, flight), study.cases_of(int(flight.cell[0])))
    settings = {key: column[0].item() for key, column in found.items()}
    return {**settings, "seed": int(seeds(study, flight)[0])}


def replay(study: Study, identifier: int, changes: Mapping[str, Any] | None = None) -> Flight:
    """Fly a flight of a campaign once more.

    Parameters
    ----------
    study : Study
    identifier : int
        Column ``id`` of the campaign's table.
    changes : mapping, optional
        Dotted keys and values in place of the flight's, with whole paths of code, which may run.

    Raises
    ------
    InputError
        If there is no such flight, or a value is not allowed.
    """
    flight = flight_of(study, identifier)
    number, drawn, cases = int(flight.variant[0]), settings_of(study, flight), study.cases_of(int(flight.cell[0]))
    if not changes:
        return fly(study.scenario_of(number, cases), settings=drawn)
    tables = study.as_tables()
    # One variant alone: the others, and what code they need, are of no matter to this flight.
    tables |= {"overrides": {**tables["overrides"], **changes}, "variant": [tables["variant"][number]]}
    scenario = study_from(tables, study.name, allowed_with(study.allows_code, changes)).scenario_of(0, cases)
    kept = {key: value for key, value in drawn.items() if _has(scenario, key)}
    return fly(scenario, settings={**kept, **changes})


def is_changed(study: Study, identifier: int, changes: Mapping[str, Any]) -> bool:
    """Whether changes make another flight of one of a campaign; not where they only say what it has.

    Parameters
    ----------
    study : Study
    identifier : int
    changes : mapping
        Dotted keys and values.

    Raises
    ------
    InputError
        If there is no such flight, or a key leads nowhere.
    """
    flight = flight_of(study, identifier)
    tables = study.tables_of(int(flight.variant[0]), study.cases_of(int(flight.cell[0])))
    override_all(tables, settings_of(study, flight))
    after = copy.deepcopy(tables)
    override_all(after, copy.deepcopy(dict(changes)))
    return after != tables


def _has(scenario: Scenario, key: str) -> bool:
    """Whether a scenario has what a drawn key sets: a part of another kind may not."""
    name, *path = key.split(".")
    if name not in SLOTS or not path:
        return True
    slot = SLOTS[name]
    if slot.many:
        parts = scenario.all(slot)
        part, path = (parts[int(path[0])] if int(path[0]) < len(parts) else None), path[1:]
    else:
        part = scenario.maybe(slot)
    return part is not None and (not path or path[0] in {"kind", "preset", *type(part.settings).model_fields})


def differences(row: Mapping[str, Any], scores: Mapping[str, Any]) -> list[str]:
    """Numbers of a flight that are not those of its row in a campaign's table, a line each.

    Parameters
    ----------
    row : mapping
        Of the table.
    scores : mapping
        Of the flight that was flown once more.
    """
    lines = []
    for name in ("outcome", "survived", "recovery_time", *METRICS):
        there, here = row.get(name.replace(".", "_")), scores.get(name)
        if not _same(there, here):
            lines.append(f"{name} is {here!r} here and {there!r} in the table")
    return lines


def _same(there: Any, here: Any) -> bool:
    numbers = [float("nan") if value is None else value for value in (there, here)]
    if all(isinstance(value, (int, float)) for value in numbers):
        first, second = numbers
        # Another processor may round otherwise; a row that differs by more is of another flight.
        return bool(np.isclose(first, second, rtol=AGREE, atol=0.0, equal_nan=True))
    return bool(there == here)


def identifier_of(study: Study, label: str, cell: int, number: int) -> int:
    """Identifier of a flight by the variant's label, the cell and the number within it.

    Raises
    ------
    InputError
        If there is no such variant, cell or number.
    """
    labels = [variant.label for variant in study.variant]
    if label not in labels:
        raise InputError(f"{study.name}: {unknown('variant', label, labels)}")
    if not 0 <= cell < study.cells:
        raise InputError(f"there is no cell {cell} in {study.name}; allowed: 0 to {study.cells - 1}")
    if not 0 <= number < study.refine.most:
        raise InputError(f"there is no flight number {number} in a cell; allowed: 0 to {study.refine.most - 1}")
    return (number * study.cells + cell) * len(labels) + labels.index(label)
