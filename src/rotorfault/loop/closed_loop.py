"""The closed loop, one sampling period: the only place where truth and belief meet.

    memories    = wind, faults brought to this period
    truth       = plant.observe(state)
    readings    = sensors(truth)
    command     = autopilot(readings, reference)
    scores      = scoring(scores, signals of this instant)
    state       = plant.step(state, command held for one period)

A loop is an ordered mapping from slots to parts. Time is the counted step times the period, never a sum of periods: a
fault at 1.8 s falls on its step exactly.
"""

from __future__ import annotations

import copy
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple, TypeVar, cast, final

from rotorfault.autopilot.autopilot import AnyBlock, Autopilot, AutopilotMemory
from rotorfault.autopilot.estimation.imu_filter import IMU_FILTER, behind
from rotorfault.autopilot.response.protocol import ON_FAULT
from rotorfault.base.one_line import LONGEST, cut
from rotorfault.loop.fault_line import FaultLine
from rotorfault.loop.recorded import Recorder
from rotorfault.loop.scores import Scores, ScoringParameters, unjudged
from rotorfault.loop.scoring import Scoring
from rotorfault.maths.geometry import PerRotor, Vec3, zeros
from rotorfault.maths.records import record_type
from rotorfault.maths.scalar import Scalar
from rotorfault.model.battery import Battery, Charge, Supply, at_voltage
from rotorfault.model.block import Context, Nothing, Record
from rotorfault.model.mixer import hover_thrust
from rotorfault.model.signals import Command, Reference
from rotorfault.model.slot import Slot
from rotorfault.model.telemetry import example
from rotorfault.model.vehicle import Vehicle
from rotorfault.plant.faults import FAULT
from rotorfault.plant.ground import GROUND
from rotorfault.plant.models import PLANT
from rotorfault.plant.plant import Held, Plant, PlantParameters, PlantState, Truth
from rotorfault.plant.sensors import SENSORS, SensorInputs
from rotorfault.plant.timed import TimeInputs
from rotorfault.plant.wind import WIND, Air

B = TypeVar("B")
Parts = Mapping[Slot[Any], AnyBlock | tuple[AnyBlock, ...]]


class LoopParameters(NamedTuple):
    """All numbers of a closed loop."""

    vehicle: Vehicle  # the true one
    belief: Vehicle
    parts: Any  # record of the parts' numbers, by slot
    period: Scalar  # s
    scoring: ScoringParameters = unjudged()


class LoopState(NamedTuple):
    """State of truth and belief, what has been counted, and the number of steps flown."""

    plant: PlantState
    truth: Any  # record of the memories of the truth's parts, by slot
    autopilot: AutopilotMemory
    scores: Scores
    steps: Scalar


class Drive(NamedTuple):
    """What enters from outside at each step."""

    reference: Reference
    own: Any = ()  # signals of the reference's own
    normals: Any = ()  # record of standard normal numbers for the parts that need some, by slot


class Start(NamedTuple):
    """Where a flight begins."""

    p_W: Vec3  # m
    v_W: Vec3  # m/s
    attitude: Vec3  # rad
    omega_B: Vec3  # rad/s
    normals: Any = ()  # record of standard normal numbers for `initial` of the parts that need some, by slot
    battery: Charge | tuple[()] = ()  # empty where the voltage is constant


