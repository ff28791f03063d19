r"""Thresholds for a wanted rate of false alarms, from the statistics of what is watched; none is tuned.

**Windows of a jump.** With no fault, :math:`z = d/\sqrt C` of one window is a Brownian motion in the information C,
over the root of it. In :math:`\ln C` that is a stationary process with the correlation
:math:`e^{-|\Delta\ln C|/2}`, which exceeds b while :math:`\ln C` grows by U with a probability of

.. math:: p(b) \approx \varphi(b)\left(\tfrac12\left(b - \tfrac1b\right)U + \tfrac2b\right)

(:math:`\varphi`: density of the standard normal distribution). A torque that lasts shows in rates
of white noise by an information that grows as the cube of time, so an onset that grows older by the factor n has
:math:`U = 3\ln n`. It is that of continuous time, where the highest value between two instants counts too.
Windows that take an onset every :math:`D_m` for N rotors alarm, by the union bound, at most
:math:`\sum_m N\,p_m(b)/D_m` times a second.

**A filtered loss.** :math:`z = \hat\lambda/\sigma` is a stationary process too, whose correlation falls over
the filter's time :math:`t_c`; N of them cross b upwards :math:`N\,b\,\varphi(b)/t_c` times a second.

**A likelihood ratio.** A sum of likelihood ratios over onsets, less the number of onsets so far, is a martingale
without a fault. So the mean time to the first alarm at a level A is at least A times the time between two onsets,
whatever the distribution (Shiryaev, Roberts; Pollak).

Sources: R. Miller, D. Siegmund, Biometrics 38, 1982; S. O. Rice, Bell Syst. Tech. J. 24, 1945; M.
Pollak, Ann. Statist. 13, 1985.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

HOUR = 3600.0  # s
STEEPNESS = 3.0  # power of time by which information grows


def tail(b: float) -> float:
    """Probability that a standard normal number exceeds b."""
    return 0.5 * math.erfc(b / math.sqrt(2.0))


def density(b: float) -> float:
    """Of the standard normal distribution."""
    return math.exp(-0.5 * b * b) / math.sqrt(2.0 * math.pi)


def window_probability(b: float, older: float) -> float:
    """Probability that z exceeds b while an onset grows older by a factor, with no fault."""
    return density(b) * (0.5 * (b - 1.0 / b) * STEEPNESS * math.log(older) + 2.0 / b)


def windows_threshold(per_hour: float, rotors: int, lengths: Sequence[float], period: float) -> float:
    """Standard deviations that windows of jumps exceed so often.

    Parameters
    ----------
    per_hour : float
        Wanted false alarms of all rotors and windows.
    rotors : int
    lengths : sequence of float, s
        Of the windows.
    period : float, s
        Of sampling.
    """

    def rate(b: float) -> float:
        # Window k takes an onset at half its length, but for the first, whose onsets are new.
        shortest, *longer = lengths
        new = window_probability(b, max(shortest / period, 1.0)) / shortest
        return rotors * HOUR * (new + sum(window_probability(b, 2.0) / (0.5 * length) for length in longer))

    return solved(rate, per_hour)


def crossing_threshold(per_hour: float, processes: int, correlation: float) -> float:
    """Standard deviations that stationary processes cross so often.

    Parameters
    ----------
    per_hour : float
        Wanted crossings of all of them.
    processes : int
    correlation : float, s
        Time over which they are alike.
    """
    return solved(lambda b: processes * HOUR / correlation * (tail(b) + b * density(b)), per_hour)


def ratio_threshold(per_hour: float, onsets_per_hour: float) -> float:
    """Logarithm of the level that a sum of likelihood ratios reaches so often.

    Parameters
    ----------
    per_hour : float
        Wanted false alarms.
    onsets_per_hour : float
        Onsets that are watched, of all rotors.
    """
    return math.log(max(onsets_per_hour / per_hour, 1.0))


def solved(rate: Callable[[float], float], wanted: float) -> float:
    """Where a rate that falls is as wanted.

    Parameters
    ----------
    rate : callable
        Of a threshold in standard deviations, 1 or more.
    wanted : float
    """
    low, high = 1.0, 40.0
    for _ in range(80):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if rate(middle) > wanted else (low, middle)
    return high
