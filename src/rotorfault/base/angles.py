"""Angles in settings: in radians, with bounds that degrees do not keep."""

from __future__ import annotations

import math
from typing import Any, final

from pydantic import GetCoreSchemaHandler
from pydantic_core import CoreSchema, core_schema

from rotorfault.base.number_rule import refusal

HALF_TURN, TURN = math.pi, 2.0 * math.pi
FASTEST_TURN = math.radians(4000.0)
"""rad/s: what the fastest gyros of multirotors measure; nothing that flies turns faster."""


def in_radians(value: float, unit: str = "rad") -> str:
    """A value that is too large for an angle in radians, in words, as a user may have typed degrees.

    Parameters
    ----------
    value : float
    unit : str
        rad or rad/s.
    """
    degrees = unit.replace("rad", "degrees")
    return f"{value:g} {unit}, which is {math.degrees(value):.6g} {degrees}"


def wrapped(angle: float) -> float:
    """An angle in rad as people read it, within half a turn: how often something has turned is no direction.

    Parameters
    ----------
    angle : float
        In rad; what is no finite number stays.
    """
    return math.remainder(angle, TURN) if math.isfinite(angle) else angle


@final
class Radians:
    """Refuses what is beyond -+ `most`, and says what it would be if degrees were meant.

    Parameters
    ----------
    most : float
        In `unit`.
    unit : str
        rad or rad/s.
    """

    def __init__(self, most: float, unit: str = "rad") -> None:
        self.unit = unit
        # By the names that documentation looks for.
        self.ge, self.le = -most, most

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.no_info_after_validator_function(self._check, handler(source))

    def _check(self, value: float) -> float:
        if not self.ge <= value <= self.le:
            degrees = self.unit.replace("rad", "degrees")
            allowed = f"{self.ge:.5g} to {self.le:.5g} {self.unit}"
            meant = f"if {value:g} {degrees} were meant, write {math.radians(value):.5g}"
            raise refusal("", f"got {in_radians(value, self.unit)}; allowed: {allowed}; {meant}")
        return value
