"""Numbers of a vehicle file, with unit and source, and what a file says of a rotor and of the air."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Annotated, Literal

import numpy as np
from pydantic import AfterValidator, Field, PlainSerializer, PlainValidator

from rotorfault.base.config import Strict, Three, refusal
from rotorfault.base.number_rule import real, short
from rotorfault.maths.geometry import Vec3
from rotorfault.model.aerodynamics import Aerodynamics
from rotorfault.model.battery import Battery, rotor_power


class Quantity(Strict):
    """A number with its unit and where it comes from."""

    value: float = Field(description="the number, in `unit`")
    unit: str = Field(description="SI unit")
    source: str = Field(min_length=1, description="publication, data sheet, or 'our choice: why'")


def one_or_each(value: object) -> float | tuple[float, ...]:
    """A finite number, or a list of them with one for each rotor; refuses anything else.

    Parameters
    ----------
    value : object
        As it came from a file or from Python.
    """
    if isinstance(value, np.ndarray) and value.ndim == 1:
        value = value.tolist()
    return tuple(_finite(item) for item in value) if isinstance(value, (list, tuple)) else _finite(value)


def _finite(value: object) -> float:
    found = real(value)
    if not math.isfinite(found):
        raise refusal("", f"got {short(found)}; allowed: a finite number")
    return found


def plain(value: float | tuple[float, ...]) -> float | list[float]:
    """One number, or one for each rotor, as files hold it."""
    return list(value) if isinstance(value, tuple) else value


OneOrEach = Annotated[
    float | tuple[float, ...],
    PlainValidator(one_or_each),
    PlainSerializer(plain, return_type=float | list[float]),
]
"""One number for all rotors, or one for each of them."""


class RotorQuantity(Strict):
    """A number of the rotors, or one for each of them, with unit and where it comes from."""

    value: OneOrEach = Field(description="the number, in `unit`; or a list with one for each rotor")
    unit: str = Field(description="SI unit")
    source: str = Field(min_length=1, description="publication, data sheet, or 'our choice: why'")

    @property
    def values(self) -> tuple[float, ...]:
        """All numbers that it has: one, or as many as there are rotors."""
        return self.value if isinstance(self.value, tuple) else (self.value,)

    def of(self, rotors: int) -> tuple[float, ...]:
        """The number of each of so many rotors."""
        return self.value if isinstance(self.value, tuple) else (self.value,) * rotors


class TripleQuantity(Strict):
    """Three numbers along body x, y, z with their unit and where they come from."""

    value: Three = Field(description="forward, left, up, in `unit`")
    unit: str = Field(description="SI unit")
    source: str = Field(min_length=1, description="publication, data sheet, or 'our choice: why'")


def value_text(quantity: Quantity | RotorQuantity | TripleQuantity) -> str:
    """The number of a quantity in few digits, or all that it has."""
    value = quantity.value
    return f"{value:g}" if isinstance(value, float) else ", ".join(f"{one:g}" for one in value)


def in_unit(unit: str, rule: Callable[[float], bool] | None = None, allowed: str = "") -> AfterValidator:
    """Check that a quantity comes in this unit and each of its values within the allowed range."""

    def check(quantity: Quantity | RotorQuantity | TripleQuantity) -> Quantity | RotorQuantity | TripleQuantity:
        if quantity.unit != unit:
            raise refusal("unit", f"got '{quantity.unit}'; allowed: '{unit}'; convert the value to it")
        for value in quantity.value if isinstance(quantity.value, tuple) else (quantity.value,):
            if rule is not None and not rule(value):
                raise refusal("value", f"got {value!r} {unit}; allowed: {allowed}")
        return quantity

    return AfterValidator(check)


UNIT_LENGTH = 1e-3
"""By how much the length of an axis may differ from 1: digits as they are printed; it is brought to 1."""


def _unit_vector(quantity: TripleQuantity) -> TripleQuantity:
    x, y, z = quantity.value
    length = math.sqrt(x * x + y * y + z * z)
    if not abs(length - 1.0) <= UNIT_LENGTH:
        meant = f"; write [{x / length:.6g}, {y / length:.6g}, {z / length:.6g}]" if length > 0.0 else ""
        raise refusal("value", f"got a vector of length {length:.6g}; allowed: 1, to {UNIT_LENGTH:g}{meant}")
    return quantity


def positive(unit: str) -> AfterValidator:
    return in_unit(unit, lambda value: value > 0.0, "greater than 0")


def not_negative(unit: str) -> AfterValidator:
    return in_unit(unit, lambda value: value >= 0.0, "0 or greater")


Inertia = Annotated[Quantity, positive("kg m^2")]
Length = Annotated[Quantity, in_unit("m")]
Product = Annotated[Quantity, in_unit("kg m^2")]
Place = Annotated[TripleQuantity, in_unit("m")]
Direction = Annotated[TripleQuantity, in_unit("1"), AfterValidator(_unit_vector)]


class Rotor(Strict):
    """Where one rotor sits and which way its drag torque turns the body."""

    x: Length = Field(description="forward of the centre of mass, m")
    y: Length = Field(description="left of the centre of mass, m")
    yaw: Literal["+", "-"] = Field(description="'+' if its drag torque turns the body towards positive yaw")
    z: Length | None = Field(default=None, description="above the centre of mass, m; 0 if not given")
    axis: Direction | None = Field(
        default=None, description="unit vector along which it pulls, in body axes, 1; straight up if not given"
    )
    name: str = Field(default="", description="the vendor's name of the rotor")


class BatteryFile(Strict):
    """A pack, and what its power goes into. See `rotorfault.model.battery`."""

    cells: Annotated[Quantity, in_unit("1", lambda n: n >= 1.0 and n == int(n), "a whole number from 1 on")] = Field(
        description="1, cells in series"
    )
    capacity: Annotated[Quantity, positive("A s")] = Field(
        description="A s, charge of a full pack: 3.6 times the mAh"
    )
    resistance: Annotated[Quantity, positive("ohm")] = Field(description="ohm, series resistance of the pack")
    pair_resistance: Annotated[Quantity, positive("ohm")] = Field(
        description="ohm, resistance of its resistor-capacitor pair"
    )
    pair_capacitance: Annotated[Quantity, positive("F")] = Field(description="F, capacitance of the pair")
    efficiency: Annotated[Quantity, in_unit("1", lambda value: 0.0 < value <= 1.0, "more than 0, up to 1")] = Field(
        description="1, power of an ideal rotor in hover over the power that it takes from the pack"
    )
    other_power: Annotated[Quantity, not_negative("W")] = Field(description="W, power of all that is no rotor")

    def pack(self, radius: float, curve: float) -> Battery:
        """The numbers alone, of a vehicle with rotors of a radius in m and a curve from signal to thrust."""
        return Battery(
            cells=self.cells.value,
            capacity=self.capacity.value,
            resistance=self.resistance.value,
            pair_resistance=self.pair_resistance.value,
            pair_capacitance=self.pair_capacitance.value,
            rotor_power=rotor_power(radius, self.efficiency.value),
            other_power=self.other_power.value,
            curve=curve,
        )


class AirFile(Strict):
    """What the air does beyond linear drag; all 0 if not given. See `rotorfault.model.aerodynamics`."""

    rotor_drag: Annotated[Quantity, not_negative("kg/rad")] | None = Field(
        default=None, description="kg/rad, force across a rotor's axis per rotor speed and airspeed"
    )
    inflow: Annotated[Quantity, not_negative("kg/rad")] | None = Field(
        default=None, description="kg/rad, thrust lost per rotor speed and speed along the axis"
    )
    translational_lift: Annotated[Quantity, not_negative("kg/m")] | None = Field(
        default=None, description="kg/m, thrust won per squared airspeed across the axis"
    )
    flapping: Annotated[Quantity, not_negative("kg m/rad")] | None = Field(
        default=None, description="kg m/rad, moment of the blades per rotor speed and airspeed across the axis"
    )
    frame_drag_x: Annotated[Quantity, not_negative("kg/m")] | None = Field(
        default=None, description="kg/m, force of the frame per squared airspeed, forward"
    )
    frame_drag_y: Annotated[Quantity, not_negative("kg/m")] | None = Field(
        default=None, description="the same force, to the left"
    )
    frame_drag_z: Annotated[Quantity, not_negative("kg/m")] | None = Field(
        default=None, description="the same force, upwards"
    )
    damping_roll: Annotated[Quantity, not_negative("N m s")] | None = Field(
        default=None, description="N m s, torque against a roll rate"
    )
    damping_pitch: Annotated[Quantity, not_negative("N m s")] | None = Field(
        default=None, description="the same for pitch"
    )
    damping_yaw: Annotated[Quantity, not_negative("N m s")] | None = Field(
        default=None, description="the same for yaw"
    )
    damping_squared_roll: Annotated[Quantity, not_negative("N m s^2")] | None = Field(
        default=None, description="N m s^2, torque against a squared roll rate"
    )
    damping_squared_pitch: Annotated[Quantity, not_negative("N m s^2")] | None = Field(
        default=None, description="the same for pitch"
    )
    damping_squared_yaw: Annotated[Quantity, not_negative("N m s^2")] | None = Field(
        default=None, description="the same for yaw"
    )

    @property
    def aerodynamics(self) -> Aerodynamics | tuple[()]:
        """The coefficients alone; empty where all are 0, which costs nothing then."""
        if not any(self.number(key) for key in type(self).model_fields):
            return ()
        angles, axes = ("roll", "pitch", "yaw"), ("x", "y", "z")
        return Aerodynamics(
            rotor_drag=self.number("rotor_drag"),
            inflow=self.number("inflow"),
            translational_lift=self.number("translational_lift"),
            flapping=self.number("flapping"),
            frame_drag=self.along("frame_drag", axes),
            damping=self.along("damping", angles),
            damping_squared=self.along("damping_squared", angles),
        )

    def number(self, key: str) -> float:
        """A coefficient, 0 where it is not given."""
        quantity: Quantity | None = getattr(self, key)
        return 0.0 if quantity is None else quantity.value

    def along(self, key: str, names: tuple[str, str, str]) -> Vec3:
        """Three coefficients, by the ends of their keys."""
        return Vec3(*(self.number(f"{key}_{name}") for name in names))
