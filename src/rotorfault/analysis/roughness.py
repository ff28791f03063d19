"""Why a loop has no derivative in hover, or no rest: a law that jumps, a rotor at its limit, or neither."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rotorfault.base.config import Strict
from rotorfault.maths.arrays import ANGLES, Array
from rotorfault.maths.geometry import Vec3, spread
from rotorfault.model.mixer import hover_thrust, nominal_inverse
from rotorfault.model.signals import Wrench
from rotorfault.model.vehicle import Vehicle
from rotorfault.model.vehicle_check import most_torque

JUMPS = "discontinuous"  # what a setting says whose law jumps
NEAR = 1e-6  # of the largest command: how near to a limit a command is at it


def why_rough(parts: Sequence[Any], vehicle: Vehicle, hover: Array, deviated: Array, name: str, step: float) -> str:
    """The reason, and what mends it, for a message.

    Parameters
    ----------
    parts : sequence of block
        Of the loop.
    vehicle : Vehicle
    hover : ndarray, shape (4, 1)
        Wrench that the commands ask for in hover: N, N m about the body axes.
    deviated : ndarray, shape (4, states)
        The same where one state at a time deviates by `step`.
    name : str
        State whose deviation is answered least smoothly.
    step : float
        In the unit of each state: m, rad, ...
    """
    jumps = [f"{key} = '{JUMPS}'" for part in parts for key in _settings_that_jump(part)]
    if jumps:
        return f"{' and '.join(dict.fromkeys(jumps))} jumps; choose 'smooth'"
    limits = _limits(vehicle)
    if at_rest := limit_in_hover(vehicle, hover):
        return at_rest
    if _at_limit(vehicle, deviated).any():
        most = [most_torque(vehicle, hover_thrust(vehicle), Vec3.of(unit)) for unit in np.eye(3).tolist()]
        share = np.abs(deviated - hover)[1:].max(axis=1) / np.maximum(most, 1e-300)
        worst = int(np.argmax(share))
        return (
            f"a deviation of {step:g} already drives a rotor to its limit ({limits}), for lack of torque about "
            f"{ANGLES[worst]}: hover leaves {most[worst]:.3g} N m; these gains ask for more than the vehicle can give"
        )
    return f"it answers to a deviation of {step:g} in {name} otherwise than to a quarter of it"


def limit_in_hover(vehicle: Vehicle, asked: Array) -> str:
    """Which rotors are at a limit in hover, for a message; empty if none is.

    Parameters
    ----------
    vehicle : Vehicle
    asked : ndarray, shape (4, 1)
        Wrench that the commands ask for: N, N m about the body axes.
    """
    rotors = ", ".join(str(i) for i in np.flatnonzero(_at_limit(vehicle, asked)[:, 0]) + 1)
    line = f"in hover the command of rotor {rotors} is at its limit ({_limits(vehicle)}); check mass and thrust_max"
    return line if rotors else ""


def _limits(vehicle: Vehicle) -> str:
    low, high = (spread(limit, vehicle.rotors) for limit in (vehicle.thrust_min, vehicle.thrust_max))
    return f"{min(low):g} to {max(high):g} N"


def _at_limit(vehicle: Vehicle, asked: Array) -> NDArray[np.bool_]:
    """Which commands are at a limit, from the wrench that they give, shape (rotors, columns)."""
    thrust = nominal_inverse(vehicle, Wrench(asked[0], Vec3(asked[1], asked[2], asked[3])))
    command = np.array(list(thrust / vehicle.rotor_gain))
    low, high = (np.array([*spread(x, vehicle.rotors)])[:, None] for x in (vehicle.thrust_min, vehicle.thrust_max))
    at: NDArray[np.bool_] = (command <= low + NEAR * high) | (command >= high - NEAR * high)
    return at


def _settings_that_jump(part: object) -> Iterator[str]:
    """Keys of settings, of a part and of what it is made of, that choose a law that jumps."""
    inner = [(f"{name}.", one) for name, one in vars(part).items() if hasattr(one, "settings")]
    for above, owner in [("", part), *inner]:
        settings = getattr(owner, "settings", None)
        for key, value in dict(settings).items() if isinstance(settings, Strict) else ():
            if value == JUMPS:
                yield f"{above}{key}"
