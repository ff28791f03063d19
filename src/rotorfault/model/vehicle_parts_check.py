r"""Numbers of battery, air and rotor discs that are possible but hardly meant: a number in another unit.

Judged like the others (`rotorfault.model.vehicle_check`), in proportion to the vehicle: a pack by how long it carries
hover and by the voltage that hover takes of it, power by that of hover; what the air takes by the speed at which it
holds the weight, or by the time in which it stops a spin. The bounds are our choice, wide around the vehicles that we
know of, narrow beside a wrong unit.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

from rotorfault.maths.geometry import PerRotor
from rotorfault.model.aerodynamics import Aerodynamics
from rotorfault.model.battery import Battery
from rotorfault.model.mixer import hover_thrust
from rotorfault.model.proportion import LENGTHS, Proportion, times
from rotorfault.model.vehicle import Discs, Vehicle, rotor_speeds

CELL = 3.7  # V, of a lithium polymer cell, nominal
CAPACITIES = {"in mA h": times(3.6), "in A h": times(3600.0), "in mA s": times(1e-3)}


def parts(vehicle: Vehicle, arm: float) -> Iterator[Proportion]:
    """Each number in its proportion.

    Parameters
    ----------
    vehicle : Vehicle
        Of floats, its rotors sound.
    arm : float, m
        The longest.
    """
    if isinstance(vehicle.discs, Discs):
        what = "radius over the arm"
        yield Proportion("rotor_radius", vehicle.discs.radius, "m", what, lambda r: r / arm, 0.05, 0.6, 2.0, LENGTHS)
    if isinstance(vehicle.battery, Battery):
        yield from _pack(vehicle, vehicle.battery)
    if isinstance(vehicle.air, Aerodynamics):
        yield from _air(vehicle, vehicle.air)


def _pack(vehicle: Vehicle, pack: Battery) -> Iterator[Proportion]:
    thrusts: PerRotor = hover_thrust(vehicle)
    rotors = pack.rotor_power * math.fsum(max(f, 0.0) ** 1.5 for f in thrusts)
    volts = pack.cells * CELL
    amperes = (rotors + pack.other_power) / volts
    # With the power of the rest in another unit nothing could be said of the pack, so it is left out here.
    what = "time for which it carries hover [s],"
    yield Proportion(
        "battery.capacity", pack.capacity, "A s", what, lambda c: c * volts / rotors, 60.0, 900.0, 14400.0, CAPACITIES
    )
    what = "voltage that hover takes of it, over its own,"
    for key, ohms in (("resistance", pack.resistance), ("pair_resistance", pack.pair_resistance)):
        yield Proportion(
            f"battery.{key}",
            ohms,
            "ohm",
            what,
            lambda r: r * amperes / volts,
            1e-4,
            0.03,
            0.5,
            {"in mohm": times(1e-3)},
        )
    what = "time constant with pair_resistance [s],"
    yield Proportion(
        "battery.pair_capacitance", pack.pair_capacitance, "F", what, lambda c: c * pack.pair_resistance, 0.05, 20.0,
        5000.0, {"in mF": times(1e-3)},
    )  # fmt: skip
    if pack.other_power > 0.0:
        what = "power over that of the rotors in hover"
        yield Proportion(
            "battery.other_power",
            pack.other_power,
            "W",
            what,
            lambda p: p / rotors,
            0.0,
            0.05,
            2.0,
            {"in mW": times(1e-3)},
        )


def over(number: float) -> Callable[[float], float]:
    """That number over a value.

    Parameters
    ----------
    number : float
    """
    return lambda value: number / value


def _air(vehicle: Vehicle, air: Aerodynamics) -> Iterator[Proportion]:
    weight = vehicle.mass * vehicle.gravity
    turning = math.fsum(abs(w) for w in rotor_speeds(vehicle, hover_thrust(vehicle)))
    per_turn = {"in N s^2/(m krpm)": times(30.0 / math.pi * 1e-3), "in N s/(m rpm)": times(30.0 / math.pi)}
    what = "speed at which it is as much as the weight [m/s],"
    for key in ("rotor_drag", "inflow"):
        if (k := getattr(air, key)) > 0.0:
            yield Proportion(
                f"air.{key}", k, "kg/rad", what, lambda k: weight / (k * turning), 2.0, 30.0, math.inf, per_turn
            )
    for key, k in zip("xyz", air.frame_drag, strict=True):
        if k > 0.0:
            yield Proportion(
                f"air.frame_drag_{key}", k, "kg/m", what, lambda k: math.sqrt(weight / k), 2.0, 20.0, math.inf,
                {"in g/m": times(1e-3)},
            )  # fmt: skip
    what = "time in which it stops a spin [s],"
    for key, d, J in zip(("roll", "pitch", "yaw"), air.damping, vehicle.inertia, strict=True):
        if d > 0.0:
            yield Proportion(
                f"air.damping_{key}", d, "N m s", what, over(J), 0.02, 2.0, math.inf,
                {"in mN m s": times(1e-3), "in N mm s": times(1e-3)},
            )  # fmt: skip
    what = "rate at which it takes 1/s of the spin [rad/s],"
    for key, d, J in zip(("roll", "pitch", "yaw"), air.damping_squared, vehicle.inertia, strict=True):
        if d > 0.0:
            yield Proportion(
                f"air.damping_squared_{key}", d, "N m s^2", what, over(J), 0.05, 50.0, math.inf,
                {"in mN m s^2": times(1e-3)},
            )  # fmt: skip
