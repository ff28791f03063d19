"""Gusts: their statistics against the spectra of the standard, and their mean wind.

The filters are looked at from outside: gusts that came out, or the response of the block to single numbers put in.
Neither the filters' states nor their coefficients are named here.
"""

from __future__ import annotations

import functools
import itertools
import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from plant_flights import part
from scipy import linalg, signal

from rotorfault.maths.records import flatten, unflatten
from rotorfault.model.block import Context
from rotorfault.model.vehicle_file import load_vehicle
from rotorfault.plant import WIND
from rotorfault.plant.timed import TimeInputs

Array = NDArray[np.float64]
VEHICLE = load_vehicle("paper").vehicle
AXES = ("along", "across", "up")
MEAN = (6.0, -8.0, 0.0)  # m/s: 10 m/s along (0.6, -0.8)
H, W20 = 20.0, 15.0  # m, m/s
each_axis = pytest.mark.parametrize("axis", range(3), ids=AXES)


def dryden(**settings: Any) -> Any:
    given = {"velocity_W": MEAN, "altitude": H, "wind_at_6m": W20} | settings
    return part(WIND, "dryden", **given)


def numbers_of(wind: Any, period: float = 0.1) -> Any:
    return wind.parameters(Context(VEHICLE, period))


def stepped(wind: Any, memory: Any, normals: Any, numbers: Any, period: float) -> Any:
    """The memory a sampling period later."""
    return wind.step(memory, TimeInputs(0.0, tuple(normals)), numbers, period)[0]


def expected(altitude: float = H, w20: float = W20) -> tuple[Array, Array]:
    """Standard deviations [m/s] and scale lengths [m] of u, v, w, typed from the standard, all of it in feet."""
    h = altitude / 0.3048
    low = 0.177 + 0.000823 * h
    sigma_w = 0.1 * (w20 / 0.3048)
    sigma = np.array([sigma_w / low**0.4, sigma_w / low**0.4, sigma_w])
    return 0.3048 * sigma, 0.3048 * np.array([h / low**1.2, h / low**1.2, h])


SIGMA, LENGTH = expected()


def in_gust_axes(velocity: Array, mean: tuple[float, float, float] = MEAN) -> Array:
    """Gusts along, across and up from velocities of the air in world axes, shape (3, ...)."""
    along = np.array([mean[0], mean[1], 0.0]) / math.hypot(mean[0], mean[1])
    frame = np.array([along, np.cross([0.0, 0.0, 1.0], along), [0.0, 0.0, 1.0]])
    return np.tensordot(frame, velocity - np.reshape(mean, (3,) + (1,) * (velocity.ndim - 1)), axes=1)


def blow(wind: Any, period: float, steps: int, flights: int, seed: int) -> Array:
    """Gusts at the sampling instants in their own axes, shape (steps + 1, 3, flights); the first before any step."""
    draw = np.random.default_rng(seed)
    numbers = numbers_of(wind, period)
    memory = wind.initial(TimeInputs(0.0, tuple(draw.standard_normal((6, flights)))), numbers)
    seen = []
    for k in range(steps + 1):
        seen.append(np.array(flatten(wind.at(k * period, memory, numbers).velocity_W)))
        memory = stepped(wind, memory, draw.standard_normal((3, flights)), numbers, period)
    return np.moveaxis(in_gust_axes(np.moveaxis(np.array(seen), 1, 0)), 1, 0)


def recursion(wind: Any, period: float) -> tuple[Array, Array, Array, Array]:
    """The block as x' = A x + B n, gust = C x, x0 = D m: read off its responses to single ones, for it is linear."""
    numbers = numbers_of(wind, period)
    template = wind.initial(TimeInputs(0.0, (0.0,) * 6), numbers)
    size = len(flatten(template))

    def step(x: Array, n: Array) -> Array:
        return np.array(flatten(stepped(wind, unflatten(template, x.tolist()), n.tolist(), numbers, period)))

    def gust(x: Array) -> Array:
        air = wind.at(0.0, unflatten(template, x.tolist()), numbers)
        return in_gust_axes(np.array(flatten(air.velocity_W)))

    def start(m: Array) -> Array:
        return np.array(flatten(wind.initial(TimeInputs(0.0, tuple(m.tolist())), numbers)))

    rest, still = np.zeros(size), np.zeros(3)
    A = np.column_stack([step(x, still) for x in np.eye(size)])
    B = np.column_stack([step(rest, n) for n in np.eye(3)])
    return A, B, np.column_stack([gust(x) for x in np.eye(size)]), np.column_stack([start(m) for m in np.eye(6)])


