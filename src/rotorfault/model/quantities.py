"""Numbers of a vehicle file, with unit and source, and what a file says of a rotor and of the air."""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Literal

from pydantic import AfterValidator, Field

from rotorfault.base.config import Strict, refusal
from rotorfault.maths.geometry import Vec3


class Quantity(Strict):
    """A number with its unit and where it comes from."""

    value: float = Field(description="the number, in `unit`")
    unit: str = Field(description="SI unit")
    source: str = Field(min_length=1, description="publication, data sheet, or 'our choice: why'")


def in_unit(unit: str, rule: Callable[[float], bool] | None = None, allowed: str = "") -> AfterValidator:
    """Check that a quantity comes in this unit and its value within the allowed range."""

    def check(quantity: Quantity) -> Quantity:
        if quantity.unit != unit:
            raise refusal("unit", f"got '{quantity.unit}'; allowed: '{unit}'; convert the value to it")
        if rule is not None and not rule(quantity.value):
            raise refusal("value", f"got {quantity.value!r} {unit}; allowed: {allowed}")
        return quantity

    return AfterValidator(check)


def positive(unit: str) -> AfterValidator:
    return in_unit(unit, lambda value: value > 0.0, "greater than 0")


def not_negative(unit: str) -> AfterValidator:
    return in_unit(unit, lambda value: value >= 0.0, "0 or greater")


Inertia = Annotated[Quantity, positive("kg m^2")]
Length = Annotated[Quantity, in_unit("m")]
Thrust = Annotated[Quantity, not_negative("N")]


class Rotor(Strict):
    """Where one rotor sits and which way its drag torque turns the body."""

    x: Length = Field(description="forward of the centre of mass, m")
    y: Length = Field(description="left of the centre of mass, m")
    yaw: Literal["+", "-"] = Field(description="'+' if its drag torque turns the body towards positive yaw")
    z: Length | None = Field(default=None, description="above the centre of mass, m; 0 if not given")
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

    def number(self, key: str) -> float:
        """A coefficient, 0 where it is not given."""
        quantity: Quantity | None = getattr(self, key)
        return 0.0 if quantity is None else quantity.value

    def along(self, key: str, names: tuple[str, str, str]) -> Vec3:
        """Three coefficients, by the ends of their keys."""
        return Vec3(*(self.number(f"{key}_{name}") for name in names))
