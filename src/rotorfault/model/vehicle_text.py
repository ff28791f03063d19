"""A vehicle file as text: the head in words, then every number with unit and source."""

from __future__ import annotations

import json
import textwrap
from collections.abc import Iterable, Sequence

from rotorfault.base.one_line import cut
from rotorfault.model.quantities import Quantity

WIDTH = 118
BREAKS = ("mass", "thrust_coefficient")  # keys before which a line is left empty


def vehicle_text(
    name: str,
    description: str,
    head: Iterable[str],
    numbers: Sequence[tuple[str, Quantity]],
    rotors: Iterable[tuple[str, float, float, float, str, str]],
    air: Sequence[tuple[str, Quantity]] = (),
) -> str:
    """The text of a vehicle file.

    Parameters
    ----------
    name, description : str
    head : iterable of str
        What stands above it all as a comment, a paragraph each.
    numbers : sequence of (str, Quantity)
        By key, in the order of the file.
    rotors : iterable of (str, float, float, float, str, str)
        Name, x, y and z in m, "+" or "-" for the yaw torque, source of the place.
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
    for label, x, y, z, yaw, source in rotors:
        lines += ["", "[[rotor]]", f"name = {_text(label)}"]
        # A height is there for what the air does alone, and 0 if not given.
        for key, value in (("x", x), ("y", y), *((("z", z),) if z else ())):
            lines.append(f"{key} = {_inline(Quantity(value=value, unit='m', source=source))}")
        lines.append(f"yaw = {_text(yaw)}")
    return "\n".join(lines) + "\n"


def _inline(quantity: Quantity) -> str:
    # A number in TOML has a point or an exponent to be a float; repr gives all digits that count.
    number = repr(float(quantity.value)).replace("e-0", "e-")
    return f"{{ value = {number}, unit = {_text(quantity.unit)}, source = {_text(quantity.source)} }}"


def _text(text: str) -> str:
    """A basic string of TOML, in which JSON's escapes mean the same."""
    return json.dumps(cut(text, 400), ensure_ascii=False).replace("\x7f", "\\u007f")
