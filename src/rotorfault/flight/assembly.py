"""From scenarios to batches: make every part, collect its numbers, tabulate the reference."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TypeVar

import numpy as np

from rotorfault.autopilot.autopilot import Autopilot
from rotorfault.base.errors import InputError
from rotorfault.engine.batch import Array, Batch, columns, no_reference
from rotorfault.engine.noise import FIRST_GUST, SENSOR_NOISE, Noise, Stream
from rotorfault.engine.structure import structure
from rotorfault.loop.closed_loop import ClosedLoop, Drive, LoopParameters, LoopState, Start
from rotorfault.loop.scoring import AT_LIMIT, SETTLED, TRACKED, ScoringParameters, bands
from rotorfault.maths.geometry import Vec3
from rotorfault.maths.records import flatten, unflatten
from rotorfault.maths.scalar import maximum
from rotorfault.model.vehicle import Vehicle
from rotorfault.plant import PLANTS, Ground, no_first_normals, no_noise
from rotorfault.plant.plant import Plant
from rotorfault.reference.sources import ReferenceTable
from rotorfault.scenario.scenario import Scenario

R = TypeVar("R")


def assemble(scenario: Scenario, controller: Any = None) -> Batch:
    """A batch of the one flight that a scenario describes.

    Parameters
    ----------
    scenario : Scenario
    controller : Controller, optional
        Flies in place of the scenario's.

    Raises
    ------
    InputError
        If the reference is not finite, or a part cannot be made for this vehicle and sampling period.
    """
    loop = build(scenario, controller)
    reference = reference_of(scenario)
    parameters = LoopParameters(
        plant=loop.plant.parameters(scenario.mismatch.applied(scenario.vehicle.vehicle)),
        autopilot=loop.autopilot.parameters(scenario.vehicle.vehicle, scenario.period),
        sensors=loop.sensors.parameters(),
        period=scenario.period,
        scoring=scoring_parameters(
            np.array(scenario.start.position), scenario.vehicle.vehicle, scenario.ground, reference
        ),
    )
    seeds = ((scenario.seed, 0),)
    state = initial_state(loop, start_of(scenario), reference, seeds, parameters)
    return Batch(loop, state, parameters, reference, 1, seeds, scenario.every)


def build(scenario: Scenario, controller: Any = None) -> ClosedLoop:
    """The parts of a scenario put together; see `assemble`."""
    plant = Plant(
        PLANTS[scenario.plant](),
        scenario.wind.make(),
        [fault.make() for fault in scenario.fault],
        scenario.substeps,
        None if scenario.ground is None else Ground(scenario.ground),
    )
    autopilot = Autopilot(
        scenario.diagnosis.make(),
        scenario.controller.make() if controller is None else controller,
        scenario.allocation.make(),
        scenario.on_fault.make(),
    )
    return ClosedLoop(plant, scenario.sensors.make(), autopilot)


def reference_of(scenario: Scenario) -> Array:
    """Rows (steps, 12) of `Reference`, one for each sampling instant.

    Raises
    ------
    InputError
        If one is not finite.
    """
    times = np.arange(scenario.steps) * scenario.period
    with np.errstate(all="ignore"):
        rows = reference_rows(scenario.reference.make().table(times))
    wrong = np.flatnonzero(~np.isfinite(rows).all(axis=1))
    if len(wrong):
        raise InputError(
            f"reference: position, velocity or acceleration at t = {times[wrong[0]]:g} s is not finite; "
            "its numbers are too large, or its times too short"
        )
    return rows


def initial_state(
    loop: ClosedLoop, start: Start, reference: Array, seeds: tuple[tuple[int, int], ...], parameters: LoopParameters
) -> LoopState:
    """State before the first step, for one flight or, with leaves of N numbers, for N."""
    if loop.plant.wind.needs_noise:
        start = start._replace(gust=_first_noise(no_first_normals(), seeds, FIRST_GUST))
    noise = _first_noise(no_noise(), seeds, SENSOR_NOISE) if loop.sensors.needs_noise else no_noise()
    first = unflatten(no_reference(), reference[0].tolist())
    # On arrays for a single flight too: NumPy's sine may differ from that of floats in the last bit, and a flight
    # must begin the same alone and in any batch.
    many = unflatten(start, list(columns(start, len(seeds))))
    state = loop.initial(many, Drive(first, noise), parameters)
    return state if len(seeds) > 1 else unflatten(state, columns(state, 1)[:, 0].tolist())


def assemble_all(scenarios: Sequence[Scenario]) -> Batch:
    """One batch of several flights that differ in numbers only: vehicle, start, wind, faults, gains, seed.

    Raises
    ------
    InputError
        If there are none, or they differ in structure (kinds of parts, options), in length or in reference.
    """
    if not scenarios:
        raise InputError("no scenarios were given; a batch needs at least one")
    batches = [assemble(scenario) for scenario in scenarios]
    first = batches[0]
    for batch, scenario in zip(batches[1:], scenarios[1:], strict=True):
        same = structure(batch.loop) == structure(first.loop) and batch.every == first.every
        if not same or not np.array_equal(batch.reference, first.reference):
            raise InputError(
                f"scenario '{scenario.name}' differs from the first in more than numbers (parts, options, length or "
                "reference); fly it in a batch of its own"
            )
    return first._replace(
        state=_stacked(first.state, [batch.state for batch in batches]),
        parameters=_stacked(first.parameters, [batch.parameters for batch in batches]),
        flights=len(batches),
        # Each by its own seed, whatever its place: a flight is the same alone and in any batch.
        seeds=tuple(seed for batch in batches for seed in batch.seeds),
    )


def scoring_parameters(
    position: Array, vehicle: Vehicle, ground: float | None, reference: Array
) -> ScoringParameters:
    """What scoring needs to know of a flight.

    Parameters
    ----------
    position : ndarray, shape (..., 3)
        Where it begins, in m.
    vehicle : Vehicle
        As the autopilot believes it to be.
    ground : float or None
        Height of the ground in m.
    reference : ndarray, shape (steps, 12)
        Rows of `Reference`.
    """
    margin = AT_LIMIT * maximum(1.0, vehicle.thrust_max)
    settle, track = (np.moveaxis(bands(reference[:, :3], position, share), -1, 0) for share in (SETTLED, TRACKED))
    return ScoringParameters(
        settle_band=Vec3.of(settle),
        track_band=Vec3.of(track),
        half=float(len(reference) // 2),
        command_low=vehicle.thrust_min + margin,
        command_high=vehicle.thrust_max - margin,
        ground=0.0 if ground is None else ground,
    )


def _stacked(template: Any, records: list[Any]) -> Any:
    rows = np.array([[float(leaf) for leaf in flatten(record)] for record in records]).T
    return unflatten(template, list(rows))


def start_of(scenario: Scenario) -> Start:
    """Where a flight begins."""
    s = scenario.start
    return Start(Vec3.of(s.position), Vec3.of(s.velocity), Vec3.of(s.attitude), Vec3.of(s.body_rates))


def _first_noise(template: R, seeds: tuple[tuple[int, int], ...], stream: Stream) -> R:
    return unflatten(template, list(Noise(seeds, stream).draw(1)[0]))


def reference_rows(table: ReferenceTable) -> Array:
    """A reference table as rows (n, 12) in the order of `Reference`."""
    return np.column_stack([table.p_W, table.v_W, table.a_W, table.yaw, table.yaw_rate, table.yaw_acceleration])
