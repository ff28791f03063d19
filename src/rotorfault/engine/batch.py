"""What an engine is given and what it gives back: a batch of flights of one closed loop."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from rotorfault.closed_loop import ClosedLoop, Drive, LoopParameters, LoopState
from rotorfault.geometry import zeros
from rotorfault.plant.sensors import no_noise
from rotorfault.records import flatten
from rotorfault.signals import Reference
from rotorfault.telemetry import SIGNAL_NAMES

Array = NDArray[np.float64]
CHUNK = 500  # steps between two looks at progress, noise and early endings


class Batch(NamedTuple):
    """N flights of one closed loop, all of the same length."""

    loop: ClosedLoop
    state: LoopState  # leaves are floats, or arrays (N,)
    parameters: LoopParameters  # leaves are floats, or arrays (N,)
    reference: Array  # (steps, 12): rows of `Reference`, shared by all flights
    flights: int  # N
    seeds: tuple[tuple[int, int], ...]  # (seed, flight index) per flight: names its random numbers
    every: int = 1  # record each so many steps

    @property
    def steps(self) -> int:
        """Number of sampling periods."""
        return len(self.reference)


class Recording(NamedTuple):
    """Signals of a batch; a flight that was cut short has fewer records."""

    signals: Array  # (records, rows of `Signals`, N)
    steps: Array  # (records,): number of the step at which each record was taken
    interrupted: bool = False


Watch = Callable[[int, Array], bool]
"""Called after each chunk with the steps done and the records so far; returns True to end the batch early."""


class Engine(Protocol):
    """Runs batches on one number type."""

    def __call__(self, batch: Batch, watch: Watch) -> Recording:
        """Fly a batch."""


def no_watch(done: int, records: Array) -> bool:
    """Never ends a batch early."""
    return False


class Stream(NamedTuple):
    """One of the streams of normal numbers of a flight."""

    width: int  # numbers a step
    words: tuple[int, ...]  # tell it from the others of the same flight


SENSOR_NOISE = Stream(12, ())  # `Normals`
GUSTS = Stream(3, (1,))  # `Drive.gust`
FIRST_GUST = Stream(6, (2,))  # `FirstNormals`, one step of them


class Noise:
    """Standard normal numbers of each flight, the same whatever batch it flies in.

    A counter-based generator (Philox) per flight and stream, keyed by (seed, flight index) and the words of the
    stream; numbers are drawn in order of steps. Streams of their own keep the gusts of a flight when its sensors get
    noise, and the other way round.
    """

    def __init__(self, seeds: tuple[tuple[int, int], ...], stream: Stream = SENSOR_NOISE) -> None:
        self._width = stream.width
        sequences = [np.random.SeedSequence(s, spawn_key=stream.words) for s in seeds]
        self._generators = [np.random.Generator(np.random.Philox(s)) for s in sequences]

    def draw(self, steps: int) -> Array:
        """Numbers of the next steps, shape (steps, numbers of the stream, N)."""
        return np.stack([g.standard_normal((steps, self._width)) for g in self._generators], axis=2)


def drive_rows(batch: Batch) -> Iterator[tuple[int, Array]]:
    """First step and rows of the drive, chunk by chunk.

    The rows have shape (steps of the chunk, 12, 1) without noise and (steps of the chunk, rows, N) with it: twelve
    rows more for sensors that need noise, and then three more for a wind that does.
    """
    noise = [Noise(batch.seeds, SENSOR_NOISE)] if batch.loop.sensors.needs_noise else []
    noise += [Noise(batch.seeds, GUSTS)] if batch.loop.plant.wind.needs_noise else []
    for first in range(0, batch.steps, CHUNK):
        reference = batch.reference[first : first + CHUNK, :, None]
        if not noise:
            yield first, reference
        else:
            shared = np.broadcast_to(reference, (*reference.shape[:2], batch.flights))
            yield first, np.concatenate([shared, *(part.draw(len(reference)) for part in noise)], axis=1)


def drive_template(batch: Batch) -> Any:
    """A record of the shape that the rows of `drive_rows` flatten: a drive, empty where nothing is drawn."""
    zero = zeros()
    reference = Reference(p_W=zero, v_W=zero, a_W=zero, yaw=0.0, yaw_rate=0.0, yaw_acceleration=0.0)
    loop = batch.loop
    sensors: Any = no_noise() if loop.sensors.needs_noise else ()
    gust: Any = zero if loop.plant.wind.needs_noise else ()
    return Drive(reference, sensors, gust)


def as_drive(record: Any) -> Drive:
    """The drive that a record of the shape of `drive_template` stands for."""
    noise = no_noise() if record.noise == () else record.noise
    return Drive(record.reference, noise, zeros() if record.gust == () else record.gust)


def columns(record: Any, count: int) -> Array:
    """Leaves of a record as rows of an array (leaves, N); floats are repeated."""
    return np.stack([np.broadcast_to(np.asarray(leaf, dtype=float), (count,)) for leaf in flatten(record)])


def recorded(batch: Batch, first: int, length: int) -> list[int]:
    """Which steps of a chunk are to be recorded, counted from its first."""
    return [k for k in range(length) if (first + k) % batch.every == 0]


class Records:
    """Records taken one by one, in one array that is there from the start.

    To stack them anew for every look would take time with the square of a flight's length. Memory is occupied only
    as far as it is written.
    """

    def __init__(self, batch: Batch) -> None:
        capacity = -(-batch.steps // batch.every)
        self._signals = np.empty((capacity, len(SIGNAL_NAMES), batch.flights))
        self._steps = np.empty(capacity)
        self._filled = 0

    def add(self, step: int, signals: Array) -> None:
        """Keep the signals of a step, shape (rows of `Signals`, N)."""
        self._signals[self._filled], self._steps[self._filled] = signals, step
        self._filled += 1

    @property
    def so_far(self) -> Array:
        """The records so far, not copied; shape (records, rows of `Signals`, N)."""
        return self._signals[: self._filled]

    def recording(self, interrupted: bool = False) -> Recording:
        """All of them; KeyboardInterrupt if it came before the first."""
        if self._filled == 0:
            raise KeyboardInterrupt
        return Recording(self.so_far, self._steps[: self._filled], interrupted)
