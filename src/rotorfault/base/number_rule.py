"""What counts as a number, at every door: one rule, one wording.

A text that reads like a number is none, and neither is a truth value: who writes ``duration = "0_1"`` or
``position = [true, 0, 1]`` has made a mistake that must not fly. Numbers of NumPy are numbers like any others.
"""

from __future__ import annotations

import math
import re
from numbers import Real
from typing import Any, cast

from pydantic_core import CoreSchema, PydanticCustomError, core_schema

from rotorfault.base.errors import short as short

OWN = "rotorfault"
"""Marks the errors that say by themselves what came and what is allowed."""

_PLAIN = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)
_APART = ("metadata", "default", "serialization", "expected", "cls", "config", "ref")  # hold no schemas


def refusal(key: str, message: str) -> PydanticCustomError:
    """The error to raise in a validator when `message` says all: what came, what is allowed, how to mend it.

    Parameters
    ----------
    key : str
        The key below the validated object that is at fault; empty for the object itself.
    message : str
        One line.
    """
    return PydanticCustomError(OWN, "{message}", {"message": message, "key": key})


def plain_number(text: str) -> float:
    """The finite number that a text writes in digits, with a decimal point or exponent; NaN if it is none.

    Stricter than Python's own `float`, which takes ``1_000``, ``nan`` and digits of any script.

    Parameters
    ----------
    text : str
    """
    number = float(text) if _PLAIN.fullmatch(text) else math.nan
    return number if math.isfinite(number) else math.nan


def number(value: object) -> int | float:
    """A number as Python's own, of one of Python or NumPy.

    Parameters
    ----------
    value : object

    Raises
    ------
    PydanticCustomError
        If it is none; says what came.
    """
    found = _unwrapped(value)
    if isinstance(found, bool) or not isinstance(found, Real):
        reads = isinstance(found, str) and not math.isnan(plain_number(found.strip()))
        hint = ", without quotation marks" if reads else ""
        raise refusal("", f"got {_told(found)}; allowed: a number{hint}")
    if isinstance(found, int):
        return found
    return float(found)


def real(value: object) -> float:
    """A number as a float; see `number`."""
    found = number(value)
    try:
        return float(found)
    except OverflowError:
        raise refusal("", f"got {short(found)}; allowed: a finite number, up to 1.8e308") from None


def truth(value: object) -> bool:
    """A truth value as Python's own.

    Raises
    ------
    PydanticCustomError
        If it is none; says what came.
    """
    found = _unwrapped(value)
    if not isinstance(found, bool):
        raise refusal("", f"got {_told(found)}; allowed: true or false")
    return found


def number_or_text(value: object) -> Any:
    """A number as Python's own, or a text."""
    found = _unwrapped(value)
    if isinstance(found, bool) or not isinstance(found, (str, Real)):
        raise refusal("", f"got {_told(found)}; allowed: a number or a text")
    return found if isinstance(found, (str, int)) else float(found)


def _unwrapped(value: object) -> object:
    """What a scalar of NumPy, or an array of no dimension, holds."""
    if isinstance(value, (int, float, str)) and type(value).__module__ == "builtins":
        return value
    item = getattr(value, "item", None)
    return item() if callable(item) and getattr(value, "shape", None) == () else value


def _told(value: object) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    return f"the text {short(value)}" if isinstance(value, str) else short(value)


def strict(schema: CoreSchema) -> CoreSchema:
    """The schema of a configuration, with this module's rule at every number and truth value in it.

    Parameters
    ----------
    schema : CoreSchema
        Of pydantic; changed in place.
    """
    return cast("CoreSchema", _strict(schema))


def _strict(schema: Any) -> Any:
    if isinstance(schema, list):
        return [_strict(one) for one in schema]
    if isinstance(schema, tuple):
        return tuple(_strict(one) for one in schema)
    if not isinstance(schema, dict):
        return schema
    kind = schema.get("type")
    if kind == "function-before" and schema["function"].get("function") in _RULES.values():
        return schema  # of a model within this one, which has the rule already
    if kind == "union" and {"float", "str"} <= {
        one.get("type") for one in schema["choices"] if isinstance(one, dict)
    }:
        choices = [
            {**one, "strict": True} if one.get("type") in ("float", "int") else one for one in schema["choices"]
        ]
        return core_schema.no_info_before_validator_function(number_or_text, {**schema, "choices": choices})
    if isinstance(kind, str) and kind in _RULES:
        return core_schema.no_info_before_validator_function(_RULES[kind], cast("CoreSchema", schema))
    for key, value in schema.items():
        if key not in _APART:
            schema[key] = _strict(value)
    return schema


_RULES = {"float": real, "int": number, "bool": truth}
