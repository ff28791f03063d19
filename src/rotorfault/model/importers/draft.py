"""What a source says of a vehicle, and how a vehicle file is made of it: what is missing is asked for or estimated.

A reader of a format (`px4`, `ardupilot`, `rotorpy`, `sdf`, `urdf`) brings its axes, its order of motors and its signs
into ours once, and gives a `Draft`. Nothing is added to it silently: each number that the source does not have is
given by the user, or estimated because the user says so, and its `source` says which.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import NamedTuple

from rotorfault.base.config import parse_toml, validate
from rotorfault.base.errors import InputError
from rotorfault.model.frames import Frame, place_of
from rotorfault.model.importers.estimates import Known, estimate_of
from rotorfault.model.importers.numbers import GRAVITY, ORDER, UNITS, Given, checked, quantity, rotor_quantity
from rotorfault.model.quantities import Quantity, RotorQuantity
from rotorfault.model.vehicle_file import VehicleFile
from rotorfault.model.vehicle_text import RotorText, vehicle_text

ALWAYS = {
    "rotor_gain": Quantity(value=1.0, unit="1", source="our choice: commands are thrusts"),
    "gravity": Quantity(value=GRAVITY, unit="m/s^2", source="standard gravity, rounded"),
    "rotor_reaction": Quantity(value=1.0, unit="1", source="physics: momentum is conserved"),
}
OPTIONS = {
    "mass": "--mass M (kg)",
    "inertia_x": "--inertia IX,IY,IZ (kg m^2)",
    "inertia_y": "--inertia IX,IY,IZ (kg m^2)",
    "inertia_z": "--inertia IX,IY,IZ (kg m^2)",
    "rotor_inertia": "--rotor-inertia J (kg m^2)",
    "thrust_coefficient": "--thrust-coefficient B (N/(rad/s)^2)",
    "torque_ratio": "--torque-ratio K (m)",
    "thrust_max": "--thrust-max F (N of one rotor)",
    "rotor_bandwidth": "--rotor-bandwidth W (rad/s, 1 over the lag)",
    "linear_drag": "--linear-drag D (N s/m)",
    "arm": "--arm L (m, the longest)",
}
"""How to give what may be missing, on the command line; from Python the words are the same."""
NOT_ESTIMATED = ("mass", "arm")


class SourceRotor(NamedTuple):
    """One rotor as a source has it, in our axes."""

    number: str  # that the source gives it
    x: float  # m, forward of the centre of mass
    y: float  # m, left of it
    clockwise: bool  # whether its propeller turns so, seen from above
    source: str  # of the place
    level: str = ""  # "upper" or "lower" of two on one arm, where the source says it; else ""
    z: float | None = None  # m, above the centre of mass, where the source says it
    axis: tuple[float, float, float] | None = None  # unit vector along which it pulls; None if it points up

    @property
    def label(self) -> str:
        """Its name in the vehicle file."""
        place = " ".join(filter(None, (place_of(self.x, self.y), self.level)))
        return f"motor {self.number}, {place}, turns {'clockwise' if self.clockwise else 'counter-clockwise'}"


class Draft(NamedTuple):
    """What a source says, in our axes and units."""

    where: str  # the source in messages
    about: str  # the source in words, for the head of the file
    rotors: tuple[SourceRotor, ...]  # in the order of the source; empty where only a frame is known
    known: Mapping[str, Quantity | RotorQuantity]  # by key of the vehicle file
    frame: Frame | None = None  # that the source names instead of places; its arm is to be given
    frame_source: str = ""  # where it is named
    hover_share: tuple[float, str] | None = None  # thrust in hover over the greatest thrust, and its source
    least_share: tuple[float, str] | None = None  # least thrust over the greatest, and its source
    notes: tuple[str, ...] = ()  # what of the source is left out, a line each
    air: tuple[tuple[str, Quantity], ...] = ()  # what the air does beyond linear drag, by key of the table [air]


class Imported(NamedTuple):
    """A vehicle that was made of a source."""

    file: VehicleFile
    text: str  # of the vehicle file
    rotors: tuple[SourceRotor, ...]  # in the order of the file
    notes: tuple[str, ...]  # what was left out, a line each
    estimated: tuple[str, ...]  # keys whose numbers are estimates


def completed(draft: Draft, name: str, given: Given, estimate: bool) -> Imported:
    """The vehicle file of a draft.

    Parameters
    ----------
    draft : Draft
    name : str
        Of the vehicle.
    given : Given
        Numbers of the user; they go before those of the source.
    estimate : bool
        Whether what is missing is estimated.

    Raises
    ------
    InputError
        If numbers are missing, or the vehicle is none that can fly.
    """
    given = checked(given)
    numbers = _with_given(draft, given)
    if "thrust_max" not in numbers and draft.hover_share is not None and "mass" in numbers:
        numbers["thrust_max"] = _thrust_of_hover(draft, _one(numbers["mass"]))
    missing = [key for key in UNITS if key not in numbers and key != "thrust_min"]
    if not draft.rotors and given.arm is None:
        missing.append("arm")
    if missing and not (estimate and not set(missing) & set(NOT_ESTIMATED)):
        raise InputError(f"{draft.where}: {_missing(missing, estimate)}")
    rotors = _rotors(draft, given)
    estimated = [key for key in missing if key in UNITS]
    for key in sorted(estimated, key=_FIRST.index):
        numbers[key] = quantity(key, *estimate_of(key, _known(numbers, rotors, draft.where)))
    if "thrust_min" not in numbers:
        share, source = draft.least_share or (0.0, "our choice: rotors may stop")
        least = [_digits(share * most) for most in _values(numbers["thrust_max"])]
        numbers["thrust_min"] = rotor_quantity("thrust_min", least, source)
    text = vehicle_text(
        name,
        f"imported from {draft.about}",
        [f"Made by rotorfault from {draft.about}.", *draft.notes],
        [(key, numbers[key]) for key in ORDER if key in numbers],
        [
            RotorText(one.label, one.x, one.y, "+" if one.clockwise else "-", one.source, one.z, one.axis)
            for one in rotors
        ],
        draft.air,
    )  # fmt: skip
    file = validate(VehicleFile, parse_toml(text, draft.where), draft.where)
    return Imported(file, text, rotors, draft.notes, tuple(estimated))


def levels(places: Iterable[tuple[float, float, float]]) -> list[str]:
    """Which of rotors that share a place in plan are upper and lower; "" for all others.

    Parameters
    ----------
    places : iterable of (float, float, float), m
        Forward, left, up.
    """
    known = list(places)
    found = []
    for x, y, z in known:
        others = [other for a, b, other in known if math.hypot(a - x, b - y) < 1e-3 and abs(other - z) > 1e-6]
        found.append("" if not others else "upper" if z > max(others) else "lower" if z < min(others) else "")
    return found


# ------------------------------------------------------------------------------------------------------------ numbers

_FIRST = [
    "thrust_max",
    "thrust_coefficient",
    *(key for key in UNITS if key not in ("thrust_max", "thrust_coefficient")),
]


def _values(number: Quantity | RotorQuantity) -> tuple[float, ...]:
    """All numbers that a quantity has."""
    return number.values if isinstance(number, RotorQuantity) else (number.value,)


def _one(number: Quantity | RotorQuantity) -> float:
    """One number of a quantity: the mean of several."""
    values = _values(number)
    return values[0] if len(values) == 1 else math.fsum(values) / len(values)


def _with_given(draft: Draft, given: Given) -> dict[str, Quantity | RotorQuantity]:
    """The numbers of a draft, and those of the user instead of them."""
    numbers = {**ALWAYS, **draft.known}
    if given.inertia is not None:
        # Who gives the moments gives the inertia.
        numbers = {key: number for key, number in numbers.items() if not key.startswith("inertia_")}
    if given.rotor_bandwidth is not None:
        numbers.pop("rotor_bandwidth_down", None)
    if given.inertia is not None:
        for axis, value in zip("xyz", given.inertia, strict=True):
            numbers[f"inertia_{axis}"] = quantity(f"inertia_{axis}", value, "given at import: inertia")
    for key in ("mass", "rotor_inertia", "thrust_coefficient", "torque_ratio", "thrust_min", "thrust_max",
                "rotor_bandwidth", "linear_drag"):  # fmt: skip
        value = getattr(given, key)
        if value is not None:
            numbers[key] = quantity(key, value, f"given at import: {key}")
    return numbers


def _thrust_of_hover(draft: Draft, mass: float) -> Quantity:
    """The greatest thrust of a rotor, of the share of it that hover takes."""
    assert draft.hover_share is not None
    share, source = draft.hover_share
    # As many as pull upwards: of tilted rotors a part of each.
    up = [1.0 if rotor.axis is None else max(rotor.axis[2], 0.0) for rotor in draft.rotors]
    count = float(f"{math.fsum(up):.6g}") or len(draft.frame.motors if draft.frame else ())
    value = _digits(mass * GRAVITY / (count * share))
    return quantity("thrust_max", value, f"weight of {mass:g} kg over {count:g} rotors and {share:.4g}, {source}")


def _rotors(draft: Draft, given: Given) -> tuple[SourceRotor, ...]:
    """Rotors of a draft; of a frame with the arm that is given, to the micrometre."""
    if draft.rotors:
        if given.arm is not None:
            raise InputError(
                f"{draft.where}: arm: got {given.arm:g} m, but the source has places of all rotors; leave it out"
            )
        return draft.rotors
    if given.arm is None or draft.frame is None or not given.arm > 0.0:
        raise InputError(f"{draft.where}: arm: got {given.arm!r}; allowed: a length in m, greater than 0")
    source = f"{draft.frame_source}: {draft.frame.name}; arm of {given.arm:g} m given at import"
    return tuple(
        SourceRotor(
            str(motor.number),
            round(motor.x * given.arm, 6) + 0.0,
            round(motor.y * given.arm, 6) + 0.0,
            motor.clockwise,
            source,
            motor.level,
        )
        for motor in draft.frame.motors
    )


def _known(numbers: Mapping[str, Quantity | RotorQuantity], rotors: tuple[SourceRotor, ...], where: str) -> Known:
    """What estimates are made of."""
    thrust = numbers.get("thrust_coefficient")
    for key in ("mass", "thrust_coefficient"):
        if key in numbers and not min(_values(numbers[key])) > 0.0:
            raise InputError(f"{where}: {key} is {min(_values(numbers[key])):g}; allowed: greater than 0")
    if len({(round(rotor.x, 4), round(rotor.y, 4)) for rotor in rotors}) < 2:
        raise InputError(f"{where}: all rotors are at one place; allowed: rotors about the centre of mass")
    return Known(
        mass=_one(numbers["mass"]),
        gravity=_one(numbers["gravity"]),
        places=[(rotor.x, rotor.y) for rotor in rotors],
        thrust_coefficient=None if thrust is None else _one(thrust),
    )


def _missing(keys: list[str], estimate: bool) -> str:
    """What is missing and how to give it, in one line."""
    fixed = [key for key in keys if key in NOT_ESTIMATED]
    # Of what is estimated anyway nothing need be said.
    keys = fixed if estimate else keys
    options = list(dict.fromkeys(OPTIONS[key] for key in keys))
    said = f"does not say {', '.join(keys)}; give {', '.join(options)}"
    if estimate:
        return f"{said}; --estimate does not estimate {' and '.join(fixed)}"
    but = f" (but {' and '.join(fixed)})" if fixed else ""
    rest = len(keys) > len(fixed)
    return f"{said}; or let what you do not know be estimated with --estimate{but}" if rest else said


def _digits(value: float) -> float:
    """A derived number with the digits that it deserves."""
    return float(f"{value:.6g}")
