r"""Vehicles from parameters of ArduPilot, and the parameters of a vehicle for ArduPilot.

ArduPilot knows a copter by ``FRAME_CLASS`` and ``FRAME_TYPE``: where its motors are and how they turn, without
lengths, so the arm is to be given. ``MOT_THST_HOVER`` is the thrust in hover, 0 to 1, of the range that motors have
from ``MOT_SPIN_MIN`` to ``MOT_SPIN_MAX``. A signal u gives the thrust :math:`(1-e)u+eu^2` of full thrust, e being
``MOT_THST_EXPO``. Both ends of the range are put through it; the greatest thrust is that at ``MOT_SPIN_MAX``.

Sources: ArduPilot's parameter reference; its `AP_MotorsMatrix` for the frames, its `AP_Motors_Thrust_Linearization`
for the range.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import NamedTuple

from rotorfault.base.errors import InputError
from rotorfault.model.frames import ALIASES, FRAMES
from rotorfault.model.importers.draft import Draft
from rotorfault.model.importers.frame_match import distance, number_of
from rotorfault.model.importers.numbers import quantity
from rotorfault.model.importers.params_text import Params, read_params
from rotorfault.model.vehicle_file import VehicleFile

BY_NUMBERS = {
    (int(kind), int(type_)): name
    for alias, name in ALIASES.items()
    if alias.startswith("ardupilot-")
    for kind, type_ in [alias.split("-")[1:]]
}
"""Names of frames by FRAME_CLASS and FRAME_TYPE."""
RANGES = {
    "MOT_THST_EXPO": (-1.0, 1.0),
    "MOT_SPIN_MIN": (0.0, 0.5),
    "MOT_SPIN_MAX": (0.5, 1.0),
    "MOT_THST_HOVER": (0.05, 0.95),
}


class ArduPilotParams(NamedTuple):
    """A vehicle as ArduPilot knows it."""

    text: str  # of the parameter file
    frame: str  # name of the frame
    numbers: tuple[int, ...]  # of ArduPilot's motors, by rotor of the vehicle
    away: float  # how far a rotor is at most from where ArduPilot has its motor, in longest arms


def read_ardupilot(path: str | Path) -> Draft:
    """What a parameter file of ArduPilot says of its copter.

    Parameters
    ----------
    path : str or Path
        As Mission Planner, QGroundControl or MAVProxy save it.

    Raises
    ------
    InputError
        If it cannot be read, or its frame is none that is known here.
    """
    params = read_params(path)
    where = params.where
    kind, type_ = params.whole("FRAME_CLASS"), params.whole("FRAME_TYPE")
    if (kind, type_) not in BY_NUMBERS:
        types = ", ".join(str(t) for k, t in sorted(BY_NUMBERS) if k == kind)
        classes = ", ".join(map(str, sorted({k for k, _ in BY_NUMBERS})))
        allowed = f"FRAME_TYPE {types} of this class" if types else f"FRAME_CLASS {classes}"
        raise InputError(f"{where}: FRAME_CLASS is {kind}, FRAME_TYPE {type_}; allowed: {allowed}")
    about = f"{where}, parameters of ArduPilot"
    source = f"{where}: FRAME_CLASS {kind}, FRAME_TYPE {type_}"
    hover, least = _shares(params)
    known = {}
    if params.has("MOT_THST_EXPO"):
        expo = params.number("MOT_THST_EXPO")
        known["thrust_curve"] = quantity("thrust_curve", expo, f"{where}: MOT_THST_EXPO")
    return Draft(where, about, (), known, FRAMES[BY_NUMBERS[kind, type_]], source, hover, least)


def ardupilot_params(vehicle: VehicleFile) -> ArduPilotParams:
    """Parameters of a vehicle for ArduPilot, and which of its motors each rotor is.

    Parameters
    ----------
    vehicle : VehicleFile

    Raises
    ------
    InputError
        If ArduPilot has no frame with motors near its rotors that turn so.
    """
    if vehicle.rotor_set.tilted:
        raise InputError(
            f"{vehicle.name}: has tilted rotors, and no frame of ArduPilot has any; export to px4, which takes them"
        )
    fits = {
        name: numbers for name in BY_NUMBERS.values() if (numbers := number_of(vehicle, FRAMES[name])) is not None
    }
    if not fits:
        raise InputError(
            f"{vehicle.name}: no frame of ArduPilot has motors where its {len(vehicle.rotor)} rotors are, that turn "
            "as they do; compare with 'rotorfault frames', or export to px4, which takes any geometry"
        )
    order = tuple(range(1, len(vehicle.rotor) + 1))
    # The nearest; of those that are as near, the one that counts the motors as the vehicle does.
    best = min(fits, key=lambda name: (round(distance(vehicle, FRAMES[name], fits[name]), 3), fits[name] != order))
    kind, type_ = next(numbers for numbers, name in BY_NUMBERS.items() if name == best)
    hover = 1.0 / vehicle.thrust_to_weight
    motors = ", ".join(f"{rotor} is motor {number}" for rotor, number in enumerate(fits[best], start=1))
    lines = [
        f"# Vehicle '{vehicle.name}', written by rotorfault for ArduPilot: frame {best}, thrust in hover, no gains.",
        f"# By its rotors: {motors}. Compare each with the vehicle before it flies.",
        f"FRAME_CLASS,{kind}",
        f"FRAME_TYPE,{type_}",
        f"MOT_THST_HOVER,{hover:.9g}",
    ]
    if vehicle.thrust_curve is not None:
        lines.append(f"MOT_THST_EXPO,{vehicle.thrust_curve.value:.9g}")
    return ArduPilotParams("\n".join(lines) + "\n", best, fits[best], distance(vehicle, FRAMES[best], fits[best]))


def _shares(params: Params) -> tuple[tuple[float, str] | None, tuple[float, str] | None]:
    """Thrust in hover and least thrust over the greatest, each with its source."""
    for name, (low, high) in RANGES.items():
        if params.has(name) and not low <= params.number(name) <= high:
            raise InputError(f"{params.where}: {name} is {params.number(name):g}; allowed: {low:g} to {high:g}")
    expo, least = params.number("MOT_THST_EXPO", 0.0), params.number("MOT_SPIN_MIN", 0.0)
    most = params.number("MOT_SPIN_MAX", 1.0)

    def thrust(signal: float) -> float:
        return (1.0 - expo) * signal + expo * signal**2

    named = [name for name in ("MOT_THST_EXPO", "MOT_SPIN_MIN", "MOT_SPIN_MAX") if params.has(name)]
    through = f" through {', '.join(named)}" if named else ""
    lowest = (thrust(least) / thrust(most), f"{params.where}: MOT_SPIN_MIN{through}") if least > 0.0 else None
    if not params.has("MOT_THST_HOVER"):
        return None, lowest
    asked = params.number("MOT_THST_HOVER")
    # The signal in its range that the curve turns into this thrust.
    root = math.sqrt((1.0 - expo) ** 2 + 4.0 * expo * asked)
    signal = 2.0 * asked / (1.0 - expo + root)
    share = thrust(least + (most - least) * signal) / thrust(most)
    return (share, f"{params.where}: MOT_THST_HOVER{through}"), lowest
