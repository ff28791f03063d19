"""Registered parts, found by name.

Controllers, plants, winds, faults, references, detectors, allocators and sensors each have a `Registry`. What is
registered can be named in a scenario, is listed by ``rotorfault list`` and goes through the conformance tests.
"""

from __future__ import annotations

import difflib
from collections.abc import Callable, Iterator
from typing import Generic, TypeVar

from rotorfault.base.errors import InputError

T = TypeVar("T")


class Registry(Generic[T]):
    """Named parts of one sort.

    Parameters
    ----------
    sort : str
        What its members are, in the singular, for messages: "controller", "wind", ...
    """

    def __init__(self, sort: str) -> None:
        self.sort = sort
        self._members: dict[str, T] = {}

    def register(self, name: str) -> Callable[[T], T]:
        """Decorator that registers a part under a name; the last registration of a name holds."""

        def keep(member: T) -> T:
            self._members[name] = member
            return member

        return keep

    def __iter__(self) -> Iterator[str]:
        return iter(self._members)

    def __contains__(self, name: str) -> bool:
        return name in self._members

    def items(self) -> list[tuple[str, T]]:
        """All names with their parts, in order of registration."""
        return list(self._members.items())

    def summary(self, name: str) -> str:
        """First line of the docstring of a part."""
        return (self._members[name].__doc__ or "").strip().partition("\n")[0]

    def __getitem__(self, name: str) -> T:
        """Find a part.

        Raises
        ------
        InputError
            If there is no such name; the message lists those that exist and the nearest one.
        """
        if name in self._members:
            return self._members[name]
        raise InputError(unknown(self.sort, name, list(self._members)))


def unknown(sort: str, name: object, allowed: list[str]) -> str:
    """One line for a name that does not exist: what came, what is allowed, the nearest."""
    close = difflib.get_close_matches(str(name), allowed, n=1, cutoff=0.5)
    hint = f"; did you mean '{close[0]}'?" if close else ""
    return f"unknown {sort} '{name}'{hint} (allowed: {', '.join(allowed)})"
