"""From scenarios to batches: make every part, collect its numbers, tabulate the reference.

One way for one flight and for many: a *group* of flights that differ in numbers only shares one loop; each part is
made and checked once for each different set of its own numbers, not once for each flight.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Annotated, Any, NamedTuple, TypeVar, final

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, TypeAdapter, ValidationError
from pydantic_core import PydanticCustomError

from rotorfault.autopilot.autopilot import AnyBlock
from rotorfault.autopilot.estimation.imu_filter import IMU_FILTER, behind
from rotorfault.base.errors import InputError
from rotorfault.engine.batch import Batch
from rotorfault.engine.program import same_code
from rotorfault.flight.beginning import initial_state, start_of
from rotorfault.flight.reference_rows import reference_of, require_above_ground
from rotorfault.loop.closed_loop import ClosedLoop, LoopParameters
from rotorfault.loop.scores import scoring_parameters
from rotorfault.maths.arrays import Array
from rotorfault.maths.records import flatten, unflatten
from rotorfault.model.block import Context, Record
from rotorfault.model.likeness import alike
from rotorfault.model.mixer import hover_thrust
from rotorfault.model.slot import Slot
from rotorfault.plant.ground import GROUND
from rotorfault.plant.sensors import SENSORS
from rotorfault.reference import REFERENCE, ReferenceSource
from rotorfault.scenario.overrides import override_all
from rotorfault.scenario.part import Part
from rotorfault.scenario.scenario import Scenario, scenario_fields, scenario_from, true_vehicle
from rotorfault.scenario.slots import SLOTS
from rotorfault.scenario.time_grid import require_on_grid

R = TypeVar("R")
Own = Mapping[Slot[Any], AnyBlock]
"""Parts that fly in place of a scenario's, such as a controller that a user hands in."""


Objects = tuple[list[Any], NDArray[np.intp]]
"""Different objects, and which of them each flight has."""


class Group(NamedTuple):
    """Flights that differ in numbers only."""

    scenario: Scenario
    flights: NDArray[np.intp]  # which of all
    columns: dict[str, Array]  # numbers, one per flight of the group
    seeds: NDArray[np.int64]


def assemble(scenario: Scenario, own: Own | None = None) -> Batch:
    """A batch of the one flight that a scenario describes.

    Parameters
    ----------
    scenario : Scenario
    own : mapping of Slot to Block, optional
        Parts in place of the scenario's.

    Raises
    ------
    InputError
        If the reference is not finite, or a part cannot be made for this vehicle and sampling period.
    """
    return assemble_group(Group(scenario, np.zeros(1, dtype=np.intp), {}, np.array([scenario.seed])), own=own)


def assemble_group(group: Group, part: slice = slice(None), own: Own | None = None) -> Batch:
    """The batch of a group, or of some of its flights.

    Parameters
    ----------
    group : Group
    part : slice, optional
        Which of its flights.
    own : mapping of Slot to Block, optional
        Parts in place of the scenario's.

    Raises
    ------
    InputError
        If a value is not allowed; names the flight.
    """
    return _Assembly(group, part, own or {}).batch()


def numbers_of(group: Group) -> tuple[ClosedLoop, LoopParameters]:
    """The loop of a group and the numbers of its flights, for those who ask parts and fly nothing.

    Parameters
    ----------
    group : Group

    Raises
    ------
    InputError
        If a value is not allowed; names the flight.
    """
    loop = build(group.scenario)
    return loop, _Assembly(group, slice(None), {}).parameters(loop)


def assemble_all(scenarios: Sequence[Scenario]) -> Batch:
    """One batch of several flights that differ in numbers only: vehicle, start, wind, faults, gains, seed.

    Parameters
    ----------
    scenarios : sequence of Scenario
        At least one.

    Raises
    ------
    InputError
        If there are none, or they differ in structure (kinds of parts, options), in length or in reference.
    """
    if not scenarios:
        raise InputError("no scenarios were given; a batch needs at least one")
    batches = [assemble(scenario) for scenario in scenarios]
    first = batches[0]
    alike = same_code(*batches)
    for batch, scenario in zip(batches[1:], scenarios[1:], strict=True):
        same = (alike or same_code(first, batch)) and batch.every == first.every
        if not same or not np.array_equal(batch.reference, first.reference):
            raise InputError(
                f"scenario '{scenario.name}' differs from the first in more than numbers (parts, options, length or "
                "reference); fly it in a batch of its own"
            )
    return first._replace(
        state=stacked(first.state, [batch.state for batch in batches]),
        parameters=stacked(first.parameters, [batch.parameters for batch in batches]),
        flights=len(batches),
        # Each by its own seed, whatever its place: a flight is the same alone and in any batch.
        seeds=tuple(seed for batch in batches for seed in batch.seeds),
    )


