"""Many flights of one scenario: which numbers differ, and the batch that this makes.

A *column* is a dotted key of the scenario (``fault.0.loss``) with one value per flight. Numbers of parts, vehicle,
mismatch, start and seed become numbers of the batch: all flights share one compiled loop. Any other key (kinds,
options, reference, duration ...) changes the loop, and flights are grouped by its values.

Each part is made and checked once for each different set of its own numbers, not once for each flight.
"""

from __future__ import annotations

from collections.abc import Mapping
from numbers import Real
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rotorfault.base.errors import InputError
from rotorfault.base.foreign import is_own
from rotorfault.base.number_rule import short
from rotorfault.engine.program import same_code
from rotorfault.flight.assembly import Group, assemble, overridden
from rotorfault.flight.beginning import begins_alike
from rotorfault.scenario.overrides import for_rotors, is_number, override
from rotorfault.scenario.part import Part
from rotorfault.scenario.scenario import MOST_SEED, Scenario
from rotorfault.scenario.slots import SLOTS

_TABLES = ("vehicle", "mismatch", "start")  # of numbers that may vary, besides those of the parts

Columns = Mapping[str, NDArray[Any]]


def checked_columns(scenario: Scenario, vary: Mapping[str, Any]) -> dict[str, NDArray[Any]]:
    """Columns as arrays of one length.

    Raises
    ------
    InputError
        If a key is no key of the scenario, a column is empty or no list, or lengths differ.
    """
    if not isinstance(vary, Mapping):
        raise InputError(f"vary: got {short(vary)}; allowed: dotted keys, each with one value per flight")
    if not vary:
        raise InputError("nothing varies; give at least one key with one value per flight, such as seed=range(100)")
    found: dict[str, NDArray[Any]] = {}
    tables = scenario.as_tables()
    for key, values in vary.items():
        if not isinstance(key, str):
            raise InputError(f"vary: got the key {key!r}; allowed: dotted keys, such as 'fault.0.loss'")
        column = _column(key, values)
        override(tables, key, column[0].item())  # tells whether there is such a key
        found[key] = column
    lengths = {key: len(column) for key, column in found.items()}
    if len(set(lengths.values())) > 1:
        told = ", ".join(f"{key} {length}" for key, length in lengths.items())
        raise InputError(f"vary: columns differ in length ({told}); give one value per flight in each")
    return found


def _column(key: str, values: Any) -> NDArray[Any]:
    """One column as an array: whole numbers, numbers, truth values or texts."""
    allowed = "allowed: a list with one value per flight: numbers, or texts"
    if isinstance(values, (str, bytes, Mapping, set, frozenset)) or np.ma.is_masked(values):
        raise InputError(f"vary: {key}: got {short(values)}; {allowed}")
    # Before NumPy makes texts of the numbers beside a text, and numbers of truth values.
    listed = values if isinstance(values, (range, np.ndarray)) else _listed(values)
    if isinstance(listed, list) and len(sorts := {_sort(value) for value in listed}) > 1:
        raise InputError(f"vary: {key}: got {short(values)}, {' and '.join(sorted(sorts))} together; {allowed}")
    try:
        column = np.asarray(list(listed) if isinstance(listed, range) else listed)
    except ValueError:
        column = np.zeros((0, 0))  # rows of unlike lengths
    if column.ndim == 1 and column.dtype == object:
        column = _of_objects(column)
    if column.ndim != 1 or not len(column) or column.dtype.kind not in "biufU":
        raise InputError(f"vary: {key}: got {short(values)}; {allowed}")
    return column


def _listed(values: Any) -> Any:
    """Values one by one, where there are any."""
    try:
        return list(values)
    except TypeError:
        return values


def _sort(value: Any) -> str:
    if isinstance(value, (bool, np.bool_)):
        return "truth values"
    return "texts" if isinstance(value, str) else "numbers" if isinstance(value, Real) else f"{type(value).__name__}s"


def _of_objects(column: NDArray[Any]) -> NDArray[Any]:
    """An array of objects as one of numbers, texts or truth values, if all are of one sort."""
    sorts = {_sort(value) for value in column}
    return np.array(column.tolist()) if len(sorts) == 1 and sorts <= {"numbers", "texts", "truth values"} else column


def groups_of(scenario: Scenario, columns: Columns) -> list[Group]:
    """Divide flights into groups that differ in numbers only.

    Raises
    ------
    InputError
        If a value is not allowed.
    """
    count = len(next(iter(columns.values())))
    seeds = _seeds(scenario, columns, count)
    tables = scenario.as_tables()
    numeric = {key for key, column in columns.items() if key != "seed" and _is_numeric(scenario, tables, key, column)}
    structural = [key for key in columns if key not in numeric and key != "seed"]
    if not structural:
        parts = [(scenario, np.arange(count))]
    else:
        found: dict[tuple[Any, ...], list[int]] = {}
        for i, values in enumerate(zip(*(columns[key].tolist() for key in structural), strict=True)):
            found.setdefault(values, []).append(i)
        parts = [
            (overridden(scenario, dict(zip(structural, values, strict=True)), f"flight {which[0]}"), np.array(which))
            for values, which in found.items()
        ]
    return [
        Group(one, which, {key: columns[key][which].astype(float) for key in numeric}, seeds[which])
        for one, which in parts
    ]


def _seeds(scenario: Scenario, columns: Columns, count: int) -> NDArray[np.int64]:
    if "seed" not in columns:
        return np.full(count, scenario.seed, dtype=np.int64)
    column = columns["seed"]
    # As a scenario file, it takes 7.0 for 7.
    whole = column.dtype.kind in "iuf" and bool(np.all(np.isfinite(column)) and np.all(column == np.floor(column)))
    if not whole or column.min() < 0 or column.max() > MOST_SEED:
        raise InputError(f"vary: seed: got {short(column)}; allowed: whole numbers from 0 to {MOST_SEED:.0e}")
    return column.astype(np.int64)


def _is_numeric(scenario: Scenario, tables: dict[str, Any], key: str, column: NDArray[Any]) -> bool:
    """Whether a key of the scenario holds a float that may be one of the batch's numbers.

    Of parts from outside the package nobody knows whether they keep the rule that every float is a parameter
    (`rotorfault.check_block` tells): there, loops with the least and the largest value must have the same code, and
    begin alike.
    """
    first, _, rest = key.partition(".")
    if not np.issubdtype(column.dtype, np.number) or not isinstance(_value_at(tables, key), float):
        return False
    if first not in SLOTS:
        return first in _TABLES
    slot = SLOTS[first]
    if slot.side == "task":
        return False
    value = getattr(scenario, first)
    part = value[int(rest.partition(".")[0])] if slot.many else value
    if not isinstance(part, Part):
        return False
    if is_own(type(part.make()).__module__):
        return True
    least, most = (overridden(scenario, {key: float(end)}, "vary") for end in (column.min(), column.max()))
    one, other = assemble(least), assemble(most)
    return same_code(one, other) and begins_alike(one.loop, most, other)


def _value_at(tables: dict[str, Any], key: str) -> Any:
    here: Any = tables
    path = key.split(".")
    for depth, part in enumerate(path):
        if depth == len(path) - 1 and is_number(here) and for_rotors(path[:-1]):
            return here  # what a list of one for each rotor begins with
        here = here[int(part)] if isinstance(here, list) else here.get(part) if isinstance(here, dict) else None
    return here
