"""Vehicles, demands and beliefs that the tests of allocation share."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import strategies as st
from numpy.typing import NDArray

from rotorfault.autopilot.allocation import ALLOCATION, AllocationInputs
from rotorfault.maths.geometry import PerRotor, Vec3
from rotorfault.maths.records import flatten
from rotorfault.model.block import Context
from rotorfault.model.signals import Allocation, Diagnosis, Wrench, healthy
from rotorfault.model.vehicle import Vehicle, wrench_of
from rotorfault.model.vehicle_file import load_vehicle

Array = NDArray[np.float64]
PAPER = load_vehicle("paper").vehicle
PAIRED = ("crazyflie-2.1", "hummingbird", "paper", "paper-arm-0225", "paper-iz-33e-4")  # small, large, slow, strong
VEHICLES = {name: load_vehicle(name).vehicle for name in PAIRED}
# Stretched X with a floor below the thrust, a gain and the other sense of rotation: nothing cancels by luck.
VEHICLES["stretched"] = PAPER._replace(
    rotor_x=PerRotor(0.2, -0.2, -0.15, 0.15),
    rotor_y=PerRotor(-0.25, 0.25, -0.22, 0.22),
    rotor_yaw_sign=PerRotor(-1.0, -1.0, 1.0, 1.0),
    thrust_min=0.4,
    rotor_gain=1.2,
)
each_vehicle = pytest.mark.parametrize("vehicle", VEHICLES.values(), ids=VEHICLES)
each_allocator = pytest.mark.parametrize("name", list(ALLOCATION.registry))


def make(name: str) -> Any:
    kind = ALLOCATION.registry[name]
    return kind(kind.Settings())


def allocate(allocator: Any, vehicle: Vehicle, demand: Wrench, diagnosis: Diagnosis) -> Allocation:
    """What an allocator, or the one of this name, makes of a demand; the last command is no number."""
    made = make(allocator) if isinstance(allocator, str) else allocator
    numbers = made.parameters(Context(vehicle, 1e-3))
    inputs = AllocationInputs(demand, diagnosis, vehicle, PerRotor.all(math.nan))
    found: Allocation
    _, found, _ = made.step(made.initial(inputs, numbers), inputs, numbers, 1e-3)
    return found


def belief(*loss: float) -> Diagnosis:
    """Losses believed, and flagged where they are not 0."""
    return healthy()._replace(
        loss=PerRotor(*loss), flagged=PerRotor(*(0.0 if value == 0.0 else 1.0 for value in loss))
    )


def matrix(vehicle: Vehicle) -> Array:
    """The effectiveness matrix, column by column."""
    return np.array([flatten(wrench_of(vehicle, PerRotor(*row))) for row in np.eye(4)]).T


def wrench(numbers: Any) -> Wrench:
    thrust, *torque = (float(number) for number in numbers)
    return Wrench(thrust, Vec3(*torque))


def demand_of(vehicle: Vehicle, shares: Any) -> Wrench:
    """A demand from rotor thrusts given as shares of the largest one; outside [0, 1] it cannot be met."""
    return wrench_of(vehicle, PerRotor(*shares) * (vehicle.thrust_max * vehicle.rotor_gain))


def commands(allocation: Allocation) -> Array:
    return np.array(list(allocation.command))


wild = st.tuples(*[st.floats(-3.0, 4.0)] * 4)
inside = st.tuples(*[st.floats(0.1, 0.9)] * 4)
losses = st.tuples(*[st.one_of(st.just(0.0), st.just(1.0), st.floats(0.0, 1.0))] * 4)
partial = st.tuples(*[st.floats(0.0, 0.9)] * 4)
