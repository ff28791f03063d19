"""Battery, air and rotor discs in a wrong unit are named with the number to write, a shifted centre of mass as it."""

from __future__ import annotations

import re

import pytest

from rotorfault.maths.geometry import Vec3
from rotorfault.model.aerodynamics import Aerodynamics
from rotorfault.model.battery import Battery
from rotorfault.model.vehicle import Discs, Vehicle
from rotorfault.model.vehicle_check import vehicle_warnings
from rotorfault.model.vehicle_file import load_vehicle

X500 = load_vehicle("x500").vehicle
AIR = Aerodynamics(2e-4, 2e-4, 0.0, 0.0, Vec3(0.02, 0.02, 0.03), Vec3(3e-3, 3e-3, 3e-3), Vec3(1e-4, 1e-4, 1e-4))


def in_pack(**factors: float) -> Vehicle:
    assert isinstance(X500.battery, Battery)
    pack = X500.battery
    return X500._replace(battery=pack._replace(**{key: getattr(pack, key) * f for key, f in factors.items()}))


def in_air(**factors: float) -> Vehicle:
    found = AIR._replace(**{key: getattr(AIR, key) * f for key, f in factors.items()})
    return X500._replace(air=found)


def discs(factor: float) -> Vehicle:
    assert isinstance(X500.discs, Discs)
    return X500._replace(discs=Discs(X500.discs.radius * factor))


def test_what_is_meant_is_not_doubted() -> None:
    assert vehicle_warnings(X500) == []
    assert vehicle_warnings(in_air()) == []


@pytest.mark.parametrize(
    ("wrong", "key", "words"),
    [
        (in_pack(capacity=1.0 / 3600.0), "battery.capacity", "in A h"),
        (in_pack(capacity=1000.0), "battery.capacity", "in mA s"),
        (in_pack(resistance=1000.0), "battery.resistance", "in mohm"),
        (in_pack(pair_resistance=1000.0), "battery.pair_resistance", "in mohm"),
        (in_pack(pair_capacitance=1000.0), "battery.pair_capacitance", "in mF"),
        (in_pack(other_power=1000.0), "battery.other_power", "in mW"),
        (discs(1000.0), "rotor_radius", "in mm"),
        (discs(1.0 / 0.0254), "rotor_radius", "in inches"),
        (in_air(frame_drag=1000.0), "air.frame_drag_x", "in g/m"),
        (in_air(damping=1000.0), "air.damping_yaw", "in mN m s"),
    ],
)
def test_a_wrong_unit_is_named_with_the_number_to_write(wrong: Vehicle, key: str, words: str) -> None:
    (line,) = [line for line in vehicle_warnings(wrong) if line.startswith(f"{key} = ")]
    assert f"if it is {words}, write" in line, line


def test_a_centre_of_mass_in_mm_is_told_as_that_and_nothing_else() -> None:
    shifted = X500._replace(rotor_x=X500.rotor_x - 3.0)
    (line,) = vehicle_warnings(shifted)
    assert re.match(r"centre_of_mass = 3 m from the middle of the rotors", line)


def test_an_axis_that_a_shifted_centre_of_mass_takes_is_not_blamed_on_mass_or_thrust() -> None:
    # Little thrust to spare, and the rotors ahead have less than the others.
    shifted = X500._replace(rotor_x=X500.rotor_x - 0.1, thrust_max=X500.thrust_max * 0.6)
    lines = [line for line in vehicle_warnings(shifted) if "can hardly be controlled" in line]
    assert lines
    assert all("centre of mass lies 100 mm from the middle" in line for line in lines)


def test_a_rotor_that_pulls_back_by_next_to_nothing_is_doubted() -> None:
    (line,) = vehicle_warnings(X500._replace(thrust_min=-0.001))
    assert line.startswith("thrust_min = -0.001 N")
