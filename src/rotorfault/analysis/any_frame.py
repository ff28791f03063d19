"""Attainable hover of frames without opposite pairs, by active sets: see `rotorfault.analysis.hover`.

What closed forms give for two opposite pairs is found here by raising one number while others stay what they are
(`rotorfault.autopilot.allocation.nearest`), from thrusts that hold hover; on scalars or arrays of many cases. The
steps are twice as many as rotors, with which it agrees with linear programs (tests/analysis/test_any_frame.py).
"""

from __future__ import annotations

import math
from typing import NamedTuple

from rotorfault.autopilot.allocation.nearest import Limits, Push, Steps, limits_of, nearest, pushed
from rotorfault.maths.geometry import PerRotor, Vec3, zeros
from rotorfault.maths.scalar import NAN, Scalar, absolute, both, clip, less_equal, minimum, negated, select, sqrt
from rotorfault.model.effectiveness import WrenchRows, effectiveness
from rotorfault.model.signals import Wrench
from rotorfault.model.vehicle import Vehicle

BALANCED = 1e-6  # of the largest thrust of a rotor: torque over the length of its row that counts as none


class Frame(NamedTuple):
    """Rotors of a vehicle with losses, holding hover as well as they can."""

    vehicle: Vehicle
    rows: WrenchRows  # each of length 1
    lengths: tuple[Scalar, ...]  # of the rows, as they were
    limits: Limits
    needed: Scalar  # N
    hover: PerRotor  # N: thrusts that come nearest to hover, tilt first
    steps: int

    @property
    def tilt_held(self) -> Scalar:
        """1 where there is no tilt torque."""
        return both(self.none(self.rows.roll), self.none(self.rows.pitch))

    def none(self, row: PerRotor, thrust: PerRotor | None = None) -> Scalar:
        """1 where a row gives nothing with the thrusts of hover, or others in N."""
        most = BALANCED * self.vehicle.rotor_gain * self.vehicle.thrust_max
        return less_equal(absolute(row.dot(self.hover if thrust is None else thrust)), most)

    def raised(self, thrust: PerRotor, row: PerRotor, held: tuple[PerRotor, ...], by: Scalar) -> PerRotor:
        """Thrusts in N with a row's sum changed as far towards `by` [N] as can be, and those of others as it was."""
        return pushed(thrust, Push(row, held), by, self.limits, self.steps)


def frame_of(vehicle: Vehicle, low: PerRotor, high: PerRotor, share: PerRotor, needed: Scalar) -> Frame:
    """A frame in hover.

    Parameters
    ----------
    vehicle : Vehicle
    low, high : PerRotor, N
        Least and largest thrust of each rotor.
    share : PerRotor
        Its effectiveness, 0 to 1.
    needed : scalar, N
        Thrust of hover.
    """
    matrix, steps = effectiveness(vehicle), 2 * vehicle.rotors
    limits = limits_of(low, high, share)
    hover = nearest(matrix, Wrench(needed, zeros()), limits, Steps(steps, steps, steps))
    lengths = tuple(sqrt(row.dot(row)) for row in matrix)
    rows = WrenchRows(*(row * (1.0 / length) for row, length in zip(matrix, lengths, strict=True)))
    return Frame(vehicle, rows, lengths, limits, needed, hover, steps)


class Reach(NamedTuple):
    """Thrusts in N of a frame in balance: -inf where there is no balance."""

    most_with_yaw: Scalar
    least_with_yaw: Scalar
    most_without_yaw: Scalar
    least_without_yaw: Scalar
    yaw_torque: Scalar  # N m: left over in hover with tilt in balance


def reach(frame: Frame) -> Reach:
    """Largest and least thrust with tilt, or with all torques, in balance."""
    up, roll, pitch, yaw = frame.rows
    far = frame.limits.high.sum()
    tilt = frame.tilt_held
    most = frame.raised(frame.hover, up, (roll, pitch), far)
    least = frame.raised(frame.hover, up, (roll, pitch), -far)
    level = frame.raised(frame.hover, yaw, (roll, pitch), -yaw.dot(frame.hover))
    all_ = both(tilt, frame.none(yaw, level))
    most_level = frame.raised(level, up, (roll, pitch, yaw), far)
    least_level = frame.raised(level, up, (roll, pitch, yaw), -far)
    return Reach(
        select(all_, most_level.sum(), -math.inf),
        select(all_, least_level.sum(), math.inf),
        select(tilt, most.sum(), -math.inf),
        select(tilt, least.sum(), math.inf),
        yaw.dot(frame.hover) * frame.lengths[3],
    )


def least_thrust(frame: Frame, own: int, with_yaw: bool) -> Scalar:
    """Least thrust in N that a rotor must give for hover, the others as they are; NaN where there is no hover.

    Parameters
    ----------
    frame : Frame
        With this rotor sound.
    own : int
        Its place, from 0.
    with_yaw : bool
        Whether yaw is held.
    """
    up, roll, pitch, yaw = frame.rows
    held = (up, roll, pitch, yaw) if with_yaw else (up, roll, pitch)
    carried = frame.none(up, frame.hover - PerRotor.all(frame.needed / frame.vehicle.rotors, frame.vehicle.rotors))
    possible = both(frame.tilt_held, carried)
    if with_yaw:
        possible = both(possible, frame.none(yaw))
    one = PerRotor.of(1.0 if k == own else 0.0 for k in range(frame.vehicle.rotors))
    lowest = frame.raised(frame.hover, one, held, -frame.hover[own])
    return select(possible, lowest[own], NAN)


def reserve(frame: Frame, with_yaw: bool) -> Vec3:
    """Largest torque in N m about each body axis, either way, at the thrust of hover; 0 where there is no hover."""
    rows = frame.rows
    up, torques = rows.thrust, (rows.roll, rows.pitch, rows.yaw)
    far = 2.0 * frame.limits.high.sum()
    found: list[Scalar] = []
    for axis, row in enumerate(torques):
        if axis == 2 and not with_yaw:
            found.append(0.0)
            continue
        others = tuple(other for k, other in enumerate(torques) if k != axis and (with_yaw or k != 2))
        ways = [row.dot(frame.raised(frame.hover, row, (up, *others), sign * far)) for sign in (1.0, -1.0)]
        found.append(clip(minimum(ways[0], -ways[1]), 0.0, math.inf) * frame.lengths[1 + axis])
    possible = frame.tilt_held if not with_yaw else both(frame.tilt_held, frame.none(rows.yaw))
    return Vec3(*(select(negated(possible), 0.0, torque) for torque in found))
