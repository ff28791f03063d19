"""Allocation as if every rotor were sound: c_i = clip(F_i / k, c_min, c_max) with F from (36), corrected."""

from __future__ import annotations

from typing import final

from rotorfault.autopilot.allocation.accounting import account
from rotorfault.autopilot.allocation.protocol import ALLOCATORS
from rotorfault.base.config import Strict
from rotorfault.maths.scalar import clip
from rotorfault.model.mixer import nominal_inverse
from rotorfault.model.signals import Allocation, Diagnosis, Wrench
from rotorfault.model.vehicle import Vehicle


@ALLOCATORS.register("nominal")
@final
class Nominal:
    """Inverse for sound rotors, each command clipped by itself; ignores the diagnosis.

    The diagnosis enters the report only: what the commands leave unallocated is told as the autopilot believes it.
    """

    class Settings(Strict):
        """Nothing to set."""

    def __init__(self, settings: Settings) -> None:
        self.settings = settings

    def allocate(self, vehicle: Vehicle, wrench: Wrench, diagnosis: Diagnosis) -> Allocation:
        """Commands for a demanded wrench; see `Allocator.allocate`."""
        thrust = nominal_inverse(vehicle, wrench)
        command = thrust.map(lambda f: clip(f / vehicle.rotor_gain, vehicle.thrust_min, vehicle.thrust_max))
        return account(vehicle, wrench, diagnosis, command)
