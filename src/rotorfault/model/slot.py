"""Slots: the kinds of parts that a flight has, each with its place, its base class and its registry.

A slot's name is its key in a scenario and the prefix of its parts' signals. What iterates over the parts of a flight
(assembly, sweeps, structure, catalogue, conformance, documentation) iterates over slots; the list of all slots is
`rotorfault.scenario.slots`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Final, Generic, Literal, TypeVar, cast, final

from rotorfault.base.errors import InputError
from rotorfault.base.one_line import LONGEST, cut
from rotorfault.base.registry import Kind, Registry
from rotorfault.model.block import Nothing, Record

B = TypeVar("B")

Side = Literal["task", "truth", "belief"]
"""Of a slot: what is to be done, what is so, what the autopilot makes of it."""


@final
class Slot(Generic[B]):
    """A kind of part.

    Parameters
    ----------
    name : str
        Key in a scenario, such as "wind".
    base : type
        What its parts derive from.
    side : {"task", "truth", "belief"}
    about : str
        One line for the table of a scenario's keys.
    group : str
        Plural for ``rotorfault list``, such as "winds".
    sort : str, optional
        Singular for messages; the name if not given.
    default : str, optional
        Part of a scenario that names none. A slot without default is required, or empty if `optional`.
    many : bool
        Whether a scenario has any number of such parts, in a list.
    optional : bool
        Whether a scenario may have none.
    streams : (int, int), optional
        Words that tell the random numbers of a flight's steps, and of its start, from those of other slots. A slot
        without them has no part that draws.
    shorthand : callable, optional
        Turns what may stand for a table in a scenario (a bare number, say) into the table; leaves the rest alone.
    calm : str, optional
        Part that takes the place of any other where a loop is looked at near hover, such as no wind and no diagnosis;
        empty for no part at all. Not given: a loop keeps its own.
    presets : callable, optional
        Presets of a part by name, each a table of settings.
    inputs : callable, optional
        For the autopilot's slots: the inputs of a part, from what is known at its place in the sampling instant
        (`rotorfault.autopilot.autopilot.Instant`).
    """

    def __init__(
        self,
        name: str,
        base: type[B],
        side: Side,
        about: str,
        group: str,
        *,
        sort: str | None = None,
        default: str | None = None,
        many: bool = False,
        optional: bool = False,
        streams: tuple[int, int] | None = None,
        calm: str | None = None,
        shorthand: Callable[[Any], Any] | None = None,
        presets: Callable[[str], Mapping[str, Mapping[str, Any]]] | None = None,
        inputs: Callable[[Any], Any] | None = None,
    ) -> None:
        self.name: Final = name
        self.base: Final = base
        self.side: Final[Side] = side
        self.about: Final = about
        self.group: Final = group
        self.default: Final = default
        self.many: Final = many
        self.optional: Final = optional
        self.streams: Final = streams
        self.calm: Final = calm
        self.shorthand: Final = shorthand
        self.presets: Final = presets
        self.inputs: Final = inputs
        self.adapt: Callable[[object], Kind[B] | None] | None = None  # makes a kind of what is none by itself
        self.registry: Final[Registry[B]] = Registry(sort or name, name, self.kind_of)
        base.slot = self  # type: ignore[attr-defined]

    def words(self, part: object) -> tuple[int, int]:
        """The words of its streams of random numbers.

        Parameters
        ----------
        part : object
            That draws from them, for the message.

        Raises
        ------
        InputError
            If it has none: numbers of another slot's stream must not serve.
        """
        if self.streams is None:
            raise InputError(
                f"{self.registry.sort} {type(part).__name__} asks for random numbers (normals); parts of the slot "
                f"'{self.name}' get none"
            )
        return self.streams

    def kind_of(self, part: object, where: str) -> Kind[B]:
        """What code from outside the package gives, as a kind of part of this slot.

        Parameters
        ----------
        part : object
            A class of parts, or what can be adapted to one.
        where : str
            Where it is from, for the message.

        Raises
        ------
        InputError
            If it is neither.
        """
        if self.adapt is not None and (adapted := self.adapt(part)) is not None:
            return adapted
        try:
            home = slot_of(part)
        except InputError as error:
            raise InputError(f"{where}: {error}") from None
        if home is not self or not callable(part):
            allowed = f"a class that derives from rotorfault.{self.base.__name__}"
            raise InputError(f"{where} is a {home.registry.sort}; allowed: {allowed}")
        return cast("Kind[B]", part)

    def __repr__(self) -> str:
        return cut(f"<slot {self.name}: {', '.join(self.registry)}>", LONGEST)


Part = TypeVar("Part", bound=type[Any])


def register(name: str) -> Callable[[Part], Part]:
    """Decorator that makes a part available under a name in scenarios and on the command line.

    The class derives from the base of its kind (`Controller`, `Wind`, ...), which says where it belongs. The last
    registration of a name holds.

    Parameters
    ----------
    name : str

    Raises
    ------
    InputError
        If the class derives from no kind of part.
    """

    def keep(part: Part) -> Part:
        slot_of(part).registry.add(name, part)  # type: ignore[arg-type]  # a class of blocks makes them of settings
        return part

    return keep


def slot_of(part: object) -> Slot[Any]:
    """The slot that a part, or a class of parts, belongs to.

    Raises
    ------
    InputError
        If it derives from no kind of part.
    """
    slot = getattr(part, "slot", None)
    if not isinstance(slot, Slot):
        name = getattr(part, "__name__", type(part).__name__)
        raise InputError(
            f"{name} derives from no kind of part; derive it from rotorfault.Controller, Wind, Fault, Estimator ..."
        )
    return slot


def telemetry_of(kind: Kind[Any]) -> type[Record]:
    """Signals that the parts of a kind record."""
    telemetry: type[Record] = getattr(kind, "Telemetry", Nothing)
    return telemetry
