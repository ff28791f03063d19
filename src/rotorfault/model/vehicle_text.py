"""A vehicle file as text: the head in words, then every number with unit and source."""

from __future__ import annotations

import json
import textwrap
from collections.abc import Iterable, Sequence
from typing import NamedTuple

from rotorfault.base.one_line import cut
from rotorfault.model.quantities import Quantity, RotorQuantity, TripleQuantity

WIDTH = 118
BREAKS = ("mass", "thrust_coefficient")  # keys before which a line is left empty


class RotorText(NamedTuple):
    """What a vehicle file says of a rotor."""

    name: str
    x: float  # m
    y: float  # m
    yaw: str  # "+" or "-"
    source: str  # of the place
    z: float | None = None  # m; not written where it is None
    axis: tuple[float, float, float] | None = None  # unit vector; not written where it is None


def vehicle_text(
    name: str,
    description: str,
    head: Iterable[str],
    numbers: Sequence[tuple[str, Quantity | RotorQuantity]],
    rotors: Iterable[RotorText],
    air: Sequence[tuple[str, Quantity]] = (),
) -> str:
    """The text of a vehicle file.

    Parameters
    ----------
    name, description : str
    head : iterable of str
        What stands above it all as a comment, a paragraph each.
    numbers : sequence of (str, Quantity or RotorQuantity)
        By key, in the order of the file.
    rotors : iterable of RotorText
    air : sequence of (str, Quantity), optional
        Numbers of the table ``[air]``, by key.
    """
    lines = []
    for paragraph in head:
        plain = " ".join("".join(c if c.isprintable() else " " for c in paragraph).split())
        lines += textwrap.wrap(plain, WIDTH, initial_indent="# ", subsequent_indent="# ")
    lines += ["", f"name = {_text(name)}", f"description = {_text(description)}"]
    for key, quantity in numbers:
        lines += [""] * (key in BREAKS)
        lines.append(f"{key} = {_inline(quantity)}")
    lines += ["", "[air]"] if air else []
    lines += [f"{key} = {_inline(quantity)}" for key, quantity in air]
    for rotor in rotors:
        lines += ["", "[[rotor]]", f"name = {_text(rotor.name)}"]
        for key, value in (("x", rotor.x), ("y", rotor.y), ("z", rotor.z)):
            if value is not None:
                lines.append(f"{key} = {_inline(Quantity(value=value, unit='m', source=rotor.source))}")
        lines.append(f"yaw = {_text(rotor.yaw)}")
        if rotor.axis is not None:
            lines.append(f"axis = {_inline(TripleQuantity(value=rotor.axis, unit='1', source=rotor.source))}")
    return "\n".join(lines) + "\n"


def _inline(quantity: Quantity | RotorQuantity | TripleQuantity) -> str:
    value = quantity.value
    text = f"[{', '.join(map(_number, value))}]" if isinstance(value, tuple) else _number(value)
    return f"{{ value = {text}, unit = {_text(quantity.unit)}, source = {_text(quantity.source)} }}"


def _number(value: float) -> str:
    # A number in TOML has a point or an exponent to be a float; repr gives all digits that count.
    return repr(float(value)).replace("e-0", "e-")


def _text(text: str) -> str:
    """A basic string of TOML, in which JSON's escapes mean the same."""
    return json.dumps(cut(text, 400), ensure_ascii=False).replace("\x7f", "\\u007f")
