r"""What the time grid of a flight cannot carry: one check for every door (files, overrides, columns of many flights).

The plant is integrated by Runge-Kutta steps of length h, everything else is held over a sampling period. A motion
that is over within a step is flown wrong, or not at all, and the controller would get the blame. So the true vehicle,
after `mismatch`, keeps to (all our choice, far inside the region in which the step is stable, which ends at 2.8)

.. math:: \frac{k_d}{m}h \le \frac12, \qquad \frac{J_r\Omega}{\sqrt{J_xJ_y}}h \le 1, \qquad
          \frac{\tau_{max}}{J}h^2 \le \frac12\,\mathrm{rad}, \qquad \frac{F_{max}}{m}h^2 \le 1\,\mathrm{m}

with the greatest torque, thrust and residual speed that its rotors give: where they differ, all as the fastest and
the strongest of them. How fast they follow commands does not matter, for the lag is exact at any step. Parts say
themselves what they need (`rotorfault.model.block.Block.off_grid`).
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from rotorfault.base.config import refusal
from rotorfault.maths.geometry import PerRotor, Vec3
from rotorfault.model.block import TimeGrid
from rotorfault.model.tilt import Tilt
from rotorfault.model.vehicle import Vehicle, inertia_matrix, rows_of_tilted
from rotorfault.scenario.part import Part

FASTEST_DECAY = 0.5  # of 1 / step: then the step is right to 0.03 % of what decays
FASTEST_PRECESSION = 1.0  # of 1 / step: with one pair of rotors at full thrust and the other at none, so seldom met
FARTHEST_TURN = 0.5  # rad in a step, from rest
FARTHEST = 1.0  # m in a step, from rest
_ROOM = 1e-9  # relative: a step that is one that was named here is allowed


def require_flyable(vehicle: Vehicle, grid: TimeGrid) -> None:
    """Refuse a true vehicle that moves faster than the integration step can follow.

    Parameters
    ----------
    vehicle : Vehicle
        The true one, on floats.
    grid : TimeGrid

    Raises
    ------
    PydanticCustomError
        With the number, and the step that would do.
    """
    J, half = _moments(vehicle), vehicle.rotors / 2.0
    gain, high, low, ratio, coefficient = (
        [*value] if isinstance(value, PerRotor) else [value]
        for value in (
            vehicle.rotor_gain,
            vehicle.thrust_max,
            vehicle.thrust_min,
            vehicle.torque_ratio,
            vehicle.thrust_coefficient,
        )
    )
    # Rotors that turn either way count as what they give at most, whichever way.
    thrust = max(gain) * max(*high, *(abs(x) for x in low))
    lever = _levers(vehicle, half * max(ratio))
    speed = half * math.sqrt(thrust / min(coefficient))
    turning = max(_over(arm * thrust, moment) for arm, moment in zip(lever, J, strict=True))
    decay, pushed = _over(vehicle.linear_drag, vehicle.mass), _over(vehicle.rotors * thrust, vehicle.mass)
    precession = _over(vehicle.rotor_inertia * speed, math.sqrt(J.x) * math.sqrt(J.y))
    found = (
        (f"its drag over mass is {decay:.4g} 1/s", _most(FASTEST_DECAY, decay)),
        (f"its rotors make it precess at up to {precession:.4g} rad/s", _most(FASTEST_PRECESSION, precession)),
        (f"its rotors turn it by up to {turning:.4g} rad/s^2", math.sqrt(_most(FARTHEST_TURN, turning))),
        (f"its rotors push it by up to {pushed:.4g} m/s^2", math.sqrt(_most(FARTHEST, pushed))),
    )
    told, longest = min(found, key=lambda one: one[1])
    if not grid.step <= longest * (1.0 + _ROOM):
        raise refusal(
            "step",
            f"got {grid.step:.4g} s; allowed for the true vehicle: up to {longest:.4g} s, for {told}; "
            "give a shorter step, or check mass, inertia, drag and mismatch",
        )


def _moments(vehicle: Vehicle) -> Vec3:
    """The moments of inertia in kg m^2; with products all as the least principal one, for the axes are mixed."""
    if vehicle.inertia_products == ():
        return vehicle.inertia
    least = float(np.linalg.eigvalsh(np.reshape([*inertia_matrix(vehicle)], (3, 3)))[0])
    return Vec3(least, least, least)


def _levers(vehicle: Vehicle, about_yaw: float) -> list[float]:
    """Half the sums of the rotors' levers about roll, pitch and yaw in m."""
    if isinstance(vehicle.tilt, Tilt):
        rows = rows_of_tilted(vehicle)
        return [sum(map(abs, row)) / 2.0 for row in (rows.roll, rows.pitch, rows.yaw)]
    return [sum(map(abs, vehicle.rotor_y)) / 2.0, sum(map(abs, vehicle.rotor_x)) / 2.0, about_yaw]


def require_on_grid(part: Part[Any], key: str, grid: TimeGrid) -> None:
    """Refuse a part that the time grid cannot carry.

    Parameters
    ----------
    part : Part
    key : str
        Its dotted key in the scenario.
    grid : TimeGrid

    Raises
    ------
    PydanticCustomError
        With the number, and what would do.
    """
    if part.slot.side == "belief" or not getattr(part.factory, "limits_grid", False):
        return
    wrong = part.make().off_grid(grid)
    if wrong is not None:
        setting, message = wrong
        raise refusal(f"{key}.{setting}" if setting else "step", message)


def _over(a: float, b: float) -> float:
    return a / b if b > 0.0 else math.inf


def _most(share: float, rate: float) -> float:
    return share / rate if rate > 0.0 else math.inf
