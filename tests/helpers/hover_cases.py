"""Vehicles, losses and winds that the tests of hover share."""

from __future__ import annotations

import math

import numpy as np
import pytest
from allocation_cases import PAPER

from rotorfault.maths.geometry import PerRotor, Vec3
from rotorfault.model.vehicle import Vehicle, opposite_pairs

SOUND = PerRotor.all(0.0)
ROTORS = (1, 2, 3, 4)
held_or_not = pytest.mark.parametrize("yaw", [True, False], ids=["held", "given_up"])


def one(rotor: int, loss: float) -> PerRotor:
    return PerRotor.of(loss if rotor == i else 0.0 for i in ROTORS)


def random_case(rng: np.random.Generator, floor: float = 0.3) -> tuple[Vehicle, PerRotor, Vec3]:
    """Two opposite pairs in any order, limits, gain, sense of rotation; losses often 0 or 1; wind from anywhere."""
    angle = rng.uniform(0.0, 2.0 * math.pi)
    angles = angle, angle + rng.choice([0.5 * math.pi, rng.uniform(0.3, 2.8)])
    arms = [rng.uniform(0.05, 0.6) * np.array([math.cos(a), math.sin(a)]) for a in angles]
    r = [arms[0], -arms[0], arms[1], -arms[1]]
    order = rng.permutation(4)
    mass, sign = rng.uniform(0.02, 5.0), rng.choice([-1.0, 1.0])
    gain = rng.uniform(0.6, 1.4)
    most = mass * 9.81 * rng.uniform(1.05, 4.0) / (4.0 * gain)
    places = [(float(r[k][0]), float(r[k][1])) for k in order]
    signs = [sign if k < 2 else -sign for k in order]
    vehicle = PAPER._replace(
        pairs=opposite_pairs(places, signs) or (),
        mass=mass,
        rotor_x=PerRotor.of(float(r[k][0]) for k in order),
        rotor_y=PerRotor.of(float(r[k][1]) for k in order),
        rotor_yaw_sign=PerRotor.of(sign if k < 2 else -sign for k in order),
        torque_ratio=rng.uniform(0.003, 0.05),
        rotor_gain=gain,
        thrust_max=most,
        thrust_min=rng.choice([0.0, rng.uniform(0.0, floor)]) * most,
        linear_drag=mass * rng.uniform(0.0, 0.3),
    )
    loss = PerRotor.of(float(rng.choice([0.0, 1.0, rng.uniform()], p=[0.4, 0.1, 0.5])) for _ in ROTORS)
    wind = Vec3.of(float(w) for w in rng.normal(0.0, 6.0, 3) * rng.choice([0.0, 1.0]))
    return vehicle, loss, wind
