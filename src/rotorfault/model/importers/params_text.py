"""Parameter files of autopilots: lists of names and values in the dialects that ground stations write.

- QGroundControl (PX4): five columns, vehicle, component, name, value, type.
- Mission Planner, MAVProxy (ArduPilot): a name and a value, with a comma or blanks between.
- Start scripts of PX4's airframes: ``param set NAME VALUE`` and ``param set-default NAME VALUE``.

What follows a ``#`` is a comment. A name that comes twice has its last value, as in autopilots.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np

from rotorfault.base.config import read_text
from rotorfault.base.errors import InputError
from rotorfault.model.importers.numbers import finite

NAME = re.compile(r"[A-Z][A-Z0-9_]{1,19}")
MOST_LINES = 20_000  # a complete list of an autopilot has about 1,500


class Params(NamedTuple):
    """Parameters of an autopilot, as its file has them."""

    where: str  # the file's name
    texts: Mapping[str, str]  # values by name, as they are written

    def has(self, name: str) -> bool:
        """Whether the file has a parameter."""
        return name in self.texts

    def number(self, name: str, default: float | None = None) -> float:
        """A parameter, to the digits that single precision has, in which autopilots keep it.

        Parameters
        ----------
        name : str
        default : float, optional
            The autopilot's own value of what the file leaves out.

        Raises
        ------
        InputError
            If the file does not have it and there is no default, or it is no finite number.
        """
        if name not in self.texts:
            if default is None:
                raise InputError(f"{self.where}: has no {name}; save all parameters of the vehicle and give that")
            return default
        value = finite(self.texts[name], name, self.where)
        if abs(value) > 1e30:
            raise InputError(f"{self.where}: {name} is {value:g}; allowed: up to 1e30 either way")
        return float(str(np.float32(value)))

    def whole(self, name: str, default: int | None = None) -> int:
        """A parameter that is a whole number; raises InputError as `number` does, and if it is none."""
        value = self.number(name, None if default is None else float(default))
        if value != int(value):
            raise InputError(f"{self.where}: {name} is {value:g}; allowed: a whole number")
        return int(value)


def read_params(path: str | Path) -> Params:
    """Read a parameter file.

    Parameters
    ----------
    path : str or Path

    Raises
    ------
    InputError
        If it cannot be read, or a line is no parameter; one line that says which.
    """
    where, lines = Path(path).name, read_text(path).splitlines()
    if len(lines) > MOST_LINES:
        raise InputError(
            f"{path}: has {len(lines):,} lines; allowed: up to {MOST_LINES:,}, more than an autopilot has"
        )
    script = bool(lines) and lines[0].startswith("#!")
    texts: dict[str, str] = {}
    for number, line in enumerate(lines, start=1):
        words = re.split(r"[\s,]+", line.partition("#")[0].strip("\ufeff \t\r,"))
        if words[:2] in (["param", "set"], ["param", "set-default"]):
            words = words[2:]
        elif len(words) == 5:
            words = words[2:4]
        elif words == [""] or script:
            continue
        if len(words) < 2 or not NAME.fullmatch(words[0]):
            raise InputError(
                f"{path}: line {number} is {' '.join(words)[:60]!r}; allowed: a parameter's name and value, as "
                "QGroundControl, Mission Planner and MAVProxy write them"
            )
        texts[words[0]] = words[1]
    if not texts:
        raise InputError(f"{path}: holds no parameters; save those of the vehicle with your ground station")
    return Params(where, texts)
