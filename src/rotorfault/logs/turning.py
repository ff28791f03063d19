"""Body rates of a log that has none: by how its attitude changes from record to record."""

from __future__ import annotations

import numpy as np

from rotorfault.logs.log import Log, Series

SLOWEST = 20.0  # Hz of an attitude whose changes are rates: half of what shows a rotor lost within 0.1 s
GAP = 0.2  # s between records, beyond which nobody knows how the body turned


def with_rates(log: Log) -> Log:
    """The log, with body rates by its attitude where it has that often enough, and no others.

    Parameters
    ----------
    log : Log
        Gets them in place, and a remark that says so.
    """
    attitude = log.series.get("attitude")
    if "rates" in log.series or attitude is None or attitude.rate < SLOWEST:
        return log
    q = attitude.values / np.maximum(np.linalg.norm(attitude.values, axis=1, keepdims=True), 1e-9)
    w, v = q[:, :1], q[:, 1:]
    # Of the quaternion from one record to the next, seen in the body: its vector is half the angle turned.
    scalar = w[:-1] * w[1:] + (v[:-1] * v[1:]).sum(axis=1, keepdims=True)
    vector = w[:-1] * v[1:] - w[1:] * v[:-1] - np.cross(v[:-1], v[1:])
    vector = np.where(scalar < 0.0, -vector, vector)
    size = np.linalg.norm(vector, axis=1, keepdims=True)
    angle = 2.0 * np.arctan2(size, np.abs(scalar))
    step = np.diff(attitude.time)
    kept = (step > 0.0) & (step < GAP)
    if kept.sum() < 2:
        return log
    rates = (vector * angle / np.maximum(size, 1e-12))[kept] / step[kept, None]
    log.series["rates"] = Series((0.5 * (attitude.time[:-1] + attitude.time[1:]))[kept], rates)
    log.remarks = (*log.remarks, "no gyro is logged: body rates are those by which the attitude changes")
    return log
