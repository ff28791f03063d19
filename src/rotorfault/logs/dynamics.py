r"""How the body answers to its commands: gains, lag, and what is left of the motion that commands do not explain.

With :math:`\tau_a = \sum_i D_{ai} u_i` the commanded turn about an axis, each u_i lagged by the rotors' lag, a sound
vehicle has :math:`\dot\omega_a = K_a (\tau_a - \bar\tau_a)`. What is left, in units of command,

.. math:: \rho_a = \dot\omega_a / K_a - \tau_a, \qquad \rho_z = \bar u_h f_z / g - \bar u

is constant while nothing changes, and moves by :math:`-\lambda u_i D_{ai}` where rotor i loses a share
:math:`\lambda`: at once in the turn of the body, then, as control makes up for it, in the commands. So it takes
neither mass nor inertia. A gain K is estimated from the log where its commands move enough, from what vehicles have
where not, and its uncertainty is carried along.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, filtfilt, lfilter

from rotorfault.logs.commands import directions
from rotorfault.logs.log import Log
from rotorfault.logs.segments import block_means
from rotorfault.maths.arrays import Array

G = 9.80665  # m/s^2
FINEST = 0.05  # s: shortest block; gyro noise is averaged, and rotors have hardly moved within less
COARSEST = 0.5  # s: beyond it a lost rotor has turned the vehicle over before it is seen
LAGS = (0.01, 0.02, 0.03, 0.045, 0.06, 0.08, 0.1, 0.13)  # s, of rotors: as published, 15 to 72 ms, and beyond
# What the loss of one rotor in hover turns a vehicle by, rad/s^2, about roll and pitch, and yaw: mean and standard
# deviation of its logarithm. The built-in vehicles but the paper's have 37 to 130 and 1.8 to 14 with four rotors,
# 10 to 26 and 0.3 to 7 with more.
TURNS = {4: ((math.log(60.0), 0.6), (math.log(4.5), 0.8)), 6: ((math.log(18.0), 0.6), (math.log(1.5), 1.0))}
UNEVEN = (
    0.04  # of the command in hover: what the thrust of four motors together is not known by, with battery and air
)
# s by which yaw leads its command: a rotor that spins up turns the body the other way, by J_r dOmega/dt beside
# its drag Q; with thrust as Omega^2 that is J_r Omega / (2 Q) times the rate of the command. Built-in vehicles have
# 0.06 to 0.28 s, 0.2 s in the middle.
LEAD = 0.2
DEFAULT_LAG = 0.03  # s, where the log does not show it
BAND = (1.0, 8.0)  # Hz, in which control moves the body more than wind does and noise is not yet the most
CORRELATED = 0.5  # least correlation of demand and turn with which a gain is believed
LONGEST = 20_000  # blocks that are looked at for gains
STALE = 3.0  # periods of commands, beyond which the last one is not known to hold
UPSET = 1.2  # rad of tilt, beyond which the model of hover ends
HIT = 2.0  # times what all rotors give at their greatest command: no manoeuvre feels like that
LEAST_GAIN_ERROR = 0.1  # of a gain, however well it is known: thrust changes with airspeed and battery


class Response(NamedTuple):
    """Gains of the body's answer, per axis: roll, pitch, yaw."""

    gain: Array  # (3,) rad/s^2 per command
    error: Array  # (3,) standard deviation of its logarithm
    lag: float  # s
    lag_known: bool  # whether the log shows it
    hover: float  # mean command in hover


class Residual(NamedTuple):
    """What commands do not explain, block by block."""

    time: Array  # (n,) s, begin of each block
    block: float  # s
    values: Array  # (n, 4) roll, pitch, yaw, thrust, in units of command; NaN where something is not logged
    turn: Array  # (n, 3) the part of them that is turn over gain
    doubt: Array  # (n, 4) standard deviation of them by the errors of the model
    command: Array  # (n, N) lagged
    patterns: Array  # (4, N) how a lost share of each rotor's command shows
    response: Response