def stacked(template: R, records: Sequence[R]) -> R:
    """Records of one flight each as one whose leaves are arrays.

    Parameters
    ----------
    template : record
        Of their type.
    records : sequence of record
    """
    rows = np.array([[float(leaf) for leaf in flatten(record)] for record in records]).T
    return unflatten(template, list(rows))


def build(scenario: Scenario, own: Own | None = None) -> ClosedLoop:
    """The parts of a scenario put together; see `assemble`."""
    telemetry = source_of(scenario, own or {}).Telemetry
    rotors = scenario.vehicle.rotor
    return ClosedLoop(
        parts_of(scenario, own or {}),
        scenario.substeps,
        telemetry,
        len(rotors),
        tilted=any(rotor.axis is not None for rotor in rotors),
        battery=scenario.start.charge is not None,
        compensates=scenario.voltage_compensation,
    )


def parts_of(scenario: Scenario, own: Own) -> dict[Slot[Any], AnyBlock | tuple[AnyBlock, ...]]:
    """The parts of a scenario by slot, in order; without the reference, which is tabulated before the flight."""
    parts: dict[Slot[Any], AnyBlock | tuple[AnyBlock, ...]] = {}
    for slot in SLOTS:
        if slot.side == "task":
            continue
        if slot in own:
            parts[slot] = own[slot]
        elif slot.many:
            parts[slot] = tuple(part.make() for part in scenario.all(slot))
        elif (part := scenario.maybe(slot)) is not None:
            parts[slot] = part.make()
    return parts


def source_of(scenario: Scenario, own: Own) -> ReferenceSource:
    """The reference of a scenario."""
    mine = own.get(REFERENCE)
    return mine if isinstance(mine, ReferenceSource) else scenario[REFERENCE].make()


