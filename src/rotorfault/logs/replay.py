"""A source of diagnosis run over a log as it would fly: one step after another, on what the log says of the motion.

It is compiled as flights are (`rotorfault.engine.fold`), so that hours take seconds; what cannot be compiled, because
it runs on Python floats only, is stepped through.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from rotorfault.autopilot.diagnosis.protocol import DIAGNOSIS, Diagnoser
from rotorfault.autopilot.instant import Instant, Past
from rotorfault.autopilot.rotor_model import RotorModel, expected_thrust, follow, rotors_at_hover
from rotorfault.base.foreign import is_own
from rotorfault.engine import have_simd
from rotorfault.engine.structure import describe
from rotorfault.maths.arrays import Array
from rotorfault.maths.geometry import PerRotor, zeros
from rotorfault.maths.records import flatten, unflatten
from rotorfault.maths.rotation import Quat
from rotorfault.maths.scalar import Scalar
from rotorfault.model.block import Context
from rotorfault.model.signals import Command, Diagnosis, Estimate, Motion, Readings, Reference, motion_of
from rotorfault.model.vehicle import Vehicle, rotor_speeds


class Row(NamedTuple):
    """What a log says of one instant."""

    estimate: Estimate
    sent: PerRotor  # N: commanded from now on, by the rotors of the vehicle


class _Carried(NamedTuple):
    """From one instant to the next."""

    memory: Any
    rotors: RotorModel
    previous: Motion
    sent: PerRotor
    speed: PerRotor


class _Numbers(NamedTuple):
    of_part: Any
    vehicle: Vehicle
    step: Scalar


class Told(NamedTuple):
    """What a source says at one instant."""

    flagged: PerRotor
    loss: PerRotor


def told(part: Diagnoser[Any, Any], vehicle: Vehicle, step: float, chunks: Iterable[Array]) -> Iterator[Array]:
    """Run a source over rows: of each chunk the flags and losses of the rotors.

    Parameters
    ----------
    part : Diagnoser
    vehicle : Vehicle
        As believed.
    step : float, s
        Between rows.
    chunks : iterable of (m, 16 + N) ndarray
        Position, velocity, quaternion, body rates, specific force (as of `Estimate`), and newton per rotor.

    Yields
    ------
    (m, 2 N) ndarray
    """
    numbers = _Numbers(part.parameters(Context(vehicle, step)), vehicle, step)
    go_on: Callable[[Array], Array] | None = None
    for rows in chunks:
        if go_on is not None:
            yield go_on(rows)
            continue
        shape = _row(rows[0].tolist())
        carried, first = _begin(part, shape, numbers)
        go_on = _compiled(part, carried, shape, numbers) or _plain(part, carried, numbers)
        yield np.vstack([[float(x) for x in flatten(first)], go_on(rows[1:])])


def _compiled(part: Any, carried: _Carried, row: Row, numbers: _Numbers) -> Callable[[Array], Array] | None:
    """The step in machine code; None where it cannot be."""
    if part.python_only or not have_simd():
        return None
    # llvmlite need not be there.
    from rotorfault.engine.fold import Fold

    own = is_own(type(part).__module__)
    try:
        return Fold(partial(_step, part), carried, row, numbers, [__name__, describe(part, [])] if own else None)
    except TypeError:
        if own:
            raise
        return None  # code of a user that branches on values


def _plain(part: Any, carried: _Carried, numbers: _Numbers) -> Callable[[Array], Array]:
    """The step on Python floats."""
    now = carried

    def go_on(rows: Array) -> Array:
        nonlocal now
        out = []
        for values in rows.tolist():
            now, said = _step(part, now, _row(values), numbers)
            out.append([float(x) for x in flatten(said)])
        return np.array(out).reshape(len(rows), -1)

    return go_on


def _row(values: list[float]) -> Row:
    still = Estimate(zeros(), zeros(), Quat.identity(), zeros())
    return unflatten(Row(still, PerRotor.of([0.0] * (len(values) - len(flatten(still))))), values)


def _begin(part: Any, row: Row, numbers: _Numbers) -> tuple[_Carried, Told]:
    vehicle = numbers.vehicle
    rotors = rotors_at_hover(vehicle)
    speed = rotor_speeds(vehicle, expected_thrust(rotors, vehicle))
    still = PerRotor.of([0.0] * len(row.sent))
    before = Past(rotors, (), Command(still, zeros()), 0.0, speed)
    inputs, _ = _inputs(row, numbers, before)
    memory = part.initial(inputs, numbers.of_part)
    moved = motion_of(row.estimate, vehicle.tilt != ())
    return _advanced(part, memory, row, numbers, before._replace(previous=moved))


def _step(part: Any, before: _Carried, row: Row, numbers: _Numbers) -> tuple[_Carried, Told]:
    past = Past(before.rotors, before.previous, Command(before.sent, zeros()), numbers.step, before.speed)
    return _advanced(part, before.memory, row, numbers, past)


def _advanced(part: Any, memory: Any, row: Row, numbers: _Numbers, past: Past) -> tuple[_Carried, Told]:
    inputs, instant = _inputs(row, numbers, past)
    memory, diagnosis, _ = part.step(memory, inputs, numbers.of_part, numbers.step)
    rotors, was = follow(past.rotors, row.sent, numbers.vehicle, numbers.step), instant.expectation
    said: Diagnosis = diagnosis
    return _Carried(memory, rotors, was.now, row.sent, was.speed), Told(said.flagged, said.loss)


def _inputs(row: Row, numbers: _Numbers, past: Past) -> tuple[Any, Instant]:
    estimate = row.estimate
    nowhere = Reference(estimate.p_W, estimate.v_W, zeros(), 0.0, 0.0, 0.0)  # sources of diagnosis do not see it
    instant = Instant(Readings(), nowhere, numbers.vehicle, past, numbers.step)
    instant.outputs["estimator"] = estimate
    assert DIAGNOSIS.inputs is not None
    return DIAGNOSIS.inputs(instant), instant
