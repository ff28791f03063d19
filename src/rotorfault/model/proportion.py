"""A number of a vehicle in proportion to others of it, and the units that it may have been written in by mistake."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import NamedTuple


class Proportion(NamedTuple):
    """A number in proportion to others."""

    key: str
    value: float
    unit: str
    what: str  # the proportion in words
    of: Callable[[float], float]  # the proportion that a value has
    low: float
    typical: float
    high: float
    meant: Mapping[str, Callable[[float], float]]  # by what the user may have written: the value in `unit`

    @property
    def fits(self) -> bool:
        """Whether it is within what is usual."""
        return self.low <= self.of(self.value) <= self.high

    def line(self) -> str:
        """What there is to say of a number that does not fit: the number, the proportion, and what to write."""
        right = {
            words: value
            for words, convert in self.meant.items()
            if self.low <= self.of(value := convert(self.value)) <= self.high
        }
        best = min(right, key=lambda words: abs(math.log(self.of(right[words]) / self.typical)), default="")
        hint = f"if it is {best}, write {right[best]:.4g} {self.unit}" if best else "check its unit"
        usual = f"usual {self.low:g} {f'to {self.high:g}' if math.isfinite(self.high) else 'and more'}"
        said = f": {self.what} is {self.of(self.value):.3g}, {usual}" if self.what else f"; {usual}"
        return f"{self.key} = {self.value:.4g} {self.unit}{said}; {hint}"


def times(factor: float) -> Callable[[float], float]:
    """A unit that is so much of the one wanted.

    Parameters
    ----------
    factor : float
    """
    return lambda value: factor * value


LENGTHS = {"in mm": times(1e-3), "in cm": times(1e-2), "in inches": times(0.0254)}
INERTIAS = {
    "in g cm^2": times(1e-7),
    "in kg cm^2": times(1e-4),
    "in kg mm^2": times(1e-6),
    "in g m^2": times(1e-3),
    "in g mm^2": times(1e-9),
}
