r"""Rotor thrusts within limits whose wrench is nearest to a demand, for any frame, by a fixed number of operations.

Of N rotors with thrusts :math:`F_i \in [l_i, h_i]` those are wanted whose wrench BF meets the demand; where none
does, those that miss least tilt torque, among these least thrust, and among these least yaw torque.

It begins with the thrusts that meet the demand with the least sum of :math:`(F_i - l_i)^2/D_i`, each put within its
limits; :math:`D_i` is the square of the rotor's believed effectiveness, so one that gives little is asked for little.
Where none was beyond a limit, that is all, and more than four rotors share the work. Else what is missing of tilt,
then of thrust, then of yaw is made up for, each without a change of what comes before it. To raise b'F while RF stays
what it is, the rotors that are free of their limits move along

.. math:: v = D_{free}\,(b - R^Ty), \qquad (R D_{free} R^T + \epsilon I)\,y = R D_{free}\,b

until nothing is missing or one more is at a limit; a rotor at a limit is free where :math:`b_i - (R^Ty)_i` of the
step before leads it back from there. That is the method of active sets, with so many steps for each stage; each step
keeps what has been reached. The rows of B and R have length 1, and :math:`\epsilon` bounds the pivots of the matrix
from below: nothing near singular is inverted, however few rotors are left, and a direction in which the free rotors
can hardly move is not taken (`LEAST_GAIN`).

Tilted rotors begin with thrusts of little lateral force besides (`rotorfault.model.effectiveness.eased`); where that
is beyond a limit, what is made up for is the demand alone.

Source of the problem, and of active sets for it: M. Bodson, "Evaluation of optimization methods for control
allocation", J. Guid. Control Dyn. 25(4), 2002; O. Harkegard, "Efficient active set algorithms for solving constrained
least squares problems in aircraft control allocation", CDC 2002. How near a fixed number of steps comes to linear
programs is measured in tests/autopilot/allocation/test_nearest.py.
"""

from __future__ import annotations

from typing import NamedTuple

from rotorfault.maths.geometry import PerRotor
from rotorfault.maths.scalar import (
    Scalar,
    absolute,
    both,
    clip,
    either,
    greater_equal,
    less,
    less_equal,
    maximum,
    select,
    sqrt,
)
from rotorfault.model.effectiveness import LateralRows, WrenchRows, eased
from rotorfault.model.signals import Wrench

PIVOT = 1e-9  # of rows of length 1, squared: epsilon
LEAST_GAIN = 1e-6  # of a step's direction along what is to be raised: with less it is rounding
AT_LIMIT = 1e-9  # of the largest range of a rotor: as near it is at its limit
TINY = 1e-12  # keeps quotients finite where both of their sides are 0


class Steps(NamedTuple):
    """Steps of each stage."""

    tilt: int
    thrust: int
    yaw: int


STEPS = Steps(tilt=4, thrust=5, yaw=5)


class Limits(NamedTuple):
    """What the rotors may give."""

    low: PerRotor  # N
    high: PerRotor  # N
    weight: PerRotor  # D: square of the believed effectiveness; 0 for a rotor that must not be used
    margin: Scalar  # N: as near, a rotor is at its limit


class Push(NamedTuple):
    """What is to be raised, and what stays."""

    row: PerRotor  # b, of length 1
    held: tuple[PerRotor, ...]  # R, rows of length 1


def limits_of(low: PerRotor, high: PerRotor, share: PerRotor) -> Limits:
    """Limits of rotors, and how much each is to be used.

    Parameters
    ----------
    low, high : PerRotor, N
        Least and largest thrust of each rotor.
    share : PerRotor
        Believed effectiveness of each rotor: 1 for a sound one, 0 for one that must not be used.
    """
    return Limits(low, high, share * share, AT_LIMIT * (high - low).reduce(maximum))


