"""Signals in a page: packed so that minutes at 1 kHz fit into a file that is sent by mail.

Each column is rounded to one of 65,535 levels between its least and its largest value (the last code, 65535, is
NaN), written as differences from record to record, low bytes before high bytes, and deflated. A page says that its
numbers are rounded so; the flight file has them exactly.
"""

from __future__ import annotations

import base64
import zlib
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rotorfault.maths.arrays import Array

LEVELS = 65534
NOTHING = 65535  # the code of a NaN


def packed(values: Array) -> dict[str, Any]:
    """A signal as JSON holds it, in a few bytes per value.

    Parameters
    ----------
    values : ndarray, shape (records, columns)
        Infinite values become NaN.

    Returns
    -------
    dict
        ``low`` and ``high``, least and largest finite value of each column (null where there is none); ``coded``,
        whether it changes; and ``data``, the deflated codes of those that do, one after another, in Base64.
    """
    values = np.where(np.isfinite(values), values, np.nan)
    lows: list[float | None] = []
    highs: list[float | None] = []
    coded: list[bool] = []
    planes: list[bytes] = []
    for column in values.T:
        finite = column[np.isfinite(column)]
        low, high = (float(finite.min()), float(finite.max())) if finite.size else (None, None)
        lows.append(low)
        highs.append(high)
        coded.append(low != high or 0 < finite.size < column.size)
        if low is not None and high is not None and coded[-1]:
            planes.append(_codes(column, low, high))
    data = base64.b64encode(zlib.compress(b"".join(planes), 9)).decode("ascii") if planes else ""
    return {"low": lows, "high": highs, "coded": coded, "data": data}


def _codes(column: Array, low: float, high: float) -> bytes:
    """The codes of a column as differences, all low bytes before all high ones."""
    span = high - low
    share = (column - low) / (span if span > 0.0 else 1.0)
    codes = np.where(np.isnan(share), float(NOTHING), np.rint(np.nan_to_num(share) * LEVELS)).astype(np.uint16)
    steps: NDArray[np.uint16] = np.diff(codes, prepend=np.uint16(0))  # modulo 65536, as unsigned numbers do
    return (steps & 0xFF).astype(np.uint8).tobytes() + (steps >> 8).astype(np.uint8).tobytes()


def packed_times(time: Array) -> dict[str, Any]:
    """Times as JSON holds them: start and step if they are even, else all of them in Base64.

    Parameters
    ----------
    time : ndarray, shape (records,), s
    """
    count = len(time)
    step = float(time[-1] - time[0]) / (count - 1) if count > 1 else 0.0
    if count < 2 or np.allclose(np.diff(time), step, rtol=1e-6, atol=1e-12):
        return {"start": float(time[0]), "step": step, "count": count}
    raw = zlib.compress(np.asarray(time, dtype="<f8").tobytes(), 9)
    return {"count": count, "data": base64.b64encode(raw).decode("ascii")}


def thinned(time: Array, every: int, around: list[float], window: float) -> NDArray[np.intp]:
    """Which records a page has when there are too many: one of so many, and all of them close to what happened.

    Parameters
    ----------
    time : ndarray, shape (records,), s
    every : int
        One of so many records is kept, and the last one.
    around : list of float, s
        Times around which every record is kept.
    window : float, s
        How far to both sides.
    """
    if every <= 1:
        return np.arange(len(time), dtype=np.intp)
    keep = np.zeros(len(time), dtype=bool)
    keep[::every] = True
    keep[-1] = True
    for moment in around:
        first, last = np.searchsorted(time, [moment - window, moment + window])
        keep[first:last] = True
    return np.flatnonzero(keep).astype(np.intp)
