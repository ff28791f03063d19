"""Engine on heyoka: the closed loop traced once, compiled by LLVM, run over SIMD lanes.

Every batch, a single flight too, is padded to whole SIMD groups: lanes and a scalar remainder would differ in the
last bits, and a flight's numbers must not depend on its neighbours.
"""

from __future__ import annotations

import heyoka as hy
import numpy as np

from rotorfault.engine.batch import Array, Batch, Recording, Records, Watch, columns, drive_rows, recorded
from rotorfault.engine.compiled import stepper


def run(batch: Batch, watch: Watch) -> Recording:
    """Fly a batch on SIMD lanes; see `rotorfault.engine.batch.Engine`."""
    lanes = hy.recommended_simd_size()
    padded = -(-batch.flights // lanes) * lanes

    def widened(rows: Array) -> Array:
        # Spare lanes fly the last flight again: a lane of zeros could cost time in NaN or denormal arithmetic.
        return np.ascontiguousarray(np.pad(rows, ((0, 0), (0, padded - batch.flights)), mode="edge"))

    loop = stepper(
        batch, widened(columns(batch.state, batch.flights)), widened(columns(batch.parameters, batch.flights))
    )
    records = Records(batch)
    try:
        for first, rows in drive_rows(batch):
            if rows.shape[2] > 1:
                rows = np.pad(rows, ((0, 0), (0, 0), (0, padded - batch.flights)), mode="edge")
            wanted = set(recorded(batch, first, len(rows)))
            for k, row in enumerate(rows):
                signals = loop.advance(row)
                if k in wanted:
                    records.add(first + k, signals[:, : batch.flights])
            if watch(first + len(rows), records.so_far):
                break
    except KeyboardInterrupt:
        return records.recording(interrupted=True)
    return records.recording()
