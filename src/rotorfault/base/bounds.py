"""Bounds on what is accepted as work, told before it begins: nesting, threads, numbers of things."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from pydantic_core import PydanticCustomError

from rotorfault.base.errors import InputError, short
from rotorfault.base.number_rule import real

MOST_DEPTH = 40  # of tables and lists in each other; a scenario with everything in it has five
MOST_THREADS = 1024  # and processes: more than any machine of today has processors


def require_shallow(data: Any, where: str) -> None:
    """Refuse tables and lists that are nested deeper than anything of this program, or hold themselves.

    Parameters
    ----------
    data : object
    where : str
        Its origin, for the message.

    Raises
    ------
    InputError
        If they are.
    """
    level = [data]
    for _ in range(MOST_DEPTH):
        level = [
            inner
            for outer in level
            if isinstance(outer, (Mapping, list, tuple))
            for inner in (outer.values() if isinstance(outer, Mapping) else outer)
            if isinstance(inner, (Mapping, list, tuple))
        ]
        if not level:
            return
    raise too_deep(where)


def too_deep(where: str) -> InputError:
    """What to raise where tables or lists are nested too deeply.

    Parameters
    ----------
    where : str
        Their origin.
    """
    place = f"{where}: " if where else ""
    return InputError(f"{place}tables or lists are nested deeper than {MOST_DEPTH} levels; take some of them away")


def require(value: object, kinds: type | tuple[type, ...], name: str, allowed: str) -> None:
    """Refuse what is of another type than a function can use, before it is used.

    Parameters
    ----------
    value : object
    kinds : type or tuple of type
    name, allowed : str
        For the message: what it is called, and what may be given.

    Raises
    ------
    InputError
        If it is none of these kinds.
    """
    if not isinstance(value, kinds):
        raise InputError(f"{name}: got {short(value)}; allowed: {allowed}")


def whole_number(value: object, name: str, least: int, most: int) -> int:
    """A whole number within bounds.

    Parameters
    ----------
    value : object
        A number of Python or NumPy.
    name : str
        What it is called, for the message.
    least, most : int
        Both are allowed.

    Raises
    ------
    InputError
        If it is anything else.
    """
    item = getattr(value, "item", None)
    found = item() if callable(item) and getattr(value, "shape", None) == () else value
    if isinstance(found, bool) or not isinstance(found, int) or not least <= found <= most:
        raise InputError(f"{name}: got {short(value)}; allowed: a whole number from {least} to {most:,}")
    return found


def positive(value: object, name: str, unit: str, most: float = math.inf) -> float:
    """A finite number above 0.

    Parameters
    ----------
    value : object
        A number of Python or NumPy.
    name, unit : str
        For the message.
    most : float
        Is allowed.

    Raises
    ------
    InputError
        If it is anything else.
    """
    try:
        found = real(value)
    except PydanticCustomError:
        found = math.nan
    if not (0.0 < found <= most and math.isfinite(found)):
        until = f", up to {most:g}" if math.isfinite(most) else ""
        number = "a number" if unit == "1" else f"a number of {unit}"
        raise InputError(f"{name}: got {short(value)}; allowed: {number} above 0{until}")
    return found


def thread_count(value: object, name: str = "threads") -> int | None:
    """A number of threads or processes; None for one per processor.

    Parameters
    ----------
    value : object
    name : str
        What it is called, for the message.

    Raises
    ------
    InputError
        If it is no such number.
    """
    return None if value is None else whole_number(value, name, 1, MOST_THREADS)
