"""From scenarios to batches: make every part, collect its numbers, tabulate the reference."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TypeVar

import numpy as np

from rotorfault.autopilot import Autopilot
from rotorfault.closed_loop import ClosedLoop, Drive, LoopParameters, Start
from rotorfault.engine.batch import FIRST_GUST, SENSOR_NOISE, Array, Batch, Noise, Stream
from rotorfault.engine.structure import structure
from rotorfault.errors import InputError
from rotorfault.geometry import Vec3
from rotorfault.plant import PLANTS, Ground, no_first_normals, no_noise
from rotorfault.plant.plant import Plant
from rotorfault.records import flatten, unflatten
from rotorfault.reference import ReferenceTable
from rotorfault.scenario import Scenario
from rotorfault.scoring import AT_LIMIT, SETTLED, TRACKED, ScoringParameters, bands
from rotorfault.signals import Reference

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
    vehicle = scenario.vehicle.vehicle
    plant = Plant(
        PLANTS[scenario.plant](),
        scenario.wind.make(),
        [fault.make() for fault in scenario.fault],
        scenario.substeps,
        None if scenario.ground is None else Ground(scenario.ground),
    )
    sensors = scenario.sensors.make()
    autopilot = Autopilot(
        scenario.diagnosis.make(),
        scenario.controller.make() if controller is None else controller,
        scenario.allocation.make(),
        scenario.on_fault.make(),
    )
    loop = ClosedLoop(plant, sensors, autopilot)
    times = np.arange(scenario.steps) * scenario.period
    with np.errstate(all="ignore"):
        table = scenario.reference.make().table(times)
    rows = reference_rows(table)
    wrong = np.flatnonzero(~np.isfinite(rows).all(axis=1))
    if len(wrong):
        raise InputError(
            f"reference: position, velocity or acceleration at t = {times[wrong[0]]:g} s is not finite; "
            "its numbers are too large, or its times too short"
        )
    seeds = ((scenario.seed, 0),)
    parameters = LoopParameters(
        plant=plant.parameters(scenario.mismatch.applied(vehicle)),
        autopilot=autopilot.parameters(vehicle, scenario.period),
        sensors=sensors.parameters(),
        period=scenario.period,
        scoring=scoring_parameters(scenario, rows),
    )
    start = _start(scenario)
    if plant.wind.needs_noise:
        start = start._replace(gust=_first_noise(no_first_normals(), seeds, FIRST_GUST))
    noise = _first_noise(no_noise(), seeds, SENSOR_NOISE) if sensors.needs_noise else no_noise()
    drive = Drive(_first(table), noise)
    state = loop.initial(start, drive, parameters)
    return Batch(loop, state, parameters, rows, 1, seeds, scenario.every)


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


def scoring_parameters(scenario: Scenario, reference: Array) -> ScoringParameters:
    """What scoring needs to know of a flight.

    Parameters
    ----------
    scenario : Scenario
    reference : ndarray, shape (steps, 12)
        Rows of `Reference`.
    """
    start, vehicle = np.array(scenario.start.position), scenario.vehicle.vehicle
    margin = AT_LIMIT * max(1.0, vehicle.thrust_max)
    settle, track = (bands(reference[:, :3], start, share).tolist() for share in (SETTLED, TRACKED))
    return ScoringParameters(
        settle_band=Vec3.of(settle),
        track_band=Vec3.of(track),
        half=float(len(reference) // 2),
        command_low=vehicle.thrust_min + margin,
        command_high=vehicle.thrust_max - margin,
        ground=0.0 if scenario.ground is None else scenario.ground,
    )


def _stacked(template: Any, records: list[Any]) -> Any:
    rows = np.array([[float(leaf) for leaf in flatten(record)] for record in records]).T
    return unflatten(template, list(rows))


def _start(scenario: Scenario) -> Start:
    s = scenario.start
    return Start(Vec3.of(s.position), Vec3.of(s.velocity), Vec3.of(s.attitude), Vec3.of(s.body_rates))


def _first(table: ReferenceTable) -> Reference:
    return unflatten(table.at(0), [float(leaf) for leaf in flatten(table.at(0))])


def _first_noise(template: R, seeds: tuple[tuple[int, int], ...], stream: Stream) -> R:
    return unflatten(template, Noise(seeds, stream).draw(1)[0, :, 0].tolist())


def reference_rows(table: ReferenceTable) -> Array:
    """A reference table as rows (n, 12) in the order of `Reference`."""
    return np.column_stack([table.p_W, table.v_W, table.a_W, table.yaw, table.yaw_rate, table.yaw_acceleration])
