r"""Numbers of a vehicle that are possible but hardly meant: an axis without authority, a number in another unit.

*Authority.* The largest torque about an axis, either way, that sound rotors give while they hold hover, over the
moment of inertia, is the angular acceleration that is left to turn with. Turning by an angle :math:`\theta` and
stopping within t takes :math:`4\theta/t^2`. With less than `LEAST` of it an axis can hardly be reached: a light wind
takes thrust, or the other axes, away from it. The lever is the torque for each newton that is moved between rotors.

*Units.* Vehicles of all sizes are alike, so numbers are judged in proportion to each other: mass by the cube of the
arm; radii of gyration, :math:`\sqrt{J/m}`, and the torque ratio by the arm. The radius R of a rotor follows from the
thrust coefficient, :math:`b = C_T\rho\pi R^4`, for :math:`C_T` differs little between propellers: static
coefficients of about 0.1 in the normalisation of J. Brandt, M. Selig, "Propeller Performance Data at Low Reynolds
Numbers", AIAA 2011-1255, are 0.012 in this one. R is judged by the arm and by the speed of its tips, the rotor's
inertia by m R². The bounds are our choice: wide around the vehicles that are included and others that we know of,
narrow beside a wrong unit, which is a factor of tens and more.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

from rotorfault.maths.geometry import PerRotor, Vec3, spread
from rotorfault.model.aerodynamics import Aerodynamics
from rotorfault.model.mixer import hover_thrust, nominal_inverse
from rotorfault.model.proportion import INERTIAS, LENGTHS, Proportion, times
from rotorfault.model.signals import Wrench
from rotorfault.model.vehicle import ROTOR_NUMBERS, Vehicle, rotor_speeds
from rotorfault.model.vehicle_parts_check import parts

ANGLE = 0.5  # rad, by which the least authority turns
TIMES = Vec3(0.5, 0.5, 2.0)  # s, about roll, pitch, yaw; our choice: a gust builds up in as much, yaw can wait
LEAST = Vec3.of(4.0 * ANGLE / t**2 for t in TIMES)  # rad/s^2
AXES = ("roll", "pitch", "yaw")
SPARE = 0.2  # of hover's thrust: with less to spare up or down it is thrust that an axis lacks, not its lever
BESIDE = 0.1  # of the arm: so far from the middle of the rotors a centre of mass takes a tenth of thrust from some
ALIKE = 2.0  # share up to which two drags of one vehicle may be the same number by two sources
FAR_AWAY = 0.5  # of the arm: from 0.7 on no four rotors of an X balance each other
THRUST = 0.012 * 1.2 * math.pi  # kg/m^3: C_T rho pi


def vehicle_warnings(vehicle: Vehicle) -> list[str]:
    """What about a vehicle's numbers is hardly meant, a line each, with the number and how to mend it.

    Parameters
    ----------
    vehicle : Vehicle
        Of floats, in SI units, its rotors sound.

    Returns
    -------
    list of str
        Empty if there is nothing.
    """
    units = list(_units(vehicle))
    # Of a moment of inertia in another unit nothing more need be said.
    if any(line.startswith("centre_of_mass") for line in units):
        return units
    said = [axis for axis, key in zip(AXES, "xyz", strict=True) if any(f"inertia_{key} =" in line for line in units)]
    return [*units, *_drag_twice(vehicle), *(line for axis, line in _authority(vehicle) if axis not in said)]


def _drag_twice(vehicle: Vehicle) -> Iterator[str]:
    """A line where the drag of the rotors is as large as the linear drag: most likely the same, given twice."""
    if not isinstance(vehicle.air, Aerodynamics):
        return
    linear = vehicle.linear_drag
    of_rotors = vehicle.air.rotor_drag * math.fsum(rotor_speeds(vehicle, hover_thrust(vehicle)))
    if linear > 0.0 and linear / ALIKE < of_rotors < ALIKE * linear:
        yield (
            f"linear_drag = {linear:g} N s/m and that of the rotors, air.rotor_drag times their speeds in hover, "
            f"{of_rotors:.3g}, are about the same and act both; if it is one drag given twice, set linear_drag = 0"
        )


def most_torque(vehicle: Vehicle, thrust: PerRotor, axis_B: Vec3) -> float:
    """Largest torque in N m either way about an axis before a rotor reaches a limit; 0 if one is beyond it.

    Parameters
    ----------
    vehicle : Vehicle
        Of floats, its rotors sound.
    thrust : PerRotor, N
        That the rotors give meanwhile.
    axis_B : Vec3
        Unit vector, body axes.
    """
    change = nominal_inverse(vehicle, Wrench(0.0, axis_B))
    # Rotors that give no torque about the axis do not limit it.
    least = 1e-9 * max(abs(c) for c in change)
    rooms = _spare(vehicle, thrust)
    room = [spare / abs(c) for spare, c in zip(rooms, change, strict=True) if abs(c) > least]
    return float(max(0.0, min(room)))


# --------------------------------------------------------------------------------------------------------- authority


def _spare(vehicle: Vehicle, thrust: PerRotor) -> list[float]:
    """Thrust in N by which each rotor may change, either way, before it is at a limit; below 0 beyond it."""
    low, high = (spread(x * vehicle.rotor_gain, vehicle.rotors) for x in (vehicle.thrust_min, vehicle.thrust_max))
    return [float(min(most - f, f - least)) for f, least, most in zip(thrust, low, high, strict=True)]


def _authority(vehicle: Vehicle) -> Iterator[tuple[str, str]]:
    """Axes that can hardly be reached, each with what there is to say."""
    hover = hover_thrust(vehicle)
    spare = min(_spare(vehicle, hover))
    for name, key, moment, least, time, unit in zip(
        AXES, "xyz", vehicle.inertia, LEAST, TIMES, (Vec3.of(row) for row in _UNITS), strict=True
    ):
        torque = most_torque(vehicle, hover, unit)
        turn = torque / moment
        if turn >= least:
            continue
        lever = 1.0 / math.fsum(abs(c) for c in nominal_inverse(vehicle, Wrench(0.0, unit)))
        have = f"lever {1e3 * lever:.3g} mm, {spare:.3g} N to spare on each rotor, inertia_{key} {moment:.3g} kg m^2"
        line = (
            f"{name}: hover leaves an angular acceleration of {turn:.3g} rad/s^2 ({have}); turning by {ANGLE:g} rad "
            f"within {time:g} s takes {least:g} rad/s^2, so the axis can hardly be controlled; "
            f"{_remedy(vehicle, name, spare * vehicle.rotors / (vehicle.mass * vehicle.gravity))}"
        )
        yield name, line


_UNITS = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


def _remedy(vehicle: Vehicle, axis: str, share: float) -> str:
    away = math.hypot(*_middle(vehicle))
    if away > BESIDE * max(math.hypot(*at) for at in zip(vehicle.rotor_x, vehicle.rotor_y, strict=True)):
        return (
            f"the centre of mass lies {1e3 * away:.3g} mm from the middle of the rotors, so some carry more than "
            "their share: check centre_of_mass"
        )
    if share < SPARE:
        return (
            f"hover leaves {100.0 * share:.2g} % of a rotor's thrust to spare: check mass, thrust_min and thrust_max"
        )
    if axis == "yaw":
        return "check torque_ratio (drag torque over thrust, k_M / k_F) and inertia_z"
    return "check x and y of the rotors (are their arms nearly on one line?) and the inertia"


# ------------------------------------------------------------------------------------------------------------- units


def _units(vehicle: Vehicle) -> Iterator[str]:
    v = vehicle
    # From the middle of the rotors: a centre of mass in another unit is no wrong arm.
    x, y = _middle(v)
    arm = max(math.hypot(rx - x, ry - y) for rx, ry in zip(v.rotor_x, v.rotor_y, strict=True))
    what, bounds = "mass over arm^3 [kg/m^3]", (1.0, 120.0, 5000.0)
    mass = Proportion("mass", v.mass, "kg", what, lambda m: m / arm**3, *bounds, {"in g": times(1e-3)})
    size = Proportion("longest arm", arm, "m", what, lambda a: v.mass / a**3, *bounds, LENGTHS)
    if not size.fits:
        # All else is judged by mass and arm, so nothing more is said.
        yield mass.line() if mass.of(v.mass) > mass.high else f"{size.line()} for x and y of the rotors"
        return
    away = math.hypot(x, y)
    if away > FAR_AWAY * arm:
        # Thrusts of hover, and so the rotors' numbers, are judged by it.
        units = {words: convert(away) for words, convert in LENGTHS.items() if convert(away) < BESIDE * arm}
        hint = f"if it is {next(iter(units))}, write m" if units else "check its unit and its sign"
        yield (
            f"centre_of_mass = {away:.4g} m from the middle of the rotors: over the arm it is {away / arm:.3g}, "
            f"usual 0 to {FAR_AWAY:g}; {hint}"
        )
        return
    for proportion in (*_masses(v, arm), *_each_rotor(v, arm), *parts(v, arm)):
        if not proportion.fits:
            yield proportion.line()


def _middle(v: Vehicle) -> tuple[float, float]:
    """Where the middle of the rotors is, in m from the centre of mass."""
    return math.fsum(v.rotor_x) / v.rotors, math.fsum(v.rotor_y) / v.rotors


def _each_rotor(v: Vehicle, arm: float) -> Iterator[Proportion]:
    """Numbers of the rotors; those that differ for each of them."""
    different = [key for key in ROTOR_NUMBERS if isinstance(getattr(v, key), PerRotor)]
    for rotor in range(v.rotors if different else 1):
        numbers: Any = {key: getattr(v, key)[rotor] for key in different}
        for proportion in _rotors(v._replace(**numbers), arm):
            if proportion.key in different:
                yield proportion._replace(key=f"{proportion.key} of rotor {rotor + 1}")
            elif rotor == 0:
                yield proportion


def _masses(v: Vehicle, arm: float) -> Iterator[Proportion]:
    for axis, moment in zip("xyz", v.inertia, strict=True):
        what = "radius of gyration, sqrt(inertia / mass), over the arm"
        yield Proportion(
            f"inertia_{axis}", moment, "kg m^2", what, lambda J: math.sqrt(J / v.mass) / arm, 0.02, 0.4, 1.5, INERTIAS
        )
    if v.linear_drag > 0.0:
        what = "speed of fall, m g over it [m/s],"
        yield Proportion(
            "linear_drag", v.linear_drag, "N s/m", what, lambda k: v.mass * v.gravity / k, 2.0, 30.0, math.inf, {}
        )
    yield Proportion("gravity", v.gravity, "m/s^2", "", lambda g: g, 1.0, 9.81, 30.0, {})


def _rotors(v: Vehicle, arm: float) -> Iterator[Proportion]:
    hover = hover_thrust(v)

    def radius(b: float) -> float:
        return math.sqrt(math.sqrt(b / THRUST))

    def tip(b: float) -> float:
        return radius(b) * float(rotor_speeds(v._replace(thrust_coefficient=b), hover)[0])

    per_turn = {
        "in N/rpm^2": times((30.0 / math.pi) ** 2),
        "in N/krpm^2": times((30.0 / math.pi) ** 2 * 1e-6),
        "in N/Hz^2": times(0.25 / math.pi**2),
        "in gf/(rad/s)^2": times(9.80665e-3),
    }
    b = v.thrust_coefficient
    speed = float(rotor_speeds(v, hover)[0])
    what = (
        f"speed of the blades' tips in hover, at {speed:.4g} rad/s of blades of about {1e3 * radius(b):.3g} mm [m/s],"
    )
    yield Proportion("thrust_coefficient", b, "N/(rad/s)^2", what, tip, 5.0, 50.0, 140.0, per_turn)
    what = f"radius of the blades, about {1e3 * radius(b):.3g} mm, over the arm"
    yield Proportion(
        "thrust_coefficient", b, "N/(rad/s)^2", what, lambda b: radius(b) / arm, 0.02, 0.6, 1.1, per_turn
    )
    ratio = {
        "k_M in N m s^2": lambda value: value / b,
        "k_F / k_M": lambda value: 1.0 / value,
        "in mm": times(1e-3),
        "in cm": times(1e-2),
    }
    what = "drag torque over thrust, k_M / k_F, over the arm"
    yield Proportion("torque_ratio", v.torque_ratio, "m", what, lambda kappa: kappa / arm, 0.005, 0.1, 1.0, ratio)
    weights = v.rotor_gain * v.rotors / (v.mass * v.gravity)
    grams = {"in gf": times(9.80665e-3), "in mN": times(1e-3)}
    yield Proportion(
        "thrust_max", v.thrust_max, "N", "thrust-to-weight", lambda F: F * weights, 1.0, 2.5, 25.0, grams
    )
    if v.thrust_min < 0.0:
        what = "pull backwards over the largest push (thrust_min is 0 for rotors that only push)"
        yield Proportion(
            "thrust_min", v.thrust_min, "N", what, lambda low: -low / v.thrust_max, 0.05, 0.5, 1.5, grams
        )
    lag = {"a time constant in s": lambda tau: 1.0 / tau, "a time constant in us": lambda tau: 1e6 / tau}
    yield Proportion("rotor_bandwidth", v.rotor_bandwidth, "rad/s", "", lambda w: w, 2.0, 30.0, 1000.0, lag)
    yield Proportion("rotor_gain", v.rotor_gain, "1", "thrust over command", lambda k: k, 0.1, 1.0, 10.0, {})
    if v.rotor_inertia > 0.0:
        disc, what = v.mass * radius(b) ** 2, "inertia of a rotor over m R^2, with R of the thrust coefficient,"
        yield Proportion(
            "rotor_inertia", v.rotor_inertia, "kg m^2", what, lambda J: J / disc, 1e-6, 0.005, 0.1, INERTIAS
        )
