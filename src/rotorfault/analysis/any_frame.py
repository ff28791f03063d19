"""Attainable hover of frames without opposite pairs, by linear programs: see `rotorfault.analysis.hover`.

What closed forms give for two opposite pairs is found here by programs over the thrusts of the rotors, each within
its limits. Many cases are solved as one block-diagonal program by HiGHS; the same case is solved once.
"""

from __future__ import annotations

import math
from itertools import combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rotorfault.maths.arrays import Array
from rotorfault.maths.geometry import PerRotor, Vec3
from rotorfault.maths.scalar import Scalar
from rotorfault.model.effectiveness import effectiveness
from rotorfault.model.motion import greatest_thrust, mean_of
from rotorfault.model.vehicle import Vehicle

UP, ROLL, PITCH, YAW = range(4)
MISSED = 1e-8  # of the largest thrust: what equations may be missed by and count as met
CONTROLLED_AT_ONCE = 500  # cases whose facets are looked at together, for memory
MOST_AT_ONCE = 2000  # cases of one program: their time grows faster than their number


class Frame(NamedTuple):
    """Different cases of rotors that are to hold hover, in units of the largest thrust of a rotor."""

    rows: Array  # (cases, 4, rotors): effectiveness, each row of length 1
    lengths: Array  # (cases, 4): of the rows, as they were
    low: Array  # (cases, rotors)
    high: Array
    needed: Array  # (cases,)
    unit: Array  # (cases,) N
    place: NDArray[np.intp]  # which case each of those asked for is
    shape: tuple[int, ...]  # of those asked for

    def told(self, values: Array) -> Scalar:
        """Numbers of the cases as those who asked have them: a float for one, else an array."""
        found = values[self.place].reshape(self.shape)
        return found if self.shape else float(found)


def frame_of(vehicle: Vehicle, low: PerRotor, high: PerRotor, needed: Scalar) -> Frame:
    """A frame in hover; numbers of it may be arrays of many cases.

    Parameters
    ----------
    vehicle : Vehicle
    low, high : PerRotor, N
        Least and largest thrust of each rotor.
    needed : scalar, N
        Thrust of hover.
    """
    columns = [x for row in effectiveness(vehicle) for x in row]
    numbers = [*columns, *low, *high, needed, mean_of(greatest_thrust(vehicle))]
    whole = np.broadcast_arrays(*(np.asarray(x, dtype=float) for x in numbers))
    shape, count = whole[0].shape, vehicle.rotors
    cases, place = np.unique(np.stack([x.ravel() for x in whole], axis=1), axis=0, return_inverse=True)
    rows, unit = cases[:, : 4 * count].reshape(-1, 4, count), cases[:, -1]
    lengths = np.linalg.norm(rows, axis=2)
    low_, high_, needed_ = cases[:, 4 * count : 5 * count], cases[:, 5 * count : 6 * count], cases[:, -2]
    scaled = rows / np.maximum(lengths, 1e-300)[:, :, None]
    each = unit[:, None]
    return Frame(scaled, lengths, low_ / each, high_ / each, needed_ / unit, unit, place.reshape(-1), shape)


def optimum(frame: Frame, cost: Array, held: tuple[int, ...], right: Array) -> Array:
    """Largest cost . F with some rows of the effectiveness held; -inf where that cannot be. In units of thrust.

    Parameters
    ----------
    frame : Frame
    cost : ndarray, shape (cases, rotors)
    held : tuple of int
        Rows that are held.
    right : ndarray, shape (cases, held rows)
        At what.
    """
    found = np.full(len(cost), -math.inf)
    for first in range(0, len(cost), MOST_AT_ONCE):
        part = slice(first, first + MOST_AT_ONCE)
        rows, bounds = frame.rows[part][:, held], np.stack([frame.low[part], frame.high[part]], axis=2)
        found[part] = _optima(cost[part], rows, right[part], bounds)
    return found


def _optima(cost: Array, rows: Array, right: Array, bounds: Array) -> Array:
    cases, count = right.shape
    # First as little help for each equation, either way, as there can be: with none it can be met.
    help_ = np.broadcast_to(np.hstack([np.eye(count), -np.eye(count)]), (cases, count, 2 * count))
    endless = np.broadcast_to([0.0, np.inf], (cases, 2 * count, 2))
    price = np.hstack([np.zeros((cases, rows.shape[2])), np.ones((cases, 2 * count))])
    x = _solved(price, np.concatenate([rows, help_], axis=2), right, np.concatenate([bounds, endless], axis=1))
    possible = (x * price).sum(axis=1) < MISSED
    found = np.full(cases, -math.inf)
    if possible.any():
        # What is met but for rounding is asked for as it is met.
        met = np.einsum("ckr,cr->ck", rows, x[:, : rows.shape[2]])[possible]
        best = _solved(-cost[possible], rows[possible], met, bounds[possible])
        found[possible] = (cost[possible] * best).sum(axis=1)
    return found


