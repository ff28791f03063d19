"""Allocation as if every rotor were sound: c_i = clip(F_i / k, c_min, c_max) with F from (36), corrected."""

from __future__ import annotations

from typing import final

from rotorfault.autopilot.allocation.accounting import account
from rotorfault.autopilot.allocation.protocol import AllocationInputs, Allocator
from rotorfault.maths.scalar import Scalar
from rotorfault.model.block import Nothing, Record
from rotorfault.model.mixer import nominal_inverse
from rotorfault.model.motion import limited
from rotorfault.model.signals import Allocation
from rotorfault.model.slot import register


@register("nominal")
@final
class Nominal(Allocator[Nothing, Nothing]):
    """Inverse for sound rotors, each command clipped by itself; ignores the diagnosis.

    The diagnosis enters the report only: what the commands leave unallocated is told as the autopilot believes it.
    """

    def step(
        self, memory: Nothing, inputs: AllocationInputs, parameters: Nothing, dt: Scalar
    ) -> tuple[Nothing, Allocation, Record]:
        """Commands for a demanded wrench."""
        wrench, diagnosis, vehicle, *_ = inputs
        thrust = nominal_inverse(vehicle, wrench)
        command = limited(vehicle, thrust / vehicle.rotor_gain)
        return memory, account(vehicle, wrench, diagnosis, command), Nothing()
