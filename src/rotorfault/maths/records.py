"""Records of scalars: flatten to rows of an array, and back.

A *record* is a NamedTuple whose fields are scalars, value types (`rotorfault.maths.geometry`), records, or what has
no numbers (`Static`). What flows through the closed loop (state, memory, inputs, parameters, signals) is made of
records, so that one generic function turns any of it into rows of an array for the batch engines, and names every
row.

A NamedTuple's ``+`` concatenates: records carry data, value types carry algebra.
"""

from __future__ import annotations

from collections import namedtuple
from collections.abc import Iterator
from functools import lru_cache
from typing import Any, TypeVar

from rotorfault.maths.geometry import Value
from rotorfault.maths.scalar import Scalar, select

R = TypeVar("R")


class Static:
    """What a record says without numbers, such as which rotors are opposite; the same in all flights of a batch.

    It has no leaves, and stays as it is wherever the record goes. Two that say the same are equal.
    """

    __slots__ = ()


def _parts(record: Any) -> Iterator[tuple[str, Any]] | None:
    """Name and value of each direct part, or None for a leaf."""
    if isinstance(record, Value):
        return zip(record.names, record, strict=True)
    if isinstance(record, Static):
        return iter(())
    if isinstance(record, tuple):
        names = getattr(record, "_fields", None) or (str(i) for i in range(len(record)))
        return zip(names, record, strict=True)
    return None


def flatten(record: Any) -> list[Scalar]:
    """All scalars of a record, depth first, in the order of the fields.

    Parameters
    ----------
    record : scalar, value type, NamedTuple or tuple of these

    Returns
    -------
    list of scalars
    """
    leaves: list[Scalar] = []
    _collect(record, leaves)
    return leaves


def _collect(record: Any, leaves: list[Scalar]) -> None:
    """Append the scalars of a record. Every step of a flight on floats comes here many times."""
    if isinstance(record, tuple):
        for part in record:
            _collect(part, leaves)
    elif isinstance(record, Value):
        leaves.extend(record)
    elif not isinstance(record, Static):
        leaves.append(record)


def leaf_names(record: Any, prefix: str = "") -> list[str]:
    """Dotted name of each scalar that `flatten` returns, such as ``body.p_W.x``."""
    parts = _parts(record)
    if parts is None:
        return [prefix]
    return [leaf for name, part in parts for leaf in leaf_names(part, f"{prefix}.{name}" if prefix else name)]


def unflatten(template: R, leaves: Iterator[Scalar] | list[Scalar]) -> R:
    """Rebuild a record like `template` from scalars in the order of `flatten`.

    Parameters
    ----------
    template : record
        Gives the shape; its own numbers are ignored.
    leaves : iterator or list of scalars

    Raises
    ------
    ValueError
        If there are fewer leaves than the template has.
    """
    source = iter(leaves)

    def build(part: Any) -> Any:
        if isinstance(part, tuple):
            values = [build(inner) for inner in part]
            return _tuple_like(part, values)
        if isinstance(part, Value):
            return type(part)(*[next(source) for _ in part.names])
        return part if isinstance(part, Static) else next(source)

    try:
        return build(template)  # type: ignore[no-any-return]
    except StopIteration:
        raise ValueError("fewer scalars than the record has fields") from None


def _tuple_like(record: Any, values: list[Any]) -> Any:
    """A NamedTuple of the same type, or a tuple."""
    return type(record)._make(values) if hasattr(record, "_fields") else tuple(values)


def statics(record: Any) -> list[Static]:
    """All that a record says without numbers, depth first."""
    if isinstance(record, Static):
        return [record]
    parts = _parts(record)
    return [] if parts is None else [one for _, part in parts for one in statics(part)]


def select_record(condition: Scalar, a: R, b: R) -> R:
    """`rotorfault.maths.scalar.select` on every scalar of two records of the same shape."""
    return _selected(condition, a, b)  # type: ignore[no-any-return]


def _selected(condition: Scalar, a: Any, b: Any) -> Any:
    if a is b:
        return a
    if isinstance(a, tuple):
        values = [_selected(condition, *pair) for pair in zip(a, b, strict=True)]
        return _tuple_like(a, values)
    if isinstance(a, Value):
        pairs = zip(a, b, strict=True)
        return type(a)(*[one if one is other else select(condition, one, other) for one, other in pairs])
    return select(condition, a, b)


@lru_cache(maxsize=256)
def record_type(name: str, fields: tuple[str, ...]) -> Any:
    """A type of record whose fields are known only when a flight is put together, such as the parts of its loop.

    Parameters
    ----------
    name : str
        Of the type, for messages.
    fields : tuple of str
        Names of its fields, in order.
    """
    return namedtuple(name, fields)
