"""Curves through rows: smooth, through every row, and no further than the rows show."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from rotorfault.reference.curve import UNSEEN, Curve

Array = NDArray[np.float64]

HOLDS = {
    "a step down": ([0, 1, 2, 2.5, 3.5, 4.5], [1, 1, 1, 0.1, 0.1, 0.1]),
    "a step up": ([0, 1, 2, 3, 4, 5, 6], [0, 0, 0, 1, 1, 1, 1]),
    "a ramp, then a hold": ([0, 1, 2, 3, 4, 5], [0, 1, 2, 2, 2, 2]),
    "a leap": ([0, 5, 5.1, 10], [1, 1, 0, 0]),
    "stairs": (range(9), [0, 0, 1, 1, 2, 2, 1, 1, 1]),
    "two steps": (range(8), [0, 0, 0, 5, 5, 0, 0, 0]),
}


def finely(times: Array) -> Array:
    return np.linspace(times[0], times[-1], 20_001)


@pytest.mark.parametrize("case", HOLDS)
def test_a_curve_stays_within_rows_that_hold(case: str) -> None:
    times, values = (np.array(list(column), dtype=float) for column in HOLDS[case])
    fine = finely(times)
    swing = CubicSpline(times, values)(fine)
    assert max(swing.max() - values.max(), values.min() - swing.min()) > 0.05  # what is to be avoided
    value, rate, acceleration = Curve(times, values, None, None).evaluate(fine)
    assert value.min() >= values.min() - 1e-8
    assert value.max() <= values.max() + 1e-8
    # Between two rows as well: where they are equal, nothing moves.
    place = np.clip(np.searchsorted(times, fine) - 1, 0, len(times) - 2)
    for k in np.flatnonzero(np.diff(values) == 0.0):
        np.testing.assert_allclose(value[place == k], values[k], atol=1e-8)
        np.testing.assert_allclose(rate[place == k], 0.0, atol=1e-7)
        np.testing.assert_allclose(acceleration[place == k], 0.0, atol=1e-5)


@pytest.mark.parametrize("case", HOLDS)
def test_it_goes_through_its_rows_with_continuous_acceleration(case: str) -> None:
    times, values = (np.array(list(column), dtype=float) for column in HOLDS[case])
    curve = Curve(times, values, None, None)
    np.testing.assert_allclose(curve.evaluate(times)[0], values, atol=1e-12)
    inner = times[1:-1]
    before, after = (curve.evaluate(inner + side) for side in (-1e-9, 1e-9))
    scale = np.abs(curve.evaluate(finely(times))).max(axis=1, keepdims=True)
    assert (np.abs(after - before) <= 1e-6 * (1.0 + scale)).all()
    fine = finely(times)[1:-1]
    step = 1e-5
    low, here, high = (curve.evaluate(fine + shift) for shift in (-step, 0.0, step))
    for order in (0, 1):
        slope = (high[order] - low[order]) / (2.0 * step)
        np.testing.assert_allclose(here[order + 1], slope, rtol=0, atol=1e-3 * (1.0 + scale[order + 1, 0]))


@pytest.mark.parametrize("spacing", [0.1, 0.3, 0.6])
def test_a_smooth_motion_keeps_its_peaks(spacing: float) -> None:
    """A cubic spline through samples of a smooth motion stays what it is, and as exact."""
    times = np.arange(0.0, 12.0, spacing)
    fine = np.linspace(1.0, times[-1] - 1.0, 3001)
    found = Curve(times, np.sin(times + 0.3), None, None).evaluate(fine)
    np.testing.assert_array_equal(found[0], CubicSpline(times, np.sin(times + 0.3))(fine))
    assert np.abs(found[0] - np.sin(fine + 0.3)).max() < 0.02 * spacing**3


def test_far_from_a_swing_the_curve_is_the_spline() -> None:
    times = np.arange(0.0, 40.0, 0.25)
    values = np.where(times < 20.0, np.sin(times), np.where(times < 30.0, np.sin(20.0), np.sin(20.0) + 1.0))
    curve, spline = Curve(times, values, None, None), CubicSpline(times, values)
    fine = np.linspace(0.0, 15.0, 2001)
    np.testing.assert_allclose(curve.evaluate(fine)[0], spline(fine), atol=1e-12)
    held = np.linspace(22.0, 29.0, 501)
    assert np.abs(curve.evaluate(held)[0] - np.sin(20.0)).max() <= UNSEEN


def test_a_peak_is_no_higher_than_its_rows_agree_on() -> None:
    draw = np.random.default_rng(1)
    for _ in range(100):
        times = np.cumsum(draw.uniform(0.1, 2.0, 12))
        values = draw.normal(size=12)
        value = Curve(times, values, None, None).evaluate(finely(times))[0]
        room = 0.0
        slope = np.diff(values) / np.diff(times)
        bend = 2.0 * np.diff(slope) / (times[2:] - times[:-2])
        for k in range(1, 10):
            a, b = bend[k - 1], bend[k]
            agreed = min(abs(a), abs(b)) if a * b > 0.0 else 0.0
            room = max(room, 0.25 * agreed * (times[k + 1] - times[k]) ** 2)
        assert value.max() <= values.max() + room + UNSEEN
        assert value.min() >= values.min() - room - UNSEEN


def test_given_rates_are_kept_whatever_they_make_of_the_curve() -> None:
    times, values, rates = np.array([0.0, 1.0]), np.array([0.0, 0.0]), np.array([-4.0, 4.0])
    value, rate, _ = Curve(times, values, rates, None).evaluate(np.array([0.0, 0.5, 1.0]))
    assert value.tolist() == pytest.approx([0.0, -1.0, 0.0])
    assert rate.tolist() == pytest.approx([-4.0, 0.0, 4.0])