def continuous(axis: int) -> tuple[Array, Array, Array]:
    """The standard's shaping filter of unit variance in continuous time, as x_dot = F x + g white noise, y = h x."""
    tau = LENGTH[axis] / 10.0
    if axis == 0:  # sqrt(2 tau)/(1 + tau s)
        return np.array([[-1.0 / tau]]), np.array([[1.0]]), np.array([[math.sqrt(2.0 / tau)]])
    # sqrt(tau) (1 + sqrt(3) tau s)/(1 + tau s)^2 in controllable form
    F = np.array([[0.0, 1.0], [-1.0 / tau**2, -2.0 / tau]])
    return F, np.array([[0.0], [1.0]]), math.sqrt(tau) / tau**2 * np.array([[1.0, math.sqrt(3.0) * tau]])


# ------------------------------------------------------------------------------------------------------- statistics


@pytest.mark.parametrize("period", [0.001, 0.5])
def test_variance(period: float) -> None:
    """Of the first sample, before any step, and of later ones: over independent flights, within four deviations."""
    flights = 40_000
    gusts = blow(dryden(), period, 30, flights, seed=1) / SIGMA[:, None]
    for k in (0, 1, 6, 30):
        assert np.abs(gusts[k].var(axis=1) - 1.0).max() < 4.0 * math.sqrt(2.0 / flights), k
        assert np.abs(gusts[k].mean(axis=1)).max() < 4.0 / math.sqrt(flights), k


