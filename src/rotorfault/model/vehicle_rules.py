r"""What rotors and inertia of a vehicle file must be to fly: rules on plain numbers, each with its refusal.

*Inertia.* The eigenvalues of the inertia matrix are the principal moments: all above zero, and none above the sum of
the other two. *Reach.* Rows of the effectiveness are thrust, roll, pitch and yaw of a newton of each rotor; thrust,
roll and pitch must be had independently, and yaw where there are rotors enough for it. *Hover.* Within the limits
some thrusts carry the weight level with no torque left over.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from pydantic_core import PydanticCustomError

from rotorfault.base.config import refusal
from rotorfault.maths.arrays import Array

LEAST_ROW = 1e-3  # of an axis, what is its own: with less it is another axis in disguise
NAMES = ("thrust", "roll", "pitch", "yaw")
BEYOND = 0.05  # of a rotor's range: by as much a thrust of level hover may be beyond a limit; allocation keeps to it
ROUNDING = 1e-9  # relative: printed digits of a flat plate must not be refused


class RotorSet(NamedTuple):
    """All rotors of a vehicle; arrays have one row or number for each."""

    places: Array  # (rotors, 3), m, forward, left and up of the centre of mass
    axes: Array  # (rotors, 3), unit vectors
    signs: Array  # (rotors,), +1 where the drag torque turns the body to the left
    torque_ratio: Array  # (rotors,), m
    low: Array  # (rotors,), N, least thrust, gain included
    high: Array  # (rotors,), N, greatest thrust, gain included

    @property
    def tilted(self) -> bool:
        """Whether any does not point straight up."""
        return bool((self.axes != [0.0, 0.0, 1.0]).any())

    def rows(self) -> Array:
        """Thrust, roll, pitch and yaw of a newton of each rotor, torques over the longest arm; yaw as signs."""
        x, y = self.places[:, :2].T
        arm = max(float(np.hypot(x, y).max()), 1e-300)
        ratio = self.torque_ratio / self.torque_ratio.mean()
        if not self.tilted:
            return np.array([np.ones(len(x)), y / arm, -x / arm, self.signs * ratio])
        torque = np.cross(self.places, self.axes) + self.axes * (self.signs * self.torque_ratio)[:, None]
        yaw = torque[:, 2] / max(float(np.abs(torque[:, 2]).max()), 1e-300)
        return np.array([self.axes[:, 2], torque[:, 0] / arm, torque[:, 1] / arm, yaw])


def inertia_refusal(moments: Array, products: Array) -> PydanticCustomError | None:
    """What is wrong with an inertia; None if nothing is.

    Parameters
    ----------
    moments : ndarray, shape (3,), kg m^2
        About forward, left and upward axis.
    products : ndarray, shape (3,), kg m^2
        Elements xy, xz and yz of the inertia matrix.
    """
    if not products.any():
        for axis, moment in zip("xyz", moments.tolist(), strict=True):
            others = math.fsum(moments.tolist()) - moment
            # Equality is a flat plate; rounding of printed digits must not refuse it.
            if moment > others * (1.0 + ROUNDING):
                message = f"got {moment!r} kg m^2; allowed: at most the sum of the other two, {others:.6g} (no rigid"
                return refusal(f"inertia_{axis}", f"{message} body has more); check the exponents")
        return None
    xy, xz, yz = products
    (x, y, z) = moments
    least, middle, most = np.linalg.eigvalsh([[x, xy, xz], [xy, y, yz], [xz, yz, z]])
    told = f"principal moments of {least:.6g}, {middle:.6g} and {most:.6g} kg m^2"
    key = f"inertia_{('xy', 'xz', 'yz')[int(np.abs(products).argmax())]}"
    if not least > 0.0:
        return refusal(
            key, f"the inertia matrix has {told}; allowed: all greater than 0; check products and exponents"
        )
    if most > (least + middle) * (1.0 + ROUNDING):
        return refusal(
            key,
            f"the inertia matrix has {told}; allowed: none more than the sum of the other two (no rigid body has "
            "more); check the products",
        )
    return None


def reach_refusal(rotors: RotorSet) -> PydanticCustomError | None:
    """Whether thrust, roll and pitch can be had independently, and yaw where there are rotors enough for it."""
    rows = rotors.rows()
    # A flat tricopter has no yaw of its own, and flies without.
    count = min(len(rotors.signs), len(NAMES))
    for row in range(count if rotors.tilted else 1):
        if not np.linalg.norm(rows[row]) >= LEAST_ROW:
            return _cannot(rotors, NAMES[row], float(np.linalg.norm(rows[row])))
    for row in range(1, count):
        others = np.delete(rows[:count], row, axis=0)
        left = rows[row] - np.linalg.lstsq(others.T, rows[row], rcond=None)[0] @ others
        length = float(np.linalg.norm(rows[row]))
        share = float(np.linalg.norm(left)) / max(length, 1e-300)
        if length < LEAST_ROW or share < LEAST_ROW:
            return _cannot(rotors, NAMES[row], share)
    return None


def _cannot(rotors: RotorSet, axis: str, share: float) -> PydanticCustomError:
    tilted = ", axes that do not cancel each other" if rotors.tilted else ""
    return refusal(
        "rotor",
        f"these {len(rotors.signs)} rotors cannot give {axis} independently of the other axes "
        f"({share:.2g} of it is its own); allowed: rotors on different lines through the centre of mass{tilted}, "
        "and some of each sense of rotation",
    )


def hover_refusal(rotors: RotorSet, weight: float) -> PydanticCustomError | None:
    """Whether the rotors can carry a weight in N level with no torque left over, each within its limits.

    A lateral force may be left over: the vehicle leans against it.
    """
    from scipy.optimize import linprog

    rows = rotors.rows()[: min(len(rotors.signs), 4)]
    balance = [weight, *(0.0,) * (len(rows) - 1)]
    bounds = np.column_stack([rotors.low, rotors.high])
    if linprog(np.zeros(len(rotors.signs)), A_eq=rows, b_eq=balance, bounds=bounds).status == 0:
        return None
    low, high = float(rotors.low.min()), float(rotors.high.max())
    x, y = rotors.places[:, :2].mean(axis=0)
    return refusal(
        "rotor",
        f"no thrusts of {low:g} to {high:g} N carry {weight:.4g} N with all torques in balance; the middle of "
        f"the rotors is {1e3 * x:.3g} mm forward and {1e3 * y:.3g} mm left of the centre of mass: check x and y, "
        "which count from there, yaw and thrust_max",
    )


def level_refusal(rotors: RotorSet, hover: Iterable[float]) -> PydanticCustomError | None:
    """Whether tilted rotors are within their limits where they hover with little lateral force, or nearly.

    Parameters
    ----------
    rotors : RotorSet
    hover : iterable of float, N
        Thrusts of the rotors there.
    """
    for number, (thrust, low, high) in enumerate(zip(hover, rotors.low, rotors.high, strict=True), start=1):
        beyond = BEYOND * (high - low)
        if not low - beyond <= thrust <= high + beyond:
            return refusal(
                "rotor",
                f"level hover with little lateral force takes {thrust:.4g} N of rotor {number}; allowed: "
                f"{low:g} to {high:g} N; check axes, which are to cancel each other sideways, and yaw",
            )
    return None
