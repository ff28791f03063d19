r"""Losses that come slowly: what is built does not move, and if it seems to as by a loss, it is one.

Of a loss that grows over seconds the filter of `rotorfault.autopilot.diagnosis.fault_free` makes a wrong model as
soon as it comes: the offsets d about all axes and the share of mass e_m go along. So innovations say nothing of it,
but these states do. A loss :math:`\lambda` of rotor i that gives F in hover moves them by :math:`\lambda v_i`,

.. math:: v_i = \Big(-F J^{-1}b_i,\ \frac{F n_i}{mg}\Big)

while in a sound vehicle they only walk, and are known better than before: by how much their estimate moves since an
instant :math:`\theta` is the sum of the filter's corrections, which are independent of each other, with the variance

.. math:: y = \hat x(t) - \hat x(\theta), \qquad C_y = P(\theta) + Q\,(t - \theta) - P(t)

So y says of a loss that has come since then

.. math:: d = v_i^TC_y^{-1}y, \qquad C = v_i^TC_y^{-1}v_i

in the terms of `rotorfault.autopilot.diagnosis.jumps`, of whose windows these are the older ones, up to the last of
`LENGTHS`.
A loss that is believed is taken out of these states, :math:`\hat x \leftarrow \hat x - v_i\hat\lambda`, and while one
is believed it has part of what moves, so all begin anew.
"""

from __future__ import annotations

from typing import NamedTuple

from rotorfault.autopilot.diagnosis import touch
from rotorfault.autopilot.diagnosis.fault_free import LOSSES, MASS, OFFSETS, ModelParameters
from rotorfault.autopilot.diagnosis.jumps import Window, Windows
from rotorfault.autopilot.diagnosis.kalman import Belief, Hypothesis
from rotorfault.maths.geometry import Vec3
from rotorfault.maths.records import select_record
from rotorfault.maths.scalar import Scalar, greater_equal, maximum
from rotorfault.model.effectiveness import effectiveness
from rotorfault.model.mixer import hover_thrust
from rotorfault.model.vehicle import Vehicle, over_inertia

PLACES = (OFFSETS, OFFSETS + 1, OFFSETS + 2, MASS)
LENGTHS = (1.0, 2.0, 4.0, 8.0, 16.0)  # s: each twice as long as the one before
ASKED = 2  # from which on: younger ones are those of the jumps
UNKNOWN = 1e9  # times the variance at the start
SURE = 1e-6  # of the variance at the start: less is not told from rounding


class Since(NamedTuple):
    """What was known at an instant."""

    age: Scalar  # s: since then
    mean: tuple[Scalar, ...]  # of the states
    covariance: tuple[tuple[Scalar, ...], ...]  # of them, upper triangle, with the walk since then


Slow = tuple[Since, ...]


def at_start(belief: Belief) -> Slow:
    """From now on.

    Parameters
    ----------
    belief : Belief
    """
    # What is not known yet cannot be seen to move. One takes over from the next younger, a second after that has: so
    # all look back to what was known after the first second.
    fresh = _now(belief)
    unknown = tuple(tuple(x * UNKNOWN for x in row) for row in fresh.covariance)
    return tuple(Since(length - 1.0 - k, fresh.mean, unknown) for k, length in enumerate(LENGTHS))


def _now(belief: Belief) -> Since:
    rows = tuple(tuple(belief.of(i, j) for j in PLACES[k:]) for k, i in enumerate(PLACES))
    return Since(0.0, tuple(belief.mean[i] for i in PLACES), rows)


def watch(slow: Slow, belief: Belief, parameters: ModelParameters, dt: Scalar) -> Slow:
    """One sampling instant later.

    Parameters
    ----------
    slow : Slow
    belief : Belief
        Of the filter, now.
    parameters : ModelParameters
        Of the filter.
    dt : scalar, s
        Sampling period.
    """
    walks = [parameters.walk[i - OFFSETS] * dt for i in PLACES]
    younger = _now(belief)
    after = []
    for one, length in zip(slow, LENGTHS, strict=True):
        over = greater_equal(one.age + 0.5 * dt, length)
        kept = select_record(over, younger, one)
        rows = tuple((row[0] + walk, *row[1:]) for row, walk in zip(kept.covariance, walks, strict=True))
        after.append(Since(kept.age + dt, kept.mean, rows))
        younger = one
    return tuple(after)


