r"""Which cause explains what begins at an onset best: each rotor, or a push from outside.

The test of `scan` finds an onset from block to block, and takes errors of the model as noise of each block. To tell
causes apart that is too little: a gain of the body's answer that is wrong is wrong in every block alike, and a push
that is free about each axis would make up for it where a rotor cannot. So the gain about each axis is left open here,
for rotors as for pushes: with :math:`K e^{\delta}` in place of K the residual is

.. math:: \rho(\delta) = e^{-\delta}\,\dot\omega/K - \tau, \qquad \delta \sim N(0, \sigma_K)

and likelihoods are averaged over :math:`\delta` of each axis and the sizes of each cause.

Source of averaging over what is not known: A. Gelman et al., *Bayesian Data Analysis*, 3rd ed., section 1.3 and 7.4.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rotorfault.logs.dynamics import LEAST_GAIN_ERROR, Residual
from rotorfault.maths.arrays import Array

TAIL = 4.0  # degrees of freedom: residuals of healthy flights have a kurtosis beyond any normal one
POINTS = np.linspace(-3.0, 3.0, 121)  # of a normal distribution, in standard deviations
LOSSES = np.linspace(0.02, 1.0, 50)  # each as likely before as any other
# What wind and a shifted load turn a vehicle by, as a share of the command in hover of each motor: a centre of mass
# off by a tenth of the arm; in yaw, which only drag turns, half of that. In thrust, a tenth of the weight.
PUSH = (0.1, 0.1, 0.05, 0.1)


class Weighed(NamedTuple):
    """What speaks for each cause, against no change: logarithms of likelihoods."""

    rotors: Array  # (N,)
    free: float  # of a push
    losses: Array  # (N,) mean loss of each rotor, if it is that


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
    rotors = np.zeros((len(LOSSES), motors))
    free = 0.0
    for axis in range(4):
        known = _Axis.of(residual, rho[begin:end], span, axis, float(memory[axis]), float(spread[axis]))
        if known is None:
            continue
        for k in range(motors):
            shape = -residual.patterns[axis, k] * known.gone(command[:, k])
            rotors[:, k] += known.averaged(LOSSES[:, None] * shape)
        size = PUSH[axis] * hover * float(np.abs(residual.patterns[axis]).sum())
        sizes = np.linspace(-4.0, 4.0, 81)
        density = np.exp(-0.5 * sizes**2)
        pushes = known.averaged(size * sizes[:, None] * known.gone(np.ones(len(command)))[None])
        free += _log_mean(pushes, density / density.sum())
    even = np.full(len(LOSSES), 1.0 / len(LOSSES))
    each = np.exp(rotors - rotors.max(axis=0))
    return Weighed(
        np.array([_log_mean(rotors[:, k], even) for k in range(motors)]),
        free,
        np.asarray(LOSSES @ each / each.sum(axis=0)),
    )


class _Axis(NamedTuple):
    """What is known of one axis."""

    usable: NDArray[np.bool_]  # (n,) blocks that have a value
    innovation: Array  # (points, m) with each gain
    scale: Array  # (m,)
    weights: Array  # (points,) of the gains
    memory: float
    still: Array  # (m,) innovation with the gain as it is taken to be

    @classmethod
    def of(
        cls, residual: Residual, rho: Array, span: tuple[int, int], axis: int, memory: float, spread: float
    ) -> _Axis | None:
        """The blocks of an axis; None where none has a value."""
        begin, end = span
        doubt = residual.doubt[begin:end, axis]
        turned, error = np.zeros(len(rho)), LEAST_GAIN_ERROR
        if axis < 3:
            turned, error = residual.turn[begin:end, axis], float(residual.response.error[axis])
        left = error**2 - LEAST_GAIN_ERROR**2  # what is the same in every block; the rest changes
        doubt = np.sqrt(np.maximum(doubt**2 - left * turned**2, 0.0))
        value = rho[:, axis]
        before, turned_before = _before(value), _before(turned)
        usable = np.isfinite(value) & np.isfinite(before) & np.isfinite(doubt)
        if not usable.any():
            return None
        scale = np.sqrt(spread**2 + doubt[usable] ** 2)
        off = np.exp(-math.sqrt(max(left, 0.0)) * POINTS)[:, None] - 1.0
        change = (turned - memory * turned_before)[usable]
        still = (value - memory * before)[usable]
        weights = np.exp(-0.5 * POINTS**2)
        return cls(usable, still[None] + off * change[None], scale, weights / weights.sum(), memory, still)

    def gone(self, shape: Array) -> Array:
        """What a lasting shape adds to each innovation: all of it in the first block, then what memory leaves."""
        return np.asarray((shape - self.memory * _before(shape))[self.usable])

    def averaged(self, signals: Array) -> Array:
        """Logarithm of the likelihood of each signal (s, m) against none, averaged over gains."""
        plain = np.log1p((self.still / self.scale) ** 2 / TAIL)
        off = (self.innovation[:, None, :] - signals[None]) / self.scale
        logs = 0.5 * (TAIL + 1.0) * (plain - np.log1p(off**2 / TAIL)).sum(axis=2)
        most = logs.max(axis=0)
        found: Array = most + np.log(self.weights @ np.exp(logs - most))
        return found


def _before(values: Array) -> Array:
    """Values a block earlier; nothing before the first."""
    return np.concatenate([[0.0], values[:-1]])


def _log_mean(logs: Array, weights: Array) -> float:
    most = float(logs.max())
    return most + math.log(float(weights @ np.exp(logs - most)))
