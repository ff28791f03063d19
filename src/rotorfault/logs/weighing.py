r"""Which cause explains what begins at an onset best: each rotor, or a push from outside.

The test of `scan` finds an onset from block to block, and takes errors of the model as noise of each block. To tell
causes apart that is too little: a gain of the body's answer that is wrong is wrong in every block alike, and a push
that is free about each axis would make up for it where a rotor cannot. So the gain about each axis is left open here,
for rotors as for pushes: a body that is asked for :math:`\tau` and pushed by s, in units of command, turns by

.. math:: \dot\omega/K = e^{\delta}\,(\tau - \bar\tau + s) + n, \qquad \delta \sim N(0, \sigma_K)

and likelihoods are averaged over :math:`\delta` of each axis and the sizes of each cause.

Source of averaging over what is not known: A. Gelman et al., *Bayesian Data Analysis*, 3rd ed., section 1.3 and 7.4.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rotorfault.logs.dynamics import LEAST_GAIN_ERROR, Residual
from rotorfault.logs.trim import SAG, SHIFT, WIND
from rotorfault.maths.arrays import Array

TAIL = 4.0  # degrees of freedom: residuals of healthy flights have a kurtosis beyond any normal one
POINTS = np.linspace(-3.0, 3.0, 61)  # of a normal distribution, in standard deviations
LOSSES = np.linspace(0.02, 1.0, 50)  # each as likely before as any other
ENDS = (0.05, 0.95)  # of an interval that holds a loss 9 times of 10
BEGUN = (1.0 / 6.0, 0.5, 5.0 / 6.0)  # share of the first block that lies behind the onset
PUSH = (SHIFT, SHIFT, 0.25 * WIND, SAG)  # what a push turns and lifts by, as in trim: shares of the command in hover


class Weighed(NamedTuple):
    """What speaks for each cause, against no change: logarithms of likelihoods."""

    rotors: Array  # (N,)
    free: float  # of a push
    losses: Array  # (N,) mean loss of each rotor, if it is that
    intervals: Array  # (N, 2) that hold it 9 times of 10


def ratio(noise: Array, signal: Array) -> Array:
    """Logarithm of the likelihood with a signal over that without, per value; both over the spread.

    Parameters
    ----------
    noise, signal : ndarray
    """
    half = 0.5 * (TAIL + 1.0)
    found: Array = half * (np.log1p(noise**2 / TAIL) - np.log1p((noise - signal) ** 2 / TAIL))
    return found


def weighed(residual: Residual, rho: Array, span: tuple[int, int], memory: Array, spread: Array) -> Weighed:
    """Weigh causes over some blocks.

    Parameters
    ----------
    residual : Residual
    rho : (n, 4) ndarray
        Its values less their reference.
    span : (int, int)
        First block with the cause, and one behind the last.
    memory, spread : (4,) ndarray
        Of the noise.
    """
    begin, end = span
    motors, hover = residual.command.shape[1], residual.response.hover
    command = residual.command[begin:end]
    sizes = np.linspace(-4.0, 4.0, 81)
    density = np.exp(-0.5 * sizes**2)
    density /= density.sum()
    rotors, free = np.zeros((len(BEGUN), len(LOSSES), motors)), np.zeros(len(BEGUN))
    for axis in range(4):
        known = _Axis.of(residual, rho[begin:end], span, axis, float(memory[axis]), float(spread[axis]))
        if known is None:
            continue
        size = PUSH[axis] * hover * float(np.abs(residual.patterns[axis]).sum())
        for n, share in enumerate(BEGUN):
            for k in range(motors):
                shape = -residual.patterns[axis, k] * known.gone(command[:, k], share)
                rotors[n, :, k] += known.averaged(LOSSES[:, None] * shape)
            pushes = known.averaged(size * sizes[:, None] * known.gone(np.ones(len(command)), share)[None])
            free[n] += _log_mean(pushes, density)
    each = rotors.reshape(-1, motors)
    even = np.full(len(each), 1.0 / len(each))
    weights = np.exp(each - each.max(axis=0))
    by_loss = weights.reshape(len(BEGUN), len(LOSSES), motors).sum(axis=0) / weights.sum(axis=0)
    losses, share = LOSSES @ by_loss, np.cumsum(by_loss, axis=0) - 0.5 * by_loss
    step = 0.5 * (LOSSES[1] - LOSSES[0]) * np.array([-1.0, 1.0])  # a loss lies between those that are tried
    intervals = np.array([np.clip(np.interp(ENDS, share[:, k], LOSSES) + step, 0.01, 1.0) for k in range(motors)])
    scores = np.array([_log_mean(each[:, k], even) for k in range(motors)])
    return Weighed(scores, _log_mean(free, np.full(len(BEGUN), 1.0 / len(BEGUN))), np.asarray(losses), intervals)


class _Axis(NamedTuple):
    """What is known of one axis."""

    usable: NDArray[np.bool_]  # (n,) blocks that have a value
    gains: Array  # (points,) over the gain that is taken
    weights: Array  # (points,) of them
    turned: Array  # (m,) innovation of the turn
    asked: Array  # (m,) of what commands ask for
    scale: Array  # (points, m) with each gain
    memory: float

    @classmethod
    def of(
        cls, residual: Residual, rho: Array, span: tuple[int, int], axis: int, memory: float, spread: float
    ) -> _Axis | None:
        """The blocks of an axis; None where none has a value."""
        begin, end = span
        doubt = residual.doubt[begin:end, axis]
        turn, error = np.zeros(len(rho)), LEAST_GAIN_ERROR
        if axis < 3:
            turn, error = residual.turn[begin:end, axis], float(residual.response.error[axis])
        asked = turn - rho[:, axis]
        before, turn_before = _before(asked), _before(turn)
        usable = np.isfinite(asked) & np.isfinite(before) & np.isfinite(doubt)
        if not usable.any():
            return None
        # Errors of a gain that are the same in every block are those of the gains below; the rest changes.
        changing = (LEAST_GAIN_ERROR * turn) ** 2
        of_command = np.maximum(doubt**2 - (error * turn) ** 2, 0.0)
        gains = np.exp(math.sqrt(max(error**2 - LEAST_GAIN_ERROR**2, 0.0)) * POINTS)
        scale = np.sqrt(spread**2 + changing[usable] + gains[:, None] ** 2 * of_command[usable])
        weights = np.exp(-0.5 * POINTS**2)
        return cls(
            usable, gains, weights / weights.sum(), (turn - memory * turn_before)[usable],
            (asked - memory * before)[usable], scale, memory,
        )  # fmt: skip

    def gone(self, shape: Array, share: float) -> Array:
        """What a lasting shape adds to each innovation: a share of it in the first block, then what memory leaves."""
        shape = np.concatenate([share * shape[:1], shape[1:]])
        return np.asarray((shape - self.memory * _before(shape))[self.usable])

    def averaged(self, signals: Array) -> Array:
        """Logarithm of the likelihood of each signal (s, m) against none, averaged over gains."""
        middle = self.scale[len(self.gains) // 2]
        still = np.log1p(((self.turned - self.asked) / middle) ** 2 / TAIL).sum()
        pushed = (self.asked + signals)[:, None, :] * self.gains[:, None]
        off = np.log1p(((self.turned - pushed) / self.scale) ** 2 / TAIL).sum(axis=2)
        logs = 0.5 * (TAIL + 1.0) * (still - off) - np.log(self.scale / middle).sum(axis=1)
        most = logs.max(axis=1)
        found: Array = most + np.log(np.exp(logs - most[:, None]) @ self.weights)
        return found


def _before(values: Array) -> Array:
    """Values a block earlier; nothing before the first."""
    return np.concatenate([[0.0], values[:-1]])


def _log_mean(logs: Array, weights: Array) -> float:
    most = float(logs.max())
    return most + math.log(float(weights @ np.exp(logs - most)))
