"""The height below which no law survives: against closed forms, and against flights, which must lose more."""

from __future__ import annotations

import math

import numpy as np
import pytest
from gates import needs_simd

import rotorfault as rf
from rotorfault.analysis.least_height import least_height
from rotorfault.base.errors import InputError
from rotorfault.model.vehicle import Vehicle
from rotorfault.model.vehicle_file import load_vehicle


def in_vacuum(name: str) -> Vehicle:
    return load_vehicle(name).vehicle._replace(linear_drag=0.0, air=())


def test_upright_it_is_the_way_of_braking() -> None:
    vehicle = in_vacuum("mueller-2014")
    up = 3.0 * 3.8 / float(vehicle.mass) - float(vehicle.gravity)
    assert float(least_height(vehicle, [1], tilt=0.0, falling=6.0)) == pytest.approx(6.0**2 / (2.0 * up), rel=1e-2)
    assert float(least_height(vehicle, [1], tilt=0.0)) == 0.0


def test_upside_down_it_is_the_turn_and_the_braking_after() -> None:
    """Rotors 2 and 3 turn it, at right angles to each other: their torque is the root of two of one."""
    vehicle = in_vacuum("mueller-2014")
    J, g, m = float(vehicle.inertia.x), float(vehicle.gravity), float(vehicle.mass)
    rate = math.sqrt(2.0) * 3.8 * 0.17 / J
    t = np.linspace(0.0, 1.0, 200_001)
    upright = np.maximum(np.cos(np.maximum(math.pi - 0.5 * rate * t**2, 0.0)), 0.0)
    speed = np.cumsum(3.0 * 3.8 / m * upright - g) * (t[1] - t[0])
    height = np.cumsum(speed) * (t[1] - t[0])
    assert float(least_height(vehicle, [1])) == pytest.approx(-height.min(), rel=2e-2)


def test_less_thrust_than_weight_never_stops_a_fall() -> None:
    vehicle = in_vacuum("paper")._replace(thrust_max=1.0)
    assert math.isinf(float(least_height(vehicle, [1], tilt=0.5)))


def test_a_dead_rotor_that_is_not_there_is_named() -> None:
    with pytest.raises(InputError, match="dead rotor"):
        least_height("mueller-2014", [5])


@needs_simd
@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("name", ["mueller-2014", "deadcat"])
def test_no_flight_loses_less(name: str) -> None:
    """The deadcat's moments of roll and pitch differ. Every second one at rest; told at once, in still
    air.
    """
    draw, count = np.random.default_rng(3), 40
    roll, pitch = draw.uniform(-math.pi, math.pi, count), np.arcsin(draw.uniform(-1.0, 1.0, count))
    rates = draw.uniform(-10.0, 10.0, (3, count)) * (np.arange(count) % 2)
    varied = {"seed": np.arange(count), "start.attitude.0": roll, "start.attitude.1": pitch}
    varied |= {f"start.body_rates.{axis}": rates[axis] for axis in range(3)}
    thrown = {
        "vehicle": name,
        "controller.preset": "hummingbird",
        "duration": 4.0,
        "start.position": [0.0, 0.0, 30.0],
        "reference.position": [0.0, 0.0, 30.0],
        "wind": "none",
        "fault": [{"kind": "total", "rotor": 1, "time": 0.0}],
        "diagnosis": {"kind": "delayed", "delay": 0.0},
    }
    lost = np.asarray(rf.fly_many("hover-fault", varied, settings=thrown).table["altitude_lost"], dtype=float)
    least = least_height(name, [1], np.arccos(np.cos(roll) * np.cos(pitch)), list(rates))
    assert np.all(lost >= least - 1e-2)
    assert least.max() > 0.03
