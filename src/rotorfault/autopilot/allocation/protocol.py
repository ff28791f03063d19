"""What an allocator is, and the registry of those that exist."""

from __future__ import annotations

from typing import Any, Protocol

from rotorfault.base.config import Strict
from rotorfault.base.registry import Registry
from rotorfault.model.signals import Allocation, Diagnosis, Wrench
from rotorfault.model.vehicle import Vehicle


class Allocator(Protocol):
    """Turns a demanded wrench into rotor commands. Memoryless: the same inputs give the same commands.

    A class that satisfies it is final, holds its configuration class as `Settings` (a `Strict` whose defaults are
    usable; see `settings_class`), and says in the first line of its docstring what it does.
    """

    def __init__(self, settings: Any) -> None: ...

    def allocate(self, vehicle: Vehicle, wrench: Wrench, diagnosis: Diagnosis) -> Allocation:
        """Commands for a demanded wrench.

        Parameters
        ----------
        vehicle : Vehicle
            The vehicle as the autopilot believes it to be, with two opposite pairs of rotors (see `mixer`).
        wrench : Wrench
            Demanded thrust [N] and torque [N m, body axes].
        diagnosis : Diagnosis
            Belief about the rotors.

        Returns
        -------
        Allocation
            Commands [N] within the rotor limits; the wrench that they leave unallocated; what was given up.
        """


ALLOCATORS: Registry[type[Allocator]] = Registry("allocator")


def settings_class(allocator: type[Allocator]) -> type[Strict]:
    """The configuration class of an allocator. A function, for a type checker sees no nested class in a protocol."""
    return allocator.Settings  # type: ignore[attr-defined, no-any-return]
