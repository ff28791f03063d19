"""Angles in settings: in radians, with bounds that degrees do not keep."""

from __future__ import annotations

import math

from pydantic import AfterValidator

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


def radians(most: float, unit: str = "rad") -> AfterValidator:
    """Refuse what is beyond -+ `most`, and say what it would be if degrees were meant.

    Parameters
    ----------
    most : float
        In `unit`.
    unit : str
        rad or rad/s.
    """

    def check(value: float) -> float:
        if abs(value) > most:
            degrees = unit.replace("rad", "degrees")
            allowed = f"{-most:.5g} to {most:.5g} {unit}"
            meant = f"if {value:g} {degrees} were meant, write {math.radians(value):.5g}"
            raise refusal("", f"got {in_radians(value, unit)}; allowed: {allowed}; {meant}")
        return value

    return AfterValidator(check)