def begun_anew(slow: Slow, belief: Belief, flagged: Scalar) -> Slow:
    """As they are, or all of them from now on.

    Parameters
    ----------
    slow : Slow
    belief : Belief
        Of the filter, now.
    flagged : scalar
        1 where a loss is believed, which then has part of what moves; else 0.
    """
    return tuple(select_record(flagged, begun, one) for begun, one in zip(at_start(belief), slow, strict=True))


def windows(slow: Slow, belief: Belief, parameters: ModelParameters, vehicle: Vehicle) -> Windows:
    """What the older ones say of each rotor.

    Parameters
    ----------
    slow : Slow
    belief : Belief
        Of the filter, now.
    parameters : ModelParameters
        Of the filter.
    vehicle : Vehicle
        As believed.
    """
    least = [parameters.start[i - OFFSETS] * SURE for i in PLACES]
    now, moves = _now(belief), signatures(vehicle)
    found = []
    for one in slow[ASKED:]:
        moved = [a - b for a, b in zip(now.mean, one.mean, strict=True)]
        rows = [
            [a - b for a, b in zip(*pair, strict=True)] for pair in zip(one.covariance, now.covariance, strict=True)
        ]
        for row, size in zip(rows, least, strict=True):
            row[0] = row[0] + size
        lower, pivots = _factored(rows, least)
        y = _solved(lower, moved)
        rotors = []
        for move in moves:
            v = _solved(lower, list(move))
            scaled = [a / p for a, p in zip(v, pivots, strict=True)]
            error: list[Scalar] = [0.0] * (LOSSES + vehicle.rotors)
            for i, size in zip(PLACES, move, strict=True):
                error[i] = -size
            score, information = (sum(a * b for a, b in zip(scaled, other, strict=True)) for other in (y, v))
            rotors.append(Hypothesis(tuple(error), score, information, touch.NO_TOUCH))
        found.append(Window(0.0, tuple(rotors)))
    return tuple(found)


def signatures(vehicle: Vehicle) -> list[tuple[Scalar, ...]]:
    """By how much a whole loss of each rotor in hover seems to move the states.

    Parameters
    ----------
    vehicle : Vehicle
        As believed.
    """
    matrix, thrust = effectiveness(vehicle), hover_thrust(vehicle)
    weight = vehicle.mass * vehicle.gravity
    found = []
    for f, roll, pitch, yaw, up in zip(thrust, matrix.roll, matrix.pitch, matrix.yaw, matrix.thrust, strict=True):
        turn = over_inertia(vehicle, Vec3(roll, pitch, yaw))
        found.append((-turn.x * f, -turn.y * f, -turn.z * f, f * up / weight))
    return found


def _factored(rows: list[list[Scalar]], least: list[Scalar]) -> tuple[list[list[Scalar]], list[Scalar]]:
    """Columns of L below the diagonal and the diagonal of D, of a matrix L D L^T whose upper triangle is given."""
    lower, pivots = [], []
    rows = [list(row) for row in rows]
    for k, row in enumerate(rows):
        pivot = maximum(row[0], least[k])
        column = [x / pivot for x in row[1:]]
        for i, factor in enumerate(column):
            below = rows[k + 1 + i]
            for j in range(len(below)):
                below[j] = below[j] - factor * row[1 + i + j]
        lower.append(column)
        pivots.append(pivot)
    return lower, pivots


def _solved(lower: list[list[Scalar]], values: list[Scalar]) -> list[Scalar]:
    """L^-1 times a vector."""
    values = list(values)
    for k, column in enumerate(lower):
        for i, factor in enumerate(column):
            values[k + 1 + i] = values[k + 1 + i] - factor * values[k]
    return values
