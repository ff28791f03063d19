"""All kinds of parts that a flight has, in the order in which they act.

A new kind of part is a slot in a file of its own and a line here.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, final

from rotorfault.autopilot.allocation import ALLOCATION
from rotorfault.autopilot.control import CONTROLLER
from rotorfault.autopilot.diagnosis import DIAGNOSIS
from rotorfault.autopilot.estimation import ESTIMATOR, IMU_FILTER, SENSOR_CHECK
from rotorfault.autopilot.response import ON_FAULT
from rotorfault.base.errors import InputError, unknown
from rotorfault.model.slot import Slot, slot_of
from rotorfault.plant import FAULT, GROUND, PLANT, SENSORS, WIND
from rotorfault.reference import REFERENCE


@final
class Slots:
    """Slots in order, by name."""

    def __init__(self, slots: tuple[Slot[Any], ...]) -> None:
        self._slots = {slot.name: slot for slot in slots}
        self.version = 0  # rises with every change

    def __repr__(self) -> str:
        return f"<slots: {', '.join(self._slots)}>"

    def __iter__(self) -> Iterator[Slot[Any]]:
        return iter(self._slots.values())

    def __len__(self) -> int:
        return len(self._slots)

    def __contains__(self, name: object) -> bool:
        return name in self._slots

    def __getitem__(self, name: str) -> Slot[Any]:
        """A slot by its name.

        Raises
        ------
        InputError
            If there is none.
        """
        if name not in self._slots:
            raise InputError(unknown("kind of part", name, list(self._slots)))
        return self._slots[name]

    def home_of(self, part: object) -> tuple[Slot[Any], Any]:
        """Slot of a class of parts or of a part, and what makes parts of settings.

        Parameters
        ----------
        part : object
            A class, an object, or what a slot can adapt to one.

        Raises
        ------
        InputError
            If it is no kind of part.
        """
        for slot in self:
            if slot.adapt is not None and (adapted := slot.adapt(part)) is not None:
                return slot, adapted
        return slot_of(part), part

    def insert(self, slot: Slot[Any], after: str) -> None:
        """Give a new kind of part its place, behind that of another.

        Raises
        ------
        InputError
            If there is no such other, or a word of the new slot's streams of random numbers belongs to one already.
        """
        words = {word: other.name for other in self for word in other.streams or ()}
        for word in slot.streams or ():
            if word in words:
                raise InputError(f"slot {slot.name}: stream {word} belongs to {words[word]}; allowed: another word")
        slots = list(self)
        slots.insert(1 + slots.index(self[after]), slot)
        self._slots = {each.name: each for each in slots}
        self.version += 1

    def remove(self, slot: Slot[Any]) -> None:
        """Take a kind of part away again."""
        del self._slots[slot.name]
        self.version += 1


SLOTS = Slots(
    (
        REFERENCE,
        WIND,
        FAULT,
        GROUND,
        PLANT,
        SENSORS,
        SENSOR_CHECK,
        IMU_FILTER,
        ESTIMATOR,
        DIAGNOSIS,
        ON_FAULT,
        CONTROLLER,
        ALLOCATION,
    )
)