@pytest.mark.parametrize("period", [1e-4, 0.001, 0.01, 0.1, 1.0, 20.0])
def test_variance_without_chance(period: float) -> None:
    """The stationary covariance of the recursion, by Lyapunov's equation: sigma^2, whatever the period; and the
    start has that very covariance, hidden states included."""
    A, B, C, D = recursion(dryden(), period)
    P = linalg.solve_discrete_lyapunov(A, B @ B.T, method="direct")
    np.testing.assert_allclose(C @ P @ C.T, np.diag(SIGMA**2), rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(D @ D.T, P, atol=1e-9)


@pytest.mark.parametrize("period", [0.001, 0.1, 2.0])
@each_axis
def test_autocorrelation_is_that_of_the_continuous_filter(period: float, axis: int) -> None:
    """Matrix exponential and Lyapunov's equation of the standard's filter, against the recursion read off."""
    A, B, C, _ = recursion(dryden(), period)
    P = linalg.solve_discrete_lyapunov(A, B @ B.T, method="direct")
    F, g, h = continuous(axis)
    Q = linalg.solve_continuous_lyapunov(F, -g @ g.T)
    for k in (0, 1, 2, 3, 10, 100, 1000):
        found = (C @ np.linalg.matrix_power(A, k) @ P @ C.T)[axis, axis] / SIGMA[axis] ** 2
        wanted = (h @ linalg.expm(F * k * period) @ Q @ h.T).item()
        assert found == pytest.approx(wanted, abs=1e-9), k


@functools.cache
def long_batch(period: float, steps: int, flights: int) -> Array:
    """Blown once for all axes."""
    return blow(dryden(), period, steps, flights, seed=2)


@each_axis
def test_autocorrelation_as_sampled(axis: int) -> None:
    """At a few lags over a long batch; the closed form of the lateral one is negative beyond two time constants."""
    period, steps, flights = 0.2, 1500, 64
    gusts = long_batch(period, steps, flights)[:, axis] / SIGMA[axis]
    tau = LENGTH[axis] / 10.0
    # Neighbours within about two time constants count as one.
    spread = 4.0 * math.sqrt(4.0 * tau / (period * steps * flights))
    for lag in (1, 5, 20, 60):
        t = lag * period / tau
        wanted = math.exp(-t) * (1.0 if axis == 0 else 1.0 - 0.5 * t)
        found = np.mean(gusts[lag:] * gusts[:-lag])
        assert abs(found - wanted) < spread, lag


@each_axis
def test_power_spectral_density(axis: int) -> None:
    """Welch's estimate against the formula of the standard, a decade to each side of the corner frequency."""
    # The lengths differ by a factor of four and more: a period for each axis, far below its time constant.
    tau = LENGTH[axis] / 10.0
    period, flights, length = tau / 50.0, 512, 4096
    gusts = blow(dryden(), period, length - 1, flights, seed=3)[:, axis]
    f, density = signal.welch(gusts, fs=1.0 / period, nperseg=length, axis=0, detrend=False)
    density = density.mean(axis=1)
    omega = 2.0 * np.pi * f
    Omega = omega / 10.0  # rad/m
    s, L = SIGMA[axis], LENGTH[axis]
    spatial = {
        True: s**2 * 2.0 * L / np.pi / (1.0 + (L * Omega) ** 2),
        False: s**2 * L / np.pi * (1.0 + 3.0 * (L * Omega) ** 2) / (1.0 + (L * Omega) ** 2) ** 2,
    }[axis == 0]
    wanted = spatial * 2.0 * np.pi / 10.0  # per Hz, one-sided
    edges = np.geomspace(0.1, 10.0, 11) / tau
    for low, high in itertools.pairwise(edges):
        band = (omega >= low) & (omega < high)
        assert band.any()
        # 512 segments: 5 % on a single line, and 2 % of aliasing at the upper end.
        spread = 0.2 / math.sqrt(band.sum()) + 0.025
        assert abs(density[band].sum() / wanted[band].sum() - 1.0) < spread, (low, high)


def test_axes_are_independent() -> None:
    gusts = blow(dryden(), 0.1, 20, 40_000, seed=4)[-1] / SIGMA[:, None]
    assert np.abs(np.corrcoef(gusts) - np.eye(3)).max() < 4.0 / math.sqrt(40_000)


@pytest.mark.parametrize("altitude", [3.048, 10.0, 100.0, 304.8])
def test_intensity_and_scale_at_other_heights(altitude: float) -> None:
    A, B, C, _ = recursion(dryden(altitude=altitude, wind_at_6m=7.0), 0.1)
    sigma, length = expected(altitude, 7.0)
    P = linalg.solve_discrete_lyapunov(A, B @ B.T, method="direct")
    np.testing.assert_allclose(C @ P @ C.T, np.diag(sigma**2), rtol=1e-8, atol=1e-8)
    poles = np.sort(np.abs(linalg.eigvals(A)))
    np.testing.assert_allclose(poles, np.sort(np.exp(-0.1 * 10.0 / length[[0, 1, 1, 2, 2]])), rtol=1e-6)


def test_at_a_thousand_feet_turbulence_is_isotropic() -> None:
    """The standard's low-altitude model meets the one above there."""
    sigma, length = expected(304.8)
    numbers = numbers_of(dryden(altitude=304.8))
    assert numbers.sigma_level == pytest.approx(numbers.sigma_up)
    assert numbers.length_level == pytest.approx(numbers.length_up)
    np.testing.assert_allclose([sigma[0], length[0]], [numbers.sigma_up, numbers.length_up], rtol=1e-12)


# -------------------------------------------------------------------------------------------------- the mean wind


def test_without_a_mean_wind_gusts_lie_along_x_and_come_with_the_least_speed() -> None:
    calm = dryden(velocity_W=(0.0, 0.0, 0.0), airspeed_min=2.0)
    numbers = numbers_of(calm)
    memory = calm.initial(TimeInputs(0.0, (1.0, *[0.0] * 5)), numbers)
    np.testing.assert_allclose(flatten(calm.at(0.0, memory, numbers).velocity_W), [SIGMA[0], 0.0, 0.0])
    after = stepped(calm, memory, [0.0] * 3, numbers, 0.1)
    x = calm.at(0.0, after, numbers).velocity_W.x
    assert x == pytest.approx(SIGMA[0] * math.exp(-0.1 * 2.0 / LENGTH[0]))


def test_a_faster_mean_wind_carries_gusts_past_faster() -> None:
    """Twice the wind over half the period is the same recursion."""
    slow, fast = recursion(dryden(), 0.1), recursion(dryden(velocity_W=(12.0, -16.0, 0.0)), 0.05)
    for a, b in zip(slow[:2], fast[:2], strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-12, atol=1e-14)
    # A vertical mean wind counts as speed, but not as direction.
    numbers = numbers_of(dryden(velocity_W=(0.0, 3.0, 4.0)))
    assert (numbers.along_x, numbers.along_y) == (0.0, 1.0)
