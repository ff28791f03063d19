"""Engine on Python floats: one flight after the other, any controller, nothing to compile."""

from __future__ import annotations

import numpy as np

from rotorfault.engine.batch import (
    Batch,
    Recording,
    Records,
    Watch,
    as_drive,
    columns,
    drive_rows,
    drive_template,
    recorded,
)
from rotorfault.records import flatten, unflatten
from rotorfault.telemetry import SIGNAL_NAMES, Signals


def run(batch: Batch, watch: Watch) -> Recording:
    """Fly a batch on Python floats; see `rotorfault.engine.batch.Engine`.

    Where float arithmetic raises (division by zero, overflow) the flight goes on as NaN, as in the other engines.
    """
    template = drive_template(batch)
    numbers, starts = columns(batch.parameters, batch.flights), columns(batch.state, batch.flights)
    parameters = [unflatten(batch.parameters, numbers[:, i].tolist()) for i in range(batch.flights)]
    states = [unflatten(batch.state, starts[:, i].tolist()) for i in range(batch.flights)]
    lost = [False] * batch.flights
    missing = [np.nan] * len(SIGNAL_NAMES)
    records = Records(batch)
    try:
        for first, rows in drive_rows(batch):
            wanted = set(recorded(batch, first, len(rows)))
            for k, row in enumerate(rows):
                taken: list[list[float]] = []
                for i in range(batch.flights):
                    drive = as_drive(unflatten(template, row[:, min(i, row.shape[1] - 1)].tolist()))
                    signals: Signals | None = None
                    if not lost[i]:
                        try:
                            states[i], signals = batch.loop.step(states[i], drive, parameters[i])
                        except (ZeroDivisionError, OverflowError):
                            lost[i] = True
                    if k in wanted:
                        taken.append(missing if signals is None else [float(x) for x in flatten(signals)])
                if k in wanted:
                    records.add(first + k, np.array(taken).T)
            if watch(first + len(rows), records.so_far):
                break
    except KeyboardInterrupt:
        return records.recording(interrupted=True)
    return records.recording()
