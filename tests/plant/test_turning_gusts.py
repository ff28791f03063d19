"""Gusts that differ over the vehicle: spectra of the standard, and what turning air does to a body."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from plant_flights import part
from scipy import signal

from rotorfault.maths.geometry import Vec3, zeros
from rotorfault.maths.rotation import Quat
from rotorfault.model.aerodynamics import still_air
from rotorfault.model.block import Context
from rotorfault.model.mixer import hover_thrust
from rotorfault.model.signals import State
from rotorfault.model.vehicle import Vehicle, rotor_speeds
from rotorfault.model.vehicle_file import load_vehicle
from rotorfault.plant import WIND
from rotorfault.plant.air_forces import pushed_by_air
from rotorfault.plant.timed import TimeInputs
from rotorfault.plant.wind import Air

Array = NDArray[np.float64]
T, SPEED, H, W20 = 0.002, 10.0, 10.0, 8.0
SPAN = 0.34  # m: of the Hummingbird, whose rotors are 0.17 m from its centre


@pytest.fixture(scope="module")
def vehicle() -> Vehicle:
    return load_vehicle("hummingbird").vehicle


def blown(vehicle: Vehicle, steps: int, flights: int, **settings: Any) -> tuple[Array, Array]:
    """Velocity and turning of the air, (steps, 3, flights) each, wind along x."""
    wind: Any = part(WIND, "dryden", velocity_W=(SPEED, 0.0, 0.0), altitude=H, wind_at_6m=W20, **settings)
    numbers, rng = wind.parameters(Context(vehicle, T)), np.random.default_rng(8)
    memory = wind.initial(TimeInputs(0.0, tuple(rng.normal(size=(wind.first_normals, flights)))), numbers)
    velocity, turning = np.zeros((steps, 3, flights)), np.zeros((steps, 3, flights))
    for k in range(steps):
        memory, air, _ = wind.step(
            memory, TimeInputs(k * T, tuple(rng.normal(size=(wind.normals, flights)))), numbers, T
        )
        velocity[k] = np.array([*air.velocity_W]) - np.array([SPEED, 0.0, 0.0])[:, None]
        if air.turning_W != ():
            turning[k] = np.array([*air.turning_W])
    return velocity, turning


def test_air_turns_with_the_spectra_of_the_standard(vehicle: Vehicle) -> None:
    """Roll, pitch and yaw gusts of MIL-F-8785C as one-sided densities over rad/s, typed anew."""
    velocity, turning = blown(vehicle, 30_000, 12, gradients=True)
    skipped = turning[1000:]
    hertz, density = signal.welch(skipped, 1.0 / T, nperseg=2048, axis=0)
    measured = density.mean(axis=-1) / (2.0 * math.pi)  # per rad/s
    omega = 2.0 * math.pi * hertz
    low = 0.177 + 0.000823 * H / 0.3048
    sigma = np.array([0.1 * W20 / low**0.4, 0.1 * W20])
    length = np.array([H / low**1.2, H])
    tau, pole = length / SPEED, math.pi * SPEED / np.array([4.0 * SPAN, 3.0 * SPAN])
    p = sigma[1] ** 2 / (SPEED * length[1]) * 0.8 * (math.pi * length[1] / (4.0 * SPAN)) ** (1.0 / 3.0)
    p = p / (1.0 + (omega / pole[0]) ** 2)
    v, w = (
        s**2 * t / math.pi * (1.0 + 3.0 * (t * omega) ** 2) / (1.0 + (t * omega) ** 2) ** 2
        for s, t in zip(sigma, tau, strict=True)
    )
    q = (omega / SPEED) ** 2 / (1.0 + (omega / pole[0]) ** 2) * w
    r = (omega / SPEED) ** 2 / (1.0 + (omega / pole[1]) ** 2) * v
    for axis, wanted in enumerate((p, q, r)):
        for first, last in ((2.0, 6.0), (6.0, 20.0), (20.0, 60.0)):
            band = (omega > first) & (omega < last)
            assert measured[band, axis].sum() == pytest.approx(wanted[band].sum(), rel=0.12), (axis, first)
    # Frozen gusts that are carried past along x: w is behind where it will be, so its slope turns the air about y.
    rising = np.diff(velocity[1000:, 2], axis=0)
    assert np.corrcoef(rising.ravel(), skipped[1:, 1].ravel())[0, 1] > 0.2
    assert np.corrcoef(np.diff(velocity[1000:, 1], axis=0).ravel(), skipped[1:, 2].ravel())[0, 1] < -0.2


def test_without_gradients_the_air_does_not_turn_and_blows_as_it_did(vehicle: Vehicle) -> None:
    wind: Any = part(WIND, "dryden", velocity_W=(SPEED, 0.0, 0.0))
    assert (wind.normals, wind.first_normals) == (3, 6)
    numbers = wind.parameters(Context(vehicle, T))
    memory = wind.initial(TimeInputs(0.0, (0.1,) * 6), numbers)
    assert wind.at(0.0, memory, numbers).turning_W == ()


def test_a_body_in_turning_air_is_pushed_as_one_that_turns_against_it(vehicle: Vehicle) -> None:
    air = still_air()._replace(rotor_drag=1e-4, inflow=2e-4, damping=Vec3(1e-3, 2e-3, 3e-3))
    vehicle = vehicle._replace(air=air)
    speeds, turn = rotor_speeds(vehicle, hover_thrust(vehicle)), Vec3(0.3, -0.2, 0.5)
    half = math.sqrt(0.5)
    level = State(zeros(), zeros(), Quat(half, 0.0, 0.0, half), zeros())  # yawed by a quarter
    turning = level._replace(omega_B=Vec3(0.2, 0.3, -0.5))  # -turn in body axes
    blown_on = pushed_by_air(vehicle, level, Air(zeros(), zeros(), turn), speeds)
    itself = pushed_by_air(vehicle, turning, Air(zeros(), zeros()), speeds)
    for one, other in zip(blown_on, itself, strict=True):
        np.testing.assert_allclose([*one], [*other], atol=1e-15)
    assert abs(float(blown_on[1].x)) > 1e-4