class _Blocks(NamedTuple):
    edges: Array
    turn: Array  # (n, 3) rad/s^2
    force: Array  # (n,) m/s^2 along the body's z
    speed: Array  # (n,) rad/s, of turning


def block_length(log: Log) -> float | None:
    """Length of a block in s that the log's rates allow; None where they allow none.

    Parameters
    ----------
    log : Log
    """
    command, rates = log.series.get("command"), log.series.get("rates")
    if command is None or rates is None:
        return None
    length = max(FINEST, 1.0 / max(command.rate, 1e-3), 2.0 / max(rates.rate, 1e-3))
    return length * 1.001 if length <= COARSEST else None


def residual_of(log: Log, begin: float, end: float, hover: float, known: Response | None = None) -> Residual | None:
    """The residual over a flight.

    Parameters
    ----------
    log : Log
    begin, end : float, s
    hover : float
        Mean command in hover.
    known : Response, optional
        Of this vehicle, where a baseline has it; else it is estimated from the flight.

    Returns
    -------
    Residual or None
        None where rates or commands are missing or too slow.
    """
    length = block_length(log)
    if length is None or log.layout is None or end - begin < 20.0 * length:
        return None
    blocks = _blocks(log, np.arange(begin, end, length))
    rows = directions(log.layout)
    response = known or _response(log, begin, end, rows, hover)
    command = lagged(log, blocks.edges, response.lag)
    demand = command @ rows.T
    rate = np.abs(np.gradient(demand, axis=0)) / length
    turn = blocks.turn / response.gain
    thrust = hover * blocks.force / G - command.mean(axis=1)
    values = np.column_stack([turn - demand, thrust])
    values[_upset(log, blocks.edges) | _stale(log, blocks.edges)] = np.nan
    centred = demand - np.nanmedian(demand, axis=0)
    unsure = np.array([0.0, 0.0, LEAD]) + 0.3 * response.lag
    doubt = np.sqrt(
        (response.error * turn) ** 2
        + (LEAST_GAIN_ERROR * centred) ** 2
        + (UNEVEN * hover) ** 2
        + (unsure * rate) ** 2
    )
    up = LEAST_GAIN_ERROR * np.abs(command.mean(axis=1) - hover) + 0.02 * hover
    motors = rows.shape[1]
    patterns = np.vstack([rows, np.full((1, motors), 1.0 / motors)])
    return Residual(
        blocks.edges[:-1], length, values, turn, np.column_stack([doubt, up]), command, patterns, response
    )


def _stale(log: Log, edges: Array) -> NDArray[np.bool_]:
    """Blocks before whose end no command was logged for long: what was asked for meanwhile is not known."""
    command = log.series["command"]
    last = command.time[np.clip(np.searchsorted(command.time, edges, side="right") - 1, 0, None)]
    age = np.maximum(np.abs(edges - last)[1:], np.abs(edges - last)[:-1])
    return np.asarray(age > max(STALE / max(command.rate, 1e-3), 2.0 * (edges[1] - edges[0])))


def _upset(log: Log, edges: Array) -> NDArray[np.bool_]:
    """Blocks in which the vehicle is tilted so far that it no longer hovers, or has been in the last second."""
    attitude = log.series.get("attitude")
    if attitude is None:
        return np.zeros(len(edges) - 1, dtype=bool)
    w, x, y, z = attitude.at(edges[:-1]).T
    upright = (w * w - x * x - y * y + z * z) / np.maximum(w * w + x * x + y * y + z * z, 1e-12)
    over = upright < math.cos(UPSET)
    width = int(1.0 / (edges[1] - edges[0])) + 1
    return np.asarray(np.convolve(over, np.ones(width))[: len(over)] > 0.0)


