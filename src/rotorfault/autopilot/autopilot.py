"""The autopilot: its parts in the order of their slots, once per sampling period.

It sees readings and the scenario's reference, and holds beliefs: about its vehicle, about what its rotors do with the
commands it sent, about faults. It never sees the plant. What flows where is said by the slots
(`rotorfault.autopilot.instant`); here stand their order, the memory that they share, and the command that is sent.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple, final

from rotorfault.autopilot.allocation.accounting import account, direct
from rotorfault.autopilot.control.protocol import ControlOutput
from rotorfault.autopilot.diagnosis.borne_out import Borne, acted_on, nothing_claimed
from rotorfault.autopilot.diagnosis.protocol import Diagnoser, Oracle
from rotorfault.autopilot.instant import Decision, Instant, Past
from rotorfault.autopilot.rotor_model import expected_thrust, follow, rotors_at_hover
from rotorfault.maths.geometry import PerRotor, per_rotor, zeros
from rotorfault.maths.records import record_type
from rotorfault.maths.scalar import Scalar
from rotorfault.model.block import Block, Record
from rotorfault.model.mixer import hover_thrust
from rotorfault.model.motion import idle
from rotorfault.model.signals import Allocation, Command, Readings, Reference, Wrench, healthy, motion_of
from rotorfault.model.slot import Slot
from rotorfault.model.telemetry import example
from rotorfault.model.vehicle import Vehicle, rotor_speeds

AnyBlock = Block[Any, Any, Any, Any]


class AutopilotMemory(NamedTuple):
    """All that the autopilot carries from one sampling instant to the next."""

    past: Past
    parts: Any  # record of the parts' memories, by slot
    borne: Borne | tuple[()] = ()  # of a diagnosis that does not look; empty with one that does


class AutopilotReport(NamedTuple):
    """What one sampling instant decided, for the record."""

    instant: Instant  # with the output of every part
    wrench: Wrench  # demanded
    allocation: Allocation  # of the command that is sent
    telemetry: dict[str, Record]  # signals of each part, by slot


@final
class Autopilot:
    """The parts of an autopilot put together.

    Parameters
    ----------
    parts : mapping of Slot to Block
        In the order in which they act: estimator, diagnosis, response, controller, allocation, and whatever else has
        a slot.
    """

    def __init__(self, parts: Mapping[Slot[Any], AnyBlock]) -> None:
        self.parts = dict(parts)
        self._record = record_type("AutopilotParts", tuple(slot.name for slot in self.parts))

    @property
    def oracle(self) -> Oracle[Any, Any] | None:
        """The source of diagnosis, if it is one that is told the truth."""
        diagnoser = next((part for slot, part in self.parts.items() if slot.name == "diagnosis"), None)
        return diagnoser if isinstance(diagnoser, Oracle) else None

    @property
    def asked(self) -> bool:
        """Whether a part asks what thrust the rotors are believed to have given."""
        return any(getattr(part, "asks_for_thrust", False) for part in self.parts.values())

    @property
    def _told(self) -> bool:
        """Whether the diagnosis is found nowhere in the motion, and is not the truth either."""
        diagnoser = next((part for slot, part in self.parts.items() if slot.name == "diagnosis"), None)
        return isinstance(diagnoser, Diagnoser) and not diagnoser.looks and not isinstance(diagnoser, Oracle)

    def initial(
        self, readings: Readings, reference: Reference, vehicle: Vehicle, parameters: Any, dt: Scalar
    ) -> AutopilotMemory:
        """Memory before the first step; the rotors are believed at hover thrust.

        Parameters
        ----------
        readings : Readings
            Of the first sampling instant.
        reference : Reference
            The scenario's, at the first sampling instant.
        vehicle : Vehicle
            As believed.
        parameters : record
            Numbers of the parts, by slot.
        dt : scalar, s
            Sampling period.
        """
        hover = hover_thrust(vehicle)
        held = hover / vehicle.rotor_gain
        rotors = rotors_at_hover(vehicle)
        past = Past(rotors, (), Command(held, zeros()), 0.0, rotor_speeds(vehicle, expected_thrust(rotors, vehicle)))
        if self.asked:
            past = past._replace(believed=rotors.mean)
        instant = Instant(readings, reference, vehicle, past, dt)
        # What the parts would say before anything is known: hover with sound rotors.
        wrench, sound = Wrench(hover.sum(), zeros()), healthy(vehicle.rotors)
        instant.outputs = {
            "diagnosis": sound,
            "on_fault": Decision(reference, sound),
            "controller": ControlOutput(wrench),
            "allocation": account(vehicle, wrench, sound, held),
        }
        memories = []
        for slot, part in self.parts.items():
            numbers = getattr(parameters, slot.name)
            inputs = _inputs(slot, instant)
            memories.append(part.initial(inputs, numbers))
            if slot.name == "estimator":
                instant.outputs[slot.name] = part.step(memories[-1], inputs, numbers, dt)[1]
        past = past._replace(previous=motion_of(instant.estimate, vehicle.tilt != ()))
        return AutopilotMemory(past, self._record(*memories), nothing_claimed() if self._told else ())

    def step(
        self,
        memory: AutopilotMemory,
        readings: Readings,
        reference: Reference,
        vehicle: Vehicle,
        parameters: Any,
        dt: Scalar,
        true_loss: PerRotor | None = None,
    ) -> tuple[AutopilotMemory, Command, AutopilotReport]:
        """One sampling instant.

        Parameters
        ----------
        memory : AutopilotMemory
        readings : Readings
        reference : Reference
            The scenario's.
        vehicle : Vehicle
            As believed.
        parameters : record
            Numbers of the parts, by slot.
        dt : scalar, s
            Sampling period.
        true_loss : PerRotor, optional
            For a source of diagnosis that is an oracle, and for nobody else.
        """
        instant = Instant(readings, reference, vehicle, memory.past, dt)
        memories: list[Any] = []
        telemetry: dict[str, Record] = {}
        wrench: Wrench | None = None
        borne = memory.borne
        output: Any
        for slot, part in self.parts.items():
            before, numbers = getattr(memory.parts, slot.name), getattr(parameters, slot.name)
            if slot.name == "allocation" and isinstance(instant.demand, PerRotor):
                # The controller commands the rotors itself.
                wrench, output = direct(vehicle, instant.decision.diagnosis, instant.demand)
                after, signals = before, example(part.Telemetry, vehicle.rotors)
            elif true_loss is not None and isinstance(part, Oracle):
                output = part.told(true_loss, _inputs(slot, instant), numbers)
                after, signals = before, example(part.Telemetry, vehicle.rotors)
            else:
                after, output, signals = part.step(before, _inputs(slot, instant), numbers, dt)
            memories.append(after)
            if slot.name == "diagnosis" and isinstance(borne, Borne):
                borne, output = acted_on(borne, output, instant.expectation, vehicle)
            instant.outputs[slot.name] = output
            telemetry[slot.name] = signals
        if wrench is None:
            assert isinstance(instant.demand, Wrench)
            wrench = instant.demand
        allocation = self._relieved(instant, wrench)
        command = Command(allocation.command, instant.outputs["controller"].direct_acceleration_W)
        rotors = follow(memory.past.rotors, command.thrust, vehicle, dt)
        believed = instant.decision.diagnosis
        past = Past(
            rotors=rotors,
            previous=instant.expectation.now,
            command=command,
            elapsed=dt,
            speed=instant.expectation.speed,
            believed=believed.stuck.thrust_of(rotors.mean, believed.loss) if self.asked else (),
        )
        report = AutopilotReport(instant, wrench, allocation, telemetry)
        return AutopilotMemory(past, self._record(*memories), borne), command, report

    @staticmethod
    def _relieved(instant: Instant, wrench: Wrench) -> Allocation:
        """The allocation, less what the response takes back of every thrust."""
        allocation, decision = instant.allocation, instant.decision
        relief = decision.relief
        if isinstance(relief, tuple):
            return allocation
        least = idle(instant.vehicle)
        command = per_rotor(lambda f, least: least + (f - least) * (1.0 - relief), allocation.command, least)
        return account(instant.vehicle, wrench, decision.diagnosis, command)


def _inputs(slot: Slot[Any], instant: Instant) -> Any:
    assert slot.inputs is not None, f"slot {slot.name} does not say what its parts get"
    return slot.inputs(instant)
