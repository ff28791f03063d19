"""The structure of a closed loop: all that decides which operations it consists of.

By the house rule every float of a part is a number in its parameters, so that it may differ between the flights of
a batch; texts, booleans and whole numbers in settings are choices of structure. Parts from outside the package may
keep any rule: their floats count as structure, unless a trace shows that they are none (`engine.program.same_code`).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from rotorfault.base.foreign import is_own
from rotorfault.loop.closed_loop import ClosedLoop
from rotorfault.maths.geometry import Value


def structure(loop: ClosedLoop) -> tuple[str, ...]:
    """Words that are equal for two loops only when their compiled code is."""
    words, numbers = skeleton(loop)
    return (*words, repr(numbers))


def skeleton(loop: ClosedLoop) -> tuple[tuple[str, ...], tuple[float, ...]]:
    """Words of a loop's choices of structure, and the floats that parts from outside the package hold, in order."""
    numbers: list[float] = []
    parts = [f"{slot.name}: {describe(part, numbers)}" for slot, part in loop.each()]
    reference = f"{loop.reference.__module__}.{loop.reference.__qualname__}"
    supply = f"battery {loop.battery}, compensated {loop.compensates}"
    return (*parts, reference, f"{loop.plant.substeps} substeps, {loop.rotors} rotors", supply), tuple(numbers)


def foreign(loop: ClosedLoop) -> bool:
    """Whether a part of a loop comes from outside the package."""
    return any(not is_own(type(part).__module__) for _, part in loop.each()) or not is_own(loop.reference.__module__)


def describe(value: Any, numbers: list[float], foreign: bool = False) -> str:
    """Class, choices and inner parts of a value.

    Parameters
    ----------
    value : object
    numbers : list of float
        Gets the floats of what is from outside the package.
    foreign : bool
        Whether the value belongs to such a thing.
    """
    if isinstance(value, float):
        if foreign:
            numbers.append(value)
        return "#"
    if isinstance(value, (str, int, bool, type(None))):
        return repr(value)
    if isinstance(value, (tuple, list)):
        return f"[{', '.join(describe(item, numbers, foreign) for item in value)}]"
    if isinstance(value, np.ndarray):
        return f"array({value.dtype}, {value.shape}, {value.tobytes().hex()})"
    if isinstance(value, np.generic):
        return describe(value.item(), numbers, foreign)
    if isinstance(value, Value):
        return f"{type(value).__name__}[{', '.join(describe(item, numbers, foreign) for item in value)}]"
    if isinstance(value, dict):
        return f"{{{', '.join(f'{key}: {describe(item, numbers, foreign)}' for key, item in value.items())}}}"
    if isinstance(value, type):
        return f"{value.__module__}.{value.__qualname__}"
    kind = type(value)
    foreign = foreign or not is_own(kind.__module__)
    if callable(value) or (not hasattr(value, "__dict__") and hasattr(kind, "__slots__")):
        # Nothing can be told of it but which one it is.
        return f"{kind.__module__}.{kind.__qualname__} at {id(value)}"
    inside = vars(value) if hasattr(value, "__dict__") else {}
    return f"{kind.__module__}.{kind.__qualname__}({describe(dict(sorted(inside.items())), numbers, foreign)})"