def fallen(log: Log, onset: float, end: float, hover: float) -> tuple[float, str] | None:
    """When a vehicle flies no more after an onset, in s, and why; None where it goes on.

    It is tilted too far (where no attitude is logged: it has turned so far about roll and pitch since the onset), or
    hits something: it feels more than rotors can give.

    Parameters
    ----------
    log : Log
    onset, end : float, s
        Between which it is looked for.
    hover : float
        Mean command in hover.
    """
    attitude, rates, force = (log.series.get(name) for name in ("attitude", "rates", "specific_force"))
    found: list[tuple[float, str]] = []
    tilt: Array | None = None
    if attitude is not None:
        w, x, y, z = attitude.values.T
        level = (w * w - x * x - y * y + z * z) / np.maximum((attitude.values**2).sum(axis=1), 1e-12)
        time, tilt = attitude.time, np.arccos(np.clip(level, -1.0, 1.0))
    elif rates is not None:
        time = rates.time
        inside = (time >= onset) & (time <= end)
        steps = np.diff(time, prepend=time[0])[:, None] * rates.values[:, :2] * inside[:, None]
        tilt = np.linalg.norm(np.cumsum(steps, axis=0), axis=1)
    if tilt is not None and (over := (time >= onset) & (time <= end) & (tilt > UPSET)).any():
        found.append((float(time[int(np.argmax(over))]), f"it is tilted by more than {math.degrees(UPSET):.0f} deg"))
    if force is not None:
        size, most = np.linalg.norm(force.values, axis=1), HIT * G / max(hover, 0.02)
        hit = (force.time >= onset) & (force.time <= end) & (size > most)
        if hit.any():
            k = int(np.argmax(hit))
            found.append((float(force.time[k]), f"it hits something, with {size[k] / G:.0f} g"))
    return min(found, default=None)


def _blocks(log: Log, edges: Array) -> _Blocks:
    rates = log.series["rates"]
    length = edges[1] - edges[0]
    # Rates at an edge: the mean about it, so that noise is averaged.
    half = 0.25 * length
    around = np.column_stack([edges - half, edges + half]).ravel()
    at_edges = block_means(rates, around)[::2]
    missing = ~np.isfinite(at_edges).all(axis=1)
    at_edges[missing] = rates.at(edges[missing])
    turn = np.diff(at_edges, axis=0) / length
    gaps = ~np.isfinite(block_means(rates, edges)).all(axis=1)
    turn[gaps] = np.nan
    force = log.series.get("specific_force")
    f_z = np.full(len(turn), np.nan) if force is None else block_means(force, edges)[:, 2]
    speed = np.sqrt((at_edges[:-1] ** 2).sum(axis=1))
    return _Blocks(edges, turn, f_z, speed)


def lagged(log: Log, edges: Array, lag: float) -> Array:
    """Mean command of each block behind a first-order lag."""
    command = log.series["command"]
    step = min((edges[1] - edges[0]) / 2.0, 0.01)
    fine = np.arange(edges[0] - 10.0 * lag, edges[-1] + step, step)
    # A command holds until the next one.
    held = command.values[np.clip(np.searchsorted(command.time, fine, side="right") - 1, 0, None)]
    keep = math.exp(-step / lag)
    out = lfilter([1.0 - keep], [1.0, -keep], held, axis=0, zi=keep * held[:1])[0]
    at = np.searchsorted(fine, edges)
    sums = np.vstack([np.zeros(out.shape[1]), np.cumsum(out, axis=0)])
    means: Array = (sums[at[1:]] - sums[at[:-1]]) / np.maximum(np.diff(at), 1)[:, None]
    return means