def _solved(cost: Array, rows: Array, right: Array, bounds: Array) -> Array:
    """Where each cost is least."""
    from scipy import sparse
    from scipy.optimize import linprog

    cases = len(right)
    answer = linprog(
        cost.ravel(),
        A_eq=sparse.bsr_matrix((rows, np.arange(cases), np.arange(cases + 1))),
        b_eq=right.ravel(),
        bounds=bounds.reshape(-1, 2),
        options={"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10},
    )
    if answer.status != 0:
        raise ArithmeticError(f"linear program of the attainable set: {answer.message}")
    return np.asarray(answer.x.reshape(cost.shape))


class Reach(NamedTuple):
    """Thrusts in N of a frame in balance: -inf and inf where there is no balance."""

    most_with_yaw: Scalar
    least_with_yaw: Scalar
    most_without_yaw: Scalar
    least_without_yaw: Scalar
    yaw_torque: Scalar  # N m: left over at least in hover with tilt in balance; NaN where that cannot be


def reach(frame: Frame) -> Reach:
    """Largest and least thrust with tilt, or with all torques, in balance."""
    up, yaw, cases = frame.rows[:, UP], frame.rows[:, YAW], len(frame.rows)
    ends: list[Array] = []
    for held in ((ROLL, PITCH, YAW), (ROLL, PITCH)):
        none = np.zeros((cases, len(held)))
        for sign in (1.0, -1.0):
            ends.append(sign * optimum(frame, sign * up, held, none) * frame.lengths[:, UP] * frame.unit)
    hover = np.stack([np.zeros(cases), np.zeros(cases), frame.needed / frame.lengths[:, UP]], axis=1)
    most, least = (sign * optimum(frame, sign * yaw, (ROLL, PITCH, UP), hover) for sign in (1.0, -1.0))
    with np.errstate(invalid="ignore"):
        left = np.where(most < least, np.nan, np.clip(0.0, least, most)) * frame.lengths[:, YAW] * frame.unit
    return Reach(*(frame.told(x) for x in (*ends, left)))


def controlled(frame: Frame, channels: int) -> Scalar:
    """1 where every small change of wrench about hover can be given, in the first channels, else 0.

    Of the zonotope of all wrenches, hover has to lie within both planes of every facet, as in
    `rotorfault.analysis.controllability`. A rotor that gives nothing spans no facet; planes along it bound the set
    all the same, and where the set is flat its own plane is among them, for all rotors together reach every channel.

    Parameters
    ----------
    frame : Frame
    channels : int
        4 for thrust, roll, pitch and yaw; 3 to give up yaw.
    """
    found = np.zeros(len(frame.rows))
    three = np.array(list(combinations(range(frame.low.shape[1]), channels - 1)))
    for first in range(0, len(found), CONTROLLED_AT_ONCE):
        part = slice(first, first + CONTROLLED_AT_ONCE)
        rows, low, high = frame.rows[part, :channels], frame.low[part], frame.high[part]
        columns = rows.transpose(0, 2, 1)[:, three]  # (cases, facets, channels - 1, channels)
        minors = [(-1.0) ** k * np.linalg.det(np.delete(columns, k, axis=3)) for k in range(channels)]
        normals = np.stack(minors, axis=2)
        length = np.linalg.norm(normals, axis=2)
        flat = length <= MISSED * np.linalg.norm(columns, axis=3).prod(axis=2)
        normals = normals / np.where(flat, 1.0, length)[:, :, None]
        along = normals @ rows  # (cases, facets, rotors)
        middle = np.einsum("cfr,cr->cf", along, 0.5 * (low + high))
        hover = normals[:, :, UP] * (frame.needed[part] / frame.lengths[part, UP])[:, None]
        room = 0.5 * np.einsum("cfr,cr->cf", np.abs(along), high - low) - np.abs(hover - middle)
        found[part] = ((room > MISSED) | flat).all(axis=1)
    return frame.told(found)


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
    held = (UP, ROLL, PITCH, YAW) if with_yaw else (UP, ROLL, PITCH)
    cost = np.zeros(frame.low.shape)
    cost[:, own] = -1.0
    least = -optimum(frame, cost, held, _hover(frame, len(held)))
    return frame.told(np.where(np.isinf(least), np.nan, least * frame.unit))


def reserve(frame: Frame, with_yaw: bool) -> Vec3:
    """Largest torque in N m about each body axis, either way, at the thrust of hover; 0 where there is no hover."""
    found = []
    for axis in (ROLL, PITCH, YAW):
        if axis == YAW and not with_yaw:
            found.append(np.zeros(len(frame.rows)))
            continue
        held = tuple(k for k in (UP, ROLL, PITCH, YAW) if k != axis and (with_yaw or k != YAW))
        row, right = frame.rows[:, axis], _hover(frame, len(held))
        most = np.minimum(*(optimum(frame, sign * row, held, right) for sign in (1.0, -1.0)))
        found.append(np.maximum(most, 0.0) * frame.lengths[:, axis] * frame.unit)
    return Vec3(*(frame.told(torque) for torque in found))


def _hover(frame: Frame, held: int) -> Array:
    right = np.zeros((len(frame.rows), held))
    right[:, 0] = frame.needed / frame.lengths[:, UP]
    return right
