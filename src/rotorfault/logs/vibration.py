r"""How much each rotor shakes the body: small damage of a blade costs little thrust and shows here first.

A blade that lacks a piece is out of balance: its rotor shakes the body once per turn. With the speeds of the rotors
logged, the part of gyro and accelerometer that goes with each rotor's turning angle :math:`\varphi_k(t)` is

.. math:: x(t) = \sum_k a_k \cos \varphi_k(t) + b_k \sin \varphi_k(t) + n(t)

fitted over blocks of two seconds for all rotors at once, so that one does not pass for another that turns nearly as
fast; what noise alone would give is taken off. The size is compared with that in healthy flights of the same vehicle.
It takes records at more than twice the rotors' frequency, some hundred per second.

Source of fitting all orders at once: the Vold-Kalman family of order tracking in its simplest form, least squares.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.stats import t

from rotorfault.logs.log import Log, Series
from rotorfault.maths.arrays import Array

BLOCK = 2.0  # s of a fit: rotors half a turn per second apart are told apart
SEEN = 2.2  # records per turn at least
APART = 30.0  # condition of a fit, beyond which two rotors turn alike
FEWEST, MOST = 3, 300  # blocks
# Standard deviation of the logarithm of a size between healthy flights before any is known, and the flights that this
# is worth: sizes of healthy flights differ by a quarter.
USUAL, WORTH = 0.25, 4.0
ALARM = 0.01  # probability of a healthy rotor beyond which its size is told as more, for all rotors of a flight


class Shaking(NamedTuple):
    """What goes with each rotor's turning."""

    of: str  # what shakes: "rates" or "specific force"
    size: Array  # (N,) rad/s or m/s^2, amplitude over all axes
    blocks: int


def shaking_of(log: Log, spans: Sequence[tuple[float, float]]) -> tuple[Shaking | None, str]:
    """How much each rotor shakes the body in flight; or why the log cannot tell.

    Parameters
    ----------
    log : Log
    spans : sequence of (float, float), s
        Of flight.
    """
    speeds = log.series.get("rpm")
    if speeds is None or speeds.values.shape[1] != log.motors:
        return None, "vibration is not looked at: log the speeds of the rotors (ESC telemetry) and the gyro at 500 Hz"
    fast = [name for name in ("specific_force", "rates") if name in log.series]
    if not fast:
        return None, "vibration is not looked at: neither gyro nor accelerometer is logged"
    name = max(fast, key=lambda one: log.series[one].rate)
    moving = log.series[name]
    flown = [row for begin, end in spans for row in speeds.values[(speeds.time > begin) & (speeds.time < end)]]
    turns = float(np.median(np.array(flown))) / 60.0 if flown else 0.0
    if turns <= 1.0:
        return None, "vibration is not looked at: the speeds of the rotors are 0"
    if moving.rate < SEEN * turns:
        return None, (f"vibration is not looked at: rotors turn {turns:.0f} times per second, the gyro is logged at "
                      f"{moving.rate:.0f} Hz; log it at {10.0 * math.ceil(0.3 * turns):.0f} Hz or more")  # fmt: skip
    found = []
    for begin, end in spans:
        for start in np.arange(begin + 1.0, end - BLOCK, BLOCK)[:MOST]:
            one = _fitted(moving, speeds, float(start))
            if one is not None:
                found.append(one)
    if len(found) < FEWEST:
        return (
            None,
            "vibration is not looked at: rotors turn too alike, or the flight is too short, to tell them apart",
        )
    size = np.sqrt(np.maximum(np.median(np.array(found), axis=0), 1e-12))
    return Shaking(name.replace("_", " "), size, len(found)), ""


def _fitted(moving: Series, speeds: Series, start: float) -> Array | None:
    """Squares of the amplitudes of one block, less what noise gives; None where rotors turn alike."""
    inside = (moving.time >= start) & (moving.time < start + BLOCK)
    time, values = moving.time[inside], moving.values[inside]
    if len(time) < 40:
        return None
    turning = speeds.at(time) / 60.0 * 2.0 * math.pi
    angle = np.vstack([np.zeros((1, turning.shape[1])),
                       np.cumsum(0.5 * (turning[1:] + turning[:-1]) * np.diff(time)[:, None], axis=0)])  # fmt: skip
    table = np.hstack([np.cos(angle), np.sin(angle)])
    both = table.T @ table
    if np.linalg.cond(both) > APART:
        return None
    inverse = np.linalg.inv(both)
    trend = np.column_stack([np.ones(len(time)), time - start])
    rest = values - trend @ np.linalg.lstsq(trend, values, rcond=None)[0]
    # What is slower than the rotors is control and gusts, and no noise at their frequency: differences leave it out.
    weights = inverse @ (table.T @ rest)
    left = np.diff(rest - table @ weights, axis=0)
    noise = 0.5 * (left**2).mean(axis=0)
    count = turning.shape[1]
    square = weights[:count] ** 2 + weights[count:] ** 2
    own = np.diag(inverse)
    out: Array = (square - (own[:count] + own[count:])[:, None] * noise).sum(axis=1)
    return out


def more_than(now: Shaking, before: Sequence[Shaking]) -> list[tuple[int, float]]:
    """Rotors that shake more than in healthy flights, with how many times as much.

    Parameters
    ----------
    now : Shaking
    before : sequence of Shaking
        Of healthy flights of the same vehicle.
    """
    known = [one for one in before if one.of == now.of and len(one.size) == len(now.size)]
    if not known:
        return []
    logs = np.log([one.size for one in known])
    count, mean = len(known), logs.mean(axis=0)
    variance = (WORTH * USUAL**2 + ((logs - mean) ** 2).sum(axis=0)) / (WORTH + count - 1.0)
    change = np.log(now.size) - mean
    off = change / np.sqrt(variance * (1.0 + 1.0 / count))
    least = float(t.ppf(1.0 - ALARM / len(now.size), WORTH + count - 1.0))
    return [(int(k), float(math.exp(change[k]))) for k in np.flatnonzero(off > least)]
