"""Does a part keep the rules that every part keeps? `check_block` flies it and says.

What is checked is what makes a part work everywhere: in every engine with the same numbers, in batches whose flights
differ in its settings, recorded under its own names, and failing where its inputs are no numbers. Every part of
rotorfault goes through the same.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, final

from rotorfault.autopilot.autopilot import AnyBlock
from rotorfault.autopilot.control.python_controller import Updates, as_controller
from rotorfault.base.bounds import require
from rotorfault.base.config import validate
from rotorfault.base.errors import InputError
from rotorfault.base.foreign import is_place, load
from rotorfault.base.one_line import LONGEST, cut
from rotorfault.base.text_table import table_lines
from rotorfault.flight.rules import Check, Rules
from rotorfault.model.block import Block, NoSettings
from rotorfault.model.slot import Slot
from rotorfault.plant.faults import FAULT
from rotorfault.scenario.part import Part, part_from
from rotorfault.scenario.slots import SLOTS


@final
class BlockReport:
    """What `check_block` found.

    Attributes
    ----------
    part : str
        What was checked.
    checks : tuple of Check
        In order.
    """

    def __init__(self, part: str, checks: tuple[Check, ...]) -> None:
        self.part, self.checks = part, checks

    @property
    def kept(self) -> bool:
        """Whether every rule is kept."""
        return all(check.kept for check in self.checks)

    def __str__(self) -> str:
        rows = [(check.rule, "kept" if check.kept else "BROKEN", check.detail) for check in self.checks]
        return "\n".join([self.part, *table_lines(rows, "<<<", indent=2)])

    def __repr__(self) -> str:
        broken = [check.rule for check in self.checks if not check.kept]
        return cut(f"<{self.part}: {'all rules kept' if not broken else 'broken: ' + ', '.join(broken)}>", LONGEST)


def check_block(
    part: str | type[Any] | AnyBlock | Updates | Part[Any], settings: Mapping[str, Any] | None = None
) -> BlockReport:
    """Fly a part and see whether it keeps the rules of a part.

    Parameters
    ----------
    part : str, class, block or Part
        A class that derives from the base of its kind (`rotorfault.Controller`, `Wind`, ...), an object of one, a
        class or an object with the method ``update`` of a plain Python controller, or a place in code
        (``FILE.py:NAME``), which is run.
    settings : mapping, optional
        For a part whose settings have no defaults.

    Returns
    -------
    BlockReport
        Prints as a table.

    Raises
    ------
    InputError
        If a rule is broken; the message names each and what to change.
    """
    require(settings or {}, Mapping, "settings", "a table of settings")
    checked = _part(part, dict(settings or {}))
    report = BlockReport(f"{checked.slot.registry.sort} {checked.kind}", tuple(Rules(checked).checks()))
    if not report.kept:
        broken = "; ".join(f"{check.rule}: {check.detail}" for check in report.checks if not check.kept)
        raise InputError(f"{report.part} breaks the rules of a part: {broken}")
    return report


def _part(part: object, settings: dict[str, Any]) -> Part[Any]:
    if isinstance(part, Part):
        return part
    if isinstance(part, str):
        if not is_place(part):
            raise InputError(f"part: got '{part}'; allowed: a class, an object, or a place such as FILE.py:NAME")
        slot, _ = SLOTS.home_of(load(part, "part"))
        return part_from(slot, {"kind": part, **_some(slot, settings)}, allow=True)
    if not isinstance(part, (type, Block)) and callable(getattr(part, "update", None)):
        part = as_controller(part)
    slot, kind = SLOTS.home_of(part)
    if isinstance(part, Block):
        plain = type(part).__init__ is Block.__init__
        chosen, kind = (part.settings, type(part)) if plain else (NoSettings(), _Made(part))
        return Part(slot, type(part).__name__, chosen, factory=kind)
    name = getattr(part, "__name__", type(part).__name__)
    return Part(slot, name, validate(kind.Settings, _some(slot, settings), name), factory=kind)


@final
class _Made:
    """An object that was not made of settings alone, as a kind of part: nothing of it can be changed."""

    Settings = NoSettings

    def __init__(self, part: AnyBlock) -> None:
        self._part = part
        self.__doc__ = type(getattr(part, "inner", part)).__doc__

    def __call__(self, settings: Any, /) -> AnyBlock:
        """The object."""
        return self._part


def _some(slot: Slot[Any], settings: dict[str, Any]) -> dict[str, Any]:
    """Settings of a part; a fault hits rotor 1 if nobody says which."""
    return {"rotor": 1, **settings} if slot is FAULT else settings