def _response(log: Log, begin: float, end: float, rows: Array, hover: float) -> Response:
    """Gains and lag from the band in which control moves the body, joined with what vehicles have.

    Noise of the gyro enters turn and, by control, demand; so the gain lies between that of regression, g, and
    g / r^2 with the correlation r. Its logarithm is taken as the middle of both, give or take half their distance.
    """
    level, yaw = TURNS[4 if rows.shape[1] <= 4 else 6]
    prior = np.array([level, level, yaw])
    mean, sd = prior[:, 0] - math.log(hover), prior[:, 1]
    best, lag, known = np.zeros((2, 3)), DEFAULT_LAG, False
    fits = answers(log, begin, end, rows)
    if fits is not None:
        scores = fits[:, 1, :2].sum(axis=1)
        k = int(np.argmax(scores))
        known = bool(scores[k] > 2.0 * CORRELATED)
        k = k if known else LAGS.index(DEFAULT_LAG)
        best, lag = fits[k], LAGS[k]
    gain, error = np.exp(mean), sd.copy()
    for axis in range(3):
        slope, r = best[:, axis]
        if r > CORRELATED and slope > 0.0:
            spread = max(-math.log(r), LEAST_GAIN_ERROR)
            middle, weight = math.log(slope) - math.log(r), spread**-2
            total = weight + sd[axis] ** -2
            gain[axis] = math.exp((weight * middle + mean[axis] * sd[axis] ** -2) / total)
            error[axis] = math.sqrt(1.0 / total)
    return Response(gain, np.maximum(error, LEAST_GAIN_ERROR), lag, known, hover)


def chance(log: Log, begin: float, end: float) -> float:
    """Standard deviation of a correlation of `answers` by chance: of 2 B T independent values in a band of width B.

    Parameters
    ----------
    log : Log
    begin, end : float, s
    """
    values = 2.0 * max(_band(log)[1] - BAND[0], 0.1) * min(end - begin, LONGEST * _band(log)[0])
    return float(1.0 / math.sqrt(max(values, 1.0)))


def _band(log: Log) -> tuple[float, float]:
    """Length of a step in s, and the fastest frequency in Hz that it shows."""
    command, rates = log.series["command"], log.series["rates"]
    length = max(0.02, 1.0 / max(command.rate, 1e-3), 1.0 / max(rates.rate, 1e-3)) * 1.001
    return length, min(BAND[1], 0.35 / length)


def answers(log: Log, begin: float, end: float, rows: Array, most: float = math.inf) -> Array | None:
    """How the body turns by what is asked for, in the band in which control moves it.

    Parameters
    ----------
    log : Log
    begin, end : float, s
    rows : (3, N) ndarray
        How each motor turns the body about roll, pitch and yaw.
    most : float
        Standard deviations to which both are cut before they are compared, so that a moment does not decide.

    Returns
    -------
    (lags, 2, 3) ndarray or None
        Slope and correlation about each axis with each of `LAGS`; None where the log is too slow or too short.
    """
    length, fastest = _band(log)
    count = int(min((end - begin) / length, LONGEST))
    if fastest <= 2.0 * BAND[0] or count <= 200:
        return None
    blocks = _blocks(log, np.asarray(begin + length * np.arange(count + 1), dtype=float))
    band = butter(2, [2.0 * length * BAND[0], 2.0 * length * fastest], "band")
    turn = _cut(_filtered(band, blocks.turn), most)
    asked = (_cut(_filtered(band, lagged(log, blocks.edges, one) @ rows.T), most) for one in LAGS)
    return np.array([_fits(turn, one) for one in asked])


def _cut(values: Array, most: float) -> Array:
    """Values within so many standard deviations of 0, by their median size."""
    size = most * 1.4826 * np.maximum(np.median(np.abs(values), axis=0), 1e-12)
    out: Array = np.clip(values, -size, size)
    return out


def _filtered(band: tuple[Array, Array], values: Array) -> Array:
    """The part in a band of frequencies, without delay; what is far off is cut first."""
    values = np.nan_to_num(values)
    middle = np.median(values, axis=0)
    spread = 1.4826 * np.median(np.abs(values - middle), axis=0) + 1e-9
    out: Array = filtfilt(*band, np.clip(values, middle - 6.0 * spread, middle + 6.0 * spread), axis=0)
    return out


def _fits(turn: Array, demand: Array) -> Array:
    """Slope and correlation per axis, (2, 3)."""
    xx, yy, xy = (demand**2).sum(axis=0), (turn**2).sum(axis=0), (demand * turn).sum(axis=0)
    slope = xy / np.maximum(xx, 1e-12)
    return np.array([slope, xy / np.sqrt(np.maximum(xx * yy, 1e-18))])
