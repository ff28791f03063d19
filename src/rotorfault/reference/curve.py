"""Smooth curves through tabulated values, for references from files. SciPy is loaded with this module alone."""

from __future__ import annotations

from typing import final

import numpy as np
from scipy.interpolate import BPoly, CubicSpline

from rotorfault.maths.arrays import Array


@final
class Curve:
    """A smooth function of time through given values, and rates and accelerations where there are any.

    Without rates a cubic spline, with rates a cubic and with accelerations a quintic polynomial between each two
    instants, so that the tabulated derivatives are always those of the tabulated values.

    Parameters
    ----------
    times, values : ndarray, shape (n,)
    rates, accelerations : ndarray, shape (n,), or None
        Accelerations only with rates.
    """

    def __init__(self, times: Array, values: Array, rates: Array | None, accelerations: Array | None) -> None:
        self._first, self._last = float(times[0]), float(times[-1])
        if rates is None:
            curve = CubicSpline(times, values)
        else:
            columns = [values, rates] if accelerations is None else [values, rates, accelerations]
            curve = BPoly.from_derivatives(times, np.stack(columns, axis=1))
        self._derivatives = [curve, curve.derivative(1), curve.derivative(2)]

    def evaluate(self, times: Array) -> Array:
        """Value, rate and acceleration, shape (3, n); at rest before the first and after the last given instant."""
        inside = (times >= self._first) & (times <= self._last)
        result = np.stack([derivative(np.clip(times, self._first, self._last)) for derivative in self._derivatives])
        result[1:, ~inside] = 0.0
        return result
