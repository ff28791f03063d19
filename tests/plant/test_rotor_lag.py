"""Rotors as fast as you like: their lag is exact over a step, and the body gets the right impulse of them."""

from __future__ import annotations

import copy
import math
from typing import Any

import numpy as np
import pytest
from engine_flights import assert_same, every_engine, run
from plant_flights import MODELS, Array, array, numbers_of, plant_of, step, truth_of
from scipy.integrate import quad

import rotorfault as rf
from rotorfault.maths.geometry import PerRotor, Vec3, zeros
from rotorfault.maths.records import flatten
from rotorfault.model.signals import Command
from rotorfault.model.vehicle import Vehicle
from rotorfault.model.vehicle_file import load_vehicle
from rotorfault.plant.integrator import rk4
from rotorfault.plant.rotors import lag_step, stage_weights
from rotorfault.scenario.overrides import override_all
from rotorfault.scenario.scenario import scenario_from

VEHICLE = load_vehicle("paper").vehicle
PERIOD = 1e-3  # s
SPEEDS = [1e-6, 1e-3, 0.05, 0.3, 0.4999999, 0.5, 1.0, 3.0, 10.0, 1e3, 1e6]  # bandwidth times step
BANDWIDTHS = [1e2, 1e3, 2780.0, 1e4, 1e5]  # rad/s


# ------------------------------------------------------------------------------------------------ what a stage sees


@pytest.mark.parametrize("z", SPEEDS)
def test_the_step_gives_three_integrals_of_the_lag_exactly(z: float) -> None:
    """Velocity, path and the integral of the path that exp(-z s) drives, over a step of length 1."""
    stages = stage_weights(z)
    x, v, a = rk4(lambda chain, g: (chain[1], chain[2], g), (0.0, 0.0, 0.0), stages, 1.0)
    decayed = min(1.0, 40.0 / z)
    for found, power in ((a, 0), (v, 1), (x, 2)):
        expected = quad(lambda s, n=power: (1.0 - s) ** n / math.factorial(n) * math.exp(-z * s), 0.0, decayed)[0]
        assert found == pytest.approx(expected, rel=2e-13, abs=1e-15), power


def test_stages_are_those_of_the_lag_for_slow_rotors_and_fast_ones_are_at_their_command() -> None:
    for z in (1e-2, 5e-3):
        off = np.abs(np.subtract(stage_weights(z), [1.0, math.exp(-0.5 * z), math.exp(-z)]))
        assert 0.01 * z**2 < off.max() < 0.06 * z**2  # of second order, and no better
    assert max(map(abs, stage_weights(1e9))) < 1e-8
    assert all(-0.07 < weight < 1.0 + 1e-12 for z in np.geomspace(1e-9, 1e9, 500) for weight in stage_weights(z))


def test_the_lag_is_exact_however_long_the_step() -> None:
    start, command = PerRotor(1.0, 2.0, 3.0, 4.0), PerRotor(4.0, 3.0, 2.0, 1.0)
    for w in BANDWIDTHS:
        vehicle = VEHICLE._replace(rotor_bandwidth=w)
        whole = lag_step(vehicle, start, command, PERIOD).outputs[-1]
        expected = command + (start - command) * math.exp(-w * PERIOD)
        np.testing.assert_allclose(array(whole), array(expected), rtol=1e-15)
        halves = lag_step(vehicle, start, command, 0.5 * PERIOD).outputs[-1]
        halves = lag_step(vehicle, halves, command, 0.5 * PERIOD).outputs[-1]
        np.testing.assert_allclose(array(halves), array(whole), rtol=1e-14)


# --------------------------------------------------------------------------------------------------- what is flown


def jumping(vehicle: Vehicle, substeps: int, model: str = "rigid_body") -> Array:
    """States of bodies and thrusts, one row for each bandwidth, after hard commands: other ones every period."""
    plant = plant_of(model, substeps=substeps)
    parameters = numbers_of(plant, vehicle, PERIOD)
    state = plant.initial(zeros(), zeros(), Vec3(0.3, -0.2, 0.4), Vec3(0.5, -0.8, 1.0), PerRotor.all(4.0), parameters)
    rng = np.random.default_rng(3)
    for k in range(20):
        command = Command(PerRotor.of(rng.uniform(0.0, vehicle.thrust_max, size=4)), zeros())
        state = step(plant, state, command, k * PERIOD, parameters, PERIOD)
    truth = truth_of(plant, state, 20 * PERIOD, parameters)
    return np.array(flatten((truth.state, truth.thrust))).T


