"""Registered parts, found by name.

Each kind of part has a `Registry`. What is registered can be named in a scenario, is listed by ``rotorfault list``
and goes through the conformance tests. Parts of other packages are found by their entry point of the group
``rotorfault.parts``, whose name is the slot and the part's name: ``wind.gust-front = "package.module:GustFront"``.
They are imported when they are first asked for.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import lru_cache
from importlib import metadata
from typing import Any, Generic, Protocol, TypeVar, cast

from rotorfault.base.config import Strict
from rotorfault.base.errors import InputError, unknown
from rotorfault.base.one_line import LONGEST, cut

ENTRY_POINTS = "rotorfault.parts"

B = TypeVar("B")
B_co = TypeVar("B_co", covariant=True)


class Kind(Protocol[B_co]):
    """What makes a part from its settings: a class with `Settings`, or anything that is called like one."""

    @property
    def Settings(self) -> type[Strict]:
        """What a user may choose."""

    def __call__(self, settings: Any, /) -> B_co:
        """Make the part."""


class Registry(Generic[B]):
    """Named parts of one kind.

    Parameters
    ----------
    sort : str
        What its members are, in the singular, for messages: "controller", "wind", ...
    slot : str, optional
        Name of the slot, by which entry points name it; `sort` if not given.
    accept : callable, optional
        Makes a kind of part of what an entry point leads to, and raises InputError where it is none; gets the object
        and words for it in a message. Not given: anything is taken as it is.
    """

    def __init__(
        self, sort: str, slot: str | None = None, accept: Callable[[object, str], Kind[B]] | None = None
    ) -> None:
        self.sort = sort
        self._slot = sort if slot is None else slot
        self._accept = accept
        self._members: dict[str, Kind[B]] = {}

    def __repr__(self) -> str:
        return cut(f"<registry of {self.sort}: {', '.join(self)}>", LONGEST)

    def add(self, name: str, kind: Kind[B]) -> None:
        """Register a part under a name; the last registration of a name holds."""
        self._members[name] = kind

    def remove(self, name: str) -> None:
        """Forget a part, as tests do with parts of their own."""
        self._members.pop(name, None)

    def _names(self) -> list[str]:
        return [*self._members, *(name for name in _outside(self._slot) if name not in self._members)]

    def __iter__(self) -> Iterator[str]:
        return iter(self._names())

    def __contains__(self, name: object) -> bool:
        return name in self._members or name in _outside(self._slot)

    def __len__(self) -> int:
        return len(self._names())

    def items(self) -> list[tuple[str, Kind[B]]]:
        """All names with their parts, in order of registration."""
        return [(name, self[name]) for name in self]

    def present(self) -> list[tuple[str, Kind[B]]]:
        """Names with their parts, without those of other packages that nobody has asked for yet."""
        return list(self._members.items())

    def summary(self, name: str) -> str:
        """First line of the docstring of a part."""
        return (self[name].__doc__ or "").strip().partition("\n")[0]

    def __getitem__(self, name: str) -> Kind[B]:
        """Find a part.

        Raises
        ------
        InputError
            If there is no such name (the message lists those that exist and the nearest one), or an entry point
            cannot be loaded or leads to no part of this kind.
        """
        if name in self._members:
            return self._members[name]
        if name in _outside(self._slot):
            point = _outside(self._slot)[name]
            part = _loaded(point)
            where = f"entry point {point.name} = {point.value}"
            self._members[name] = cast("Kind[B]", part) if self._accept is None else self._accept(part, where)
            return self._members[name]
        raise InputError(unknown(self.sort, name, list(self)))


@lru_cache(maxsize=64)
def _outside(slot: str) -> dict[str, metadata.EntryPoint]:
    """Entry points of other packages for a slot, by the part's name."""
    points = _entry_points()
    return {name.partition(".")[2]: point for name, point in points.items() if name.partition(".")[0] == slot}


@lru_cache(maxsize=1)
def _entry_points() -> dict[str, metadata.EntryPoint]:
    return {point.name: point for point in metadata.entry_points(group=ENTRY_POINTS)}


def _loaded(point: metadata.EntryPoint) -> object:
    try:
        part: object = point.load()
    except Exception as error:
        raise InputError(
            f"entry point {point.name} = {point.value}: {type(error).__name__}: {' '.join(str(error).split())}; "
            "mend or uninstall the package that brings it"
        ) from error
    return part
