r"""When a rotor lost its thrust: a test of the residual, block by block, against each rotor and each loss.

The residual less its mean over the last 20 s is taken as noise that follows itself, :math:`e_k = \rho_k - \varphi
\rho_{k-1}`, with tails of Student's t. For each rotor and loss the logarithm of the ratio of likelihoods adds up from
the onset that makes it greatest:

.. math:: S_k = \max(S_{k-1} + \ell_k,\ \ell^{onset}_k)

An alarm is a sum above :math:`h = \ln(10\,h / block)`: without a fault a sum of such ratios, restarted at each block,
passes h once in :math:`e^h` blocks at most, so once in ten hours of independent blocks. The noise, its tails and its
memory are measured in the log itself.

Source: M. Basseville, I. V. Nikiforov, *Detection of Abrupt Changes*, 1993, sections 2.2 and 2.4.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from rotorfault.base.progress import Bar
from rotorfault.logs.dynamics import UNEVEN, Residual
from rotorfault.logs.weighing import ratio, weighed
from rotorfault.maths.arrays import Array

HOURS = 10.0  # between false alarms that are accepted
LOSSES = np.array([0.1, 0.15, 0.2, 0.3, 0.4, 0.55, 0.75, 1.0])
REFERENCE, GUARD = 20.0, 1.0  # s whose mean a residual is weighed against, and s between them
FIRST = 3.0  # s at least before anything is said
SETTLED, CALM = 1.0, 0.1  # s after an onset until commands have settled, and turn in units of command that is calm
SIDE, LIKE = FIRST, 4.0  # s on each side of an onset that tell its noise; by how much more it may be behind it
LASTING, PASSING = 0.05, 8  # loss below which what was found has passed, and how often that is looked for
EXPLAINED = 1.0  # s after an alarm, in which its cause is looked for
SCALES = (0.25, 0.5, 1.0, 2.0, 4.0)  # s of sums by which the noise is measured
HOLD = 5.0  # s over which evidence is gathered
SEEN = 500  # blocks between two looks at progress
SURE = 1.645  # standard deviations: an interval holds a loss 9 times of 10


class Scan(NamedTuple):
    """What the test found in one flight."""

    time: Array  # (n,) s, end of each block
    evidence: Array  # (n, N) greatest sum of each rotor over its losses
    residual: Array  # (n, 4) less its reference, NaN where there is none
    spread: Array  # (4,) of the innovations
    memory: Array  # (4,) share of a residual that remains a block later
    threshold: float
    onset: float | None  # s, of what raised the alarm
    rotor: int | None  # index
    loss: float
    alarm: float | None  # s, when the sum passed the threshold
    scores: Array  # (N,) of each rotor where the evidence is strongest, averaged over losses and gains
    free: float  # the same of a push in any direction
    settled: float | None  # loss by what commands settle at, where the flight goes on calmly
    interval: tuple[float, float] = (0.0, 1.0)  # that holds the loss 9 times of 10
    over: tuple[float, str] | None = None  # s, when the vehicle flies no more behind the onset, and why


def threshold_of(block: float) -> float:
    """The sum that is an alarm.

    Parameters
    ----------
    block : float, s
    """
    return math.log(HOURS * 3600.0 / block)


def referenced(values: Array, block: float) -> Array:
    """Residuals less the median of those before; NaN where there are too few.

    Parameters
    ----------
    values : (n, 4) ndarray
    block : float, s
    """
    guard, first, width = int(GUARD / block) + 1, int(FIRST / block), int(REFERENCE / block)
    out = np.full_like(values, np.nan)
    every = max(1, int(0.5 / block))
    for begin in range(first, len(values), every):
        before = values[max(0, begin - guard - width) : max(begin - guard, 2)]
        with np.errstate(all="ignore"):
            good = np.isfinite(before).any(axis=0)
            level = np.full(values.shape[1], np.nan)
            if good.any():
                level[good] = np.nanmedian(before[:, good], axis=0)
        out[begin : begin + every] = values[begin : begin + every] - level
    return out


def scan(residual: Residual) -> Scan:
    """Test a flight; what does not last is no loss, and is left out.

    Parameters
    ----------
    residual : Residual
    """
    rho = referenced(residual.values, residual.block)
    for _ in range(PASSING):
        _, begin = _scanned(residual, rho, _noise(rho, residual.block))
        found, begin = _scanned(residual, rho, _noise(_levelled(rho, begin, residual.block), residual.block))
        if found.alarm is None or found.settled is None or found.settled > LASTING:
            break
        rho[begin : begin + int(HOLD / residual.block)] = np.nan
    if found.alarm is None:  # below the threshold nothing began: what is told has the stated rate of false alarms
        return found._replace(onset=None, rotor=None, loss=0.0)
    return found


def _levelled(rho: Array, begin: int, block: float) -> Array:
    """Residuals on both sides of what may be an onset, each less its own level: a loss is not to pass for noise.

    What follows counts where it lasts and is about as calm as what was before: after a crash it says nothing.
    """
    least = int(SIDE / block)
    before, after = rho[:begin], rho[begin + int(SETTLED / block) :]
    short = np.isfinite(before[:, :3]).all(axis=1).sum() < least
    if np.isfinite(after[:, :3]).all(axis=1).sum() < least:
        return rho if short else before
    with np.errstate(all="ignore"):
        used = np.isfinite(after).any(axis=0)
        level = np.zeros(rho.shape[1])
        level[used] = np.nanmedian(after[:, used], axis=0)
        after = after - level
        if short:  # little was logged before: what follows tells the noise, and tells too much where it is a crash
            return np.vstack([before, after])
        calm = np.nanmedian(np.abs(after[:, :3]), axis=0) < LIKE * np.nanmedian(np.abs(before[:, :3]), axis=0)
    return np.vstack([before, after]) if calm.all() else before


def _scanned(residual: Residual, rho: Array, noise: tuple[Array, Array]) -> tuple[Scan, int]:
    """One run of the test, and the block at which what it found begins."""
    count, motors = len(rho), residual.command.shape[1]
    memory, spread = noise
    threshold = threshold_of(residual.block)
    shapes = -LOSSES[:, None, None] * residual.patterns.T[None]  # losses, rotors, axes
    sums = np.full((len(LOSSES), motors), -np.inf)
    onsets = np.zeros((len(LOSSES), motors), dtype=int)
    evidence = np.zeros((count, motors))
    hold = int(HOLD / residual.block)
    alarm: int | None = None
    best: tuple[int, Array, Array] | None = None
    strongest = 0.0
    previous, signal_before = np.full(4, np.nan), np.zeros((len(LOSSES), motors, 4))
    with Bar("looking for what begins in flight", count, "blocks") as bar:
        for k in range(count):
            if k % SEEN == 0:
                bar.update(k)
            now, doubt = rho[k], residual.doubt[k]
            usable = np.isfinite(now) & np.isfinite(previous) & np.isfinite(doubt)
            signal = shapes * residual.command[k][None, :, None]
            if usable.any():
                scale = np.sqrt(spread**2 + doubt**2)[usable]
                plain = ((now - memory * previous)[usable]) / scale
                onset_ratio = ratio(plain, signal[:, :, usable] / scale).sum(axis=-1)
                kept = (signal - memory * signal_before)[:, :, usable] / scale
                carried = sums + ratio(plain, kept).sum(axis=-1)
                fresh = (onset_ratio > carried) | (k - onsets > hold)
                sums = np.where(fresh, onset_ratio, carried)
                onsets = np.where(fresh, k, onsets)
            evidence[k] = np.maximum(sums.max(axis=0), 0.0)
            previous, signal_before = now, signal
            if alarm is None and evidence[k].max() > threshold:
                alarm = k
            # An alarm is explained by the most that is known of it within a second.
            near = alarm is not None and k - alarm <= int(EXPLAINED / residual.block)
            if (alarm is None or near) and evidence[k].max() > strongest:
                strongest, best = float(evidence[k].max()), (k, sums.copy(), onsets.copy())
    time = residual.time + residual.block
    said = Scan(time, evidence, rho, spread, memory, threshold, None, None, 0.0, None, np.zeros(motors), 0.0, None)
    if best is None:
        return said, 0
    k, sums, onsets = best
    loss, rotor = np.unravel_index(int(np.argmax(sums)), sums.shape)
    begin = int(onsets[loss, rotor])
    causes = weighed(residual, rho, (begin, k + 1), memory, spread)
    rotor = np.argmax(causes.rotors)
    known = _settled_loss(residual, rho, begin, int(rotor), noise)
    settled = None if known is None else known[0]
    low, high = causes.intervals[rotor] if known is None else known[1]
    found = said._replace(
        onset=float(residual.time[begin]),
        rotor=int(rotor),
        loss=float(causes.losses[rotor]) if settled is None else settled,
        alarm=None if alarm is None else float(time[alarm]),
        scores=causes.rotors,
        free=causes.free,
        settled=settled,
        interval=(float(low), float(high)),
    )
    return found, begin


def _settled_loss(
    residual: Residual, rho: Array, begin: int, rotor: int, noise: tuple[Array, Array]
) -> tuple[float, tuple[float, float]] | None:
    """The loss by what the commands settle at, with its interval, where the flight goes on calmly.

    There no gain matters, but how well demand is known before and behind: by the noise of either, and `UNEVEN`.
    """
    first, last = begin + int(SETTLED / residual.block), begin + int(HOLD / residual.block)
    after = slice(first, min(last, len(rho)))
    command, axes = residual.command[after], residual.patterns[:3]
    turn = residual.values[after, :3] + command @ axes.T
    calm = (command.max(axis=1, initial=0.0) < 0.97) & (np.abs(turn).max(axis=1, initial=0.0) < CALM)
    if calm.sum() < SETTLED / residual.block or calm.mean() < 0.8:
        return None
    shape, square = axes[:, rotor], float(axes[:, rotor] @ axes[:, rotor])
    known = rho[after][calm][:, :3]
    if not np.isfinite(known).any(axis=0).all():
        return None
    asked = float(np.median(command[calm, rotor]))
    loss = -float(np.nanmean(known, axis=0) @ shape) / square / asked
    memory, spread = noise[0][:3], noise[1][:3]
    mean = spread / (1.0 - memory) / math.sqrt(float(calm.sum()))
    doubt = np.hypot(mean, UNEVEN * residual.response.hover / math.sqrt(len(command.T)))
    half = SURE * math.sqrt(float((doubt * shape) @ (doubt * shape))) / square / asked
    ends = min(max(loss - half, 0.01), 1.0), min(max(loss + half, 0.01), 1.0)
    return min(max(loss, 0.01), 1.0), ends


def _longer(new: Array, block: float) -> float:
    """By how much sums of what is new spread more than those of independent numbers: gusts and turns last."""
    one = float(np.median(np.abs(new)))
    worst = 1.0
    for seconds in SCALES:
        width = max(int(seconds / block), 2)
        count = len(new) // width
        if count >= 10 and one > 0.0:
            sums = new[: count * width].reshape(count, width).sum(axis=1)
            worst = max(worst, float(np.median(np.abs(sums))) / (one * math.sqrt(width)))
    return worst


def _noise(rho: Array, block: float) -> tuple[Array, Array]:
    """How much of each residual remains a block later, and the spread of what is new."""
    memory, spread = np.zeros(4), np.full(4, 1.0)
    for axis in range(4):
        x = rho[:, axis]
        x = x[np.isfinite(x)]
        if len(x) < 20:
            continue
        limit = 4.0 * 1.4826 * np.median(np.abs(x)) + 1e-9
        x = np.clip(x, -limit, limit)
        memory[axis] = min(max(float((x[1:] * x[:-1]).sum() / max((x**2).sum(), 1e-18)), 0.0), 0.95)
        new = x[1:] - memory[axis] * x[:-1]
        spread[axis] = max(1.4826 * float(np.median(np.abs(new))) * _longer(new, block), 2e-3)
    return memory, spread