@pytest.mark.parametrize("model", MODELS)
def test_one_step_of_a_period_agrees_with_fine_ones(model: str) -> None:
    """Body rates of several rad/s; what is left is the gyroscopic torque of speeds that change within a step."""
    vehicle = VEHICLE._replace(rotor_bandwidth=np.array(BANDWIDTHS))
    off = np.abs(jumping(vehicle, 1, model) - jumping(vehicle, 32, model))
    assert off.max() < 4e-3
    assert off[:, :6].max() < 1e-5  # m and m/s
    assert off[:, -4:].max() < 1e-13  # thrusts are exact
    still = vehicle._replace(rotor_inertia=0.0)
    off = np.abs(jumping(still, 1, model) - jumping(still, 32, model))
    assert off.max() < 3e-5


def test_the_fourth_order_stays_for_rotors_of_any_speed_that_the_step_resolves() -> None:
    """With at most 0.1 for the product of bandwidth and step."""
    vehicle = VEHICLE._replace(rotor_bandwidth=np.array([50.0, 200.0]))
    fine = jumping(vehicle, 32)
    errors = np.array([np.linalg.norm(jumping(vehicle, n) - fine, axis=1) for n in (2, 4, 8)])
    assert np.all(errors > 1e-12)
    np.testing.assert_allclose(np.log2(errors[:-1] / errors[1:]), 4.0, atol=0.1)


@pytest.mark.parametrize("model", MODELS)
def test_infinitely_fast_rotors_give_what_is_commanded(model: str) -> None:
    """As a flight whose rotors are at every command from its first moment on."""

    def at_once(vehicle: Vehicle) -> Array:
        plant = plant_of(model)
        parameters = numbers_of(plant, vehicle, PERIOD)
        state = plant.initial(zeros(), zeros(), zeros(), Vec3(0.5, -0.8, 1.0), PerRotor.all(4.0), parameters)
        for k, thrust in enumerate((5.0, 3.0, 6.0, 4.0)):
            command = Command(PerRotor(thrust, 4.0, thrust, 4.1), zeros())
            held = state._replace(rotors=command.thrust)
            state = step(plant, held if at_command else state, command, k * PERIOD, parameters, PERIOD)
        return array(truth_of(plant, state, 4 * PERIOD, parameters))

    at_command = True
    expected = at_once(VEHICLE)
    at_command = False
    differences = [np.abs(at_once(VEHICLE._replace(rotor_bandwidth=w)) - expected).max() for w in (1e7, 1e9)]
    assert differences[0] < 1e-2
    assert differences[1] < 1.1e-2 * differences[0]  # of the order of 1 / w


FAST: dict[str, Any] = {
    "name": "fast rotors",
    "vehicle": "hummingbird",
    "duration": 0.4,
    "diagnosis": "off",
    "start": {"position": [0.3, 0.0, 1.0]},
    "reference": {"kind": "set_point", "position": [0.0, 0.0, 1.0]},
    "controller": {"kind": "smc", "preset": "gentle"},
}


@pytest.mark.parametrize("bandwidth", [1000.0, 2780.0, 1e5])
@pytest.mark.parametrize("reaction", [0.0, 1.0])
def test_the_default_step_flies_fast_rotors_as_a_fine_one_does(bandwidth: float, reaction: float) -> None:
    """With a reaction of rotors, yaw follows commands at once, and the loop answers the least of them."""
    fast = {"vehicle.rotor_bandwidth.value": bandwidth, "vehicle.rotor_reaction.value": reaction}
    found, fine = (rf.fly(FAST, settings=fast | more).data["thrust"].values for more in ({}, {"step": 1e-4}))
    assert found.min() >= 0.0
    assert found.max() <= load_vehicle("hummingbird").vehicle.thrust_max
    assert np.ptp(found) > 1.0
    np.testing.assert_allclose(found, fine, atol=1e-2 if reaction else 1e-4)


@every_engine
def test_fast_rotors_fly_the_same_on_all_engines(engine: str) -> None:
    settings = {"vehicle.rotor_bandwidth.value": 2780.0, "duration": 0.1}
    tables = copy.deepcopy(FAST)
    override_all(tables, settings)
    fast = scenario_from(tables, "fast rotors")
    assert_same(run(fast, engine).signals, run(fast, "python").signals)
