"""RotorPy's Hummingbird with its full aerodynamics: in RotorPy and here, by the same commands and one autopilot."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rotorfault.base.errors import InputError
from rotorfault.bench.rotorpy_plant import (
    Apart,
    busy_commands,
    closed_loop,
    flight,
    hummingbird,
    moving_start,
    open_loop,
)
from rotorfault.model.vehicle_file import VehicleFile

pytest.importorskip("rotorpy")
PERIOD, STEPS = 0.01, 100  # a second


@pytest.fixture(scope="module")
def vehicle() -> VehicleFile:
    return hummingbird()


def second(vehicle: VehicleFile, step: float, seed: int = 0, **tables: object) -> Apart:
    scenario = flight(vehicle, **({"fault": [], "period": PERIOD, "step": step} | tables))
    return open_loop(scenario, busy_commands(vehicle, STEPS, PERIOD, seed), moving_start(seed))


def test_the_same_commands_give_the_same_flight_within_a_micrometre(vehicle: VehicleFile) -> None:
    """And what is left falls with the fourth power of our step: nothing but the integrator differs."""
    coarse, fine = second(vehicle, 0.002), second(vehicle, 0.001)
    assert max(fine) < 1e-7
    assert fine.position < 1e-8
    assert math.log2(coarse.position / fine.position) == pytest.approx(4.0, abs=0.3)


def test_so_do_they_with_a_loss(vehicle: VehicleFile) -> None:
    fault = [{"kind": "step", "rotor": 2, "time": 0.3, "loss": 0.2}]
    assert second(vehicle, 0.001, 1, fault=fault).position < 1e-7


def test_it_would_be_told_if_a_coefficient_were_another(vehicle: VehicleFile) -> None:
    """A hundredth of the rotors' drag is thousands of times what the simulators differ by."""
    assert vehicle.air is not None
    air = vehicle.air.model_copy(
        update={"rotor_drag": vehicle.air.rotor_drag.model_copy(update={"value": 1.01 * 1.19e-4})}
    )
    assert second(vehicle.model_copy(update={"air": air}), 0.001).position > 1e-4


def test_one_autopilot_flies_both_alike_through_a_fault(vehicle: VehicleFile) -> None:
    """Controller, observer and allocation command RotorPy step by step; belief and commands are the same too."""
    scenario = flight(
        vehicle, duration=0.6, period=0.005, fault=[{"kind": "step", "rotor": 1, "time": 0.2, "loss": 0.3}]
    )
    apart, flown = closed_loop(scenario)
    assert apart.position < 1e-6
    assert apart.command < 1e-4
    assert apart.loss < 1e-5
    assert np.isfinite(flown.signals).all()


def test_what_rotorpy_cannot_fly_is_refused(vehicle: VehicleFile) -> None:
    with pytest.raises(InputError, match="allowed: plant 'rigid_body', and no ground"):
        closed_loop(flight(vehicle, ground=0.0))
