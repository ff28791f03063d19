"""Losses of rotors, and failed motors, as they are typed on the command line."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from rotorfault.base.errors import InputError
from rotorfault.maths.geometry import PerRotor
from rotorfault.model.frames import Frame


def parse_losses(pairs: Sequence[str], rotors: int) -> PerRotor:
    """Losses of so many rotors from ``R=VALUE`` texts, 0 for rotors that are not named.

    Raises
    ------
    InputError
        If a text is no such pair, there is no such rotor, a value is not in 0 to 1, or a rotor comes twice.
    """
    numbers = [str(number) for number in range(1, rotors + 1)]
    losses: dict[str, float] = {}
    for pair in pairs:
        rotor, _, text = (part.strip() for part in pair.partition("="))
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if rotor not in numbers or not 0.0 <= value <= 1.0:
            raise InputError(
                f"--loss {pair}: allowed: R=VALUE with rotor 1 to {rotors} and loss 0 to 1, such as 1=0.4"
            )
        if rotor in losses:
            raise InputError(f"--loss {pair}: rotor {rotor} has a loss already; allowed: one for each rotor")
        losses[rotor] = value
    return PerRotor.of(losses.get(rotor, 0.0) for rotor in numbers)


def parse_failed(text: str, frames: Iterable[Frame]) -> tuple[int, ...]:
    """Numbers of failed motors as they are typed, such as ``1,4``.

    Parameters
    ----------
    text : str
    frames : iterable of Frame
        That must have these motors.

    Raises
    ------
    InputError
        If it is no list of different numbers, or a frame lacks one.
    """
    words = [word.strip() for word in text.split(",")]
    numbers = [int(word) if word.isascii() and word.isdigit() and len(word) < 4 else 0 for word in words]
    if min(numbers) < 1 or len(set(numbers)) < len(numbers):
        raise InputError(f"--failed {text}: allowed: different numbers of motors with commas between, such as 1,4")
    for frame in frames:
        if max(numbers) > len(frame.motors):
            raise InputError(
                f"--failed {text}: {frame.name} has motors 1 to {len(frame.motors)}, numbered by "
                f"{' and '.join(frame.conventions)}; allowed: those, or name frames with more motors"
            )
    return tuple(sorted(numbers))
