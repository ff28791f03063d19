"""Engine on Python floats: one flight after the other, any controller, nothing to compile."""

from __future__ import annotations

import numpy as np

from rotorfault.engine.batch import (
    Batch,
    Recording,
    Records,
    Watch,
    columns,
    drive_rows,
    drive_template,
    ends_of,
    no_watch,
    recorded,
)
from rotorfault.loop.closed_loop import LoopState
from rotorfault.maths.arrays import Array
from rotorfault.maths.records import flatten, unflatten
from rotorfault.model.block import Record


def run(batch: Batch, watch: Watch = no_watch, threads: int | None = None) -> Recording:
    """Fly a batch on Python floats; see `rotorfault.engine.batch.Engine`.

    Where float arithmetic raises (division by zero, overflow) the flight is lost as NaN, as in the other engines.
    """
    template = drive_template(batch)
    numbers, starts = columns(batch.parameters, batch.flights), columns(batch.state, batch.flights)
    parameters = [unflatten(batch.parameters, numbers[:, i].tolist()) for i in range(batch.flights)]
    states = [unflatten(batch.state, starts[:, i].tolist()) for i in range(batch.flights)]
    lost = [False] * batch.flights
    missing = [np.nan] * len(batch.loop.layout)
    records, done, interrupted, ends = Records(batch), 0, False, ends_of(batch)

    def state() -> Array:
        return np.array([[float(leaf) for leaf in flatten(one)] for one in states]).T

    try:
        for first, rows in drive_rows(batch):
            wanted = set(recorded(batch, first, len(rows)))
            for k, row in enumerate(rows):
                taken: list[list[float]] = []
                for i in range(batch.flights):
                    drive = unflatten(template, row[:, min(i, row.shape[1] - 1)].tolist())
                    signals: Record | None = None
                    if not lost[i]:
                        try:
                            states[i], signals = batch.loop.step(states[i], drive, parameters[i])
                        except (ZeroDivisionError, OverflowError):
                            lost[i] = True
                            states[i] = _diverged(states[i], first + k)
                    if k in wanted:
                        taken.append(missing if signals is None else [float(x) for x in flatten(signals)])
                done += 1
                if k in wanted:
                    records.add(first + k, np.array(taken).T[None])
            if watch(done) or ends.passed(state(), done).all():
                break
    except KeyboardInterrupt:
        interrupted = True
    return records.recording(state(), done * batch.flights, interrupted)


def _diverged(state: LoopState, step: int) -> LoopState:
    """The same flight, over: it has no numbers from this step on."""
    if state.scores.over != 0.0:
        return state
    return state._replace(scores=state.scores._replace(over=1.0, end=float(step)))
