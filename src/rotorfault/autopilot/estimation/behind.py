"""Measurements that come late are compared with the state of the instant at which they were taken.

States of the past need not be stored: what is kept, for each measurement on its way, is by how much the filter has
moved since it was taken (place, velocity and turn, by its inertial readings), so the state then is the one now less
that. A correction in between moves the state then and the state now alike. There are as many of these as measurements
on their way (`Timing.pending`), whatever the delay is in sampling periods.
"""

from __future__ import annotations

from typing import NamedTuple

from rotorfault.maths.geometry import Vec3, zeros
from rotorfault.maths.records import select_record
from rotorfault.maths.rotation import Quat
from rotorfault.maths.scalar import Scalar, absolute, less, nearest
from rotorfault.model.sensor_model import SensorModel, SensorNoise, Timing


class Moved(NamedTuple):
    """By how much the filter has moved since an instant."""

    place_W: Vec3  # m
    velocity_W: Vec3  # m/s
    turn: Quat  # of the body, in its axes then


def timing_of_fix(sensors: SensorModel) -> Timing:
    """When position, velocity and attitude come; together, as one source gives them."""
    for sensor in (sensors.position, sensors.velocity, sensors.attitude):
        if isinstance(sensor, SensorNoise) and sensor.timing.every:
            return sensor.timing
    return Timing()


def still() -> Moved:
    """Not at all."""
    return Moved(zeros(), zeros(), Quat.identity())


def none_yet(timing: Timing) -> tuple[Moved, ...]:
    """Before the first instant.

    Parameters
    ----------
    timing : Timing
        Of the measurements.
    """
    return (still(),) * (timing.pending if timing.late else 0)


def moved_on(
    queue: tuple[Moved, ...], place_W: Vec3, velocity_W: Vec3, turn: Quat, timing: Timing, count: Scalar
) -> tuple[Moved, ...]:
    """The queue after a step of the filter; the newest first.

    Parameters
    ----------
    queue : tuple of Moved
    place_W, velocity_W : Vec3, m and m/s, world frame
        What the step added.
    turn : Quat
        By what it turned the body.
    timing : Timing
    count : scalar
        Sampling instants since the start, this one not among them.
    """
    after = tuple(Moved(one.place_W + place_W, one.velocity_W + velocity_W, one.turn @ turn) for one in queue)
    if not after:
        return after
    shifted = (still(), *after[:-1])
    if timing.every == 1:
        return shifted
    return select_record(less(absolute(phase(count, timing.every)), 0.5), shifted, after)


def corrected(
    queue: tuple[Moved, ...], velocity_W: Vec3, timing: Timing, count: Scalar, dt: Scalar
) -> tuple[Moved, ...]:
    """The queue after a correction of the velocity: it had been wrong since the measurements were taken."""
    since = 0.0 if timing.every == 1 else phase(count, timing.every)
    return tuple(
        one._replace(place_W=one.place_W + velocity_W * ((number * timing.every + since) * dt))
        for number, one in enumerate(queue)
    )


def phase(count: Scalar, every: int) -> Scalar:
    """Sampling instants since the last measurement was taken, 0 to every - 1."""
    return count - every * nearest((count + 0.5) * (1.0 / every) - 0.5)