def nearest(
    matrix: WrenchRows,
    demand: Wrench,
    limits: Limits,
    steps: Steps = STEPS,
    lateral: LateralRows | tuple[()] = (),
) -> PerRotor:
    """Thrusts in N within their limits, whose wrench is nearest to a demand.

    Parameters
    ----------
    matrix : WrenchRows
        The effectiveness.
    demand : Wrench
        Thrust [N] and torque [N m, body axes].
    limits : Limits
    steps : Steps
    lateral : LateralRows, optional
        Of tilted rotors.

    Returns
    -------
    PerRotor
        In N; exact, but for about 1e-8 of a limit, where the demand is attainable and the steps suffice.
    """
    lengths = [sqrt(row.dot(row)) for row in matrix]
    up, roll, pitch, yaw = (row * (1.0 / length) for row, length in zip(matrix, lengths, strict=True))
    T, tau_x, tau_y, tau_z = (
        x / length for x, length in zip((demand.thrust, *demand.torque_B), lengths, strict=True)
    )
    rows = (up, roll, pitch, yaw)
    thrust = _beginning(rows, (T, tau_x, tau_y, tau_z), limits, lateral).map(clip, limits.low, limits.high)

    # Tilt, along what is missing of it and with nothing added across.
    x, z = tau_x - roll.dot(thrust), tau_y - pitch.dot(thrust)
    length = sqrt(x * x + z * z)
    over = 1.0 / (length + TINY)
    x, z = x * over, z * over
    thrust = pushed(thrust, Push(roll * x + pitch * z, (pitch * x - roll * z,)), length, limits, steps.tilt)
    missing = T - up.dot(thrust)
    thrust = pushed(thrust, Push(up, (roll, pitch)), missing, limits, steps.thrust)
    missing = tau_z - yaw.dot(thrust)
    return pushed(thrust, Push(yaw, (roll, pitch, up)), missing, limits, steps.yaw)


def _beginning(
    rows: tuple[PerRotor, ...], demands: tuple[Scalar, ...], limits: Limits, lateral: LateralRows | tuple[()]
) -> PerRotor:
    """Thrusts in N that meet the demands with the least sum of squares, and little lateral force, limits or not."""
    weight = limits.weight
    if not isinstance(lateral, LateralRows):
        left = [d - row.dot(limits.low) for d, row in zip(demands, rows, strict=True)]
        return limits.low + _combined(rows, _solved(rows, weight, left)) * weight
    begun = eased(limits.low, lateral, weight)
    columns = tuple(eased(row * weight, lateral, weight) for row in rows)
    left = [d - row.dot(begun) for d, row in zip(demands, rows, strict=True)]
    return begun + _combined(columns, _factored(rows, columns, left))


def pushed(thrust: PerRotor, push: Push, missing: Scalar, limits: Limits, steps: int) -> PerRotor:
    """Thrusts in N with more of one thing, and no less or more of others.

    Parameters
    ----------
    thrust : PerRotor, N
        Within the limits.
    push : Push
    missing : scalar, N
        By which the sum of thrusts, weighted with the row, is to grow; or to fall, below zero.
    limits : Limits
    steps : int
        At most one rotor more comes to a limit with each.
    """
    row = push.row * select(less(missing, 0.0), -1.0, 1.0)
    missing = absolute(missing)
    low, high = limits.low + limits.margin, limits.high - limits.margin
    ahead = _across(row, push.held, limits.weight)
    for _ in range(steps):
        at_low, at_high = thrust.map(less_equal, low), thrust.map(greater_equal, high)
        free = ahead.map(_free, at_low, at_high, limits.weight)
        ahead = _across(row, push.held, free)
        direction = ahead * free
        gain = row.dot(direction)
        over, under = _least_ratio(thrust, direction, limits)
        # As far as is missing, or as there is room: over gain, and over / under; the smaller without a division.
        whole = less_equal(missing * under, over * gain)
        part = select(whole, missing, over) / maximum(select(whole, gain, under), TINY)
        part = select(less(gain, LEAST_GAIN), 0.0, part)
        thrust = (thrust + direction * part).map(clip, limits.low, limits.high)
        missing = maximum(missing - gain * part, 0.0)
    return thrust


