r"""Rotor thrusts within limits whose wrench is nearest to a demand, for any frame, by a fixed number of operations.

Of N rotors with thrusts :math:`F_i \in [l_i, h_i]` those are wanted whose wrench BF meets the demand; where none
does, those that miss least tilt torque, among these least thrust, and among these least yaw torque.

It begins with the thrusts that meet the demand with the least sum of :math:`(F_i - m_i)^2/D_i`, each put within its
limits; :math:`m_i` is the middle between its limits, and :math:`D_i` the square of the rotor's believed
effectiveness. So what is least is the distance from the middle over what a rotor has: rotors keep away from their
limits, one that gives little is asked for little, and more than four share the work. Where none was beyond a limit,
that is all.

Else the rotors that are within their limits take over what those at them leave, a few times (redistribution). What is
then missing of tilt, then of thrust, then of yaw is made up for, each without a change of what comes before it. To
raise b'F while RF stays what it is, the rotors that are free of their limits move along

.. math:: v = D_{free}\,(b - R^Ty), \qquad (R D_{free} R^T + \epsilon I)\,y = R D_{free}\,b

until nothing is missing or one more is at a limit; a rotor at a limit is free where :math:`b_i - (R^Ty)_i` of the
step before leads it back from there. That is the method of active sets, with so many steps for each stage; each step
keeps what has been reached. For tilt, b is along what is missing of it and R across. Where that leads no further, the
nearest tilt torque lies aside, and the rotors move along :math:`D_{free}\,b` as far as what is missing gets less.

The rows of B and R have length 1, and :math:`\epsilon` bounds the pivots of the matrix from below: nothing near
singular is inverted, however few rotors are left, and a direction in which the free rotors can hardly move is not
taken (`LEAST_GAIN`).

Tilted rotors begin with thrusts of little lateral force besides (`rotorfault.model.effectiveness.eased`); where that
is beyond a limit, what is made up for is the demand alone.

Source of the problem, and of active sets for it: M. Bodson, "Evaluation of optimization methods for control
allocation", J. Guid. Control Dyn. 25(4), 2002; O. Harkegard, "Efficient active set algorithms for solving constrained
least squares problems in aircraft control allocation", CDC 2002. How near a fixed number of steps comes to linear
programs is measured by benchmarks/allocation_study.py, and a part of that in tests.
"""

from __future__ import annotations

from typing import NamedTuple

