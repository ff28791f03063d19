"""Vehicles whose numbers are hardly meant: axes that can hardly be reached, and numbers in another unit."""

from __future__ import annotations

import math
import re
from typing import Any

import numpy as np
import pytest

from rotorfault.base.config import parse_toml, validate
from rotorfault.base.errors import InputError
from rotorfault.maths.geometry import PerRotor, Vec3
from rotorfault.model.aerodynamics import still_air
from rotorfault.model.vehicle import Vehicle
from rotorfault.model.vehicle_check import LEAST, most_torque, vehicle_warnings
from rotorfault.model.vehicle_file import VEHICLE_TEMPLATE, VehicleFile, load_vehicle, vehicle_names

GOOD = validate(VehicleFile, parse_toml(VEHICLE_TEMPLATE, "template"), "template").vehicle
# The paper's is odd by itself, and so no measure for wrong units.
VEHICLES = {"template": GOOD} | {name: load_vehicle(name).vehicle for name in ("hummingbird", "crazyflie-2.1")}
each_vehicle = pytest.mark.parametrize("vehicle", VEHICLES.values(), ids=VEHICLES)


def arms(angle: float, length: float = 0.22, turned: float = 0.0) -> dict[str, PerRotor]:
    """Two arms at half the angle in rad on either side of a line that is turned from forward."""
    a, b = turned + 0.5 * angle, turned - 0.5 * angle
    x, y = (tuple(length * f(c) for c in (a, b)) for f in (math.cos, math.sin))
    return {"rotor_x": PerRotor(x[0], -x[0], x[1], -x[1]), "rotor_y": PerRotor(y[0], -y[0], y[1], -y[1])}


@pytest.mark.parametrize("vehicle", [GOOD, *(load_vehicle(name).vehicle for name in vehicle_names())])
def test_vehicles_that_are_included_are_not_doubted(vehicle: Vehicle) -> None:
    assert vehicle_warnings(vehicle) == []


def scaled(vehicle: Vehicle, size: float, density: float) -> Vehicle:
    """A vehicle alike in all proportions; blades turn with the same speed at the tips; without a pack."""
    mass = density * size**3
    b = size**4
    return vehicle._replace(
        mass=vehicle.mass * mass,
        inertia=vehicle.inertia * (mass * size**2),
        rotor_inertia=vehicle.rotor_inertia * mass * size**2,
        rotor_x=vehicle.rotor_x * size,
        rotor_y=vehicle.rotor_y * size,
        thrust_coefficient=vehicle.thrust_coefficient * b,
        torque_ratio=vehicle.torque_ratio * size,
        thrust_max=vehicle.thrust_max * mass,
        linear_drag=vehicle.linear_drag * mass,
        battery=(),
    )


@each_vehicle
@pytest.mark.parametrize("size", [0.3, 1.0, 3.0])
@pytest.mark.parametrize("density", [0.6, 1.0, 1.5])
def test_vehicles_of_all_sizes_are_not_doubted(vehicle: Vehicle, size: float, density: float) -> None:
    assert vehicle_warnings(scaled(vehicle, size, density)) == []


@pytest.mark.parametrize(
    ("angle", "turned", "axes"),
    [
        (math.radians(1.3), 0.0, ["roll"]),
        (math.radians(1.3), 0.5 * math.pi, ["pitch"]),
        (math.radians(1.3), 0.25 * math.pi, ["roll", "pitch"]),
        (math.radians(3.0), 0.0, ["roll"]),
        (math.radians(20.0), 0.0, []),
        (math.radians(90.0), 0.25 * math.pi, []),
    ],
)
def test_arms_nearly_on_one_line_leave_an_axis_without_authority(
    angle: float, turned: float, axes: list[str]
) -> None:
    lines = vehicle_warnings(GOOD._replace(**arms(angle, turned=turned)))
    assert [line.partition(":")[0] for line in lines] == axes
    for line in lines:
        assert "are their arms nearly on one line?" in line
        assert "rad/s^2" in line
    if axes == ["roll"]:
        lever = 0.22 * math.sin(0.5 * angle)
        assert f"lever {1e3 * lever:.3g} mm" in lines[0]
        turn = 4.0 * GOOD.mass * GOOD.gravity / 4.0 * lever / GOOD.inertia.x
        assert f"{turn:.3g} rad/s^2 (lever" in lines[0]


def test_the_least_authority_turns_by_the_angle_in_the_time() -> None:
    """Full torque one way, then the other, of a body that starts and ends at rest."""
    for least, time in zip(LEAST, (0.5, 0.5, 2.0), strict=True):
        t = np.linspace(0.0, time, 20001)
        rate = np.where(t < 0.5 * time, least * t, least * (time - t))
        assert np.trapezoid(rate, t) == pytest.approx(0.5, rel=1e-6)


def test_little_thrust_to_spare_is_told_as_that() -> None:
    hover = GOOD.mass * GOOD.gravity / 4.0
    lines = vehicle_warnings(GOOD._replace(thrust_max=1.03 * hover))
    assert [line.partition(":")[0] for line in lines] == ["roll", "pitch", "yaw"]
    assert all("3 % of a rotor's thrust to spare: check mass, thrust_min and thrust_max" in line for line in lines)
    assert vehicle_warnings(GOOD._replace(thrust_max=1.3 * hover)) == []


