"""Contact with the ground: rest, bounces, friction, and nothing while nothing touches."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import rotorfault as rf
from rotorfault.flight.assembly import assemble
from rotorfault.maths.geometry import PerRotor, Vec3, zeros
from rotorfault.model.signals import Command
from rotorfault.model.vehicle import Vehicle
from rotorfault.model.vehicle_file import load_vehicle
from rotorfault.plant import PLANTS, WINDS, Ground, Plant
from rotorfault.plant.plant import PlantState
from rotorfault.scenario.scenario import scenario_from

STILL = Command(PerRotor.all(0.0), zeros())


def fall(vehicle: Vehicle, model: str, steps: int, **start: Vec3) -> tuple[Plant, list[Any]]:
    """A vehicle with rotors at rest above ground at 0; the truth every millisecond."""
    still_air = WINDS["none"](WINDS["none"].Settings())
    plant = Plant(PLANTS[model](), still_air, [], 1, Ground(0.0))
    parameters = plant.parameters(vehicle)
    given = {"p_W": Vec3(0.0, 0.0, 0.05), "v_W": zeros(), "attitude": zeros(), "omega_B": zeros()} | start
    state = plant.initial(*given.values(), PerRotor.all(0.0), parameters)
    seen = []
    for k in range(steps):
        seen.append(plant.observe(state, 0.001 * k, parameters))
        state = plant.step(state, STILL, 0.001 * k, parameters, 0.001)
    return plant, seen


@pytest.mark.parametrize(
    ("name", "model"), [("paper", "paper_model"), ("hummingbird", "rigid_body"), ("crazyflie-2.1", "rigid_body")]
)
def test_it_comes_to_rest_level_with_the_weight_balanced(name: str, model: str) -> None:
    vehicle = load_vehicle(name).vehicle
    start = {"attitude": Vec3(0.12, -0.08, 0.3), "v_W": Vec3(0.3, -0.2, 0.0), "omega_B": Vec3(0.0, 0.0, 0.5)}
    _, seen = fall(vehicle, model, 1500, **start)
    end = seen[-1]
    weight = vehicle.mass * vehicle.gravity
    assert end.ground_force == pytest.approx(weight, rel=1e-3)
    assert end.measurement.p_W.z == pytest.approx(-0.002, abs=1e-5)
    assert end.measurement.v_W.norm() < 1e-3
    assert end.measurement.omega_B.norm() < 1e-2
    assert max(abs(end.measurement.attitude.x), abs(end.measurement.attitude.y)) < 2e-3
    assert all(truth.ground_force >= 0.0 for truth in seen), "the ground never pulls"


@pytest.mark.parametrize("height", [0.05, 0.5])
def test_a_bounce_loses_energy(height: float) -> None:
    """A level fall, drag off: energy, springs' included, never grows, and it leaves at 1/a = 0.25 m/s at most."""
    vehicle = load_vehicle("hummingbird").vehicle._replace(linear_drag=0.0)
    plant, seen = fall(vehicle, "rigid_body", 600, p_W=Vec3(0.0, 0.0, height))
    stiffness = 4.0 * plant.parameters(vehicle).ground.stiffness
    z = np.array([truth.measurement.p_W.z for truth in seen])
    climb = np.array([truth.measurement.v_W.z for truth in seen])
    force = np.array([truth.ground_force for truth in seen])
    hit = int(np.argmax(force > 0.0))
    assert z[hit - 1] >= 0.0 > z[hit]
    assert -climb[hit - 1] == pytest.approx(math.sqrt(2.0 * 9.81 * height), rel=0.02)
    total = vehicle.mass * (0.5 * climb**2 + vehicle.gravity * z) + 0.5 * stiffness * np.minimum(z, 0.0) ** 2
    assert np.diff(total).max() < 1e-5 * total[0]
    assert total[-1] < 0.05 * total[0]
    assert 0.02 < climb[hit:].max() <= 0.25 + 1e-3
    assert (force[z > 0.0] == 0.0).all()


def test_touching_a_steep_wall_of_force_keeps_the_integrator_accurate() -> None:
    """Half the step changes a tilted touch-down by less than a tenth of a millimetre."""
    vehicle = load_vehicle("hummingbird").vehicle
    ends = []
    for substeps in (1, 4):
        plant = Plant(PLANTS["rigid_body"](), WINDS["none"](WINDS["none"].Settings()), [], substeps, Ground(0.0))
        parameters = plant.parameters(vehicle)
        state: PlantState = plant.initial(
            Vec3(0.0, 0.0, 0.04), Vec3(0.1, 0.0, -0.4), Vec3(0.06, 0.15, 0.0), zeros(), PerRotor.all(0.0), parameters
        )
        for k in range(200):
            state = plant.step(state, STILL, 0.001 * k, parameters, 0.001)
        ends.append(plant.observe(state, 0.2, parameters).measurement)
    assert (ends[0].p_W - ends[1].p_W).norm() < 1e-4
    assert (ends[0].attitude - ends[1].attitude).norm() < 1e-3


def test_friction_stops_a_slide_where_coulomb_says() -> None:
    """v^2 / (2 mu g), started at the depth of rest; the smoothed slip lengthens it by little."""
    vehicle = load_vehicle("hummingbird").vehicle._replace(linear_drag=0.0)
    _, seen = fall(vehicle, "rigid_body", 500, p_W=Vec3(0.0, 0.0, -0.002), v_W=Vec3(0.5, 0.0, 0.0))
    assert seen[-1].measurement.p_W.x == pytest.approx(0.25 / (2.0 * 0.6 * 9.81), rel=0.1)


def test_above_the_ground_it_is_as_without() -> None:
    """Not a bit differs while nothing touches, and a flight without ground has no state of it."""
    short = {"duration": 0.3, "on_fault": "continue", "fault.0.time": 0.1, "fault.1.time": 0.1}
    found = [
        rf.fly("land-after-fault", settings={**short, **extra}, engine="python").data
        for extra in ({}, {"ground": -100.0})
    ]
    tables = rf.load_scenario("land-after-fault", short).as_tables()
    del tables["ground"]
    bare = rf.fly(tables, engine="python").data
    for data in found:
        np.testing.assert_array_equal(data["position"], bare["position"])
        np.testing.assert_array_equal(data["thrust_command"], bare["thrust_command"])
    parameters = assemble(scenario_from(tables, "test")).parameters
    assert parameters.plant.ground == parameters.autopilot.response == ()
