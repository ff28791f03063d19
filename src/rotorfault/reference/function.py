"""A reference that is a Python function of time; central differences where it gives no derivatives."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, cast, final

import numpy as np
from pydantic import Field, field_serializer
from pydantic_core import PydanticCustomError

from rotorfault.base import foreign
from rotorfault.base.config import Strict
from rotorfault.base.errors import InputError
from rotorfault.base.number_rule import real, short
from rotorfault.maths.arrays import Array
from rotorfault.maths.records import flatten
from rotorfault.model.signals import Reference
from rotorfault.model.slot import register
from rotorfault.reference.protocol import ReferenceSource, ReferenceTable
from rotorfault.reference.turns import TURN

# s, of central differences: truncation and rounding of the second one are then both about 1e-8. A power of 2, so that
# a time and the same a step later differ by it exactly, however long the flight.
STEP = 2.0**-12


@register("function")
@final
class Function(ReferenceSource):
    """A Python function of time that returns (x, y, z, yaw), or a `rotorfault.model.signals.Reference`."""

    class Settings(Strict):
        """Which function."""

        function: Callable[[float], Any] | str = Field(
            description="The function, or where it is: 'FILE.py:name' or 'package.module:name'. It takes the time "
            "[s] and returns x, y, z [m] and yaw [rad], or a Reference with all derivatives"
        )

        def code(self) -> tuple[str, ...]:
            """The function's place, where it is named and not handed in."""
            return (self.function,) if isinstance(self.function, str) else ()

        @field_serializer("function")
        def _place(self, function: Callable[[float], Any] | str) -> str:
            # A file cannot hold a function, but can say where it was; one of a module is found there again.
            if isinstance(function, str):
                return function
            return f"{getattr(function, '__module__', '?')}:{getattr(function, '__qualname__', repr(function))}"

    def __init__(self, settings: Settings) -> None:
        super().__init__(settings)
        given = settings.function
        self._function = _import(given) if isinstance(given, str) else given
        self._name = given if isinstance(given, str) else getattr(given, "__name__", repr(given))

    def table(self, times: Array) -> ReferenceTable:
        """The reference at the given instants; see `ReferenceSource.table`. Yaw does not jump by full turns.

        Raises
        ------
        InputError
            If the function fails, or returns anything but four finite numbers or a finite `Reference`.
        """
        rows = np.array([self._row(float(time)) for time in times]).reshape(len(times), 12)
        table = ReferenceTable(rows[:, :3], rows[:, 3:6], rows[:, 6:9], rows[:, 9], rows[:, 10], rows[:, 11])
        return table.without_jumps(times)

    def _row(self, time: float) -> list[float]:
        """The twelve numbers of a `Reference`, in its order."""
        here = self._call(time)
        if len(here) == 12:
            return here
        # Never before 0, where the function need not be defined: there the differences are taken one step later.
        centre = max(time, STEP)
        before, middle, after = (np.array(self._call(centre + step)) for step in (-STEP, 0.0, STEP))
        # A heading from an arc tangent jumps by a turn within a step where it passes its border.
        for beside in (before, after):
            beside[3] -= TURN * round((beside[3] - middle[3]) / TURN)
        acceleration = (after - 2.0 * middle + before) / (STEP * STEP)
        rate = (after - before) / (2.0 * STEP) + acceleration * (time - centre)
        return [*here[:3], *rate[:3], *acceleration[:3], here[3], rate[3], acceleration[3]]

    def _call(self, time: float) -> list[float]:
        where = f"reference function '{self._name}' at t = {time:g} s"
        try:
            answer = self._function(time)
        except Exception as error:
            raise InputError(f"{where}: {type(error).__name__}: {' '.join(str(error).split())}") from error
        try:
            numbers = [real(number) for number in (flatten(answer) if isinstance(answer, Reference) else answer)]
        except (TypeError, PydanticCustomError):
            numbers = []
        if len(numbers) != (12 if isinstance(answer, Reference) else 4) or not all(map(math.isfinite, numbers)):
            allowed = "four finite numbers (x, y, z, yaw), or a Reference"
            raise InputError(f"{where}: got {short(answer)}; allowed: {allowed}")
        return numbers


def _import(place: str) -> Callable[[float], Sequence[float] | Reference]:
    """Load a function from its place."""
    function = foreign.load(place, "reference function")
    if not callable(function):
        raise InputError(f"reference function '{place}': it is no function; check the name")
    return cast("Callable[[float], Sequence[float] | Reference]", function)
