"""Gusts that turn a body: what they can do by the spectrum of the standard, and what is learned of them."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rotorfault.autopilot.diagnosis.kalman import diagonal, follow, innovation, predict
from rotorfault.autopilot.diagnosis.turning_gusts import (
    LEARNED,
    GustMemory,
    GustParameters,
    at_worst,
    calm,
    gust_densities,
    gust_parameters,
    learned,
)
from rotorfault.model.turbulence import EXPECTED_AT, turbulence
from rotorfault.model.vehicle_file import load_vehicle

DT, R = 0.001, 1e-5
WIND, DRAG = 8.0, 0.25


def parameters() -> GustParameters:
    return gust_parameters(load_vehicle("hummingbird").vehicle, WIND, DRAG, DT)


def flown(memory: GustMemory, density: float, accelerations: np.ndarray, seed: int) -> tuple[GustMemory, list[float]]:
    """Three rates that white torque of a density turns, each in a Kalman filter that believes what is learned."""
    p, rng = parameters(), np.random.default_rng(seed)
    true, beliefs, shares = np.zeros(3), [diagonal((0.0,), (R,))] * 3, []
    for acceleration in accelerations:
        true += rng.normal(size=3) * np.sqrt(density * np.array([*p.most]) * DT) + acceleration * DT
        seen = []
        for k, most in enumerate(p.most):
            before = predict(beliefs[k], {}, {}, {0: memory.share * most * DT})
            one = innovation(before, {0: 1.0}, true[k] + rng.normal() * math.sqrt(R), R)
            beliefs[k] = follow(before, one)
            seen.append(one)
        memory = learned(memory, seen, p, DT)
        shares.append(float(memory.share))
    return memory, shares


def test_the_strongest_gusts_have_the_density_of_the_standard() -> None:
    """Typed anew: roll-rate gust at 0 rad/s, a drag at each rotor, frequencies of both signs."""
    vehicle = load_vehicle("hummingbird").vehicle
    gusts, b = turbulence(WIND, EXPECTED_AT), 0.34
    spectrum = gusts.sigma_up**2 / (WIND * gusts.length_up) * 0.8 * (math.pi * gusts.length_up / (4 * b)) ** (1 / 3)
    torque = sum(DRAG / 4 * float(y) * float(y) for y in vehicle.rotor_y)
    turned = (torque / float(vehicle.inertia.x)) ** 2 * math.pi * spectrum
    assert float(gust_densities(vehicle, WIND, DRAG).x) == pytest.approx(turned, rel=1e-9)
    assert float(gust_densities(vehicle, 4.0, DRAG).x) == pytest.approx(0.5 * turned, rel=1e-9)
    assert gust_parameters(vehicle, WIND, DRAG, DT).least == pytest.approx(1.0 / WIND)


@pytest.mark.parametrize(("true", "believed"), [(0.2, 0.36), (0.01, 0.125), (0.8, 1.0)])
def test_what_gusts_do_is_learned_within_what_they_can(true: float, believed: float) -> None:
    """Of what is white 1.8 times: twice, as of gusts of the middle wind half is seen, and outliers count for less."""
    shares = np.array([flown(at_worst(), true, np.zeros((5000, 3)), seed)[1][-1500:] for seed in range(4)])
    assert shares.mean() == pytest.approx(believed, rel=0.25)


def test_a_lost_rotor_does_not_hide_itself_before_it_is_found() -> None:
    """A torque about one axis alone, from calm, counts a third and no more than three deviations: half in 0.3 s."""
    lost = np.zeros((1000, 3))
    lost[:, 0] = 4.0  # rad/s^2, as of 10 % of a rotor of the Hummingbird
    _, shares = flown(calm(parameters()), 0.0, lost, 7)
    assert shares[200] < shares[0] * math.exp((9.0 / 3.0 - 1.0 + 0.5) * 0.2 / LEARNED)
    front = np.array([[4.0, 4.0, 2.0]]) * np.ones((1000, 1))
    _, everywhere = flown(calm(parameters()), 0.0, front, 7)
    assert everywhere[-1] > 2.0 * shares[-1]