@each_vehicle
def test_a_moment_constant_in_place_of_the_ratio(vehicle: Vehicle) -> None:
    moment = vehicle.torque_ratio * vehicle.thrust_coefficient
    unit, axis = vehicle_warnings(vehicle._replace(torque_ratio=moment))
    assert unit.startswith("torque_ratio = ")
    assert f"if it is k_M in N m s^2, write {vehicle.torque_ratio:.4g} m" in unit
    assert axis.startswith("yaw: hover leaves")
    assert "k_M / k_F" in axis


WRONG_UNITS: dict[str, tuple[Any, str, str, str]] = {
    "arms in mm": (1e3, "rotor_x rotor_y", "longest arm", "in mm"),
    "arms in cm": (1e2, "rotor_x rotor_y", "longest arm", "in cm"),
    "arms in inches": (1.0 / 0.0254, "rotor_x rotor_y", "longest arm", "in inches"),
    "mass and thrusts in g": (1e3, "mass thrust_max", "mass", "in g"),
    "inertia in g cm^2": (1e7, "inertia", "inertia_x", "in g cm^2"),
    "inertia in kg cm^2": (1e4, "inertia", "inertia_z", "in kg cm^2"),
    "rotor inertia in g cm^2": (1e7, "rotor_inertia", "rotor_inertia", "in g cm^2"),
    "thrust per rpm^2": ((math.pi / 30.0) ** 2, "thrust_coefficient", "thrust_coefficient", "in N/rpm^2"),
    "thrust per Hz^2": (4.0 * math.pi**2, "thrust_coefficient", "thrust_coefficient", "in N/Hz^2"),
    "ratio in mm": (1e3, "torque_ratio", "torque_ratio", "in mm"),
    "largest thrust in grams": (1e3 / 9.80665, "thrust_max", "thrust_max", "in gf"),
}


@each_vehicle
@pytest.mark.parametrize("case", WRONG_UNITS)
def test_a_wrong_unit_is_named_with_the_number_to_write(case: str, vehicle: Vehicle) -> None:
    factor, fields, key, words = WRONG_UNITS[case]
    wrong = vehicle._replace(**{field: getattr(vehicle, field) * factor for field in fields.split()})
    lines = vehicle_warnings(wrong)
    (line,) = [line for line in lines if line.startswith(f"{key} = ")]
    arm = max(math.hypot(x, y) for x, y in zip(vehicle.rotor_x, vehicle.rotor_y, strict=True))
    right = {"longest arm": arm, "inertia_x": vehicle.inertia.x, "inertia_z": vehicle.inertia.z}
    found = re.search(rf"if it is {re.escape(words)}, write (\S+) ", line)
    assert found, line
    assert float(found[1]) == pytest.approx(right[key] if key in right else getattr(vehicle, key), rel=1e-3)
    # It is not blamed on an axis as well.
    assert not [line for line in lines if "hover leaves" in line]


@each_vehicle
def test_a_time_constant_in_place_of_the_bandwidth(vehicle: Vehicle) -> None:
    (line,) = vehicle_warnings(vehicle._replace(rotor_bandwidth=1.0 / vehicle.rotor_bandwidth))
    assert f"if it is a time constant in s, write {vehicle.rotor_bandwidth:.4g} rad/s" in line


def test_drag_that_hardly_lets_it_fall() -> None:
    (line,) = vehicle_warnings(GOOD._replace(linear_drag=200.0))
    assert re.match(r"linear_drag = 200 N s/m: speed of fall, .* is 0.049.*, usual 2 and more; check its unit", line)
    assert vehicle_warnings(GOOD._replace(linear_drag=0.0, rotor_inertia=0.0)) == []


def test_a_mass_in_grams_is_told_where_it_is_refused() -> None:
    text = VEHICLE_TEMPLATE.replace("mass = { value = 1.0", "mass = { value = 1000.0", 1)
    with pytest.raises(InputError, match=r"thrust-to-weight is 0\.00224; .*; if mass is in g, write 1 kg"):
        validate(VehicleFile, parse_toml(text, "mine"), "mine")


@each_vehicle
def test_the_most_torque_leaves_the_thrust_and_the_other_axes(vehicle: Vehicle) -> None:
    hover = PerRotor.all(vehicle.mass * vehicle.gravity / 4.0)
    spare = min(hover.r1, vehicle.thrust_max - hover.r1)
    assert most_torque(vehicle, hover, Vec3(0.0, 0.0, 1.0)) == pytest.approx(4.0 * spare * vehicle.torque_ratio)
    assert most_torque(vehicle, PerRotor.all(1.01 * vehicle.thrust_max), Vec3(0.0, 0.0, 1.0)) == 0.0


def test_a_drag_that_is_given_twice_is_doubted() -> None:
    vehicle = load_vehicle("hummingbird").vehicle
    twice = vehicle._replace(air=still_air()._replace(rotor_drag=1.19e-4))
    [line] = vehicle_warnings(twice)
    assert "linear_drag = 0.223 N s/m" in line
    assert "set linear_drag = 0" in line
    assert vehicle_warnings(twice._replace(linear_drag=0.0)) == []
    assert vehicle_warnings(twice._replace(linear_drag=0.02)) == []  # the frame's
