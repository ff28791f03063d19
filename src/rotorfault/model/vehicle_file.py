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

Units are the SI units of `rotorfault.model.vehicle.Vehicle` alone, so that no number is converted silently.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from importlib import resources
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import AfterValidator, Field, model_validator
from pydantic_core import PydanticCustomError

from rotorfault.base.bounds import require
from rotorfault.base.config import Strict, parse_toml, read_text, refusal, validate
from rotorfault.base.errors import InputError, unknown
from rotorfault.base.one_line import cut
from rotorfault.maths.arrays import Array
from rotorfault.maths.geometry import PerRotor, Vec3
from rotorfault.model.aerodynamics import Aerodynamics
from rotorfault.model.quantities import (
    AirFile,
    Inertia,
    Quantity,
    Rotor,
    Thrust,
    in_unit,
    not_negative,
    positive,
)
from rotorfault.model.vehicle import FEWEST_ROTORS, MOST_ROTORS, Opposite, Vehicle, opposite_pairs

LEAST_ROW = 1e-3  # of an axis, what is its own: with less it is another axis in disguise


class VehicleFile(Strict):
    """What a vehicle file says, checked; `vehicle` gives the plain numbers."""

    name: str = Field(min_length=1, description="short name, as used in scenarios")
    description: str = Field(default="", description="one line")
    mass: Annotated[Quantity, positive("kg")] = Field(description="kg, with battery")
    inertia_x: Inertia = Field(description="kg m^2, principal moment about the forward axis")
    inertia_y: Inertia = Field(description="kg m^2, principal moment about the left axis")
    inertia_z: Inertia = Field(description="kg m^2, principal moment about the upward axis")
    rotor_inertia: Annotated[Quantity, not_negative("kg m^2")] = Field(description="kg m^2, one rotor on its axis")
    thrust_coefficient: Annotated[Quantity, positive("N/(rad/s)^2")] = Field(
        description="N/(rad/s)^2, thrust per squared rotor speed"
    )
    torque_ratio: Annotated[Quantity, positive("m")] = Field(description="m, drag torque over thrust (kappa)")
    thrust_min: Annotated[Quantity, in_unit("N")] = Field(
        description="N, least thrust of a rotor; below 0 for rotors that can turn backwards"
    )
    thrust_max: Thrust = Field(description="N, greatest thrust of a rotor")
    rotor_bandwidth: Annotated[Quantity, positive("rad/s")] = Field(description="rad/s, first-order lag: 1/tau")
    rotor_gain: Annotated[Quantity, positive("1")] = Field(description="thrust per commanded thrust (k)")
    linear_drag: Annotated[Quantity, not_negative("N s/m")] = Field(description="N s/m, force per airspeed (k_d)")
    gravity: Annotated[Quantity, positive("m/s^2")] = Field(description="m/s^2")
    rotor_reaction: Annotated[
        Quantity, in_unit("1", lambda value: 0.0 <= value <= 1.0, "0 (without) to 1 (as it is)")
    ] = Field(
        default=Quantity(value=1.0, unit="1", source="physics: momentum is conserved"),
        description="share of the reaction to a rotor's change of speed: 1 as physics is, 0 without",
    )
    air: AirFile | None = Field(default=None, description="what the air does beyond linear drag")
    rotor: tuple[Rotor, ...] = Field(description="3 to 16 rotors, in any order")

    @model_validator(mode="after")
    def _consistent(self) -> VehicleFile:
        for check in (
            self._check_inertia,
            self._check_count,
            self._check_thrust,
            self._check_rank,
            self._check_hover,
        ):
            error = check()
            if error is not None:
                raise error
        return self

    def __repr__(self) -> str:
        return f"<vehicle {cut(self.name)}: {self.mass.value:g} kg, thrust-to-weight {self.thrust_to_weight:.3g}>"

    def with_factors(self, factors: Mapping[str, float]) -> VehicleFile:
        """The same vehicle with some numbers times factors; it keeps the rules of a file that say what can exist.

        One that is too heavy to hover exists: maps show where that begins.

        Parameters
        ----------
        factors : mapping
            By key, such as ``mass``; those that are 1 change nothing.

        Raises
        ------
        PydanticCustomError
            If such a vehicle is none.
        """
        changed: dict[str, Quantity] = {}
        for key, factor in factors.items():
            if factor == 1.0:
                continue
            old: Quantity = getattr(self, key)
            value = old.value * factor
            if not math.isfinite(value):
                raise refusal(key, f"got {value!r} {old.unit}; allowed: a finite number")
            changed[key] = Quantity.model_construct(value=value, unit=old.unit, source=old.source)
            try:
                for rule in type(self).model_fields[key].metadata:
                    if isinstance(rule, AfterValidator):
                        rule.func(changed[key])  # type: ignore[call-arg]
            except PydanticCustomError as error:
                raise refusal(key, error.message()) from None
        if not changed:
            return self
        made = self.model_copy(update=changed)
        wrong = made._check_inertia()
        if wrong is not None:
            raise wrong
        return made

    def _check_inertia(self) -> PydanticCustomError | None:
        moments = {"x": self.inertia_x.value, "y": self.inertia_y.value, "z": self.inertia_z.value}
        for axis, moment in moments.items():
            others = math.fsum(moments.values()) - moment
            # Equality is a flat plate; rounding of printed digits must not refuse it.
            if moment > others * (1.0 + 1e-9):
                message = f"got {moment!r} kg m^2; allowed: at most the sum of the other two, {others:.6g} (no rigid"
                return refusal(f"inertia_{axis}", f"{message} body has more); check the exponents")
        return None

    def _check_count(self) -> PydanticCustomError | None:
        count = len(self.rotor)
        if FEWEST_ROTORS <= count <= MOST_ROTORS:
            return None
        return refusal("rotor", f"got {count} tables; allowed: {FEWEST_ROTORS} to {MOST_ROTORS} [[rotor]] tables")

    def _check_thrust(self) -> PydanticCustomError | None:
        low, high = self.thrust_min.value, self.thrust_max.value
        if not low < high:
            return refusal("thrust_min", f"got {low!r} N; allowed: less than thrust_max = {high!r} N")
        if not low >= -high:
            message = f"got {low!r} N; allowed: -thrust_max = {-high!r} N or more, for rotors that can turn backwards"
            return refusal("thrust_min", message)
        ratio = self.thrust_to_weight
        hover = self.mass.value * self.gravity.value / (len(self.rotor) * self.rotor_gain.value)
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

    def _check_rank(self) -> PydanticCustomError | None:
        """Whether thrust, roll and pitch can be had independently, and yaw where there are rotors enough for it."""
        rows = self._scaled_rows()
        names = ("thrust", "roll", "pitch", "yaw")
        # A flat tricopter has no yaw of its own, and flies without.
        count = min(len(self.rotor), len(names))
        for row in range(1, count):
            others = np.delete(rows[:count], row, axis=0)
            left = rows[row] - np.linalg.lstsq(others.T, rows[row], rcond=None)[0] @ others
            length = float(np.linalg.norm(rows[row]))
            share = float(np.linalg.norm(left)) / max(length, 1e-300)
            if length < LEAST_ROW or share < LEAST_ROW:
                return refusal(
                    "rotor",
                    f"these {len(self.rotor)} rotors cannot give {names[row]} independently of the other axes "
                    f"({share:.2g} of it is its own); allowed: rotors on different lines through the centre of mass, "
                    "and some of each sense of rotation",
                )
        return None

    def _check_hover(self) -> PydanticCustomError | None:
        """Whether the rotors can carry the weight level with no torque left over, each within its limits."""
        if self.pairs is not None:
            return None
        from scipy.optimize import linprog

        weight = self.mass.value * self.gravity.value
        rows = self._scaled_rows()[: min(len(self.rotor), 4)]
        low, high = (self.rotor_gain.value * limit.value for limit in (self.thrust_min, self.thrust_max))
        balance = [weight, *(0.0,) * (len(rows) - 1)]
        if linprog(np.zeros(len(self.rotor)), A_eq=rows, b_eq=balance, bounds=(low, high)).status == 0:
            return None
        x, y = np.mean([(rotor.x.value, rotor.y.value) for rotor in self.rotor], axis=0)
        return refusal(
            "rotor",
            f"no thrusts of {low:g} to {high:g} N carry {weight:.4g} N with all torques in balance; the middle of "
            f"the rotors is {1e3 * x:.3g} mm forward and {1e3 * y:.3g} mm left of the centre of mass: check x and y, "
            "which count from there, yaw and thrust_max",
        )

    def _scaled_rows(self) -> Array:
        """Thrust, roll, pitch and yaw of a newton of each rotor, torques over the longest arm; yaw as signs."""
        x = np.array([rotor.x.value for rotor in self.rotor])
        y = np.array([rotor.y.value for rotor in self.rotor])
        arm = max(float(np.hypot(x, y).max()), 1e-300)
        return np.array([np.ones(len(x)), y / arm, -x / arm, [_sign(rotor) for rotor in self.rotor]])

    def rotor_label(self, index: int) -> str:
        """A rotor in a message, by its number from 1 and its name if it has one; `index` counts from 0."""
        name = self.rotor[index].name
        return f"rotor {index + 1}" + (f" ('{name}')" if name else "")

    @property
    def pairs(self) -> Opposite | None:
        """The pairs of a quadrotor whose rotors are opposite in pairs that turn alike; None for any other frame."""
        places = [(rotor.x.value, rotor.y.value) for rotor in self.rotor]
        return opposite_pairs(places, [_sign(rotor) for rotor in self.rotor])

    @property
    def thrust_to_weight(self) -> float:
        """Greatest thrust of all rotors over the weight."""
        return (
            len(self.rotor) * self.rotor_gain.value * self.thrust_max.value / (self.mass.value * self.gravity.value)
        )

    @property
    def vehicle(self) -> Vehicle:
        """The numbers alone, as Python floats in SI units."""
        return Vehicle(
            mass=self.mass.value,
            inertia=Vec3(self.inertia_x.value, self.inertia_y.value, self.inertia_z.value),
            rotor_inertia=self.rotor_inertia.value,
            rotor_x=PerRotor.of(rotor.x.value for rotor in self.rotor),
            rotor_y=PerRotor.of(rotor.y.value for rotor in self.rotor),
            rotor_yaw_sign=PerRotor.of(_sign(rotor) for rotor in self.rotor),
            thrust_coefficient=self.thrust_coefficient.value,
            torque_ratio=self.torque_ratio.value,
            thrust_min=self.thrust_min.value,
            thrust_max=self.thrust_max.value,
            rotor_bandwidth=self.rotor_bandwidth.value,
            rotor_gain=self.rotor_gain.value,
            linear_drag=self.linear_drag.value,
            gravity=self.gravity.value,
            rotor_reaction=self.rotor_reaction.value,
            air=self._aerodynamics(),
            pairs=self.pairs or (),
        )

    def _aerodynamics(self) -> Aerodynamics | tuple[()]:
        """Coefficients of the air; empty where all are 0, which costs nothing then."""
        if self.air is None or not any(self.air.number(key) for key in AirFile.model_fields):
            return ()
        angles, axes = ("roll", "pitch", "yaw"), ("x", "y", "z")
        return Aerodynamics(
            rotor_z=PerRotor.of(0.0 if rotor.z is None else rotor.z.value for rotor in self.rotor),
            rotor_drag=self.air.number("rotor_drag"),
            inflow=self.air.number("inflow"),
            translational_lift=self.air.number("translational_lift"),
            flapping=self.air.number("flapping"),
            frame_drag=self.air.along("frame_drag", axes),
            damping=self.air.along("damping", angles),
            damping_squared=self.air.along("damping_squared", angles),
        )

    def quantities(self) -> Iterator[tuple[str, Quantity]]:
        """Every number of the file under its key, such as ``mass`` or ``rotor.1.x``, with unit and source."""
        for key in type(self).model_fields:
            if isinstance(quantity := getattr(self, key), Quantity):
                yield key, quantity
        for number, rotor in enumerate(self.rotor, start=1):
            yield f"rotor.{number}.x", rotor.x
            yield f"rotor.{number}.y", rotor.y
            if rotor.z is not None:
                yield f"rotor.{number}.z", rotor.z
        for key in () if self.air is None else AirFile.model_fields:
            if (coefficient := getattr(self.air, key)) is not None:
                yield f"air.{key}", coefficient


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
