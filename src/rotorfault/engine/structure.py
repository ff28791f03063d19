"""The structure of a closed loop: all that decides which operations it consists of.

By the house rule every float of a part is a number in its parameters, so that it may differ between the flights of
a batch; texts, booleans and whole numbers in settings are choices of structure. Allocators have no parameters and
parts from outside the package may keep any rule: their floats count as structure.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from rotorfault.loop.closed_loop import ClosedLoop
from rotorfault.maths.geometry import Value


def structure(loop: ClosedLoop) -> tuple[str, ...]:
    """Words that are equal for two loops exactly when their compiled code is."""
    plant, autopilot = loop.plant, loop.autopilot
    words = [describe(part) for part in (plant.model, plant.wind, *plant.faults, loop.sensors)]
    words += [
        describe(part) for part in (plant.ground, autopilot.diagnoser, autopilot.response, autopilot.controller)
    ]
    words.append(describe(autopilot.allocator, floats=True))
    return (*words, repr(autopilot.diagnoser.oracle_delay), repr(plant.substeps))


def parts_of(loop: ClosedLoop) -> list[Any]:
    """All parts of a loop."""
    plant, autopilot = loop.plant, loop.autopilot
    return [
        plant.model, plant.wind, *plant.faults, *([] if plant.ground is None else [plant.ground]), loop.sensors,
        autopilot.diagnoser, autopilot.response, autopilot.controller, autopilot.allocator,
    ]  # fmt: skip


def describe(value: Any, floats: bool = False) -> str:
    """Class, choices and inner parts of a value; floats only where asked for."""
    if isinstance(value, float):
        return repr(value) if floats else "#"
    if isinstance(value, (str, int, bool, type(None))):
        return repr(value)
    if isinstance(value, (tuple, list)):
        return f"[{', '.join(describe(item, floats) for item in value)}]"
    if isinstance(value, np.ndarray):
        return f"array({value.dtype}, {value.shape}, {value.tobytes().hex()})"
    if isinstance(value, np.generic):
        return describe(value.item(), floats)
    if isinstance(value, Value):
        return f"{type(value).__name__}[{', '.join(describe(item, floats) for item in value)}]"
    if isinstance(value, dict):
        return f"{{{', '.join(f'{key}: {describe(item, floats)}' for key, item in value.items())}}}"
    kind = type(value)
    floats = floats or not kind.__module__.startswith("rotorfault.")
    if callable(value) or (not hasattr(value, "__dict__") and hasattr(kind, "__slots__")):
        # Nothing can be told of it but which one it is.
        return f"{kind.__module__}.{kind.__qualname__} at {id(value)}"
    inside = vars(value) if hasattr(value, "__dict__") else {}
    return f"{kind.__module__}.{kind.__qualname__}({describe(dict(sorted(inside.items())), floats)})"
