"""Vehicle files: TOML in which every number carries its unit and its source.

    name = "paper"
    description = "one line"
    mass = { value = 1.77, unit = "kg", source = "paper, section 5" }
    ...
    [[rotor]]                    # 3 to 16 of them, in any order
    name = "front"               # optional: the vendor's name
    x = { value = 0.42, unit = "m", source = "paper, (3)" }    # forward of the centre of mass
    y = { value = 0.0, unit = "m", source = "..." }            # left of it
    yaw = "+"                    # its drag torque turns the body towards positive yaw (to the left)
    axis = { value = [0.0, 0.34, 0.94], unit = "1", source = "..." }    # optional: tilted; unit vector, body axes

Rotors that differ have a list in place of one number, in the order of their tables:

    thrust_max = { value = [8.1, 8.0, 7.9, 8.0], unit = "N", source = "thrust stand, each motor" }

and so have thrust_coefficient, torque_ratio, thrust_min, rotor_bandwidth, rotor_bandwidth_down and rotor_gain.

Units are the SI units of `rotorfault.model.vehicle.Vehicle` alone, so that no number is converted silently.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from importlib import resources
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import Field, model_validator
from pydantic_core import PydanticCustomError

from rotorfault.base.bounds import require
from rotorfault.base.config import Strict, parse_toml, read_text, refusal, validate
from rotorfault.base.errors import InputError, unknown
from rotorfault.base.one_line import cut
from rotorfault.maths.geometry import PerRotor, Vec3
from rotorfault.maths.scalar import Scalar
from rotorfault.model.battery import Battery
from rotorfault.model.mixer import hover_thrust
from rotorfault.model.quantities import (
    AirFile,
    BatteryFile,
    Inertia,
    Place,
    Product,
    Quantity,
    Rotor,
    RotorQuantity,
    TripleQuantity,
    in_unit,
    not_negative,
    positive,
)
from rotorfault.model.thrust_curve import STEEPEST
from rotorfault.model.tilt import Tilt
from rotorfault.model.vehicle import FEWEST_ROTORS, MOST_ROTORS, ROTOR_NUMBERS, Discs, Opposite, Reversible, Vehicle
from rotorfault.model.vehicle import opposite_pairs as opposite
from rotorfault.model.vehicle_rules import RotorSet, hover_refusal, inertia_refusal, level_refusal, reach_refusal

UPWARD = (0.0, 0.0, 1.0)


class VehicleFile(Strict):
    """What a vehicle file says, checked; `vehicle` gives the plain numbers."""

    name: str = Field(min_length=1, description="short name, as used in scenarios")
    description: str = Field(default="", description="one line")
    mass: Annotated[Quantity, positive("kg")] = Field(description="kg, with battery")
    inertia_x: Inertia = Field(description="kg m^2, moment about the forward axis")
    inertia_y: Inertia = Field(description="kg m^2, moment about the left axis")
    inertia_z: Inertia = Field(description="kg m^2, moment about the upward axis")
    inertia_xy: Product | None = Field(
        default=None, description="kg m^2, element of the matrix: minus the integral of xy dm"
    )
    inertia_xz: Product | None = Field(default=None, description="kg m^2, the same for xz")
    inertia_yz: Product | None = Field(default=None, description="kg m^2, the same for yz")
    centre_of_mass: Place | None = Field(
        default=None,
        description="m, where it is in the frame of the rotors' x, y, z; at its origin if not given",
    )
    rotor_inertia: Annotated[Quantity, not_negative("kg m^2")] = Field(description="kg m^2, one rotor on its axis")
    thrust_coefficient: Annotated[RotorQuantity, positive("N/(rad/s)^2")] = Field(
        description="N/(rad/s)^2, thrust per squared rotor speed"
    )
    torque_ratio: Annotated[RotorQuantity, positive("m")] = Field(description="m, drag torque over thrust (kappa)")
    thrust_min: Annotated[RotorQuantity, in_unit("N")] = Field(
        description="N, least thrust of a rotor; below 0 it can turn the other way"
    )
    thrust_max: Annotated[RotorQuantity, positive("N")] = Field(description="N, greatest thrust of a rotor")
    rotor_bandwidth: Annotated[RotorQuantity, positive("rad/s")] = Field(description="rad/s, first-order lag: 1/tau")
    rotor_bandwidth_down: Annotated[RotorQuantity, positive("rad/s")] | None = Field(
        default=None, description="rad/s, the same for thrust that falls; `rotor_bandwidth` if not given"
    )
    rotor_gain: Annotated[RotorQuantity, positive("1")] = Field(description="thrust per commanded thrust (k)")
    linear_drag: Annotated[Quantity, not_negative("N s/m")] = Field(description="N s/m, force per airspeed (k_d)")
    gravity: Annotated[Quantity, positive("m/s^2")] = Field(description="m/s^2")
    rotor_reaction: Annotated[
        Quantity, in_unit("1", lambda value: 0.0 <= value <= 1.0, "0 (without) to 1 (as it is)")
    ] = Field(
        default=Quantity(value=1.0, unit="1", source="physics: momentum is conserved"),
        description="share of the reaction to a rotor's change of speed: 1 as physics is, 0 without",
    )
    thrust_curve: (
        Annotated[Quantity, in_unit("1", lambda value: -STEEPEST <= value <= STEEPEST, "-1 to 1")] | None
    ) = Field(
        default=None, description="1, a of T = T_max (a u^2 + (1 - a) u) for a signal u: THR_MDL_FAC, MOT_THST_EXPO"
    )
    rotor_radius: Annotated[Quantity, positive("m")] | None = Field(
        default=None, description="m, radius of the rotors: with it thrust grows near the ground"
    )
    battery: BatteryFile | None = Field(default=None, description="the pack; flown with start.charge")
    air: AirFile | None = Field(default=None, description="what the air does beyond linear drag")
    rotor: tuple[Rotor, ...] = Field(description="3 to 16 rotors, in any order")

    @model_validator(mode="after")
    def _consistent(self) -> VehicleFile:
        for check in (
            self._check_inertia,
            self._check_battery,
            self._check_count,
            self._check_lists,
            self._check_thrust,
            self._check_reach,
            self._check_hover,
        ):
            error = check()
            if error is not None:
                raise error
        return self

    def __repr__(self) -> str:
        return f"<vehicle {cut(self.name)}: {self.mass.value:g} kg, thrust-to-weight {self.thrust_to_weight:.3g}>"

    def check_existence(self) -> PydanticCustomError | None:
        """What such a vehicle breaks of the rules that say what can exist, flyable or not; None if nothing."""
        return self._check_inertia() or self._check_limits()

    def _check_inertia(self) -> PydanticCustomError | None:
        return inertia_refusal(np.array(self._moments), np.array(self._products))

    def _check_battery(self) -> PydanticCustomError | None:
        if self.battery is None or self.rotor_radius is not None:
            return None
        return refusal("rotor_radius", "is not given; a vehicle with [battery] needs it for the power of its rotors")

    def _check_count(self) -> PydanticCustomError | None:
        count = len(self.rotor)
        if FEWEST_ROTORS <= count <= MOST_ROTORS:
            return None
        return refusal("rotor", f"got {count} tables; allowed: {FEWEST_ROTORS} to {MOST_ROTORS} [[rotor]] tables")

    def _check_lists(self) -> PydanticCustomError | None:
        for key in (*ROTOR_NUMBERS, "rotor_bandwidth_down"):
            quantity: RotorQuantity | None = getattr(self, key)
            if quantity is not None and isinstance(quantity.value, tuple) and len(quantity.value) != len(self.rotor):
                said = f"got a list of {len(quantity.value)}; allowed: one number, or a list with one for each of the"
                return refusal(f"{key}.value", f"{said} {len(self.rotor)} rotors")
        return None

    def _check_limits(self) -> PydanticCustomError | None:
        for low, high in zip(self.of_rotors("thrust_min"), self.of_rotors("thrust_max"), strict=True):
            if not low < high:
                return refusal("thrust_min", f"got {low!r} N; allowed: less than thrust_max = {high!r} N")
        return None

    def _check_thrust(self) -> PydanticCustomError | None:
        wrong = self._check_limits()
        if wrong is not None:
            return wrong
        low, high, ratio = min(self.of_rotors("thrust_min")), max(self.of_rotors("thrust_max")), self.thrust_to_weight
        for least, most in zip(self.of_rotors("thrust_min"), self.of_rotors("thrust_max"), strict=True):
            if not least >= -most:
                said = (
                    f"got {least!r} N; allowed: -thrust_max = {-most!r} N or more, for rotors that can turn backwards"
                )
                return refusal("thrust_min", said)
        hover = self.mass.value * self.gravity.value / math.fsum(self.of_rotors("rotor_gain"))
        if not ratio > 1.0:
            message = f"got {high!r} N: thrust-to-weight is {ratio:.3g}; allowed: more than 1, so thrust_max above"
            grams = f"; if mass is in g, write {0.001 * self.mass.value:g} kg" if 1.0 < 1e3 * ratio < 25.0 else ""
            return refusal("thrust_max", f"{message} {hover:.4g} N per rotor{grams}")
        if not low < hover:
            return refusal(
                "thrust_min",
                f"got {low!r} N: it cannot descend; allowed: less than in hover, {hover:.4g} N per rotor",
            )
        return None

    def _check_reach(self) -> PydanticCustomError | None:
        return reach_refusal(self.rotor_set)

    def _check_hover(self) -> PydanticCustomError | None:
        if self.pairs is not None:
            return None
        rotors = self.rotor_set
        wrong = hover_refusal(rotors, self.mass.value * self.gravity.value)
        return wrong or level_refusal(rotors, hover_thrust(self.vehicle)) if rotors.tilted else wrong

    def of_rotors(self, key: str) -> tuple[float, ...]:
        """A number of the rotors for each of them."""
        quantity: RotorQuantity = getattr(self, key)
        return quantity.of(len(self.rotor))

    def _rotor_number(self, key: str) -> Scalar:
        """A number of the rotors: a float where the file has one for all.

        What the file says decides, and not whether numbers happen to be equal: so a flight in a batch in which they
        vary has the shape of the flight alone.
        """
        quantity: RotorQuantity = getattr(self, key)
        return PerRotor(*quantity.value) if isinstance(quantity.value, tuple) else quantity.value

    @property
    def _moments(self) -> tuple[float, float, float]:
        return self.inertia_x.value, self.inertia_y.value, self.inertia_z.value

    @property
    def _products(self) -> tuple[float, float, float]:
        xy, xz, yz = (0.0 if q is None else q.value for q in (self.inertia_xy, self.inertia_xz, self.inertia_yz))
        return xy, xz, yz

    @property
    def places(self) -> list[tuple[float, float, float]]:
        """Where the rotors are, in m, forward, left and up of the centre of mass."""
        centre = (0.0, 0.0, 0.0) if self.centre_of_mass is None else self.centre_of_mass.value
        return [
            (rotor.x.value - centre[0], rotor.y.value - centre[1], (rotor.z.value if rotor.z else 0.0) - centre[2])
            for rotor in self.rotor
        ]

    @property
    def axes(self) -> list[tuple[float, float, float]]:
        """Unit vectors along which the rotors pull, body axes."""
        return [UPWARD if rotor.axis is None else _unit(rotor.axis.value) for rotor in self.rotor]

    @property
    def rotor_set(self) -> RotorSet:
        """The rotors as arrays, in the order of the file."""
        signs = np.array([_sign(rotor) for rotor in self.rotor])
        ratio, gain, low, high = (
            np.array(self.of_rotors(key)) for key in ("torque_ratio", "rotor_gain", "thrust_min", "thrust_max")
        )
        return RotorSet(np.array(self.places), np.array(self.axes), signs, ratio, gain * low, gain * high)

    def rotor_label(self, index: int) -> str:
        """A rotor in a message, by its number from 1 and its name if it has one; `index` counts from 0."""
        name = self.rotor[index].name
        return f"rotor {index + 1}" + (f" ('{name}')" if name else "")

    @property
    def pairs(self) -> Opposite | None:
        """The pairs of a quadrotor whose rotors are opposite in pairs that turn alike; None for any other frame.

        None too where rotors have axes, or numbers of their own: what has a closed form is for equal ones.
        """
        listed = any(isinstance(getattr(self, key).value, tuple) for key in ROTOR_NUMBERS)
        if listed or any(rotor.axis is not None for rotor in self.rotor):
            return None
        return opposite([(x, y) for x, y, _ in self.places], [_sign(rotor) for rotor in self.rotor])

    @property
    def thrust_to_weight(self) -> float:
        """Greatest thrust of all rotors along body z over the weight."""
        weight = self.mass.value * self.gravity.value
        gain, high = self._rotor_number("rotor_gain"), self._rotor_number("thrust_max")
        if isinstance(gain, float) and isinstance(high, float) and not self.rotor_set.tilted:
            return len(self.rotor) * gain * high / weight
        return float(np.maximum(self.rotor_set.axes[:, 2], 0.0) @ self.rotor_set.high) / weight

    @property
    def vehicle(self) -> Vehicle:
        """The numbers alone, as Python floats in SI units."""
        places, axes = self.places, self.axes
        tilted = any(rotor.axis is not None for rotor in self.rotor)
        air = () if self.air is None else self.air.aerodynamics
        discs = () if self.rotor_radius is None else Discs(self.rotor_radius.value)
        high = self.centre_of_mass is not None or any(rotor.z is not None for rotor in self.rotor)
        felt = tilted or air != () or discs != ()
        ahead, left, above = (PerRotor.of(axis[k] for axis in axes) for k in range(3))
        down = () if self.rotor_bandwidth_down is None else self._rotor_number("rotor_bandwidth_down")
        products = self.inertia_xy, self.inertia_xz, self.inertia_yz
        return Vehicle(
            mass=self.mass.value,
            inertia=Vec3(*self._moments),
            rotor_inertia=self.rotor_inertia.value,
            rotor_x=PerRotor.of(x for x, _, _ in places),
            rotor_y=PerRotor.of(y for _, y, _ in places),
            rotor_yaw_sign=PerRotor.of(_sign(rotor) for rotor in self.rotor),
            thrust_coefficient=self._rotor_number("thrust_coefficient"),
            torque_ratio=self._rotor_number("torque_ratio"),
            thrust_min=self._rotor_number("thrust_min"),
            thrust_max=self._rotor_number("thrust_max"),
            rotor_bandwidth=self._rotor_number("rotor_bandwidth"),
            rotor_gain=self._rotor_number("rotor_gain"),
            linear_drag=self.linear_drag.value,
            gravity=self.gravity.value,
            rotor_reaction=self.rotor_reaction.value,
            air=air,
            battery=self._battery(),
            discs=discs,
            pairs=self.pairs or (),
            rotor_z=PerRotor.of(z for _, _, z in places) if high and felt else (),
            rotor_bandwidth_down=down,
            inertia_products=() if products == (None, None, None) else Vec3(*self._products),
            tilt=Tilt(ahead, left, above) if tilted else (),
            reversible=Reversible() if min(self.of_rotors("thrust_min")) < 0.0 else (),
        )

    def _battery(self) -> Battery | tuple[()]:
        """Numbers of the pack; empty if there is none."""
        if self.battery is None or self.rotor_radius is None:
            return ()
        curve = 1.0 if self.thrust_curve is None else self.thrust_curve.value
        return self.battery.pack(self.rotor_radius.value, curve)

    def quantities(self) -> Iterator[tuple[str, Quantity | RotorQuantity | TripleQuantity]]:
        """Every number of the file under its key, such as ``mass`` or ``rotor.1.x``, with unit and source."""
        for key in type(self).model_fields:
            if isinstance(quantity := getattr(self, key), (Quantity, RotorQuantity, TripleQuantity)):
                yield key, quantity
        for number, rotor in enumerate(self.rotor, start=1):
            yield f"rotor.{number}.x", rotor.x
            yield f"rotor.{number}.y", rotor.y
            if rotor.z is not None:
                yield f"rotor.{number}.z", rotor.z
            if rotor.axis is not None:
                yield f"rotor.{number}.axis", rotor.axis
        for key in () if self.battery is None else BatteryFile.model_fields:
            yield f"battery.{key}", getattr(self.battery, key)
        for key in () if self.air is None else AirFile.model_fields:
            if (coefficient := getattr(self.air, key)) is not None:
                yield f"air.{key}", coefficient


def _unit(axis: tuple[float, float, float]) -> tuple[float, float, float]:
    """An axis of length 1: what was printed with few digits is brought to it."""
    x, y, z = axis
    length = math.sqrt(x * x + y * y + z * z)
    return x / length, y / length, z / length


def _sign(rotor: Rotor) -> float:
    return 1.0 if rotor.yaw == "+" else -1.0


def vehicle_names() -> list[str]:
    """Names of the vehicles that come with rotorfault."""
    folder = resources.files("rotorfault.model.vehicles")
    return sorted(entry.name.removesuffix(".toml") for entry in folder.iterdir() if entry.name.endswith(".toml"))


def load_vehicle(name_or_path: str | Path) -> VehicleFile:
    """Load and check a vehicle.

    Parameters
    ----------
    name_or_path : str or Path
        Name of a built-in vehicle, or a path that ends in ``.toml``.

    Raises
    ------
    InputError
        If there is no such vehicle or file, or it is not right; one line with file and key.
    """
    require(name_or_path, (str, Path), "vehicle", "a name, or a path that ends in .toml")
    if str(name_or_path).endswith(".toml"):
        where, text = str(name_or_path), read_text(name_or_path)
    else:
        name = str(name_or_path)
        if name not in vehicle_names():
            raise InputError(f"{unknown('vehicle', name, vehicle_names())}; or give a path that ends in .toml")
        where = f"{name}.toml"
        text = (resources.files("rotorfault.model.vehicles") / where).read_text(encoding="utf-8")
    return validate(VehicleFile, parse_toml(text, where), where)


def new_vehicle(name: str) -> str:
    """Text of a vehicle file to start from: commented, and valid as it stands.

    Raises
    ------
    InputError
        If the name is empty or contains quotation marks, backslashes or line breaks.
    """
    if not name or any(character in '"\\' or not character.isprintable() for character in name):
        raise InputError(f"vehicle name {name!r}; allowed: printable characters without quotation marks or backslash")
    return VEHICLE_TEMPLATE.replace("NAME", name, 1)


VEHICLE_TEMPLATE = (resources.files("rotorfault.model.vehicles") / "template.txt").read_text(encoding="utf-8")
"""A commented vehicle file with NAME for its name."""
