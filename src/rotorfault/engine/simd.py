"""Engine on heyoka: the closed loop traced once, compiled by LLVM, run over SIMD lanes.

One call of the compiled function takes all flights one sampling period further. Its buffer has the rows

    [drive | state | signals]

and there are two of them: the call reads drive and state of one and writes state and signals of the other, both
contiguous, so that nothing is ever copied from step to step. Every batch, a single flight too, is padded to whole
SIMD groups: lanes and a scalar remainder would differ in the last bits.
"""

from __future__ import annotations

from typing import Any

import heyoka as hy
import numpy as np

from rotorfault.engine import cache
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
)
from rotorfault.records import flatten, unflatten


def compiled(batch: Batch) -> Any:
    """The compiled step of a closed loop, from the cache if it was ever compiled before."""
    return cache.get(cache.key(batch.loop, hy.__version__), lambda: _compile(batch))


def _compile(batch: Batch) -> Any:
    template = drive_template(batch)
    drive = [hy.expression(f"d{i:03d}") for i in range(len(flatten(template)))]
    state = [hy.expression(f"s{i:03d}") for i in range(len(flatten(batch.state)))]
    parameters = [hy.par[i] for i in range(len(flatten(batch.parameters)))]
    after, signals = batch.loop.step(
        unflatten(batch.state, state), as_drive(unflatten(template, drive)), unflatten(batch.parameters, parameters)
    )
    outputs = [x if isinstance(x, hy.expression) else hy.expression(float(x)) for x in flatten((after, signals))]
    return hy.cfunc(outputs, [*drive, *state])


def run(batch: Batch, watch: Watch) -> Recording:
    """Fly a batch on SIMD lanes; see `rotorfault.engine.batch.Engine`."""
    step = compiled(batch)
    lanes = hy.recommended_simd_size()
    padded = -(-batch.flights // lanes) * lanes

    def widened(rows: Array) -> Array:
        # Spare lanes fly the last flight again: a lane of zeros could cost time in NaN or denormal arithmetic.
        return np.ascontiguousarray(np.pad(rows, ((0, 0), (0, padded - batch.flights)), mode="edge"))

    parameters, start = (
        widened(columns(batch.parameters, batch.flights)),
        widened(columns(batch.state, batch.flights)),
    )
    n_drive, n_state = len(flatten(drive_template(batch))), len(start)
    n_rows = n_drive + len(step.fn)
    buffers = [np.zeros((n_rows, padded)) for _ in range(2)]
    reads = [b[: n_drive + n_state] for b in buffers]
    writes = [b[n_drive:] for b in buffers]
    drives = [b[:n_drive] for b in buffers]
    seen = [b[n_drive + n_state :, : batch.flights] for b in buffers]
    buffers[0][n_drive : n_drive + n_state] = start

    capacity = -(-batch.steps // batch.every)
    records = np.empty((capacity, n_rows - n_drive - n_state, batch.flights))
    steps = np.empty(capacity)
    filled = now = 0
    try:
        for first, rows in drive_rows(batch):
            if rows.shape[2] > 1:
                rows = np.pad(rows, ((0, 0), (0, 0), (0, padded - batch.flights)), mode="edge")
            wanted = set(recorded(batch, first, len(rows)))
            for k, row in enumerate(rows):
                then = 1 - now
                drives[now][:] = row
                step(reads[now], outputs=writes[then], pars=parameters)
                if k in wanted:
                    records[filled], steps[filled] = seen[then], first + k
                    filled += 1
                now = then
            if watch(first + len(rows), records[:filled]):
                break
    except KeyboardInterrupt:
        if filled == 0:
            raise
        return Recording(records[:filled], steps[:filled], interrupted=True)
    return Recording(records[:filled], steps[:filled])