from rotorfault.maths.geometry import PerRotor
from rotorfault.maths.scalar import (
    Scalar,
    absolute,
    both,
    clip,
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

    share: int  # redistributions
    tilt: int
    thrust: int
    yaw: int


# By benchmarks/allocation_study.py: what can be had is then had up to MANY rotors, and nearly always with more.
FEW_STEPS, MANY_STEPS, MANY = Steps(share=2, tilt=3, thrust=4, yaw=5), Steps(share=4, tilt=4, thrust=6, yaw=5), 8


def steps_for(rotors: int) -> Steps:
    """How many steps so many rotors take."""
    return FEW_STEPS if rotors <= MANY else MANY_STEPS


class Limits(NamedTuple):
    """What the rotors may give."""

    low: PerRotor  # N
    high: PerRotor  # N
    weight: PerRotor  # D: square of the believed effectiveness; 0 for a rotor that must not be used
    near: tuple[PerRotor, PerRotor]  # N: from here on a rotor counts as at its lower, and at its upper limit


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
    margin = AT_LIMIT * (high - low).reduce(maximum)
    return Limits(low, high, share * share, (low + margin, high - margin))


def nearest(
    matrix: WrenchRows,
    demand: Wrench,
    limits: Limits,
    steps: Steps | None = None,
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
    steps : Steps, optional
        `steps_for` the rotors if not given.
    lateral : LateralRows, optional
        Of tilted rotors.

    Returns
    -------
    PerRotor
        In N; exact, but for about 1e-8 of a limit, where the demand is attainable and the steps suffice.
    """
    steps = steps_for(len(limits.low)) if steps is None else steps
    lengths = [sqrt(row.dot(row)) for row in matrix]
    up, roll, pitch, yaw = rows = tuple(row * (1.0 / length) for row, length in zip(matrix, lengths, strict=True))
    wanted = [x / length for x, length in zip((demand.thrust, *demand.torque_B), lengths, strict=True)]
    thrust = (limits.low + limits.high) * 0.5
    free = limits.weight
    for _ in range(1 + steps.share):
        thrust = _shared(thrust, rows, wanted, free, lateral).map(clip, limits.low, limits.high)
        inside = thrust.map(_inside, *limits.near)
        free = limits.weight.map(lambda weight, within: select(within, weight, 0.0), inside)

    thrust = _tilted(thrust, (roll, pitch), (wanted[1], wanted[2]), limits, steps.tilt)
    missing = wanted[0] - up.dot(thrust)
    thrust = pushed(thrust, Push(up, (roll, pitch)), missing, limits, steps.thrust)
    missing = wanted[3] - yaw.dot(thrust)
    return pushed(thrust, Push(yaw, (roll, pitch, up)), missing, limits, steps.yaw)


def _shared(
    thrust: PerRotor,
    rows: tuple[PerRotor, ...],
    wanted: list[Scalar],
    free: PerRotor,
    lateral: LateralRows | tuple[()],
) -> PerRotor:
    """Thrusts in N that meet the demands, as near as can be and with little lateral force, limits or not."""
    if not isinstance(lateral, LateralRows):
        y = _solved(rows, free, [d - row.dot(thrust) for d, row in zip(wanted, rows, strict=True)])
        return thrust + _combined(rows, y) * free
    begun = eased(thrust, lateral, free)
    columns = tuple(eased(row * free, lateral, free) for row in rows)
    left = [d - row.dot(begun) for d, row in zip(wanted, rows, strict=True)]
    return begun + _combined(columns, _factored(rows, columns, left))


def _tilted(
    thrust: PerRotor, rows: tuple[PerRotor, PerRotor], wanted: tuple[Scalar, Scalar], limits: Limits, steps: int
) -> PerRotor:
    """Thrusts in N with a tilt torque nearer to the one that is wanted; that of both rows, of length 1."""
    roll, pitch = rows
    ahead: PerRotor | None = None
    for _ in range(steps):
        x, z = wanted[0] - roll.dot(thrust), wanted[1] - pitch.dot(thrust)
        missing = sqrt(x * x + z * z)
        over = 1.0 / (missing + TINY)
        x, z = x * over, z * over
        row, across = roll * x + pitch * z, pitch * x - roll * z
        ahead = _across(row, (across,), limits.weight) if ahead is None else ahead
        at_low, at_high = _at_limits(thrust, limits)
        free = ahead.map(_free, at_low, at_high, limits.weight)
        ahead = _across(row, (across,), free)
        direction = ahead * free
        aside = row * row.map(_free, at_low, at_high, limits.weight)
        no_way = less(row.dot(direction), LEAST_GAIN)
        direction = direction.map(lambda d, a, no_way=no_way: select(no_way, a, d), aside)
        gain, drift = row.dot(direction), across.dot(direction)
        # To where least is missing: the foot of what is missing on the way that tilt takes.
        whole = missing * gain, gain * gain + drift * drift
        thrust, _ = _stepped(thrust, direction, gain, whole, limits)
    return thrust


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
    ahead = _across(row, push.held, limits.weight)
    for _ in range(steps):
        at_low, at_high = _at_limits(thrust, limits)
        free = ahead.map(_free, at_low, at_high, limits.weight)
        ahead = _across(row, push.held, free)
        direction = ahead * free
        gain = row.dot(direction)
        thrust, part = _stepped(thrust, direction, gain, (missing, gain), limits)
        missing = maximum(missing - gain * part, 0.0)
    return thrust


def _stepped(
    thrust: PerRotor, direction: PerRotor, gain: Scalar, whole: tuple[Scalar, Scalar], limits: Limits
) -> tuple[PerRotor, Scalar]:
    """Thrusts in N further along a direction, by a quotient or as far as there is room; and how far that is."""
    over, under = _least_ratio(thrust, direction, limits)
    # The smaller of two quotients, without a division.
    fits = less_equal(whole[0] * under, over * whole[1])
    part = select(fits, whole[0], over) / maximum(select(fits, whole[1], under), TINY)
    part = select(less(gain, LEAST_GAIN), 0.0, part)
    return (thrust + direction * part).map(clip, limits.low, limits.high), part


def _at_limits(thrust: PerRotor, limits: Limits) -> tuple[PerRotor, PerRotor]:
    """1 for rotors at their lower, and at their upper limit."""
    low, high = limits.near
    return thrust.map(less_equal, low), thrust.map(greater_equal, high)


def _inside(thrust: Scalar, low: Scalar, high: Scalar) -> Scalar:
    """1 for a rotor at neither limit."""
    return both(less(low, thrust), less(thrust, high))


def _free(ahead: Scalar, at_low: Scalar, at_high: Scalar, weight: Scalar) -> Scalar:
    """The weight of a rotor that is at no limit, or leaves it; else 0."""
    return select(select(less(0.0, ahead), at_high, at_low), 0.0, weight)


def _least_ratio(thrust: PerRotor, direction: PerRotor, limits: Limits) -> tuple[Scalar, Scalar]:
    """Room of the rotor that comes to its limit first, and its part of the direction: numerator and denominator."""
    best: tuple[Scalar, Scalar] = (1.0, 0.0)  # without end
    for f, v, low, high in zip(thrust, direction, limits.low, limits.high, strict=True):
        room, size = select(less(v, 0.0), f - low, high - f), absolute(v)
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
