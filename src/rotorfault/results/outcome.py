"""How a flight ended, and its numbers as JSON holds them."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from rotorfault.loop.scores import SURVIVED


class Outcome(NamedTuple):
    """How a flight ended; see `rotorfault.loop.scoring`."""

    kind: str  # settled, tracked, offset, landed, ground, tumbled, diverged, interrupted
    time: float  # s: end of the flight

    @property
    def survived(self) -> bool:
        """Whether the vehicle was sound when the flight ended: flying, or landed."""
        return self.kind in SURVIVED

    def __str__(self) -> str:
        return f"{self.kind} at {self.time:.3f} s"


def finite_or_none(value: Any) -> Any:
    """The same data with None for numbers that JSON cannot hold."""
    if isinstance(value, dict):
        return {key: finite_or_none(item) for key, item in value.items()}
    if isinstance(value, list):
        return [finite_or_none(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
