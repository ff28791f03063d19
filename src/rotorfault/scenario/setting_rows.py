"""Settings as rows for readers: key, default, what is allowed, unit, meaning; from the models that check them.

The tables of docs/ and ``rotorfault list`` show them. Texts are Markdown: what would stand in a file is in backticks.
"""

from __future__ import annotations

import re
import types
from collections.abc import Iterator
from typing import Any, Literal, NamedTuple, Union, get_args, get_origin

from pydantic import BaseModel
from pydantic.fields import FieldInfo
from pydantic_core import PydanticUndefined

from rotorfault.model.slot import Slot
from rotorfault.scenario.mismatch import EachRotor, Mismatch
from rotorfault.scenario.part import Part
from rotorfault.scenario.scenario import Start, scenario_fields
from rotorfault.scenario.slots import SLOTS


class Setting(NamedTuple):
    """One key of a configuration."""

    key: str
    default: str
    allowed: str
    unit: str
    meaning: str


def settings(model: type[BaseModel], prefix: str = "") -> Iterator[Setting]:
    """All keys of a model with those of the models inside it, dotted; lists of models as ``name[].key``."""
    for name, field in model.model_fields.items():
        inner, many = inner_model(field.annotation)
        if inner is None:
            yield _setting(prefix + name, field)
        elif many or field.default is None:
            # The table or list itself may be left out, which its own row says.
            yield _setting(prefix + name, field)
            yield from settings(inner, f"{prefix}{name}{'[]' if many else ''}.")
        else:
            defaults = None if field.is_required() else field.get_default(call_default_factory=True)
            for setting in settings(inner, f"{prefix}{name}."):
                if isinstance(defaults, BaseModel):
                    # What counts is the default of the outer model, which fills the inner one.
                    value: Any = defaults
                    for part in setting.key.removeprefix(f"{prefix}{name}.").split("."):
                        value = getattr(value, part, PydanticUndefined)
                    setting = setting if value is PydanticUndefined else setting._replace(default=toml_value(value))
                yield setting


def inner_model(annotation: Any) -> tuple[type[BaseModel] | None, bool]:
    """The model that an annotation stands for, and whether it is a list of them."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation, False
    arguments = [a for a in get_args(annotation) if a is not type(None) and a is not Ellipsis]
    if len(arguments) == 1 and isinstance(arguments[0], type) and issubclass(arguments[0], BaseModel):
        return arguments[0], get_origin(annotation) is tuple
    return None, False


def _setting(key: str, field: FieldInfo) -> Setting:
    default = "required" if field.is_required() else toml_value(field.get_default(call_default_factory=True))
    text = " ".join((field.description or key.rpartition(".")[2].replace("_", " ")).split())
    brackets = re.findall(r"\s*\[[^\]]*\]", text)
    unit = ""
    if len(brackets) == 1:
        unit = brackets[0].strip()[1:-1]
        text = text.replace(brackets[0], "", 1).strip().removeprefix(", ")
    return Setting(key, default, _allowed(field), "" if unit in ("1", "-") else unit, text)


def toml_value(value: Any) -> str:
    """A default as it would stand in a TOML file."""
    if value is None:
        return "not given"
    if isinstance(value, Part):
        return f"`{value.kind}`"
    if isinstance(value, bool):
        return f"`{str(value).lower()}`"
    if isinstance(value, str):
        return f'`"{value}"`'
    if isinstance(value, tuple):
        return f"`[{', '.join(_number(x) for x in value)}]`"
    return f"`{_number(value)}`"


def _number(value: Any) -> str:
    text = repr(value)
    large = isinstance(value, float) and value >= 1e5
    return re.sub(r"e\+0*", "e", f"{value:.0e}") if large else text


def _allowed(field: FieldInfo) -> str:
    """Type and range in a few words."""
    kind = field.annotation
    options = [a for a in get_args(kind) if a is not type(None)]
    if get_origin(kind) is Literal:
        return ", ".join(f"`{option}`" for option in options)
    if get_origin(kind) in (Union, types.UnionType) and len(options) == 1:
        kind, options = options[0], []
    bounds = _bounds(field.metadata)
    if any(isinstance(mark, EachRotor) for mark in field.metadata):
        return f"number{bounds}, or a list with one for each rotor"
    if kind is bool:
        return "`true`, `false`"
    if kind is str:
        return "text"
    if kind is int:
        return f"whole number{bounds}"
    if kind is float:
        return f"number{bounds}"
    if get_origin(kind) is tuple and Ellipsis not in options and options:
        each = {_bounds(_metadata(option)) for option in options}
        return f"{len(options)} numbers{each.pop() if len(each) == 1 else ''}"
    if get_origin(kind) is tuple:
        return "list of tables"
    return "table" if inner_model(field.annotation)[0] else ""


def _metadata(kind: Any) -> list[Any]:
    """What stands beside a type in an annotation, with that of its fields."""
    beside = getattr(kind, "__metadata__", ())
    return [inner for one in beside for inner in (one.metadata if isinstance(one, FieldInfo) else [one])]


def _bounds(metadata: list[Any]) -> str:
    signs = {"gt": ">", "ge": "≥", "lt": "<", "le": "≤"}
    every = {name: [getattr(m, name) for m in metadata if getattr(m, name, None) is not None] for name in signs}
    found = {name: (max if name[0] == "g" else min)(each) for name, each in every.items() if each}
    if set(found) == {"ge", "le"}:
        return f", {found['ge']:.4g} to {found['le']:.4g}"
    return ",".join(f" {signs[name]} {value:g}" for name, value in found.items())


NO_FACTORS = ("mismatch.centre_of_mass", "mismatch.thrust_curve")


def scenario_settings() -> Iterator[Setting]:
    """All keys of a scenario; of a kind of part the key alone, for its settings are those of the part."""
    inside: dict[str, type[BaseModel]] = {"start": Start, "mismatch": Mismatch}
    for name, field in scenario_fields().items():
        if name in inside:
            for setting in settings(inside[name], f"{name}."):
                plain = name != "mismatch" or setting.key in NO_FACTORS
                yield setting if plain else setting._replace(meaning=f"factor on the true {setting.meaning}")
        elif name in SLOTS:
            yield _slot_setting(SLOTS[name], field)
        elif name == "vehicle":
            yield Setting(name, "required", "name, path, or a vehicle's tables", "", "the vehicle")
        else:
            yield _setting(name, field)


def _slot_setting(slot: Slot[Any], field: FieldInfo) -> Setting:
    """The key of a kind of part."""
    empty = slot.many or slot.optional
    default = "required" if field.is_required() else "none" if empty else f"`{slot.default}`"
    allowed = "list of tables with `kind`" if slot.many else "table with `kind`, or a bare name"
    if slot.shorthand is not None:
        allowed = "table with `kind`, a bare name, or a number"
    return Setting(slot.name, default, allowed, "", slot.about)