def _free(ahead: Scalar, at_low: Scalar, at_high: Scalar, weight: Scalar) -> Scalar:
    """The weight of a rotor that is at no limit, or leaves it; else 0."""
    blocked = either(both(at_high, less(0.0, ahead)), both(at_low, less(ahead, 0.0)))
    return select(blocked, 0.0, weight)


def _least_ratio(thrust: PerRotor, direction: PerRotor, limits: Limits) -> tuple[Scalar, Scalar]:
    """Room of the rotor that comes to its limit first, and its part of the direction: numerator and denominator."""
    best: tuple[Scalar, Scalar] = (1.0, 0.0)  # without end
    for f, v, low, high in zip(thrust, direction, limits.low, limits.high, strict=True):
        room, size = maximum(select(less(v, 0.0), f - low, high - f), 0.0), absolute(v)
        first = less(room * best[1], best[0] * size)
        best = select(first, room, best[0]), select(first, size, best[1])
    return best


def _across(row: PerRotor, held: tuple[PerRotor, ...], weight: PerRotor) -> PerRotor:
    """What a row has beside others: b - R'y."""
    weighted = row * weight
    y = _solved(held, weight, [other.dot(weighted) for other in held])
    return row - _combined(held, y)


def _combined(rows: tuple[PerRotor, ...], factors: list[Scalar]) -> PerRotor:
    total: PerRotor = rows[0] * factors[0]
    for row, factor in zip(rows[1:], factors[1:], strict=True):
        total = total + row * factor
    return total


def _solved(rows: tuple[PerRotor, ...], weight: PerRotor, right: list[Scalar]) -> list[Scalar]:
    """Solution of (rows diag(weight) rows' + epsilon I) x = right."""
    return _factored(rows, tuple(row * weight for row in rows), right)


def _factored(rows: tuple[PerRotor, ...], weighted: tuple[PerRotor, ...], right: list[Scalar]) -> list[Scalar]:
    """Solution of (weighted rows' + epsilon I) x = right, symmetric, by L D L'."""
    lower: list[list[Scalar]] = []
    pivots: list[Scalar] = []
    x: list[Scalar] = []
    for i, row in enumerate(weighted):
        parts: list[Scalar] = []  # of row i of L D
        for j in range(i):
            part = row.dot(rows[j])
            for k in range(j):
                part = part - parts[k] * lower[j][k]
            parts.append(part)
        lower.append([part / pivot for part, pivot in zip(parts, pivots, strict=True)])
        pivot = row.dot(rows[i])
        for part, below in zip(parts, lower[i], strict=True):
            pivot = pivot - part * below
        pivots.append(maximum(pivot, 0.0) + PIVOT)  # exactly, it is not below zero
        value = right[i]
        for j in range(i):
            value = value - lower[i][j] * x[j]
        x.append(value)
    x = [value / pivot for value, pivot in zip(x, pivots, strict=True)]
    for i in reversed(range(len(x))):
        for j in range(i + 1, len(x)):
            x[i] = x[i] - lower[j][i] * x[j]
    return x


def most_thrust(matrix: WrenchRows, limits: Limits, steps: int) -> tuple[Scalar, Scalar]:
    """Largest thrust in N with no more torque than the least thrusts have, and with yaw torque whatever comes.

    Parameters
    ----------
    matrix : WrenchRows
        The effectiveness.
    limits : Limits
    steps : int
        For each of the two.
    """
    up, *torques = (row * (1.0 / sqrt(row.dot(row))) for row in matrix)
    endless = limits.high.sum()
    balanced = pushed(limits.low, Push(up, tuple(torques)), endless, limits, steps)
    turning = pushed(balanced, Push(up, tuple(torques[:2])), endless, limits, steps)
    return matrix.thrust.dot(balanced), matrix.thrust.dot(turning)
