"""What truth and belief share: Euler's right-hand side, drag, limits, and a lag whose input is held, exactly."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.linalg import expm

from rotorfault.maths.geometry import PerRotor, Vec3
from rotorfault.model.motion import angular_acceleration, drag_acceleration, effect_of, lag_held, limited
from rotorfault.model.vehicle_file import load_vehicle

VEHICLE = load_vehicle("paper").vehicle._replace(inertia=Vec3(2.16e-3, 3.1e-3, 1.7e-3), rotor_gain=0.9)
Array = NDArray[np.float64]
thrusts = st.floats(-20.0, 20.0)
bandwidths, periods = st.floats(0.5, 400.0), st.floats(1e-4, 0.1)


def end_and_mean(output: float, entering: float, bandwidth: float, dt: float) -> Array:
    """Of v' = w (u - v), by the exponential of the matrix that moves output, input and integral on."""
    A = np.array([[-bandwidth, bandwidth, 0.0], [0.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
    after = expm(A * dt) @ np.array([output, entering, 0.0])
    return np.array([after[0], after[2] / dt])


@given(thrusts, thrusts, bandwidths, periods)
def test_a_held_lag_is_the_matrix_exponential(output: float, entering: float, bandwidth: float, dt: float) -> None:
    found = lag_held(output, entering, bandwidth, dt)
    scale = 1.0 + abs(output) + abs(entering)
    np.testing.assert_allclose(found, end_and_mean(output, entering, bandwidth, dt), rtol=0, atol=1e-11 * scale)


@given(thrusts, thrusts, bandwidths, periods)
def test_a_lag_is_the_same_in_one_period_or_two(output: float, entering: float, bandwidth: float, dt: float) -> None:
    end, mean = lag_held(output, entering, bandwidth, dt)
    middle, first = lag_held(output, entering, bandwidth, 0.5 * dt)
    again, second = lag_held(middle, entering, bandwidth, 0.5 * dt)
    assert end == pytest.approx(again, abs=1e-12 * (1.0 + abs(output) + abs(entering)))
    assert mean == pytest.approx(0.5 * (first + second), abs=1e-11 * (1.0 + abs(output) + abs(entering)))


def test_a_held_lag_by_numbers_worked_out_by_hand() -> None:
    end, mean = lag_held(2.0, 6.0, math.log(4.0), 1.0)  # to a quarter of the way: 6 - 4/4; mean 6 - 4 (3/4)/ln 4
    assert end == pytest.approx(5.0, abs=1e-14)
    assert mean == pytest.approx(6.0 - 3.0 / math.log(4.0), abs=1e-14)
    assert lag_held(3.0, 3.0, 50.0, 0.01) == (3.0, 3.0)


def test_a_held_lag_on_arrays_and_beside_a_fine_integration() -> None:
    """Against explicit small steps, which know nothing of exponentials."""
    bandwidth, dt, steps = np.array([5.0, 50.0, 200.0]), 0.02, 20_000
    v, total = np.array([1.0, -2.0, 8.0]), np.zeros(3)
    end, mean = lag_held(v, 4.0, bandwidth, dt)
    for _ in range(steps):
        half = v + 0.5 * dt / steps * bandwidth * (4.0 - v)
        total += half / steps
        v = v + dt / steps * bandwidth * (4.0 - half)
    np.testing.assert_allclose(end, v, atol=1e-6)
    np.testing.assert_allclose(mean, total, atol=1e-6)


def test_angular_acceleration_is_eulers_equation() -> None:
    """In matrices: J w' = tau - w x (J w + h), with the momentum h of the rotors along body z."""
    rng = np.random.default_rng(3)
    J = np.diag(list(VEHICLE.inertia))
    for _ in range(20):
        torque, omega, residual = rng.normal(size=3), rng.normal(size=3) * 5.0, float(rng.normal() * 500.0)
        h = np.array([0.0, 0.0, VEHICLE.rotor_inertia * residual])
        expected = np.linalg.solve(J, torque - np.cross(omega, J @ omega + h))
        found = angular_acceleration(VEHICLE, Vec3.of(torque), Vec3.of(omega), residual)
        np.testing.assert_allclose(list(found), expected, rtol=1e-12)


def test_drag_pulls_towards_the_velocity_of_the_air() -> None:
    vehicle = VEHICLE._replace(linear_drag=0.3, mass=1.5)
    assert list(drag_acceleration(vehicle, Vec3(5.0, -10.0, 0.0))) == pytest.approx([1.0, -2.0, 0.0])


def test_limits_and_effect() -> None:
    vehicle = VEHICLE._replace(thrust_min=0.5, thrust_max=8.0)
    assert limited(vehicle, PerRotor(-1.0, 0.7, 8.0, 9.0)) == PerRotor(0.5, 0.7, 8.0, 8.0)
    assert math.isnan(limited(vehicle, PerRotor(math.nan, 1.0, 1.0, 1.0)).r1)
    assert list(effect_of(vehicle, PerRotor(0.0, 0.25, 1.0, -0.1))) == pytest.approx([0.9, 0.675, 0.0, 0.99])
