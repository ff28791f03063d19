"""The registered sources of diagnosis, run over a log as they would fly: through their own interface, on estimates.

A source needs a vehicle: mass, inertia, rotors. Commands become newton by what they are in the log's own hover, each
motor's for itself, so that an uneven vehicle begins with no residual. What a source says is told beside the ranked
causes, and whether it is the same. It enters no probability: it looks at the same records, which are weighed already,
and knows no baseline and no alternatives.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from pydantic_core import PydanticCustomError

from rotorfault.autopilot.diagnosis.protocol import DIAGNOSIS
from rotorfault.base.errors import InputError
from rotorfault.base.plain_text import one_line
from rotorfault.base.progress import Bar
from rotorfault.logs.dynamics import G
from rotorfault.logs.estimates import in_body
from rotorfault.logs.log import Log
from rotorfault.logs.replay import told
from rotorfault.logs.segments import Hover
from rotorfault.maths.arrays import Array
from rotorfault.model.vehicle_file import VehicleFile, load_vehicle
from rotorfault.scenario.part import read

FINEST, CHUNK = 0.004, 20_000  # s of a step, and steps between two looks at progress
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


def said_by_all(
    log: Log, spans: Sequence[tuple[float, float]], hover: Hover, vehicle: str | Path, own: Sequence[str] = ()
) -> list[Said]:
    """What each registered source, and each of one's own, says of flights that have rates, attitude and velocity.

    Parameters
    ----------
    log : Log
    spans : sequence of (float, float), s
        Begin and end of each flight.
    hover : Hover
    vehicle : str or Path
        Name or file.
    own : sequence of str
        Places of code, ``FILE.py:CLASS``, besides the registered ones.

    Raises
    ------
    InputError
        If the vehicle is not the log's, or there is no such code.
    """
    file = load_vehicle(vehicle)
    order = order_of(log, file)
    parts: list[tuple[str, Any]] = []
    for name in DIAGNOSIS.registry:
        kind: Any = DIAGNOSIS.registry[name]
        if name != DIAGNOSIS.calm and getattr(kind, "looks", True):
            parts.append((name, kind(kind.Settings())))
    parts += [(place, detector_of(place)) for place in own]
    missing = [name for name in ("rates", "attitude", "velocity") if name not in log.series]
    if missing:
        return [Said(name, (), f"the log has no {', '.join(missing)}") for name, _ in parts]
    said = []
    for name, part in parts:
        try:
            said.append(_run(name, part, log, spans, hover, file, order))
        except (InputError, ValueError, ZeroDivisionError, OverflowError) as error:
            said.append(Said(name, (), one_line(str(error)) or type(error).__name__))
    return said


def detector_of(place: str) -> Any:
    """A source of diagnosis by its name, or by its place in code that the user names.

    Parameters
    ----------
    place : str
        ``FILE.py:CLASS``, ``package.module:CLASS``, or a registered name.

    Raises
    ------
    InputError
        If there is none, or it needs settings.
    """
    try:
        return read(DIAGNOSIS, place, allow=[place]).make()
    except PydanticCustomError as error:
        raise InputError(f"detector: {error.message()}") from None


def _run(
    name: str,
    part: Any,
    log: Log,
    spans: Sequence[tuple[float, float]],
    hover: Hover,
    file: VehicleFile,
    order: list[int],
) -> Said:
    step = max(FINEST, 1.0 / max(log.series["rates"].rate, 1.0))
    command = log.series["command"]
    inside = np.zeros(len(command.time), dtype=bool)
    for begin, end in spans:
        inside |= (command.time >= begin) & (command.time <= end)
    even = hover.command.mean(axis=0) if len(hover.time) else np.median(command.values[inside], axis=0)
    weight = float(file.vehicle.mass * file.vehicle.gravity)
    newton = (weight / len(order) / np.maximum(even, 1e-3))[order]
    whole = int(sum(max(end - begin, 0.0) for begin, end in spans) / step)
    flags: list[tuple[int, float, float]] = []
    done = 0
    with Bar(f"{name} over {log.source}", whole, "steps") as bar:
        for begin, end in spans:
            first: dict[int, float] = {}
            losses = [0.0] * len(order)
            now = begin
            chunks = (_rows(log, time, newton, order) for time in _times(begin, end, step))
            for values in told(part, file.vehicle, step, chunks):
                flagged, loss = values[:, : len(order)] > 0.5, values[:, len(order) :]
                time = now + step * np.arange(len(values))
                for rotor in range(len(order)):
                    if rotor not in first and flagged[:, rotor].any():
                        first[rotor] = float(time[int(np.argmax(flagged[:, rotor]))])
                    if rotor in first:
                        soon = (time >= first[rotor]) & (time <= first[rotor] + SOON)
                        losses[rotor] = max(losses[rotor], float(np.nan_to_num(loss[soon, rotor]).max(initial=0.0)))
                now, done = float(time[-1] + step), done + len(values)
                bar.update(done)
            flags += [(order[rotor] + 1, when, losses[rotor]) for rotor, when in first.items()]
    return Said(name, tuple(sorted(flags, key=lambda flag: flag[1])), "")


def _times(begin: float, end: float, step: float) -> Iterator[Array]:
    """Instants of a flight, so many at a time."""
    count = int((end - begin) / step)
    for k in range(0, count, CHUNK):
        yield np.asarray(begin + step * np.arange(k, min(k + CHUNK, count)), dtype=float)


def _rows(log: Log, time: Array, newton: Array, order: list[int]) -> Array:
    """What the log says of some instants, and newton that are sent from them on, by the rotors of the vehicle."""
    rates, attitude, velocity = (log.series[name].at(time) for name in ("rates", "attitude", "velocity"))
    place = log.series["position"].at(time) if "position" in log.series else np.zeros((len(time), 3))
    attitude = attitude / np.maximum(np.linalg.norm(attitude, axis=1, keepdims=True), 1e-9)
    if "specific_force" in log.series:
        force = log.series["specific_force"].at(time)
    else:
        force = in_body(attitude, np.tile([0.0, 0.0, G], (len(time), 1)))
    command = log.series["command"]
    at = np.clip(np.searchsorted(command.time, time, side="right") - 1, 0, None)
    return np.hstack([place, velocity, attitude, rates, force, command.values[at][:, order] * newton])