@final
class _Assembly:
    """Builds the batch of some flights of a group.

    Parameters
    ----------
    group : Group
    part : slice
        Which of its flights.
    own : mapping of Slot to Block
        Parts in place of the scenario's.
    """

    def __init__(self, group: Group, part: slice, own: Own) -> None:
        self.scenario, self.own = group.scenario, own
        self.flights = group.flights[part]
        self.columns = {key: column[part] for key, column in group.columns.items()}
        self.seeds = tuple((int(seed), 0) for seed in group.seeds[part])
        self.count = len(self.flights)
        self._objects: dict[str, Objects] = {}
        self._told: dict[bool, Objects] = {}
        self._tables = self.scenario.as_tables() if self.columns else {}

    def parameters(self, loop: ClosedLoop) -> LoopParameters:
        """Numbers of the flights, without those of scoring."""
        return LoopParameters(
            vehicle=self._record((self._contexts(truth=True),), lambda context: context.vehicle),
            belief=self._record((self._contexts(truth=False),), lambda context: context.vehicle),
            parts=loop.record(*(self._part_numbers(slot) for slot in loop.parts)),
            period=self.scenario.period,
        )

    def batch(self) -> Batch:
        """Loop, state, numbers and reference of the flights."""
        scenario, source = self.scenario, source_of(self.scenario, self.own)
        loop = build(scenario, self.own)
        reference = reference_of(scenario, source)
        parameters = self.parameters(loop)
        believed, true = parameters.belief, parameters.vehicle
        start = self.numbers(("start",), lambda s: start_of(scenario.model_copy(update={"start": s})))
        position = np.stack([np.broadcast_to(x, (self.count,)) for x in start.p_W], axis=-1)
        ground = loop.maybe(GROUND)
        if ground is not None:
            heights = ground.height(parameters.parts.ground)
            require_above_ground(source, reference, scenario.period, position[:, 2], heights)
        scoring = scoring_parameters(
            position if self.count > 1 else position[0],
            believed.thrust_min,
            believed.thrust_max,
            0.0 if ground is None else ground.bottom(parameters.parts.ground),
            true.mass * true.gravity,
            hover_thrust(believed).sum() / believed.rotors / believed.rotor_gain,
            reference,
        )
        parameters = parameters._replace(scoring=scoring)
        state = initial_state(loop, start, reference, self.seeds, parameters)
        return Batch(loop, state, parameters, reference, self.count, self.seeds, scenario.every)

    def _part_numbers(self, slot: Slot[Any]) -> Any:
        """The numbers of the part of a slot, or of its parts."""
        # What a part of the truth is told of is the true vehicle.
        about = self._contexts(slot.side == "truth")

        def record(part: Part[AnyBlock], context: Context) -> Record:
            return part.make().parameters(context)  # type: ignore[no-any-return]

        if slot in self.own:
            return self._record((about,), self.own[slot].parameters)
        if slot.many:
            names = [f"{slot.name}.{i}" for i in range(len(self.scenario.all(slot)))]
            return tuple(self._record((self.objects(name), about), record) for name in names)
        return self._record((self.objects(slot.name), about), record)

    def _contexts(self, truth: bool) -> Objects:
        """What parts are told of the flight, once for each different vehicle."""
        if truth not in self._told:
            period = self.scenario.period
            things = [self.objects("vehicle"), self.objects("mismatch")]
            if not truth:
                things += [self.objects(SENSORS.name), self.objects(IMU_FILTER.name)]
            pairs, inverse = _different(things)
            made = []
            for number, (vehicle, mismatch, *sensors) in enumerate(pairs):
                about = f"flight {self.flights[np.argmax(inverse == number)]}"
                if truth:
                    made.append(Context(true_vehicle(vehicle, mismatch, self.scenario.grid, about), period))
                    continue
                believed = Context(vehicle.vehicle, period)
                part: Any = self.own[SENSORS] if SENSORS in self.own else sensors[0].make()
                model = part.model(believed).scaled(1.0 / mismatch.sensor_noise)
                between: Any = self.own[IMU_FILTER] if IMU_FILTER in self.own else sensors[1].make()
                made.append(believed._replace(sensors=behind(between, model, believed)))
            vehicles_ = alike([one.vehicle for one in made])  # one loop for all
            made = [one._replace(vehicle=vehicle) for one, vehicle in zip(made, vehicles_, strict=True)]
            self._told[truth] = made, inverse
        return self._told[truth]

    def numbers(self, names: Sequence[str], record: Callable[..., Any]) -> Any:
        """A record of numbers that depends on some parts: floats where they do not vary, else arrays (N,)."""
        return self._record([self.objects(name) for name in names], record)

    @staticmethod
    def _record(parts: Sequence[Objects], record: Callable[..., Any]) -> Any:
        """The same for objects that the flights have."""
        pairs, place = _different(parts)
        made = [record(*pair) for pair in pairs]
        if len(made) == 1:
            return made[0]
        rows = np.array([[float(leaf) for leaf in flatten(one)] for one in made]).T
        # What is the same in all stays one number: a hundred thousand flights are held in memory.
        same = (rows == rows[:, :1]).all(axis=1)
        return unflatten(made[0], [float(row[0]) if one else row[place] for row, one in zip(rows, same, strict=True)])

    def objects(self, name: str) -> Objects:
        """The different objects of a part of the scenario, and which of them each flight has."""
        if name not in self._objects:
            self._objects[name] = self._made(name)
        return self._objects[name]

    def _made(self, name: str) -> Objects:
        field, _, index = name.partition(".")
        keys = [key for key in self.columns if key == name or key.startswith(f"{name}.")]
        here = getattr(self.scenario, field)
        if not keys:
            return [here[int(index)] if index else here], np.zeros(self.count, dtype=np.intp)
        values, first, inverse = np.unique(
            np.stack([self.columns[key] for key in keys]), axis=1, return_index=True, return_inverse=True
        )
        about = scenario_fields()[field]
        kind: Any = Annotated[(about.annotation, *about.metadata, Field())]
        adapter: TypeAdapter[Any] = TypeAdapter(kind)
        made = []
        for numbers, flight in zip(values.T.tolist(), first, strict=True):
            changes = dict(zip(keys, numbers, strict=True))
            tables = {"vehicle": self._tables["vehicle"]} | {field: _copied(self._tables[field])}
            override_all(tables, changes)
            try:
                # What is in a checked scenario was allowed when it was checked.
                one = adapter.validate_python(tables[field], context={"allow_code": True})
            except ValidationError:
                # Said once more by the whole scenario, whose message names the key.
                overridden(self.scenario, changes, f"flight {self.flights[flight]}")
                raise
            made.append(one[int(index)] if index else one)
            try:
                if isinstance(made[-1], Part):
                    require_on_grid(made[-1], name, self.scenario.grid)
            except PydanticCustomError:
                overridden(self.scenario, changes, f"flight {self.flights[flight]}")
                raise
        return made, inverse.reshape(-1)


def _different(parts: Sequence[Objects]) -> tuple[list[tuple[Any, ...]], NDArray[np.intp]]:
    """Combinations of objects that flights have, and which of them each has."""
    if all(len(objects) == 1 for objects, _ in parts):
        return [tuple(objects[0] for objects, _ in parts)], parts[0][1]
    pairs, inverse = np.unique(np.stack([inverse for _, inverse in parts]), axis=1, return_inverse=True)
    made = [tuple(objects[i] for (objects, _), i in zip(parts, pair, strict=True)) for pair in pairs.T.tolist()]
    return made, inverse.reshape(-1)


def _copied(tables: Any) -> Any:
    if isinstance(tables, dict):
        return {key: _copied(value) for key, value in tables.items()}
    return [_copied(value) for value in tables] if isinstance(tables, list) else tables


def overridden(scenario: Scenario, changes: Mapping[str, Any], where: str) -> Scenario:
    """The scenario with other values for some of its keys.

    Parameters
    ----------
    scenario : Scenario
    changes : mapping
        Dotted keys and values.
    where : str
        For messages.

    Raises
    ------
    InputError
        If a value is not allowed.
    """
    tables = scenario.as_tables()
    override_all(tables, changes)
    return scenario_from(tables, where, allow_code=True)
