"""Engine on machine code: the closed loop traced once, compiled by LLVM, run over vector lanes and threads.

Flights are flown in blocks small enough for the cache, each block by one thread from its first step to its last, in
chunks of steps. Between two chunks flights that are over make room: the others move together, and groups of lanes
that have become empty are flown no further. What a flight's numbers are depends on none of that: each lane computes
for itself, with the same operations in the same order.
"""

from __future__ import annotations

import os
import threading
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor, wait
from typing import final

import numpy as np
from numpy.typing import NDArray

from rotorfault.engine.batch import CHUNK, Batch, Recording, Records, Watch, columns, ends_of, no_watch
from rotorfault.engine.machine import Machine, Machines, aligned, grouped, ungrouped
from rotorfault.engine.native import lanes
from rotorfault.maths.arrays import Array

GROUPS = 8  # of lanes in a block: enough for calls to cost nothing, few enough for the cache
PATIENCE = 0.1  # s between two looks at progress


def run(batch: Batch, watch: Watch = no_watch, threads: int | None = None) -> Recording:
    """Fly a batch on vector lanes; see `rotorfault.engine.batch.Engine`."""
    threads = threads or os.cpu_count() or 1
    flight = _Common(batch, threads)
    blocks = [flight.block(first) for first in range(0, batch.flights, flight.block_size)]
    threads = min(threads, len(blocks))
    interrupted = False
    try:
        if threads == 1:
            for block in blocks:
                for _ in block.chunks():
                    if watch(flight.done // batch.flights):
                        flight.stop.set()
                block.close()
        else:
            _run_threads(flight, blocks, watch, threads)
    except KeyboardInterrupt:
        flight.stop.set()
        interrupted = True
    for block in blocks:
        block.close()
    if flight.stop.is_set():
        flight.records.until(min(block.reached for block in blocks))
    if interrupted and batch.every == 0:
        raise KeyboardInterrupt
    return flight.records.recording(flight.state, flight.done, interrupted)


def _run_threads(flight: _Common, blocks: list[_Block], watch: Watch, threads: int) -> None:
    with ThreadPoolExecutor(threads) as pool:
        waiting: set[Future[None]] = {pool.submit(block.fly) for block in blocks}
        try:
            while waiting:
                done, waiting = wait(waiting, timeout=PATIENCE)
                for future in done:
                    future.result()
                if watch(flight.done // flight.batch.flights):
                    flight.stop.set()
        except BaseException:
            flight.stop.set()
            raise


@final
class _Common:
    """What all blocks of a batch share."""

    def __init__(self, batch: Batch, threads: int) -> None:
        machines = Machines(batch)
        self.batch = batch
        steps = batch.steps * -(-batch.flights // (lanes() * threads))
        self.quiet = machines.get(False, steps) if batch.every != 1 else None
        self.recording = machines.get(True, steps / batch.every) if batch.every != 0 else None
        any_machine = self.quiet or self.recording
        assert any_machine is not None
        self.layout, self.lanes = any_machine.layout, any_machine.lanes
        groups = -(-batch.flights // self.lanes)
        self.block_size = min(GROUPS, -(-groups // threads)) * self.lanes  # work for all, if there is enough
        self.records, self.ends = Records(batch), ends_of(batch)
        self.state = np.zeros((self.layout.state, batch.flights))
        self.reference = np.ascontiguousarray(batch.reference)
        self.stop = threading.Event()
        self._lock, self.done = threading.Lock(), 0

    def block(self, first: int) -> _Block:
        """The block of flights that begins with this one."""
        return _Block(self, np.arange(first, min(first + self.block_size, self.batch.flights)))

    def count(self, steps: int) -> None:
        """Flight-steps have been done."""
        with self._lock:
            self.done += steps


@final
class _Block:
    """Some flights, flown together. Nothing is allocated before it begins."""

    def __init__(self, common: _Common, flights: NDArray[np.intp]) -> None:
        self._common, self._flights, self.reached = common, flights, 0
        self._state: Array | None = None
        self._prepared: dict[int, Array] = {}  # by machine

    def fly(self) -> None:
        """From the first step to the last."""
        for _ in self.chunks():
            pass
        self.close()  # at once: only results are held until all blocks are done

    def chunks(self) -> Iterator[None]:
        """Fly chunk by chunk."""
        common, batch = self._common, self._common.batch
        self._begin()
        for first in range(0, batch.steps, CHUNK):
            if common.stop.is_set():
                break
            steps = min(CHUNK, batch.steps - first)
            self._advance(first, steps)
            self.reached = first + steps
            common.count(len(self._flights) * steps)
            self._drop()
            yield
            if not len(self._flights):
                self.reached = batch.steps  # nothing is left that could be recorded
                break

    def close(self) -> None:
        """Keep the state of the flights as far as they got."""
        if self._state is not None and len(self._flights):
            self._keep(self._flights, ungrouped(self._state, len(self._flights)))
        self._state, self._prepared = None, {}

    @property
    def _flying(self) -> Array:
        """State of the block, shape (groups, rows, lanes)."""
        assert self._state is not None
        return self._state

    def _begin(self) -> None:
        common, batch = self._common, self._common.batch
        part = slice(int(self._flights[0]), int(self._flights[-1]) + 1)
        self._state = grouped(columns(batch.state, batch.flights, part), common.lanes)
        seeds = np.array(batch.seeds[part], dtype=float).T
        parameters = grouped(np.vstack([columns(batch.parameters, batch.flights, part), seeds]), common.lanes)
        self._prepared = {
            id(machine): machine.prepare(parameters)
            for machine in (common.quiet, common.recording)
            if machine is not None
        }

    def _advance(self, first: int, steps: int) -> None:
        """Fly some steps, and record those that are wanted."""
        common, every = self._common, self._common.batch.every
        shared = common.reference[first : first + steps]
        if common.recording is None:
            assert common.quiet is not None
            self._call(common.quiet, shared)
            return
        if common.quiet is None:
            self._record(first, shared)
            return
        k = 0
        while k < steps:
            due = (first + k) % every == 0
            until = k + 1 if due else min(steps, k + every - (first + k) % every)
            if due:
                self._record(first + k, shared[k:until])
            else:
                self._call(common.quiet, shared[k:until])
            k = until

    def _record(self, first: int, shared: Array) -> None:
        machine = self._common.recording
        assert machine is not None
        out = aligned((len(self._flying), len(shared), machine.layout.signals, machine.lanes))
        self._call(machine, shared, out)
        by_flight = out.transpose(1, 2, 0, 3).reshape(len(shared), machine.layout.signals, -1)
        self._common.records.add(first, by_flight[:, :, : len(self._flights)], self._flights)

    def _call(self, machine: Machine, shared: Array, out: Array | None = None) -> None:
        machine.fly(self._flying, self._prepared[id(machine)], shared, out)

    def _drop(self) -> None:
        """Let flights that are over make room, where that saves a group of lanes."""
        lanes, count = self._common.lanes, len(self._flights)
        rows = ungrouped(self._flying, count)
        over = self._common.ends.passed(rows, self.reached)
        left = int(count - over.sum())
        if -(-left // lanes) == len(self._flying) and left:
            return
        self._keep(self._flights[over], rows[:, over])
        flying = np.flatnonzero(~over)
        self._flights = self._flights[flying]
        if not left:
            return
        self._state = grouped(rows[:, flying], lanes)
        self._prepared = {
            key: grouped(ungrouped(prepared, count)[:, flying], lanes) for key, prepared in self._prepared.items()
        }

    def _keep(self, flights: NDArray[np.intp], rows: Array) -> None:
        self._common.state[:, flights] = rows
