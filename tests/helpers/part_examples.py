"""All registered parts, each with settings that fill just what must be set."""

from __future__ import annotations

import inspect
import itertools
import types
import typing
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pydantic import BaseModel

from rotorfault.model.slot import Slot
from rotorfault.scenario.part import Part, part_from
from rotorfault.scenario.slots import SLOTS

PARTS = [(slot.name, name) for slot in SLOTS for name in slot.registry]
each_part = pytest.mark.parametrize(("slot", "name"), PARTS, ids=[f"{slot}-{name}" for slot, name in PARTS])


def example(model: type[BaseModel], folder: Path) -> dict[str, Any]:
    """Tables that set just what must be set. Numbers rise from field to field, so that ends come after starts."""
    rising = itertools.count(1)
    return {
        name: _value(field.annotation, field.metadata, folder, rising)
        for name, field in model.model_fields.items()
        if field.is_required()
    }


def _value(kind: Any, metadata: list[Any], folder: Path, rising: Iterator[int]) -> Any:
    origin, inner = typing.get_origin(kind), typing.get_args(kind)
    if origin is typing.Annotated:
        return _value(inner[0], list(inner[1:]), folder, rising)
    if origin in (typing.Union, types.UnionType):
        return _value(inner[0], metadata, folder, rising)
    if origin is typing.Literal:
        return inner[0]
    if origin is tuple:
        count = 1 if inner[-1] is Ellipsis else len(inner)
        return [_value(inner[0], [], folder, rising) for _ in range(count)]
    if kind is float:
        return _within(0.02 * next(rising), metadata)
    if kind is int:
        return int(_within(1, metadata))
    if kind is str:
        file = folder / "table.csv"
        file.write_text("t,x,y,z\n0,0,0,0\n0.5,0.1,0.2,0.3\n1,0.2,0.1,0.4\n")
        return str(file)
    if inspect.isclass(kind) and issubclass(kind, BaseModel):
        return example(kind, folder)
    if "Callable" in repr(kind):
        return lambda time: (0.1 * time, 0.0, 0.2 * time * time, 0.0)
    raise NotImplementedError(f"teach tests/helpers/part_examples.py an example of {kind!r}")


def _within(value: float, metadata: list[Any]) -> float:
    for bound in metadata:
        value = max(value, getattr(bound, "ge", value), getattr(bound, "gt", -np.inf) + 1e-3)
        value = min(value, getattr(bound, "le", value), getattr(bound, "lt", np.inf) - 1e-3)
    return value


def part_of(slot: str | Slot[Any], name: str, folder: Path) -> Part[Any]:
    """A registered part, its settings the least that it takes."""
    home = SLOTS[slot] if isinstance(slot, str) else slot
    return part_from(home, {"kind": name, **example(home.registry[name].Settings, folder)}, allow=True)
