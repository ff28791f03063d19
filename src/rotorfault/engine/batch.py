"""What an engine is given and what it gives back: a batch of flights of one closed loop."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from rotorfault.base.one_line import record_line
from rotorfault.engine.noise import Noise, Stream
from rotorfault.loop.closed_loop import ClosedLoop, Drive, LoopParameters, LoopState
from rotorfault.maths.arrays import Array
from rotorfault.maths.records import flatten, leaf_names

Look = Callable[[int, Array], None]
"""Is shown records as they are made: number of the first one's step, and signals, shape (records, rows, flights)."""

CHUNK = 500  # steps between two looks at progress, noise and flights that are over


class Batch(NamedTuple):
    """N flights of one closed loop, all of the same length."""

    loop: ClosedLoop
    state: LoopState  # leaves are floats, or arrays (N,)
    parameters: LoopParameters  # leaves are floats, or arrays (N,)
    reference: Array  # (steps, 12 and more): `Reference` and the source's own signals, shared by all flights
    flights: int  # N
    seeds: tuple[tuple[int, int], ...]  # (seed, flight index) per flight: names its random numbers
    every: int = 1  # record each so many steps; 0 records nothing
    wanted: tuple[int, ...] | None = None  # rows of the loop's layout that are recorded; None for all
    look: Look | None = None  # of a single flight: sees its records before an engine's `Watch` is next called

    def __repr__(self) -> str:
        return record_line(self)

    @property
    def steps(self) -> int:
        """Number of sampling periods."""
        return len(self.reference)


class Recording(NamedTuple):
    """What came of a batch; a batch whose flights were all over early has fewer records."""

    signals: (
        Array  # (records, recorded rows of the loop's layout, N); NaN after the first record from a flight's end on
    )
    steps: Array  # (records,): number of the step at which each record was taken
    state: Array  # (leaves of `LoopState`, N): at the end, scores included
    flown: int  # flight-steps that were computed
    interrupted: bool = False

    def __repr__(self) -> str:
        return record_line(self)


Watch = Callable[[int], bool]
"""Called now and then with the steps done, the mean of all flights; returns True to end the batch early."""


class Engine(Protocol):
    """Runs batches on one number type. A flight that is over may be dropped at the next chunk of steps."""

    def __call__(self, batch: Batch, watch: Watch, threads: int | None = None) -> Recording:
        """Fly a batch; on as many threads as there are processors, or as are given, where the engine has threads."""


def no_watch(done: int) -> bool:
    """Never ends a batch early."""
    return False


def streams_of(batch: Batch) -> dict[str, Stream]:
    """The streams that a batch draws from at every step, by slot, in the order of their rows."""
    return {slot.name: Stream(part.normals, slot.words(part)[0]) for slot, part in batch.loop.each() if part.normals}


def drive_rows(batch: Batch) -> Iterator[tuple[int, Array]]:
    """First step and rows of the drive, chunk by chunk.

    The rows have shape (steps of the chunk, shared rows, 1) without noise and (steps of the chunk, rows, N) with it:
    normal numbers of each stream follow the shared ones.
    """
    noise = [Noise(batch.seeds, stream) for stream in streams_of(batch).values()]
    for first in range(0, batch.steps, CHUNK):
        reference = batch.reference[first : first + CHUNK, :, None]
        if not noise:
            yield first, reference
        else:
            shared = np.broadcast_to(reference, (*reference.shape[:2], batch.flights))
            yield first, np.concatenate([shared, *(part.draw(len(reference)) for part in noise)], axis=1)


def drive_template(batch: Batch) -> Drive:
    """A record of the shape that the rows of `drive_rows` flatten."""
    return batch.loop.drive()


def columns(record: Any, count: int, part: slice = slice(None)) -> Array:
    """Leaves of a record as rows of an array (leaves, N), or a part of its columns; floats are repeated."""
    leaves = flatten(record)
    rows = np.empty((len(leaves), len(range(count)[part])))
    for row, leaf in zip(rows, leaves, strict=True):
        row[:] = leaf[part] if isinstance(leaf, np.ndarray) and leaf.ndim else leaf
    return rows


def recorded(batch: Batch, first: int, length: int) -> list[int]:
    """Which steps of a chunk are to be recorded, counted from its first."""
    return [k for k in range(length) if batch.every and (first + k) % batch.every == 0]


class Ends(NamedTuple):
    """Tells which flights nothing more is to be computed of: those that are over and whose end is on record.

    What is recorded of a flight must not depend on when an engine notices that it is over, which happens between
    two chunks of steps: its last record is the first one from its end on.
    """

    every: int  # a record each so many steps; 0 for none
    over: int  # row of the state that is not 0 once a flight is over
    end: int  # row of the state with the step at which that was

    def last_record(self, rows: Array) -> Array:
        """Number of the last record of each flight, infinite for those that are not over.

        Parameters
        ----------
        rows : ndarray, shape (leaves of `LoopState`, flights)
        """
        return np.where(rows[self.over] != 0.0, np.ceil(rows[self.end] / max(self.every, 1)), np.inf)

    def passed(self, rows: Array, reached: int) -> NDArray[np.bool_]:
        """Whether each flight needs to be flown no further than the steps done."""
        if not self.every:
            return np.asarray(rows[self.over] != 0.0)
        return np.asarray(self.last_record(rows) * self.every < reached)


def ends_of(batch: Batch) -> Ends:
    """Tells the ends of the flights of a batch."""
    names = leaf_names(batch.state)
    return Ends(batch.every, names.index("scores.over"), names.index("scores.end"))


class Records:
    """Records of a batch, in one array that is there from the start.

    To stack them anew for every look would take time with the square of a flight's length. Memory is occupied only
    as far as it is written.
    """

    def __init__(self, batch: Batch) -> None:
        self.every, self._look = batch.every, batch.look
        self._ends = ends_of(batch)
        self._rows = None if batch.wanted is None else list(batch.wanted)
        capacity = 0 if batch.every == 0 else -(-batch.steps // batch.every)
        width = len(batch.loop.layout) if self._rows is None else len(self._rows)
        self._signals = np.empty((capacity, width, batch.flights))
        if batch.flights > 1:
            self._signals[:] = np.nan  # for flights that are dropped because they are over
        self._filled = 0

    def add(self, step: int, signals: Array, flights: Any = slice(None)) -> None:
        """Keep signals of consecutive recorded steps from `step` on.

        Parameters
        ----------
        step : int
            A multiple of `every`.
        signals : ndarray, shape (records, rows of the loop's layout, flights)
        flights : slice or array of int
            Which of the batch they are.
        """
        first = step // self.every
        chosen = signals if self._rows is None else signals[:, self._rows]
        self._signals[first : first + len(signals), :, flights] = chosen
        self._filled = max(self._filled, first + len(signals))
        if self._look is not None:
            self._look(step, chosen)

    def until(self, step: int) -> None:
        """Forget records from a step on: some of the flights have not got there."""
        if self.every:
            self._filled = min(self._filled, -(-step // self.every))

    def recording(self, state: Array, flown: int, interrupted: bool = False) -> Recording:
        """All of them; KeyboardInterrupt if it came before the first."""
        if interrupted and self._filled == 0:
            raise KeyboardInterrupt
        if self.every:
            last = self._ends.last_record(state)
            self._filled = int(min(self._filled, last.max() + 1))
            gone = np.arange(self._filled)[:, None] > last
            self._signals[: self._filled].transpose(0, 2, 1)[gone] = np.nan
        steps: Array = np.arange(self._filled, dtype=np.float64) * float(self.every)
        return Recording(self._signals[: self._filled], steps, state, flown, interrupted)
