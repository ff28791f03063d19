r"""What the geometry of a vehicle reaches in hover: torque about each axis, force across body z without leaning.

Torques are those of `rotorfault.analysis.hover.torque_reserve`: about one axis at a time, the others in balance, at
the thrust of hover. With tilted rotors the forces across body z, with all torques in balance and the weight carried,
are a polygon,

.. math:: \{Lu : Bu = (mg, 0, 0, 0),\ lo \le u \le hi\},

whose corners linear programs find in many directions. The largest circle about no force that it holds is what the
vehicle can push in any direction without leaning; a vehicle that has one is fully actuated. Where no force at all is
outside of the polygon, the vehicle leans in hover.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from scipy.optimize import linprog

from rotorfault.analysis.hover import torque_reserve
from rotorfault.base.one_line import record_line
from rotorfault.maths.arrays import Array
from rotorfault.maths.geometry import PerRotor, Vec3, spread
from rotorfault.model.effectiveness import effectiveness, lateral_rows
from rotorfault.model.mixer import hover_thrust
from rotorfault.model.vehicle import Vehicle, lateral_force

DIRECTIONS = 48  # in which corners are looked for
YAW_ROTORS = 4  # fewer have no yaw of their own
NOTHING = 1e-6  # of the weight: a smaller force is 0 but for rounding


class Reach(NamedTuple):
    """What hover leaves to turn with and to push with."""

    torque: Vec3  # N m: about each body axis, either way, the others in balance
    turn: Vec3  # rad/s^2: over the moment of inertia
    lateral: float  # N: in any direction across body z without leaning; 0 without tilted rotors, negative if it leans
    left_over: Vec3  # N: force across body z that level hover has

    def __repr__(self) -> str:
        return record_line(self)


def reach_of(vehicle: Vehicle) -> Reach:
    """What a vehicle can reach in hover with sound rotors.

    Parameters
    ----------
    vehicle : Vehicle
        Of floats.
    """
    yaw = vehicle.rotors >= YAW_ROTORS
    torque = torque_reserve(vehicle, PerRotor.all(0.0, vehicle.rotors), yaw=yaw)
    none = Vec3(0.0, 0.0, 0.0)
    if vehicle.tilt == ():
        return Reach(torque, torque.over(vehicle.inertia), 0.0, none)
    return Reach(
        torque, torque.over(vehicle.inertia), lateral_radius(vehicle), lateral_force(vehicle, hover_thrust(vehicle))
    )


def lateral_radius(vehicle: Vehicle) -> float:
    """Force in N across body z that tilted rotors can give in any direction, level and in balance.

    Parameters
    ----------
    vehicle : Vehicle
        With tilted rotors.

    Returns
    -------
    float
        0 if there is none; negative where hover cannot be had without leaning, by the force that is too much.
    """
    rows = np.array([[*row] for row in effectiveness(vehicle)], dtype=float)[: min(vehicle.rotors, YAW_ROTORS)]
    rows /= np.linalg.norm(rows, axis=1)[:, None]
    sides = np.array([[*row] for row in lateral_rows(vehicle)], dtype=float)
    low, high = (
        np.array([*spread(limit * vehicle.rotor_gain, vehicle.rotors)], dtype=float)
        for limit in (vehicle.thrust_min, vehicle.thrust_max)
    )
    weight = float(vehicle.mass * vehicle.gravity)
    up = np.array([*effectiveness(vehicle).thrust], dtype=float)
    right = np.zeros(len(rows))
    right[0] = weight / float(np.linalg.norm(up))
    corners = []
    for angle in np.arange(DIRECTIONS) * (2.0 * math.pi / DIRECTIONS):
        cost = -(math.cos(angle) * sides[0] + math.sin(angle) * sides[1])
        answer = linprog(cost, A_eq=rows, b_eq=right, bounds=np.column_stack([low, high]))
        if answer.status != 0:
            return -math.inf
        corners.append(sides @ answer.x)
    found = _radius(np.array(corners))
    return 0.0 if abs(found) < NOTHING * weight else found


def _radius(corners: Array) -> float:
    """Distance of the origin from the edges between corners that go round once; negative outside."""
    least = math.inf
    for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        edge = b - a
        length = float(np.hypot(*edge))
        if length > NOTHING:
            least = min(least, float(a[0] * edge[1] - a[1] * edge[0]) / length)
    return least if math.isfinite(least) else -float(np.hypot(*corners[0]))


def reach_lines(vehicle: Vehicle) -> list[str]:
    """The same in words, a line each.

    Parameters
    ----------
    vehicle : Vehicle
        Of floats.
    """
    reach, weight = reach_of(vehicle), float(vehicle.mass * vehicle.gravity)
    names = ["roll", "pitch", "yaw"] if vehicle.rotors >= YAW_ROTORS else ["roll", "pitch"]
    turns = ", ".join(f"{name} {turn:.3g}" for name, turn in zip(names, reach.turn, strict=False))
    lines = [f"in hover it can turn with {turns} rad/s^2" + ("" if len(names) == 3 else "; yaw is never held")]
    if vehicle.tilt == ():
        return lines
    size = reach.left_over.norm()
    if reach.lateral > 0.0:
        share = f"{reach.lateral / weight:.2g} of the weight"
        lines.append(f"fully actuated: it can push {reach.lateral:.3g} N in any direction without leaning, {share}")
    elif size > NOTHING * weight:
        lean = math.degrees(math.atan2(size, weight))
        lines.append(f"level hover leaves {size:.3g} N across it, so it leans by {lean:.2g} degrees")
    else:
        lines.append("not fully actuated: it cannot push in every direction without leaning")
    return lines