@final
class ClosedLoop:
    """Parts of truth and belief put together, and the scores of their flight.

    Parameters
    ----------
    parts : mapping of Slot to Block, or to a tuple of them
        In the order of the slots.
    substeps : int
        Integration steps per sampling period, at least 1.
    reference : type of NamedTuple
        Signals of the reference's own.
    rotors : int
        Of the vehicle.
    tilted : bool
        Whether any of them is tilted.
    battery : bool
        Whether the voltage is that of the vehicle's battery, and not constant.
    compensates : bool
        Whether the autopilot makes up for it.

    Attributes
    ----------
    layout : Layout
        Names, units and rows of what is recorded.
    """

    def __repr__(self) -> str:
        parts = ", ".join(f"{slot.name} {type(part).__name__}" for slot, part in self.each())
        return cut(f"<closed loop of {parts}>", LONGEST)

    def __init__(
        self,
        parts: Parts,
        substeps: int,
        reference: type[Record] = Nothing,
        rotors: int = 4,
        tilted: bool = False,
        battery: bool = False,
        compensates: bool = False,
    ) -> None:
        self.parts, self.rotors, self.battery, self.compensates = dict(parts), rotors, battery, compensates
        truth = {slot: part for slot, part in self.parts.items() if slot.side == "truth"}
        self.autopilot = Autopilot(
            {slot: cast("AnyBlock", part) for slot, part in self.parts.items() if slot.side == "belief"}
        )
        self.faults = FaultLine(self.all(FAULT))
        self.plant = Plant(self[PLANT], self[WIND], self.faults.of_rotors, substeps, self.maybe(GROUND))
        self.sensors = self[SENSORS]
        self._names = tuple(slot.name for slot in truth)
        self._memories = record_type("TruthParts", self._names)
        self.record = record_type("Parts", tuple(slot.name for slot in self.parts))
        self.reference = reference
        telemetry = {"reference": reference}
        for slot, part in self.parts.items():
            if isinstance(part, tuple):
                telemetry |= {f"{slot.name}_{number}": one.Telemetry for number, one in enumerate(part)}
            else:
                telemetry[slot.name] = part.Telemetry
        response = self.maybe(ON_FAULT)
        lands = response is not None and response.lands
        self.recorder = Recorder(self.plant.ground is not None, lands, telemetry, rotors, tilted, battery)
        self.layout = self.recorder.layout
        self.scoring = Scoring(
            ground=self.plant.ground is not None,
            lands=lands,
            faulty=tuple(fault.rotor for fault in self.plant.faults),
            signals=self.layout.signals,
            rotors=rotors,
            upside_down=self.plant.model.upside_down,
        )

    def __getitem__(self, slot: Slot[B]) -> B:
        """The part of a slot that has one."""
        return cast("B", self.parts[slot])

    def all(self, slot: Slot[B]) -> tuple[B, ...]:
        """The parts of a slot that has many."""
        return cast("tuple[B, ...]", self.parts.get(slot, ()))

    def maybe(self, slot: Slot[B]) -> B | None:
        """The part of a slot that may be empty."""
        return cast("B | None", self.parts.get(slot))

    def each(self) -> Iterator[tuple[Slot[Any], AnyBlock]]:
        """Every part with its slot."""
        for slot, part in self.parts.items():
            for one in part if isinstance(part, tuple) else (part,):
                yield slot, one

    def numbers(self, vehicle: Vehicle, belief: Vehicle, period: float) -> Any:
        """Record of the numbers of all parts, by slot.

        Parameters
        ----------
        vehicle, belief : Vehicle
            The true one, and what the autopilot believes.
        period : float, s
            Sampling period.
        """
        believed = Context(belief, period)
        contexts = {
            "truth": Context(vehicle, period),
            "belief": believed._replace(
                sensors=behind(self.maybe(IMU_FILTER), self.sensors.model(believed), believed)
            ),
        }
        return self.record(
            *(
                tuple(one.parameters(contexts[slot.side]) for one in part)
                if isinstance(part, tuple)
                else part.parameters(contexts[slot.side])
                for slot, part in self.parts.items()
            )
        )

    def drive(self, reference: Reference | None = None) -> Drive:
        """A drive without noise, of the shape that all drives of this loop have.

        Parameters
        ----------
        reference : Reference, optional
            The origin, at rest, if not given.
        """
        own = () if self.reference is Nothing else example(self.reference, self.rotors)
        widths = {slot.name: part.normals for slot, part in self.each() if part.normals}
        zeros_of = record_type("Normals", tuple(widths))(*((0.0,) * width for width in widths.values()))
        return Drive(no_reference() if reference is None else reference, own, zeros_of)

    def level_start(self, p_W: Vec3) -> Start:
        """At rest and level at a position in m, without noise."""
        widths = {
            slot.name: part.normals if part.first_normals is None else part.first_normals
            for slot, part in self.each()
            if part.normals or part.first_normals
        }
        zeros_of = record_type("FirstNormals", tuple(widths))(*((0.0,) * width for width in widths.values()))
        return Start(p_W, zeros(), zeros(), zeros(), zeros_of, Charge(1.0, 0.0) if self.battery else ())

    def with_plant(self, plant: Plant) -> ClosedLoop:
        """The same loop with another integrator of the motion."""
        loop = copy.copy(self)
        loop.plant = plant
        return loop

    def initial(self, start: Start, drive: Drive, parameters: LoopParameters) -> LoopState:
        """State before the first step; rotors at the hover thrust that the autopilot believes in."""
        numbers, plant_numbers = parameters.parts, self.plant_numbers(parameters)
        plant = self.plant.initial(
            start.p_W,
            start.v_W,
            start.attitude,
            start.omega_B,
            hover_thrust(parameters.belief),
            plant_numbers,
            start.battery,
        )
        at_start = TimeInputs(0.0, _normals(start.normals, "wind"))
        held = Held(
            self.plant.wind.initial(at_start, numbers.wind),
            tuple(
                fault.initial(TimeInputs(0.0), one)
                for fault, one in zip(self.plant.faults, self._faults(numbers), strict=True)
            ),
        )
        air = self.plant.wind.at(0.0, held.wind, numbers.wind)
        truth = self.plant.observe(plant, held, air, 0.0, plant_numbers)
        at_first = self._sensed(truth, 0.0, _normals(start.normals, "sensors"), numbers)
        sensors = self.sensors.initial(at_first, numbers.sensors)
        # Read as at the first step, which reads them once more.
        sensed = self._sensed(truth, 0.0, _normals(drive.normals, "sensors"), numbers)
        readings = self.sensors.step(sensors, sensed, numbers.sensors, parameters.period)[1]
        spoilt = self.faults.first(readings, _of_faults(numbers))
        readings = self.faults.through(spoilt, readings, 0.0, _of_faults(numbers))[1]
        autopilot = self.autopilot.initial(readings, drive.reference, parameters.belief, numbers, parameters.period)
        return LoopState(plant, self._kept(held, sensors, spoilt), autopilot, self.scoring.initial(), 0.0)

    def step(self, state: LoopState, drive: Drive, parameters: LoopParameters) -> tuple[LoopState, Record]:
        """One sampling period: the state after it, and the signals at its beginning."""
        after, command, recorded = self.decide(state, drive, parameters)
        time = state.steps * parameters.period
        plant = self.plant.step(
            after.plant, command, self.held(after), time, self.plant_numbers(parameters), parameters.period
        )
        return after._replace(plant=plant), recorded

    def decide(self, state: LoopState, drive: Drive, parameters: LoopParameters) -> tuple[LoopState, Command, Record]:
        """The sampling instant alone.

        Returns
        -------
        state : LoopState
            All that is held from it on; wind and faults are those of the period that begins, nothing has moved.
        command : Command
            The autopilot's, not yet put within the rotor limits.
        recorded : record
            The signals of this instant, in the order of `layout`.
        """
        time, dt, numbers = state.steps * parameters.period, parameters.period, parameters.parts
        telemetry: dict[str, Record] = {"reference": drive.own}
        held, air = self._blown(state, drive, parameters, telemetry)
        plant_numbers = self.plant_numbers(parameters)
        truth = self.plant.observe(state.plant, held, air, time, plant_numbers)
        sensed = self._sensed(truth, time, _normals(drive.normals, "sensors"), numbers)
        sensors, readings, telemetry["sensors"] = self.sensors.step(state.truth.sensors, sensed, numbers.sensors, dt)
        spoilt, readings = self.faults.through(_of_faults(state.truth), readings, time, _of_faults(numbers))
        memory, command, report = self.autopilot.step(
            state.autopilot,
            readings,
            drive.reference,
            parameters.belief,
            numbers,
            dt,
            self._told(state.plant, held, time, parameters),
        )
        recorded = self.recorder.record(truth, command, report, telemetry | report.telemetry)
        scores = self.scoring.step(
            state.scores, recorded, parameters.scoring, self.onsets(numbers), state.steps, time, dt
        )
        after = LoopState(state.plant, self._kept(held, sensors, spoilt), memory, scores, state.steps + 1.0)
        return after, self._compensated(command, truth, parameters.belief), recorded

    def _compensated(self, command: Command, truth: Truth, belief: Vehicle) -> Command:
        """What is sent, with the measured voltage made up for if the autopilot does that."""
        if not (self.compensates and isinstance(truth.supply, Supply) and isinstance(belief.battery, Battery)):
            return command
        reversible = belief.reversible != ()
        sent = at_voltage(belief.battery, command.thrust, belief.thrust_max, 1.0 / truth.supply.share, reversible)
        return command._replace(thrust=sent)

    def limited(self, command: Command, parameters: LoopParameters) -> Command:
        """The command within the true rotor limits."""
        return self.plant.limited(command, self.plant_numbers(parameters))

    def substep(
        self, state: LoopState, command: Command, time: Scalar, parameters: LoopParameters, dt: Scalar
    ) -> LoopState:
        """State one integration step of dt [s] later, after `decide`, the command (within the limits) held."""
        numbers = self.plant_numbers(parameters)
        return state._replace(plant=self.plant.substep(state.plant, command, self.held(state), time, numbers, dt))

    def held(self, state: LoopState) -> Held:
        """Memories of wind and faults over the period that begins, after `decide`."""
        return Held(state.truth.wind, self.faults.rotors(_of_faults(state.truth)))

    def _blown(
        self, state: LoopState, drive: Drive, parameters: LoopParameters, telemetry: dict[str, Record]
    ) -> tuple[Held, Air]:
        """Wind and faults brought to the period that begins."""
        time, dt, numbers = state.steps * parameters.period, parameters.period, parameters.parts
        before = self.held(state)
        wind, air, telemetry["wind"] = self.plant.wind.step(
            before.wind, TimeInputs(time, _normals(drive.normals, "wind")), numbers.wind, dt
        )
        faults = []
        each = zip(self.plant.faults, before.faults, self._faults(numbers), strict=True)
        for number in range(len(self.all(FAULT))):
            telemetry[f"fault_{number}"] = Nothing()
        for number, (fault, memory, one) in zip(self.faults.places, each, strict=True):
            memory, _, telemetry[f"fault_{number}"] = fault.step(memory, TimeInputs(time), one, dt)
            faults.append(memory)
        return Held(wind, tuple(faults)), air

    def _told(self, plant: PlantState, held: Held, time: Scalar, parameters: LoopParameters) -> PerRotor | None:
        """The true losses, for a source of diagnosis that is an oracle; nothing for any other."""
        oracle = self.autopilot.oracle
        if oracle is None:
            return None
        age = oracle.age(parameters.parts.diagnosis)
        return self.plant.true_loss(plant, held, time - age, self.plant_numbers(parameters))

    def onsets(self, numbers: Any) -> tuple[Scalar, ...]:
        """Time of the first effect of each fault of a rotor in s."""
        return tuple(fault.onset(one) for fault, one in zip(self.plant.faults, self._faults(numbers), strict=True))

    def _faults(self, numbers: Any) -> tuple[Any, ...]:
        return self.faults.rotors(_of_faults(numbers))

    def plant_numbers(self, parameters: LoopParameters) -> PlantParameters:
        """The numbers of the truth's parts, as the plant has them."""
        numbers = parameters.parts
        return PlantParameters(
            parameters.vehicle,
            numbers.wind,
            self._faults(numbers),
            () if self.plant.ground is None else numbers.ground,
        )

    def _sensed(self, truth: Truth, time: Scalar, normals: tuple[Scalar, ...], numbers: Any) -> SensorInputs:
        ground = 0.0 if self.plant.ground is None else self.plant.ground.height(numbers.ground)
        return SensorInputs(time, truth.state, truth.specific_force_B, normals, truth.rotor_speed, ground)

    def _kept(self, held: Held, sensors: Any, spoilt: dict[int, Any]) -> Any:
        """Memories of the truth's parts by slot; the body and the ground have none of their own."""
        own = {"wind": held.wind, "fault": self.faults.all(held.faults, spoilt), "sensors": sensors}
        return self._memories(*(own.get(name, ()) for name in self._names))


def _of_faults(records: Any) -> tuple[Any, ...]:
    """Numbers or memories of all faults; a loop may have none."""
    return getattr(records, "fault", ())


def _normals(normals: Any, slot: str) -> tuple[Scalar, ...]:
    """Normal numbers of a slot; zeros are not made up: a part that needs some and gets none fails at once."""
    return cast("tuple[Scalar, ...]", getattr(normals, slot, ()))


def no_reference() -> Reference:
    """The origin, at rest."""
    zero = zeros()
    return Reference(p_W=zero, v_W=zero, a_W=zero, yaw=0.0, yaw_rate=0.0, yaw_acceleration=0.0)
