r"""The least height that any law could need: a body without some rotors, leaning and turning, whose fall is stopped.

What no law can beat, however clever and however soon it is told. With J the smaller moment of roll and pitch,
:math:`\tau` the largest tilt torque that the living rotors have together in any one direction, T their whole thrust,

.. math:: \dot s \le \frac{\tau}{J} + \frac{|J_x - J_y|}{2J}\,|r|\,s, \qquad \dot\theta \ge -s, \qquad
          \dot v \le \frac{T}{m}\max(\cos\theta, 0) - g + d(v)

with :math:`s \ge \sqrt{p^2 + q^2}` the tilt rate, of which gyroscopic torques take and give nothing, :math:`\theta`
the angle of the thrust axis to the vertical, and v the vertical speed. All tilt rate there is turns the axis upwards,
all torque speeds that up, the rotors follow at once and give all their thrust without any torque besides, and the air
holds the body back by as much as drag can at that speed. The height is what is lost until v is zero.

So it is a bound from below and no promise: that a rotor pushes one way only, that rotors lag, that full thrust tilts
a body that has lost one, and that it has to be stopped upright before it flies on, is not in it.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from rotorfault.analysis.relaxed_hover import dead_rotors
from rotorfault.analysis.vehicle_settings import numbers_of_vehicle
from rotorfault.maths.arrays import Array
from rotorfault.maths.geometry import spread
from rotorfault.model.aerodynamics import Aerodynamics
from rotorfault.model.effectiveness import effectiveness
from rotorfault.model.likeness import in_air
from rotorfault.model.motion import greatest_thrust
from rotorfault.model.vehicle import Vehicle, rotor_speeds
from rotorfault.model.vehicle_file import VehicleFile

STEP = 1e-3  # s: the heights are right to a millimetre or so
LONGEST = 20.0  # s: a fall that is not stopped by then is not stopped


def least_height(
    vehicle: Vehicle | VehicleFile | str | Path,
    dead: Iterable[int] = (),
    tilt: ArrayLike = math.pi,
    omega_B: Sequence[ArrayLike] = (0.0, 0.0, 0.0),
    falling: ArrayLike = 0.0,
) -> Array:
    """Height in m below which no law stops the fall of a vehicle, in still air; infinite where thrust never does.

    Parameters
    ----------
    vehicle : Vehicle, VehicleFile, or name or path of a vehicle file
    dead : iterable of int
        Rotors that give no thrust, counted from 1.
    tilt : array_like, rad
        Angle of the thrust axis to the vertical at the start; upside down if not given.
    omega_B : three array_like, rad/s
        Body rates at the start; at rest if not given.
    falling : array_like, m/s
        Speed downwards at the start.

    Raises
    ------
    InputError
        If there is no such vehicle, a rotor does not exist or is named twice, or none lives.
    """
    able = _Able(numbers_of_vehicle(vehicle), dead)
    p, q, r, theta, v = np.broadcast_arrays(
        *(np.asarray(x, dtype=float) for x in (*omega_B, np.abs(tilt), np.negative(falling)))
    )
    J = min(able.J[:2])
    s = np.sqrt((able.J[0] * p**2 + able.J[1] * q**2) / J)
    r, height = np.abs(r) + able.reaction, np.zeros(np.shape(s))
    least, falls = height, np.ones(np.shape(s), dtype=bool)
    apart = abs(able.J[0] - able.J[1])
    for _ in range(round(LONGEST / STEP)):
        s = s + STEP * (able.tilting / J + 0.5 * apart / J * r * s)
        r = r + STEP * (able.turning + 0.5 * apart * s**2) / able.J[2]
        theta = np.maximum(theta - STEP * s, 0.0)
        down = np.maximum(-v, 0.0)
        air = (able.drag[0] * down + able.drag[1] * down**2) / able.mass
        v = v + STEP * (able.thrust / able.mass * np.maximum(np.cos(theta), 0.0) - able.gravity + air)
        height = height + STEP * v
        least = np.minimum(least, height)
        # Upright and no longer falling it climbs for good, or never.
        falls = falls & ((v < 0.0) | (theta > 0.0))
        if not falls.any():
            break
    return np.asarray(np.where(falls, np.inf, -least))


class _Able:
    """What living rotors and the air can do at most."""

    def __init__(self, vehicle: Vehicle, dead: Iterable[int]) -> None:
        vehicle = in_air(vehicle)
        gone = dead_rotors(vehicle, dead)
        alive = [i for i in range(vehicle.rotors) if i + 1 not in gone]
        most = spread(greatest_thrust(vehicle), vehicle.rotors)
        rows = [np.array([float(row[i] * most[i]) for i in alive]) for row in effectiveness(vehicle)]
        self.mass, self.gravity = float(vehicle.mass), float(vehicle.gravity)
        self.J = [float(x) for x in vehicle.inertia]
        self.thrust, self.turning = float(rows[0].sum()), float(np.abs(rows[3]).sum())
        self.tilting = _longest(np.stack(rows[1:3], axis=1))
        fastest = [float(abs(speed)) for speed in rotor_speeds(vehicle, most)]
        whole: Any = spread(vehicle.rotor_inertia, vehicle.rotors)
        # Rotors that are stopped, or brought to speed, turn the body.
        self.reaction = sum(float(inertia) * speed for inertia, speed in zip(whole, fastest, strict=True)) / self.J[2]
        air = vehicle.air
        assert isinstance(air, Aerodynamics)
        by_rotors = (float(air.rotor_drag) + float(air.inflow)) * sum(fastest)
        frame = max(map(float, air.frame_drag)) + float(air.translational_lift) * vehicle.rotors
        self.drag = (float(vehicle.linear_drag) + by_rotors, frame)


def _longest(torques: Array) -> float:
    """Length of the longest sum of some of these torques, one in each row: any rotor may give all or nothing."""
    # The longest sum lies on one side of a line: those within half a turn from a first one.
    around = np.argsort(np.arctan2(torques[:, 1], torques[:, 0]))
    ordered = np.vstack([torques[around], torques[around]])
    count = len(torques)
    ends = combinations(range(len(ordered) + 1), 2)
    return max(float(np.hypot(*ordered[a:b].sum(axis=0))) for a, b in ends if b - a <= count)
