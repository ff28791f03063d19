r"""Relaxed hover: how a multirotor stays in the air without the rotors that it has lost, if need be by spinning.

With some rotors dead there may be no thrusts that balance all torques. What is then left is a motion in which the
body turns steadily about an axis fixed in it, and that axis stays vertical: it neither climbs nor goes anywhere, but
on a small circle. Body rates omega, thrusts F and the vertical n in body axes do not change:

.. math:: \omega = w\,n, \qquad \tau(F) + \tau_{gyro}(\omega) + \tau_{air}(\omega) = \omega\times J\omega, \qquad
          n_z \sum_i F_i = m g

Where there is one at rest, hover is not relaxed. Of all others the one with the least power, the sum of
:math:`F_i^{3/2}`, whose living rotors each keep a *reserve*: a share of their mean thrust that none falls below, as
much as asked for where that is possible. Without one, the rotor opposite a dead one could stand still and push to one
side only.

Source of the idea: M. W. Mueller, R. D'Andrea, "Stability and control of a quadrocopter despite the complete loss of
one, two, or three propellers", ICRA 2014, and "Relaxed hover solutions for multicopters", IJRR 35(8), 2016. Flying so
is claimed by US patent 9,856,016 B2. The equations here are solved as they stand, for any rotors.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.optimize import minimize

from rotorfault.analysis.vehicle_settings import numbers_of_vehicle
from rotorfault.base.bounds import require, whole_number
from rotorfault.base.errors import InputError
from rotorfault.base.one_line import record_line
from rotorfault.base.text_table import table_lines
from rotorfault.maths.arrays import Array
from rotorfault.maths.geometry import PerRotor, Vec3, spread, zeros
from rotorfault.maths.scalar import Scalar, sqrt
from rotorfault.model.aerodynamics import Aerodynamics, air_wrench
from rotorfault.model.likeness import in_air
from rotorfault.model.motion import angular_acceleration, greatest_thrust
from rotorfault.model.vehicle import (
    Vehicle,
    body_momentum,
    lateral_force,
    residual_speed,
    rotor_places,
    rotor_speeds,
    wrench_of,
)
from rotorfault.model.vehicle_file import VehicleFile

RESERVE = 0.3  # as the cascade of controllers has it
GYRO_END = math.radians(2000.0)  # rad/s: end of the usual largest range of small gyros, such as the BMI088's
FASTEST = 2000.0  # rad/s: of the body, far beyond what holds together; bounds the search
TINY = 1e-6  # (rad/s)^2: makes the axis smooth at rest
_BALANCED = 1e-7  # of what is left of an equation, each brought to a size of about 1


class RelaxedHover(NamedTuple):
    """A steady motion in which a vehicle stays in the air."""

    dead: tuple[int, ...]  # rotors counted from 1
    possible: bool
    thrust: PerRotor  # N; NaN where it is not possible
    omega_B: Vec3  # rad/s, body axes
    axis_B: Vec3  # of length 1, body axes: what points up, and about which the body turns
    tilt: float  # rad, between the thrust axis and the vertical
    period: float  # s for one turn; infinite where it does not turn
    radius: float  # m, of the circle that the centre of mass goes round
    power: float  # over that of hover with all rotors
    reserve: float  # least share of their mean thrust that a living rotor has
    why: str  # it is not possible; empty where it is

    def __repr__(self) -> str:
        return record_line(self)


def relaxed_hover(
    vehicle: Vehicle | VehicleFile | str | Path, dead: Iterable[int] = (), reserve: float = RESERVE
) -> RelaxedHover:
    """The steady hover that a vehicle has left when rotors are dead, in still air.

    Parameters
    ----------
    vehicle : Vehicle, VehicleFile, or name or path of a vehicle file
    dead : iterable of int
        Rotors that give no thrust, counted from 1.
    reserve : float
        Least share, 0 to 1, of their mean thrust that each living rotor keeps.

    Returns
    -------
    RelaxedHover

    Raises
    ------
    InputError
        If there is no such vehicle, a rotor does not exist or is named twice, none lives, or the reserve is not
        between 0 and 1.
    """
    vehicle = numbers_of_vehicle(vehicle)
    gone = dead_rotors(vehicle, dead)
    require(reserve, (int, float), "reserve", "a share of the mean thrust, 0 to 1")
    if not 0.0 <= reserve <= 1.0:
        raise InputError(f"reserve: {reserve!r} came; allowed: a share of the mean thrust, 0 to 1")
    problem = _Problem(vehicle, gone)
    if why := problem.without_search():
        return _impossible(vehicle, gone, why)
    found = problem.best(reserve)
    if found is None:  # with less reserve; where there is nothing without any, there is nothing
        least = problem.best(0.0)
        if least is None:
            return _impossible(vehicle, gone, problem.why_none())
        found = next((x for share in (0.5, 0.25) if (x := problem.best(share * reserve)) is not None), least)
    return problem.result(found)


def relaxed_lines(hover: RelaxedHover, vehicle: Vehicle) -> list[str]:
    """Relaxed hover as text.

    Parameters
    ----------
    hover : RelaxedHover
    vehicle : Vehicle
        The one that it is of.

    Returns
    -------
    list of str
    """
    gone = f"rotor{'s' if len(hover.dead) > 1 else ''} {', '.join(map(str, hover.dead))} dead"
    if not hover.possible:
        return [f"Relaxed hover, {gone}: not possible; {hover.why}"]
    turning = math.isfinite(hover.period)
    circle = f", on a circle of {hover.radius:.2g} m" if turning else ""
    # What the search leaves of a rate that is none is not printed.
    size = 1e-4 * float(hover.omega_B.norm())
    rates = ", ".join(f"{rate:.3g}" if abs(rate) > size else "0" for rate in map(float, hover.omega_B))
    rows = [
        ("thrusts [N]", ", ".join(f"{number}: {float(f):.4g}" for number, f in enumerate(hover.thrust, start=1))),
        ("least thrust of a living rotor", f"{hover.reserve:.3g} of their mean" if hover.reserve > 1e-6 else "0"),
        ("body rates p, q, r [rad/s]", f"{rates}; a turn takes {hover.period:.3g} s" if turning else "0, it stands"),
        ("tilt", f"{math.degrees(hover.tilt):.3g} deg{circle}"),
        ("power", f"{hover.power:.3g} times that of hover with all rotors"),
    ]
    note = []
    if turning and float(hover.omega_B.norm()) > GYRO_END:
        note = [f"  that is more than the {GYRO_END:.3g} rad/s (2,000 deg/s) at which common gyros end"]
    return [f"Relaxed hover, {gone}", *table_lines(rows, "<<", indent=2), *note]


def dead_rotors(vehicle: Vehicle, of: Iterable[int]) -> tuple[int, ...]:
    """Numbers of dead rotors in order, checked: each there, named once, and one at least that lives.

    Parameters
    ----------
    vehicle : Vehicle
    of : iterable of int
        Counted from 1.
    """
    require(of, Iterable, "dead", "numbers of rotors, such as [1, 3]")
    dead = [whole_number(rotor, "dead rotor", 1, vehicle.rotors) for rotor in of]
    if len({*dead}) != len(dead):
        raise InputError(f"dead rotors {', '.join(map(str, dead))} came; allowed: each once")
    if len(dead) == vehicle.rotors:
        raise InputError("all rotors are dead; allowed: at least one that lives")
    return tuple(sorted(dead))


class _Problem:
    """Unknowns x: thrusts of the living rotors over their mean in level hover, then the body rates over `_RATE`."""

    def __init__(self, vehicle: Vehicle, dead: tuple[int, ...]) -> None:
        self.vehicle, self.dead = in_air(vehicle), dead
        self.living = [index for index in range(vehicle.rotors) if index + 1 not in dead]
        self.weight = float(vehicle.mass * vehicle.gravity)
        self.mean = self.weight / len(self.living)
        # N m: brings torques to a size of about 1.
        self.torque = self.weight * max(
            math.hypot(x, y) for x, y in zip(vehicle.rotor_x, vehicle.rotor_y, strict=True)
        )

    def split(self, x: Array) -> tuple[PerRotor, Vec3]:
        """Thrusts of all rotors in N, and body rates in rad/s."""
        thrust: list[Scalar] = [0.0] * self.vehicle.rotors
        for index, share in zip(self.living, x, strict=False):
            thrust[index] = share * self.mean
        return PerRotor(*thrust), Vec3.of(x[-3:] * _RATE)

    def unbalanced(self, x: Array) -> Array:
        """What the equations miss: three of torque, one of weight. `x` may have a column for each of many motions."""
        vehicle = self.vehicle
        thrust, omega = self.split(x)
        speeds = rotor_speeds(vehicle, thrust)
        assert isinstance(vehicle.air, Aerodynamics)
        _, damped = air_wrench(vehicle.air, rotor_places(vehicle), speeds, zeros(), omega)
        wrench = wrench_of(vehicle, thrust)
        faster = angular_acceleration(vehicle, wrench.torque_B + damped, omega, residual_speed(vehicle, speeds))
        left = body_momentum(vehicle, faster) / self.torque
        return np.array([*left, self.carried(thrust, omega) / self.weight - 1.0])

    def carried(self, thrust: PerRotor, omega: Vec3) -> Scalar:
        """Force of the rotors in N along the axis about which the body turns."""
        along = wrench_of(self.vehicle, thrust).thrust
        up: Scalar = along * upright(omega)
        if self.vehicle.tilt == ():
            return up
        beside = lateral_force(self.vehicle, thrust)
        if not np.any(np.abs(omega.z) > _STANDING):
            # It stands, and leans until the whole force points up.
            return sqrt(along * along + beside.x * beside.x + beside.y * beside.y)
        across = (beside.x * omega.x + beside.y * omega.y) * omega.z
        return up + across / ((omega.dot(omega) + TINY) * upright(omega))

    def slope(self, x: Array) -> Array:
        """Derivatives of `unbalanced`, a column for each unknown: central differences, all in one evaluation."""
        step = 1e-6
        there = x[:, None] + step * np.hstack([np.eye(len(x)), -np.eye(len(x))])
        ends = self.unbalanced(there)
        return np.asarray((ends[:, : len(x)] - ends[:, len(x) :]) / (2.0 * step))

    def power(self, x: Array) -> float:
        """Power over that of level hover with the living rotors alike."""
        return float(np.mean(np.maximum(x[: len(self.living)], 0.0) ** 1.5))

    def power_slope(self, x: Array) -> Array:
        """Derivatives of `power`."""
        living = len(self.living)
        return np.array([*(1.5 / living * np.sqrt(np.maximum(x[:living], 0.0))), 0.0, 0.0, 0.0])

    def starts(self) -> list[Array]:
        """Where searches begin: equal thrusts, at rest and turning the way that they push, upright and leaning."""
        shares = np.ones(len(self.living))
        push = float(wrench_of(self.vehicle, self.split(np.array([*shares, 0.0, 0.0, 0.0]))[0]).torque_B.z)
        # Away from the dead rotors: there the living ones push down the side that is left.
        x, y = (sum(float(place[r - 1]) for r in self.dead) for place in (self.vehicle.rotor_x, self.vehicle.rotor_y))
        away = math.hypot(x, y) or 1.0
        motions = [(0.0, 0.0)] + [(math.copysign(spin, push), lean) for spin in (20.0, 100.0) for lean in (0.0, 0.5)]
        return [
            np.array([*shares, -lean * spin * x / away / _RATE, -lean * spin * y / away / _RATE, spin / _RATE])
            for spin, lean in motions
        ]

    def solve(self, start: Array, reserve: float, fastest: float = FASTEST) -> Array | None:
        """The motion with the least power that a search from a start finds; None if it finds none."""
        vehicle, living = self.vehicle, len(self.living)
        gain, least = (spread(number, vehicle.rotors) for number in (vehicle.rotor_gain, vehicle.thrust_min))
        low, high = (gain * least) / self.mean, spread(greatest_thrust(vehicle), vehicle.rotors) / self.mean
        bounds = [(float(low[i]), float(high[i])) for i in self.living] + [(-fastest / _RATE, fastest / _RATE)] * 3
        rest = np.hstack([np.eye(living) - reserve / living, np.zeros((living, 3))])
        rules = [
            {"type": "eq", "fun": self.unbalanced, "jac": self.slope},
            {"type": "ineq", "fun": lambda x: rest @ x, "jac": lambda x: rest},
        ]
        with np.errstate(all="ignore"):
            found = minimize(
                self.power, start, jac=self.power_slope, bounds=bounds, constraints=rules, method="SLSQP",
                options={"maxiter": 60, "ftol": 1e-14},
            )  # fmt: skip
        x = np.asarray(found.x)
        if not np.all(np.isfinite(x)):
            return None
        left = max(float(np.abs(self.unbalanced(x)).max()), -float((rest @ x).min()))
        # At the bound of the search nothing balances the spin: it only turns too fast to see that.
        settled = left < _BALANCED and max(np.abs(x[-3:])) * _RATE < 0.9 * max(fastest, _STANDING)
        return x if settled else None

    def best(self, reserve: float) -> Array | None:
        """The motion with the least power that searches find, one at rest if there is any; None if there is none."""
        rest, *turning = self.starts()
        if (still := self.solve(rest, reserve, fastest=0.0)) is not None:
            return still
        found = [motion for start in turning if (motion := self.solve(start, reserve)) is not None]
        return min(found, key=self.power, default=None)

    def why_none(self) -> str:
        """What is to be said where the searches found none."""
        air = self.vehicle.air
        assert isinstance(air, Aerodynamics)
        if not any((*air.damping, *air.damping_squared, air.rotor_drag)):
            return "nothing of this vehicle damps a spin; see air.damping_yaw and air.rotor_drag of vehicle files"
        return "no steady spin carries the weight within the limits of the rotors"

    def without_search(self) -> str:
        """What stands against any such motion, where that is plain; else empty."""
        greatest = spread(greatest_thrust(self.vehicle), self.vehicle.rotors)
        alive = PerRotor.of(float(index in self.living) for index in range(self.vehicle.rotors))
        most = float(wrench_of(self.vehicle, greatest * alive).thrust)
        if most < self.weight:
            return f"the rotors left give {most:.4g} N at most, the weight is {self.weight:.4g} N"
        return ""

    def result(self, x: Array) -> RelaxedHover:
        """The motion in the vehicle's own numbers."""
        thrust, omega = self.split(x)
        # What the search leaves of a thrust that is none.
        thrust = PerRotor.of(float(f) if abs(f) > 1e-9 * self.mean else 0.0 for f in thrust)
        omega = Vec3.of(float(rate) for rate in omega)
        rate, up = float(omega.norm()), float(upright(omega))
        turning = rate > _STANDING
        force_B = Vec3(0.0, 0.0, wrench_of(self.vehicle, thrust).thrust)
        if self.vehicle.tilt != ():
            force_B = force_B + lateral_force(self.vehicle, thrust)
        total, along = float(force_B.norm()), float(self.carried(thrust, omega))
        lateral = math.sqrt(max(0.0, total * total - along * along))
        living = [float(thrust[index]) for index in self.living]
        sound = self.vehicle.rotors * (self.weight / self.vehicle.rotors) ** 1.5
        return RelaxedHover(
            dead=self.dead,
            possible=True,
            thrust=thrust,
            omega_B=omega if turning else zeros(),
            axis_B=omega / math.copysign(rate, omega.z) if turning else force_B / total,
            tilt=math.acos(min(1.0, up if turning else float(force_B.z) / total)),
            period=2.0 * math.pi / rate if turning else math.inf,
            radius=lateral / float(self.vehicle.mass) / rate**2 if turning else 0.0,
            power=sum(max(f, 0.0) ** 1.5 for f in living) / sound,
            reserve=min(living) / (sum(living) / len(living)),
            why="",
        )


_RATE = 10.0  # rad/s: brings body rates to a size of about 1
_STANDING = 1e-2  # rad/s: a body that turns slower, once in ten minutes, does not turn


def upright(omega_B: Vec3) -> Scalar:
    """Cosine of the angle between the thrust axis and the axis about which a body turns; 1 for one that does not.

    Parameters
    ----------
    omega_B : Vec3, rad/s
        Body rates.
    """
    cosine: Scalar = sqrt((omega_B.z * omega_B.z + TINY) / (omega_B.dot(omega_B) + TINY))
    return cosine


def _impossible(vehicle: Vehicle, dead: tuple[int, ...], why: str) -> RelaxedHover:
    none = math.nan
    return RelaxedHover(
        dead, False, PerRotor.all(none, vehicle.rotors), Vec3(none, none, none), Vec3(none, none, none),
        none, none, none, none, none, why,
    )  # fmt: skip
