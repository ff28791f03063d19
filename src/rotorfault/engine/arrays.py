"""Engine on NumPy arrays: all flights of a batch at once, no compiler needed."""

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
from rotorfault.maths.records import unflatten


def run(batch: Batch, watch: Watch = no_watch, threads: int | None = None) -> Recording:
    """Fly a batch on NumPy arrays; see `rotorfault.engine.batch.Engine`."""
    template = drive_template(batch)
    parameters = unflatten(batch.parameters, list(columns(batch.parameters, batch.flights)))
    state = unflatten(batch.state, list(columns(batch.state, batch.flights)))
    records, done, interrupted, ends = Records(batch), 0, False, ends_of(batch)
    try:
        with np.errstate(all="ignore"):  # failure is data: NaN shows in the record
            for first, rows in drive_rows(batch):
                wanted = set(recorded(batch, first, len(rows)))
                for k, row in enumerate(np.broadcast_to(rows, (*rows.shape[:2], batch.flights))):
                    state, signals = batch.loop.step(state, unflatten(template, list(row)), parameters)
                    done += 1
                    if k in wanted:
                        records.add(first + k, columns(signals, batch.flights)[None])
                if watch(done) or ends.passed(columns(state, batch.flights), done).all():
                    break
    except KeyboardInterrupt:
        interrupted = True
    return records.recording(columns(state, batch.flights), done * batch.flights, interrupted)
