"""Losses of rotors as they are typed on the command line."""

from __future__ import annotations

import math
from collections.abc import Sequence

from rotorfault.base.errors import InputError
from rotorfault.maths.geometry import PerRotor


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
    return PerRotor.of(losses.get(number, 0.0) for number in numbers)
