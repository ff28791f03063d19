"""Many flights of one scenario: which numbers differ, and the batch that this makes.

A *column* is a dotted key of the scenario (``fault.0.loss``) with one value per flight. Numbers of parts, vehicle,
mismatch, start and seed become numbers of the batch: all flights share one compiled loop. Any other key (kinds,
options, reference, duration ...) changes the loop, and flights are grouped by its values.

Each part is made and checked once for each different set of its own numbers, not once for each flight.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Annotated, Any, NamedTuple, final

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, TypeAdapter, ValidationError

from rotorfault.autopilot.autopilot import AutopilotParameters
from rotorfault.base.errors import InputError
from rotorfault.engine.batch import Array, Batch
from rotorfault.flight.assembly import build, initial_state, reference_of, scoring_parameters, start_of
from rotorfault.loop.closed_loop import LoopParameters
from rotorfault.maths.records import flatten, unflatten
from rotorfault.plant.plant import PlantParameters
from rotorfault.scenario.scenario import Part, Scenario, override, override_all, scenario_from

MOST_SEED = 10**12
_NUMERIC = ("vehicle", "mismatch", "start", "fault", "wind", "sensors", "controller", "diagnosis", "on_fault")

Columns = Mapping[str, NDArray[Any]]


class Group(NamedTuple):
    """Flights that differ in numbers only."""

    scenario: Scenario
    flights: NDArray[np.intp]  # which of all
    columns: dict[str, Array]  # numbers, one per flight of the group
    seeds: NDArray[np.int64]


def checked_columns(scenario: Scenario, vary: Mapping[str, Any]) -> dict[str, NDArray[Any]]:
    """Columns as arrays of one length.

    Raises
    ------
    InputError
        If a key is no key of the scenario, a column is empty or no list, or lengths differ.
    """
    if not isinstance(vary, Mapping):
        raise InputError(f"vary: got {_told(vary)}; allowed: dotted keys, each with one value per flight")
    if not vary:
        raise InputError("nothing varies; give at least one key with one value per flight, such as seed=range(100)")
    found: dict[str, NDArray[Any]] = {}
    tables = scenario.as_tables()
    for key, values in vary.items():
        if not isinstance(key, str):
            raise InputError(f"vary: got the key {key!r}; allowed: dotted keys, such as 'fault.0.loss'")
        try:
            column = np.asarray(list(values) if isinstance(values, range) else values)
        except ValueError:
            column = np.zeros((0, 0))  # rows of unlike lengths
        if column.ndim != 1 or not len(column) or column.dtype.kind not in "biufU":
            raise InputError(
                f"vary: {key}: got {_told(values)}; allowed: a list with one value per flight: numbers, or texts"
            )
        override(tables, key, column[0].item())  # tells whether there is such a key
        found[key] = column
    lengths = {key: len(column) for key, column in found.items()}
    if len(set(lengths.values())) > 1:
        told = ", ".join(f"{key} {length}" for key, length in lengths.items())
        raise InputError(f"vary: columns differ in length ({told}); give one value per flight in each")
    return found


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
            (_overridden(scenario, dict(zip(structural, values, strict=True)), f"flight {which[0]}"), np.array(which))
            for values, which in found.items()
        ]
    return [
        Group(one, which, {key: columns[key][which].astype(float) for key in numeric}, seeds[which])
        for one, which in parts
    ]


def assemble_group(group: Group, part: slice = slice(None)) -> Batch:
    """The batch of a group, or of some of its flights.

    Raises
    ------
    InputError
        If a value is not allowed; names the flight.
    """
    return _Assembly(group, part).batch()


@final
class _Assembly:
    def __init__(self, group: Group, part: slice) -> None:
        self.scenario = group.scenario
        self.flights = group.flights[part]
        self.columns = {key: column[part] for key, column in group.columns.items()}
        self.seeds = tuple((int(seed), 0) for seed in group.seeds[part])
        self.count = len(self.flights)
        self._objects: dict[str, tuple[list[Any], NDArray[np.intp]]] = {}
        self._tables = self.scenario.as_tables()

    def batch(self) -> Batch:
        scenario, loop = self.scenario, build(self.scenario)
        reference = reference_of(scenario)
        plant, period = loop.plant, scenario.period
        vehicle = self.numbers(("vehicle",), lambda v: v.vehicle)
        truth = self.numbers(("vehicle", "mismatch"), lambda v, m: m.applied(v.vehicle))
        wind = self.numbers(("wind",), lambda w: w.make().parameters())
        faults = tuple(
            self.numbers((f"fault.{i}",), lambda f: f.make().parameters()) for i in range(len(scenario.fault))
        )
        ground: Any = ()
        if (level := plant.ground) is not None:
            ground = self.numbers(("vehicle", "mismatch"), lambda v, m: level.parameters(m.applied(v.vehicle)))
        parameters = LoopParameters(
            plant=PlantParameters(truth, wind, faults, ground),
            autopilot=AutopilotParameters(
                vehicle,
                self.numbers(("diagnosis", "vehicle"), lambda d, v: d.make().parameters(v.vehicle, period)),
                self.numbers(("on_fault",), lambda r: r.make().parameters()),
                self.numbers(("controller", "vehicle"), lambda c, v: c.make().parameters(v.vehicle, period)),
            ),
            sensors=self.numbers(("sensors",), lambda s: s.make().parameters()),
            period=period,
        )
        start = self.numbers(("start",), lambda s: start_of(scenario.model_copy(update={"start": s})))
        position = np.stack([np.broadcast_to(x, (self.count,)) for x in start.p_W], axis=-1)
        parameters = parameters._replace(scoring=scoring_parameters(position, vehicle, scenario.ground, reference))
        state = initial_state(loop, start, reference, self.seeds, parameters)
        return Batch(loop, state, parameters, reference, self.count, self.seeds, scenario.every)

    def numbers(self, names: Sequence[str], record: Callable[..., Any]) -> Any:
        """A record of numbers that depends on some parts: floats where they do not vary, else arrays (N,)."""
        parts = [self.objects(name) for name in names]
        varying = [inverse for objects, inverse in parts if len(objects) > 1]
        if not varying:
            return record(*(objects[0] for objects, _ in parts))
        pairs, inverse = np.unique(np.stack([inverse for _, inverse in parts]), axis=1, return_inverse=True)
        made = [record(*(objects[i] for (objects, _), i in zip(parts, pair, strict=True))) for pair in pairs.T]
        rows, place = np.array([[float(leaf) for leaf in flatten(one)] for one in made]).T, inverse.reshape(-1)
        # What is the same in all stays one number: a hundred thousand flights are held in memory.
        same = (rows == rows[:, :1]).all(axis=1)
        return unflatten(made[0], [float(row[0]) if one else row[place] for row, one in zip(rows, same, strict=True)])

    def objects(self, name: str) -> tuple[list[Any], NDArray[np.intp]]:
        """The different objects of a part of the scenario, and which of them each flight has."""
        if name not in self._objects:
            self._objects[name] = self._made(name)
        return self._objects[name]

    def _made(self, name: str) -> tuple[list[Any], NDArray[np.intp]]:
        field, _, index = name.partition(".")
        keys = [key for key in self.columns if key == name or key.startswith(f"{name}.")]
        here = getattr(self.scenario, field)
        if not keys:
            return [here[int(index)] if index else here], np.zeros(self.count, dtype=np.intp)
        values, first, inverse = np.unique(
            np.stack([self.columns[key] for key in keys]), axis=1, return_index=True, return_inverse=True
        )
        about = Scenario.model_fields[field]
        kind: Any = Annotated[(about.annotation, *about.metadata, Field())]
        adapter: TypeAdapter[Any] = TypeAdapter(kind)
        made = []
        for numbers, flight in zip(values.T.tolist(), first, strict=True):
            changes = dict(zip(keys, numbers, strict=True))
            tables = {field: _copied(self._tables[field])}
            override_all(tables, changes)
            try:
                one = adapter.validate_python(tables[field])
            except ValidationError:
                # Said once more by the whole scenario, whose message names the key.
                _overridden(self.scenario, changes, f"flight {self.flights[flight]}")
                raise
            made.append(one[int(index)] if index else one)
        return made, inverse.reshape(-1)


def _copied(tables: Any) -> Any:
    if isinstance(tables, dict):
        return {key: _copied(value) for key, value in tables.items()}
    return [_copied(value) for value in tables] if isinstance(tables, list) else tables


def _overridden(scenario: Scenario, changes: Mapping[str, Any], where: str) -> Scenario:
    tables = scenario.as_tables()
    override_all(tables, changes)
    return scenario_from(tables, where)


def _seeds(scenario: Scenario, columns: Columns, count: int) -> NDArray[np.int64]:
    if "seed" not in columns:
        return np.full(count, scenario.seed, dtype=np.int64)
    column = columns["seed"]
    if not np.issubdtype(column.dtype, np.integer) or column.min() < 0 or column.max() > MOST_SEED:
        raise InputError(f"vary: seed: got {_told(column)}; allowed: whole numbers from 0 to {MOST_SEED:.0e}")
    return column.astype(np.int64)


def _is_numeric(scenario: Scenario, tables: dict[str, Any], key: str, column: NDArray[Any]) -> bool:
    """Whether a key of the scenario holds a float that may be one of the batch's numbers.

    It is part of the loop where nobody knows better: in parts from outside the package, and the age of a truth that
    is told late, which acts in the loop itself. (So are an allocator's numbers, whose part is not in `_NUMERIC`.)
    """
    first, _, rest = key.partition(".")
    if first not in _NUMERIC or not np.issubdtype(column.dtype, np.number):
        return False
    here = getattr(scenario, first)
    part = here[int(rest.partition(".")[0])] if first == "fault" else here
    if isinstance(part, Part):
        made = part.make()
        if not type(made).__module__.startswith("rotorfault."):
            return False
        if first == "diagnosis" and rest == "delay" and made.oracle_delay is not None:
            return False
    return isinstance(_value_at(tables, key), float)


def _value_at(tables: dict[str, Any], key: str) -> Any:
    here: Any = tables
    for part in key.split("."):
        here = here[int(part)] if isinstance(here, list) else here.get(part) if isinstance(here, dict) else None
    return here


def _told(values: Any) -> str:
    text = " ".join(repr(values).split())
    return text if len(text) <= 60 else text[:57] + "..."
