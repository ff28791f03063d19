"""The registered sources of diagnosis, run over a log as they would fly: through their own interface, on estimates.

A source needs a vehicle: mass, inertia, rotors. Commands become newton by what they are in the log's own hover, each
motor's for itself, so that an uneven vehicle begins with no residual. What a source says is told beside the ranked
causes, and whether it is the same. It enters no probability: it looks at the same records, which are weighed already,
and knows no baseline and no alternatives.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from rotorfault.autopilot.diagnosis.protocol import DIAGNOSIS
from rotorfault.autopilot.instant import Instant, Past
from rotorfault.autopilot.rotor_model import expected_thrust, follow, rotors_at_hover
from rotorfault.base.errors import InputError
from rotorfault.base.progress import Bar
from rotorfault.logs.log import Log
from rotorfault.logs.segments import Hover
from rotorfault.maths.arrays import Array
from rotorfault.maths.geometry import PerRotor, Vec3, zeros
from rotorfault.maths.rotation import Quat
from rotorfault.model.block import Context
from rotorfault.model.signals import Command, Estimate, Readings, Reference, motion_of
from rotorfault.model.vehicle import rotor_speeds
from rotorfault.model.vehicle_file import VehicleFile, load_vehicle

FINEST, MOST_STEPS = 0.004, 40_000  # s of a step, and steps of a log
EARLY, SOON = 0.5, 0.5  # s before an onset that a flag may be of it, and after a flag in which a loss is believed
NEAR = 0.35  # of the longest arm: how far a motor of the log may be from a rotor of the vehicle


class Said(NamedTuple):
    """What one source says of a flight."""

    detector: str
    flags: tuple[tuple[int, float, float], ...]  # motor of the log, s of its first flag, loss believed soon after
    note: str  # why it could not run; empty if it did

    def first(self, onset: float | None) -> tuple[int, float, float] | None:
        """The first flag of what begins at an onset; what comes later may be what a crash looks like.

        Parameters
        ----------
        onset : float or None, s
            None for what was there from the beginning.
        """
        since = -math.inf if onset is None else onset - EARLY
        return next((flag for flag in self.flags if flag[1] >= since), None)


def order_of(log: Log, vehicle: VehicleFile) -> list[int]:
    """Index of the log's motor that each rotor of a vehicle is.

    Parameters
    ----------
    log : Log
    vehicle : VehicleFile

    Raises
    ------
    InputError
        If they are not at the same places, or turn otherwise.
    """
    layout = log.layout
    if layout is None or len(layout.places) != len(vehicle.rotor):
        count = 0 if layout is None else len(layout.places)
        raise InputError(f"{log.source}: has {count} motors, vehicle {vehicle.name} {len(vehicle.rotor)} rotors")
    places = np.array([(x, y) for x, y, _ in vehicle.places])
    places = places / max(float(np.hypot(*places.T).max()), 1e-9)
    turns = np.array([1.0 if rotor.yaw == "+" else -1.0 for rotor in vehicle.rotor])
    apart = np.hypot(*(places[:, None, :] - layout.places[None]).transpose(2, 0, 1))
    apart = apart + (turns[:, None] != layout.yaw[None])  # one above the other are told apart by how they turn
    order = [int(k) for k in apart.argmin(axis=1)]
    if len(set(order)) != len(order) or float(apart.min(axis=1).max()) > NEAR:
        raise InputError(
            f"{log.source}: its motors are not where the rotors of {vehicle.name} are, or turn otherwise; compare "
            f"with rotorfault check {vehicle.name}"
        )
    return order


def said_by_all(log: Log, span: tuple[float, float], hover: Hover, vehicle: str | Path) -> list[Said]:
    """What each registered source says of a flight that has rates, attitude and velocity.

    Parameters
    ----------
    log : Log
    span : (float, float), s
        Begin and end of the flight.
    hover : Hover
    vehicle : str or Path
        Name or file.

    Raises
    ------
    InputError
        If the vehicle is not the log's.
    """
    file = load_vehicle(vehicle)
    order = order_of(log, file)
    missing = [name for name in ("rates", "attitude", "velocity") if name not in log.series]
    said = []
    for name in DIAGNOSIS.registry:
        kind = DIAGNOSIS.registry[name]
        if name == DIAGNOSIS.calm or not getattr(kind, "looks", True):
            continue
        if missing:
            said.append(Said(name, (), f"the log has no {', '.join(missing)}"))
            continue
        try:
            said.append(_run(name, log, span, hover, file, order))
        except (InputError, ValueError, ZeroDivisionError, OverflowError) as error:
            said.append(Said(name, (), str(error)))
    return said


def _run(name: str, log: Log, span: tuple[float, float], hover: Hover, file: VehicleFile, order: list[int]) -> Said:
    kind: Any = DIAGNOSIS.registry[name]
    part: Any = kind(kind.Settings())
    vehicle, step = file.vehicle, max(FINEST, 1.0 / max(log.series["rates"].rate, 1.0))
    begin, end = span
    count = min(int((end - begin) / step), MOST_STEPS)
    time = np.asarray(begin + step * np.arange(count), dtype=float)
    command = log.series["command"]
    at = np.clip(np.searchsorted(command.time, time, side="right") - 1, 0, None)
    inside = (command.time >= begin) & (command.time <= end)
    even = hover.command.mean(axis=0) if len(hover.time) else np.median(command.values[inside], axis=0)
    weight = float(vehicle.mass * vehicle.gravity)
    newton = (command.values[at] / np.maximum(even, 1e-3) * weight / len(order))[:, order]
    memory: Any = None
    numbers = part.parameters(Context(vehicle, step))
    rotors = rotors_at_hover(vehicle)
    still = Command(PerRotor.of([0.0] * len(order)), zeros())
    past = Past(rotors, (), still, 0.0,
                rotor_speeds(vehicle, expected_thrust(rotors, vehicle)))  # fmt: skip
    first: dict[int, float] = {}
    losses = [0.0] * len(order)
    with Bar(f"{name} over {log.source}", count, "steps") as bar:
        for k, estimate in enumerate(_estimates(log, time)):
            instant = Instant(Readings(), _nowhere(estimate), vehicle, past, step)
            instant.outputs["estimator"] = estimate
            assert DIAGNOSIS.inputs is not None
            inputs = DIAGNOSIS.inputs(instant)
            if memory is None:
                memory = part.initial(inputs, numbers)
                past = past._replace(previous=motion_of(estimate, vehicle.tilt != ()))
            memory, diagnosis, _ = part.step(memory, inputs, numbers, step)
            for rotor, (flagged, loss) in enumerate(zip(diagnosis.flagged, diagnosis.loss, strict=True)):
                if flagged > 0.5 and rotor not in first:
                    first[rotor] = float(time[k])
                if rotor in first and time[k] <= first[rotor] + SOON:
                    losses[rotor] = max(losses[rotor], float(loss))
            sent = PerRotor.of(newton[k].tolist())
            rotors, before = follow(past.rotors, sent, vehicle, step), instant.expectation
            past = Past(rotors, before.now, Command(sent, zeros()), step, before.speed)
            if k % 500 == 0:
                bar.update(k)
    flags = sorted((order[rotor] + 1, when, losses[rotor]) for rotor, when in first.items())
    note = "" if count < MOST_STEPS else f"only the first {count * step:.0f} s"
    return Said(name, tuple(sorted(flags, key=lambda flag: flag[1])), note)


def _estimates(log: Log, time: Array) -> Iterator[Estimate]:
    """What the log says of the motion at some times."""
    rates, attitude, velocity = (log.series[name].at(time) for name in ("rates", "attitude", "velocity"))
    place = log.series["position"].at(time) if "position" in log.series else np.zeros((len(time), 3))
    attitude = attitude / np.maximum(np.linalg.norm(attitude, axis=1, keepdims=True), 1e-9)
    for p, v, q, w in zip(place.tolist(), velocity.tolist(), attitude.tolist(), rates.tolist(), strict=True):
        yield Estimate(Vec3(*p), Vec3(*v), Quat(*q), Vec3(*w))


def _nowhere(estimate: Estimate) -> Reference:
    """A reference that stands for none: sources of diagnosis do not see it."""
    return Reference(estimate.p_W, estimate.v_W, zeros(), 0.0, 0.0, 0.0)
