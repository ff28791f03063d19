r"""Gain, delay and phase margin of each axis of a linearised loop, broken at the plant's input.

With axis i broken and all other axes closed, the loop transfer function, negative feedback, is

.. math:: T_i(z) = C_i (zI - A)^{-1} B_i, \qquad L_i = -T_i / (1 + T_i), \qquad z = e^{j\omega T}

A gain g there brings a pole onto the unit circle where g L_i = -1, a delay tau where L_i exp(-j w tau) = -1; so from
a stable loop the nearest such g and tau *are* the margins, however often L_i crosses, and whether or not L_i itself
is stable. Source: K. J. Astrom, B. Wittenmark, "Computer-Controlled Systems", 3rd ed., 1997, chapter 3. A delay of
whole periods is meant exactly, of fractions as its phase.

Roll carries y and pitch carries x: the position loop is closed through the attitude, so these two have a lower gain
margin as well. The autopilot knows nothing of gain or delay; a law that compares motion with commands (roismc, ismc)
takes them for a disturbance.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq

from rotorfault.analysis.linearisation import AXES, LinearLoop
from rotorfault.base.one_line import record_line
from rotorfault.maths.arrays import Array, Complex

# Loop gains outside this range are not looked at. Our choice: no actuator is wrong by a factor of 1e5, and the loop
# transfer is mostly rounding there.
LOOP_GAIN_RANGE = (1e-5, 1e5)
GRID = 2000  # frequencies, some 400 per decade at a period of 1 ms; resonances get more of their own


class Margins(NamedTuple):
    """How much one axis stands at the plant's input; NaN throughout where the loop is unstable as it is."""

    gain_up: float  # factor on the wrench at which the loop turns unstable; inf if none
    gain_down: float  # the same below 1; 0 if none
    delay: float  # s; inf if none
    phase: float  # rad, least over all crossovers; inf if none
    crossover: float  # rad/s, where `delay` is decided; NaN if none

    def __repr__(self) -> str:
        return record_line(self)


def margins(linear: LinearLoop) -> dict[str, Margins]:
    """Gain, delay and phase margin of each axis at the plant's input, the other axes closed.

    Parameters
    ----------
    linear : LinearLoop

    Returns
    -------
    dict of str to Margins
        By the names in `rotorfault.analysis.linearisation.AXES`.
    """
    if not linear.stable:
        return {axis: Margins(*[math.nan] * 5) for axis in AXES}
    omega = _grid(linear)
    L = linear.loop_transfer(omega)
    return {axis: _margins_of(linear, i, omega, L[:, i]) for i, axis in enumerate(AXES)}


def _grid(linear: LinearLoop) -> Array:
    nyquist = math.pi / linear.period
    s = linear.continuous_poles
    slowest = float(np.min(np.abs(s), initial=nyquist))
    low = min(max(1e-2 * slowest, 1e-3), 1e-2 * nyquist)
    # Resonances are narrow; the grid must not step over them.
    own = np.abs(s.imag)
    near = np.concatenate([own * factor for factor in (0.99, 1.0, 1.01)])
    parts = [np.geomspace(low, nyquist, GRID), np.linspace(0.5 * nyquist, nyquist, GRID // 8), near]
    omega = np.unique(np.concatenate(parts))
    return omega[(omega >= low) & (omega <= nyquist)]


def _margins_of(linear: LinearLoop, i: int, omega: Array, L: Complex) -> Margins:
    def at(w: float) -> complex:
        return complex(linear.loop_transfer(np.array([w]))[0, i])

    size = np.abs(L)
    within = (size > LOOP_GAIN_RANGE[0]) & (size < LOOP_GAIN_RANGE[1])
    pairs = within[:-1] & within[1:]
    up, down = math.inf, 0.0
    crossings = [
        at(brentq(lambda w: at(w).imag, omega[k], omega[k + 1]))
        for k in np.flatnonzero(pairs & (L.imag[:-1] * L.imag[1:] < 0.0))
    ]
    # At z = 1 and z = -1 L is real without changing sign.
    for crossing in [*crossings, at(0.0), at(math.pi / linear.period)]:
        if crossing.real < 0.0 and LOOP_GAIN_RANGE[0] < abs(crossing) < LOOP_GAIN_RANGE[1]:
            g = 1.0 / abs(crossing)
            up, down = (min(up, g), down) if g > 1.0 else (up, max(down, g))
    delay, phase, crossover = math.inf, math.inf, math.nan
    for k in np.flatnonzero(pairs & ((size[:-1] - 1.0) * (size[1:] - 1.0) < 0.0)):
        w = float(brentq(lambda v: abs(at(v)) - 1.0, omega[k], omega[k + 1]))
        lead = (math.atan2(at(w).imag, at(w).real) + math.pi) % (2.0 * math.pi)
        phase = min(phase, lead, 2.0 * math.pi - lead)
        if lead / w < delay:
            delay, crossover = lead / w, w
    return Margins(up, down, delay, phase, crossover)
