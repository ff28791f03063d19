"""What an allocator is, and the slot of those that exist."""

from __future__ import annotations

from typing import NamedTuple

from rotorfault.autopilot.instant import Instant
from rotorfault.base.errors import InputError
from rotorfault.base.one_line import record_line
from rotorfault.maths.geometry import PerRotor
from rotorfault.maths.scalar import Scalar
from rotorfault.model.block import Block, MemoryT, ParametersT
from rotorfault.model.signals import Allocation, Diagnosis, Wrench
from rotorfault.model.slot import Slot
from rotorfault.model.vehicle import Vehicle

# Of a rotor, below which it counts as dead: our choice, a twentieth is as little as detectors tell from nothing.
LEAST_EFFECTIVENESS = 0.05


class AllocationInputs(NamedTuple):
    """All that an allocator may use at one sampling instant."""

    wrench: Wrench  # demanded thrust [N] and torque [N m, body axes]
    diagnosis: Diagnosis  # believed
    vehicle: Vehicle  # belief
    command: PerRotor  # N, sent at the last instant
    spin: Scalar = 0.0  # rad/s: estimated yaw rate of the body

    def __repr__(self) -> str:
        return record_line(self)


class Allocator(Block[AllocationInputs, Allocation, MemoryT, ParametersT]):
    """Turns a demanded wrench into rotor commands within the limits, and says what it could not give."""


def _inputs(instant: Instant) -> AllocationInputs:
    wrench = instant.demand
    if isinstance(wrench, PerRotor):
        raise InputError("a controller that commands the rotors itself needs no allocation")
    return AllocationInputs(
        wrench=wrench,
        diagnosis=instant.decision.diagnosis,
        vehicle=instant.vehicle,
        command=instant.past.command.thrust,
        spin=instant.estimate.omega_B.z,
    )


ALLOCATION = Slot(
    "allocation",
    Allocator,
    "belief",
    "control allocation: from the demanded wrench to rotor commands",
    "allocators",
    sort="allocator",
    default="effectiveness",
    calm="nominal",
    inputs=_inputs,
)
