"""The compiled forms of a closed loop: one function for a whole sampling period, or two.

`Whole` takes all flights one sampling period further in one call. Its buffer has the rows

    [drive | state | signals]

and there are two of them: the call reads drive and state of one and writes state and signals of the other, both
contiguous, so that nothing is ever copied from step to step.

With many integration steps in a sampling period the code of one function would grow with their number, and its
compilation faster than that (100 of them: minutes). `Split` compiles the sampling instant and one integration step
apart and calls the second as often as needed. The operations are the same in both.
"""

from __future__ import annotations

from typing import Any

import heyoka as hy
import numpy as np

from rotorfault.engine import cache
from rotorfault.engine.batch import Array, Batch, as_drive, drive_template
from rotorfault.geometry import PerRotor, zeros
from rotorfault.records import flatten, unflatten
from rotorfault.signals import Command

MOST_IN_ONE = 2  # integration steps that one function holds


class Whole:
    """One compiled function for a sampling period."""

    def __init__(self, batch: Batch, start: Array, parameters: Array) -> None:
        name = cache.key(batch.loop, hy.__version__, "whole")
        self._step = cache.get(name, lambda: _compile_whole(batch))
        self._parameters = parameters
        n_drive, n_state, lanes = len(flatten(drive_template(batch))), len(start), start.shape[1]
        n_rows = n_drive + len(self._step.fn)
        buffers = [np.zeros((n_rows, lanes)) for _ in range(2)]
        self._reads = [b[: n_drive + n_state] for b in buffers]
        self._writes = [b[n_drive:] for b in buffers]
        self._drives = [b[:n_drive] for b in buffers]
        self._signals = [b[n_drive + n_state :] for b in buffers]
        buffers[0][n_drive : n_drive + n_state] = start
        self._now = 0

    def advance(self, drive: Array) -> Array:
        """One sampling period further; the signals at its beginning, shape (rows, lanes), overwritten by the next."""
        now, then = self._now, 1 - self._now
        self._drives[now][:] = drive
        self._step(self._reads[now], outputs=self._writes[then], pars=self._parameters)
        self._now = then
        return self._signals[then]


class Split:
    """Two compiled functions: the sampling instant, and one integration step of the plant."""

    def __init__(self, batch: Batch, start: Array, parameters: Array) -> None:
        loop, version = batch.loop, hy.__version__
        self._decide = cache.get(cache.key(loop, version, "decide"), lambda: _compile_decide(batch))
        self._move = cache.get(cache.key(loop, version, "move"), lambda: _compile_move(batch))
        self._parameters, self._substeps = parameters, loop.plant.substeps
        self._n_drive = len(flatten(drive_template(batch)))
        self._n_plant, n_state, lanes = len(flatten(batch.state.plant)), len(start), start.shape[1]
        self._n_memory = n_state - self._n_plant
        # The air, last of the plant's rows, is held like the command over the plant's steps.
        self._n_held = len(flatten(batch.state.plant.air)) + len(_COMMAND)
        # [drive | plant | memory and step count]; what `decide` writes: [memory and count | air, command | signals].
        self._reads = np.zeros((self._n_drive + n_state, lanes))
        self._reads[self._n_drive :] = start
        self._writes = np.zeros((len(self._decide.fn), lanes))
        # [plant, air its last | command | time], twice for the plant's steps.
        self._motion = [np.zeros((self._n_plant + len(_COMMAND) + 1, lanes)) for _ in range(2)]
        self._period = parameters[_index_of_period(batch)]

    def advance(self, drive: Array) -> Array:
        """One sampling period further; the signals at its beginning, shape (rows, lanes), overwritten by the next."""
        reads, writes, n_drive, n_plant = self._reads, self._writes, self._n_drive, self._n_plant
        reads[:n_drive] = drive
        self._decide(reads, outputs=writes, pars=self._parameters)
        time = reads[-1] * self._period
        dt = self._period * (1.0 / self._substeps)
        motion = self._motion
        held = writes[self._n_memory : self._n_memory + self._n_held]
        motion[0][:n_plant] = reads[n_drive : n_drive + n_plant]
        for buffer in motion:
            buffer[-1 - self._n_held : -1] = held
        for k in range(self._substeps):
            now, then = motion[k % 2], motion[1 - k % 2]
            now[-1] = time + k * dt
            self._move(now, outputs=then[:n_plant], pars=self._parameters)
        reads[n_drive : n_drive + n_plant] = motion[self._substeps % 2][:n_plant]
        reads[n_drive + n_plant :] = writes[: self._n_memory]
        return writes[self._n_memory + self._n_held :]


def stepper(batch: Batch, start: Array, parameters: Array) -> Whole | Split:
    """The compiled form that suits a batch.

    Parameters
    ----------
    batch : Batch
    start : ndarray, shape (leaves of the state, lanes)
    parameters : ndarray, shape (leaves of the parameters, lanes)
    """
    form = Whole if batch.loop.plant.substeps <= MOST_IN_ONE else Split
    return form(batch, start, parameters)


_COMMAND = flatten(Command(PerRotor.all(0.0), zeros()))


def _index_of_period(batch: Batch) -> int:
    # `period` is the last field of `LoopParameters`.
    return len(flatten(batch.parameters)) - 1


def _symbols(letter: str, record: Any) -> tuple[list[Any], Any]:
    found = [hy.expression(f"{letter}{i:03d}") for i in range(len(flatten(record)))]
    return found, unflatten(record, found)


def _parameters_of(batch: Batch) -> Any:
    return unflatten(batch.parameters, [hy.par[i] for i in range(len(flatten(batch.parameters)))])


def _function(outputs: Any, inputs: list[Any]) -> Any:
    lifted = [x if isinstance(x, hy.expression) else hy.expression(float(x)) for x in flatten(outputs)]
    return hy.cfunc(lifted, inputs)


def _compile_whole(batch: Batch) -> Any:
    drive, drive_record = _symbols("d", drive_template(batch))
    state, state_record = _symbols("s", batch.state)
    return _function(batch.loop.step(state_record, as_drive(drive_record), _parameters_of(batch)), [*drive, *state])


def _compile_decide(batch: Batch) -> Any:
    drive, drive_record = _symbols("d", drive_template(batch))
    state, state_record = _symbols("s", batch.state)
    memory, air, command, signals = batch.loop.decide(state_record, as_drive(drive_record), _parameters_of(batch))
    return _function((memory, state_record.steps + 1.0, air, command, signals), [*drive, *state])


def _compile_move(batch: Batch) -> Any:
    plant, plant_record = _symbols("s", batch.state.plant)
    command, command_record = _symbols("u", Command(PerRotor.all(0.0), zeros()))
    time, parameters = hy.expression("t"), _parameters_of(batch)
    dt = parameters.period * (1.0 / batch.loop.plant.substeps)
    after = batch.loop.plant.substep(plant_record, command_record, time, parameters.plant, dt)
    return _function(after, [*plant, *command, time])
