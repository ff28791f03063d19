"""How far yaw turns from one instant to the next, where a table may have lost full turns.

A heading that comes from an arc tangent or a compass lies within one turn and jumps at its border; the vehicle does
not. A table of n instants is put right by one rule:

- A table whose values span more than a turn cannot have been cut to one: it is taken as it stands.
- With yaw rates, the number of turns between two instants is the one that comes nearest to the mean of the two rates
  times the time between them.
- Without, it is the one with the least change.

Between two instants it stays *unclear* how far yaw turns if the change so found is off by more than a quarter turn
from what the rates say or, without rates, the values are more than half a turn apart and the way over the border is
more than a quarter turn.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from rotorfault.maths.arrays import Array

TURN = 2.0 * math.pi
OVER = 0.01  # rad: what a table cut to one turn may span more, by rounding


def continuous_yaw(times: Array, yaw: Array, rates: Array | None) -> tuple[Array, NDArray[np.intp]]:
    """Yaw without jumps by full turns.

    Parameters
    ----------
    times : ndarray, shape (n,)
        In s, ascending.
    yaw : ndarray, shape (n,)
        In rad.
    rates : ndarray, shape (n,), or None
        In rad/s.

    Returns
    -------
    yaw : ndarray, shape (n,)
        In rad; from the first value on.
    unclear : ndarray of int
        Indices of the instants after which it is unclear how far yaw turns.
    """
    change = np.diff(yaw)
    if len(yaw) < 2 or not np.isfinite(yaw).all() or np.ptp(yaw) > TURN + OVER:
        return yaw, np.zeros(0, dtype=np.intp)
    apart = np.abs(change) > math.pi
    if rates is None:
        turns = -np.round(change / TURN)
        unclear = apart & (np.abs(change + TURN * turns) > 0.25 * TURN)
    else:
        expected = 0.5 * (rates[1:] + rates[:-1]) * np.diff(times)
        turns = np.round((expected - change) / TURN)
        unclear = (apart | (turns != 0.0)) & (np.abs(change + TURN * turns - expected) > 0.25 * TURN)
    if np.any(turns):
        yaw = yaw + TURN * np.concatenate([[0.0], np.cumsum(turns)])
    return yaw, np.flatnonzero(unclear)
