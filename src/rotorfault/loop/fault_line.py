"""Faults in the order of the scenario: those of rotors act on the plant, those of sensors on what is read."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, final

from rotorfault.maths.scalar import Scalar
from rotorfault.model.signals import Readings
from rotorfault.plant.faults import Fault
from rotorfault.plant.sensor_faults import SensorFault


@final
class FaultLine:
    """Which faults hit what.

    Parameters
    ----------
    faults : sequence of Fault
        In the order of the scenario, in which their numbers and memories are kept.
    """

    def __init__(self, faults: Sequence[Fault[Any, Any]]) -> None:
        self._sensors = {place: fault for place, fault in enumerate(faults) if isinstance(fault, SensorFault)}
        self.places = tuple(place for place in range(len(faults)) if place not in self._sensors)
        self.of_rotors = tuple(faults[place] for place in self.places)
        self._count = len(faults)

    def rotors(self, records: Any) -> tuple[Any, ...]:
        """What belongs to the faults of rotors, of the records of all.

        Parameters
        ----------
        records : tuple of record
            One for each fault; empty where there are none.
        """
        return tuple(records[place] for place in self.places) if self.of_rotors else ()

    def first(self, readings: Readings, numbers: Any) -> dict[int, Any]:
        """Memories of the faults of sensors before the first instant, from its readings."""
        return {place: fault.first(readings, numbers[place]) for place, fault in self._sensors.items()}

    def through(
        self, memories: Any, readings: Readings, time: Scalar, numbers: Any
    ) -> tuple[dict[int, Any], Readings]:
        """What comes through of readings at a time in s, and the memories of the faults of sensors after it."""
        after = {}
        for place, fault in self._sensors.items():
            after[place], readings = fault.through(memories[place], readings, time, numbers[place])
        return after, readings

    def all(self, rotors: tuple[Any, ...], sensors: dict[int, Any]) -> tuple[Any, ...]:
        """The memories of all faults, in order."""
        each = dict(zip(self.places, rotors, strict=True)) | sensors
        return tuple(each[place] for place in range(self._count))
