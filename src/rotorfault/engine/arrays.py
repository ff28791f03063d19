"""Engine on NumPy arrays: all flights of a batch at once, no compiler needed."""

from __future__ import annotations

import numpy as np

from rotorfault.engine.batch import (
    Array,
    Batch,
    Recording,
    Watch,
    as_drive,
    columns,
    drive_rows,
    drive_template,
    recorded,
    recording,
)
from rotorfault.records import unflatten


def run(batch: Batch, watch: Watch) -> Recording:
    """Fly a batch on NumPy arrays; see `rotorfault.engine.batch.Engine`."""
    template = drive_template(batch)
    parameters = unflatten(batch.parameters, list(columns(batch.parameters, batch.flights)))
    state = unflatten(batch.state, list(columns(batch.state, batch.flights)))
    records: list[Array] = []
    steps: list[int] = []
    try:
        with np.errstate(all="ignore"):  # failure is data: NaN shows in the record
            for first, rows in drive_rows(batch):
                wanted = set(recorded(batch, first, len(rows)))
                for k, row in enumerate(np.broadcast_to(rows, (*rows.shape[:2], batch.flights))):
                    state, signals = batch.loop.step(state, as_drive(unflatten(template, list(row))), parameters)
                    if k in wanted:
                        records.append(columns(signals, batch.flights))
                        steps.append(first + k)
                if watch(first + len(rows), np.stack(records)):
                    break
    except KeyboardInterrupt:
        return recording(records, steps, interrupted=True)
    return recording(records, steps, interrupted=False)
