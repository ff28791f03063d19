"""Which part of a log is flight, and where in it the vehicle hovers.

Flight is what lies between the first and the last time that motors pull like in flight. Hover is looked for in blocks
of a second: slow, level and unaccelerated, so that commands are those of trim.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rotorfault.logs.log import Log, Series
from rotorfault.maths.arrays import Array

PULLING = 0.5  # of the median command in flight, below which motors do not carry the vehicle
IDLE = 0.05  # command below which a motor idles
BLOCK = 1.0  # s of a block of hover
SETTLING, LANDING = 2.0, 1.0  # s after take-off and before landing, in which the ground is near
BRIDGED, SHORTEST, LIFTED = 1.0, 3.0, 0.15  # s of a gap in a flight, s of a flight, m that it leaves the ground
UNSEEN = 5.0  # s without records, in which nobody lands and takes off again: the flight goes on
MOST_FLIGHTS = 200  # of a log
SLOW, CLIMB, TURN = 0.7, 0.25, 0.25  # m/s, m/s, rad/s: beyond them drag and gyroscopic torque enter the trim
CHANGE = 0.4  # m/s: change of speed over a block


class Hover(NamedTuple):
    """Blocks of hover."""

    time: Array  # (n,) s, middle of each block
    command: Array  # (n, N) mean of commands
    voltage: Array  # (n,) V, NaN where it is not logged
    tilt: Array  # (n, 2) mean of the thrust axis' x and y in world axes turned by yaw, NaN where attitude is missing


def flight_spans(log: Log) -> list[tuple[float, float]]:
    """Begin and end of each flight in s; none where motors never carry the vehicle.

    Parameters
    ----------
    log : Log
    """
    command = log.series.get("command")
    if command is None:
        return []
    mean = command.values.mean(axis=1)
    running = mean > IDLE
    if running.sum() < 5:
        return []
    up = mean > PULLING * float(np.median(mean[running]))
    if (landed := log.series.get("landed")) is not None:
        up &= landed.at(command.time)[:, 0] < 0.5
    if (position := log.series.get("position")) is not None:
        height = position.values[:, 2]
        known = np.ptp(height) > 0.0  # what never changes is not estimated
        if known and np.ptp(height) < LIFTED and abs(float(np.median(height))) < 2.0 * LIFTED:
            return []  # it never leaves the ground
    at = command.time[up]
    if not len(at):
        return []
    seen = np.diff(np.flatnonzero(up)) > 1  # records between, that are no flight
    gaps = np.diff(at)
    breaks = np.flatnonzero((seen & (gaps > BRIDGED)) | (gaps > UNSEEN))
    starts, ends = at[np.concatenate([[0], breaks + 1])], at[np.concatenate([breaks, [len(at) - 1]])]
    return [(float(a), float(b)) for a, b in zip(starts, ends, strict=True) if b - a > SHORTEST][:MOST_FLIGHTS]


def hover_of(log: Log, spans: list[tuple[float, float]]) -> Hover:
    """All blocks of hover of some flights, without take-off and landing.

    Parameters
    ----------
    log : Log
    spans : list of (float, float), s
    """
    each = [hover_blocks(log, begin + SETTLING, end - LANDING) for begin, end in spans]
    if not each:
        none = np.empty((0, max(log.motors, 1)))
        return Hover(np.empty(0), none, np.empty(0), np.empty((0, 2)))
    return Hover(*(np.concatenate(parts) for parts in zip(*each, strict=True)))


def hover_blocks(log: Log, begin: float, end: float, length: float = BLOCK) -> Hover:
    """Blocks of hover between two times.

    Parameters
    ----------
    log : Log
    begin, end : float, s
    length : float, s
        Of a block.
    """
    edges = np.arange(begin, end + 1e-9, length)
    count = max(len(edges) - 1, 0)
    good = np.ones(count, dtype=bool)
    command = block_means(log.series["command"], edges)
    good &= np.isfinite(command).all(axis=1) & (command.min(axis=1, initial=1.0) > IDLE)
    good &= command.max(axis=1, initial=0.0) < 0.98
    if (velocity := log.series.get("velocity")) is not None:
        v = block_means(velocity, edges)
        first, last = velocity.at(edges[:-1]), velocity.at(edges[1:])
        good &= (np.hypot(v[:, 0], v[:, 1]) < SLOW) & (np.abs(v[:, 2]) < CLIMB)
        good &= np.sqrt(((last - first) ** 2).sum(axis=1)) < CHANGE
    if (rates := log.series.get("rates")) is not None:
        good &= np.abs(block_means(rates, edges)).max(axis=1, initial=0.0) < TURN
    battery, attitude = log.series.get("battery"), log.series.get("attitude")
    voltage = np.full(count, np.nan) if battery is None else block_means(battery, edges)[:, 0]
    tilt = np.full((count, 2), np.nan) if attitude is None else block_means(_level(attitude), edges)
    middle = 0.5 * (edges[:-1] + edges[1:])
    return Hover(middle[good], command[good], voltage[good], tilt[good])


def _level(attitude: Series) -> Series:
    """x and y of the thrust axis in the world, turned back by yaw."""
    w, x, y, z = attitude.values.T
    ax, ay = 2.0 * (x * z + w * y), 2.0 * (y * z - w * x)
    yaw = np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    c, s = np.cos(yaw), np.sin(yaw)
    return Series(attitude.time, np.column_stack([c * ax + s * ay, -s * ax + c * ay]))


def block_means(series: Series, edges: Array) -> Array:
    """Mean of a series between neighbouring times; NaN where it has no record.

    Parameters
    ----------
    series : Series
    edges : (n + 1,) ndarray, s

    Returns
    -------
    (n, width) ndarray
    """
    at = np.searchsorted(series.time, edges)
    sums = np.vstack([np.zeros(series.values.shape[1]), np.cumsum(series.values, axis=0)])
    number = np.diff(at)
    with np.errstate(invalid="ignore", divide="ignore"):
        means: Array = (sums[at[1:]] - sums[at[:-1]]) / number[:, None]
    return means
