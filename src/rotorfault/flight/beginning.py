"""How a flight begins: the state before its first step, the same alone and in any batch."""

from __future__ import annotations

from typing import Any

import numpy as np

from rotorfault.engine.batch import Batch, columns
from rotorfault.engine.noise import Stream, normals
from rotorfault.loop.closed_loop import ClosedLoop, LoopParameters, LoopState, Start
from rotorfault.maths.arrays import Array
from rotorfault.maths.geometry import Vec3
from rotorfault.maths.records import flatten, record_type, unflatten
from rotorfault.model.battery import Charge
from rotorfault.scenario.scenario import Scenario


def start_of(scenario: Scenario) -> Start:
    """Where a flight begins."""
    s = scenario.start
    battery = () if s.charge is None else Charge(s.charge, 0.0)
    return Start(
        Vec3.of(s.position), Vec3.of(s.velocity), Vec3.of(s.attitude), Vec3.of(s.body_rates), battery=battery
    )


def first_normals(loop: ClosedLoop, seeds: tuple[tuple[int, int], ...]) -> tuple[Any, Any]:
    """Standard normal numbers for `initial` and for the first step, by slot, each of shape (N,).

    A part that says nothing of the start gets the numbers of the first step there too.
    """
    steps: dict[str, Stream] = {}
    starts: dict[str, Stream] = {}
    for slot, part in loop.each():
        if part.normals:
            steps[slot.name] = starts[slot.name] = Stream(part.normals, slot.words(part)[0])
        if part.first_normals is not None:
            starts[slot.name] = Stream(part.first_normals, slot.words(part)[1])

    def drawn(name: str, streams: dict[str, Stream]) -> Any:
        numbers = (tuple(normals(seeds, stream, 0, 1)[0]) if stream.width else () for stream in streams.values())
        return record_type(name, tuple(streams))(*numbers)

    return drawn("FirstNormals", starts), drawn("Normals", steps)


def initial_state(
    loop: ClosedLoop, start: Start, reference: Array, seeds: tuple[tuple[int, int], ...], parameters: LoopParameters
) -> LoopState:
    """State before the first step, for one flight or, with leaves of N numbers, for N."""
    drive = loop.drive()
    wanted, own = unflatten((drive.reference, drive.own), reference[0].tolist())
    at_start, first_step = first_normals(loop, seeds)
    drive = drive._replace(reference=wanted, own=own, normals=first_step)
    # On arrays for a single flight too, and for numbers that all flights share: NumPy's sine and exponential may
    # differ from those of floats in the last bit, and a flight must begin the same alone and in any batch.
    many = unflatten(start, list(columns(start, len(seeds))))._replace(normals=at_start)
    numbers = unflatten(parameters, list(columns(parameters, len(seeds))))
    state = loop.initial(many, drive, numbers)
    return state if len(seeds) > 1 else unflatten(state, columns(state, 1)[:, 0].tolist())


def begins_alike(loop: ClosedLoop, scenario: Scenario, batch: Batch) -> bool:
    """Whether a flight begins the same in another loop, which knows its numbers from the parameters alone.

    Parameters
    ----------
    loop : ClosedLoop
        With the same parts, of other settings.
    scenario : Scenario
        Of the flight.
    batch : Batch
        Of the flight.
    """
    state = initial_state(loop, start_of(scenario), batch.reference, batch.seeds, batch.parameters)
    one, other = (np.array(flatten(record), dtype=float) for record in (state, batch.state))
    return np.array_equal(one, other, equal_nan=True)
