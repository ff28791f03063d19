"""Thrust near the ground: Cheeseman and Bennett's law, its limits, and what it does to a landing."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from engine_flights import every_engine, run
from gates import needs_simd
from hypothesis import given
from hypothesis import strategies as st
from plant_flights import array, numbers_of, part, plant_of, step, truth_of

import rotorfault as rf
from rotorfault.engine.program import program, same_for_all, trace
from rotorfault.flight.assembly import assemble
from rotorfault.maths.geometry import PerRotor, Vec3, zeros
from rotorfault.maths.rotation import Quat
from rotorfault.model.likeness import alike
from rotorfault.model.signals import Command, State
from rotorfault.model.vehicle import Discs, Vehicle
from rotorfault.model.vehicle_file import load_vehicle
from rotorfault.plant import GROUND
from rotorfault.plant.ground_effect import thrust_near_ground
from rotorfault.scenario.scenario import Scenario, scenario_from

R = 0.1  # m
VEHICLE = load_vehicle("hummingbird").vehicle._replace(discs=Discs(R))
WEIGHT = VEHICLE.mass * VEHICLE.gravity


def near(p: Vec3, attitude: Vec3 | None = None, thrust: PerRotor | None = None) -> np.ndarray:
    state = State(p, zeros(), Quat.from_euler(attitude or zeros()), zeros())
    return array(thrust_near_ground(VEHICLE, thrust or PerRotor.all(1.0), state, 0.0))


@given(st.floats(-0.2, 30.0), st.floats(-0.6, 0.6), st.floats(-0.6, 0.6))
def test_each_rotor_has_the_law_of_its_own_height(z: float, roll: float, pitch: float) -> None:
    """Heights here by turning vectors with NumPy: about y, then about x, as of roll and pitch without yaw."""
    cr, sr, cp, sp = np.cos(roll), np.sin(roll), np.cos(pitch), np.sin(pitch)
    turned = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]]) @ np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
    places = np.array([[*VEHICLE.rotor_x], [*VEHICLE.rotor_y], np.zeros(4)])
    height = np.maximum(z + (turned @ places)[2], R / 2.0)
    wanted = 16.0 * height**2 / (16.0 * height**2 - R**2)
    np.testing.assert_allclose(near(Vec3(0.0, 0.0, z), Vec3(roll, pitch, 0.0)), wanted, rtol=1e-12)


def test_the_published_numbers() -> None:
    """Cheeseman and Bennett: 1.33 at half a radius, 1.07 at one, 1.016 at two, and nothing to speak of at ten."""
    for height, factor in ((0.5, 4.0 / 3.0), (1.0, 16.0 / 15.0), (2.0, 64.0 / 63.0), (10.0, 1.000625)):
        np.testing.assert_allclose(near(Vec3(0.0, 0.0, height * R)), factor, rtol=1e-5)
    assert (near(Vec3(0.0, 0.0, -1.0)) == near(Vec3(0.0, 0.0, 0.5 * R))).all(), "capped below half a radius"


def over_ground(vehicle: Vehicle, height: float, thrust: PerRotor, tilt: Vec3 | None = None) -> Any:
    plant = plant_of(ground=part(GROUND, "level"))
    parameters = numbers_of(plant, vehicle)
    rest = float(parameters.ground.height - parameters.ground.leg)
    state = plant.initial(Vec3(0.0, 0.0, rest + height), zeros(), tilt or zeros(), zeros(), thrust, parameters)
    return plant, parameters, state


def test_it_hovers_near_the_ground_with_less_thrust() -> None:
    height = 0.16
    thrust = PerRotor.all(WEIGHT / 4.0 * (1.0 - (R / (4.0 * height)) ** 2))
    plant, parameters, state = over_ground(VEHICLE, height, thrust)
    start = array(state.body.p_W)
    for k in range(200):
        state = step(plant, state, Command(thrust, zeros()), k * 1e-3, parameters)
    np.testing.assert_allclose(array(state.body.p_W), start, atol=1e-9)
    truth = truth_of(plant, state, 0.2, parameters)
    assert float(truth.thrust.sum()) == pytest.approx(WEIGHT, rel=1e-9)
    assert float(truth.specific_force_B.z) == pytest.approx(VEHICLE.gravity, rel=1e-9)


def test_a_tilted_vehicle_is_turned_level_and_yaw_is_left_alone() -> None:
    thrust = PerRotor.all(WEIGHT / 4.0)
    for tilt in (Vec3(0.2, 0.0, 0.0), Vec3(0.0, -0.2, 0.0)):
        plant, parameters, state = over_ground(VEHICLE, 0.16, thrust, tilt)
        for k in range(20):
            state = step(plant, state, Command(thrust, zeros()), k * 1e-3, parameters)
        rates = array(state.body.omega_B)
        assert rates @ array(tilt) < -1e-3
        assert rates[2] == pytest.approx(0.0, abs=1e-12)


def test_what_an_accelerometer_feels_is_the_change_of_momentum() -> None:
    thrust, h = PerRotor(1.1, 1.2, 1.0, 1.3), 1e-4
    plant, parameters, state = over_ground(VEHICLE, 0.16, thrust, Vec3(0.1, 0.05, 0.0))
    flown = []
    for k in range(12):
        flown.append(state)
        state = step(plant, state, Command(thrust, zeros()), k * h, parameters, h)
    truth = truth_of(plant, flown[10], 10 * h, parameters)
    change = (array(flown[11].body.v_W) - array(flown[9].body.v_W)) / (2.0 * h)
    felt = truth.state.q_WB.matrix() @ truth.specific_force_B + Vec3(0.0, 0.0, -VEHICLE.gravity)
    np.testing.assert_allclose(change, array(felt), atol=1e-5)


def landing(radius: float | None, **settings: Any) -> Scenario:
    """The Hummingbird lands after the paper's faults, on rotors of a radius."""
    tables = rf.load_scenario("land-after-fault-hummingbird").as_tables()["vehicle"]
    if radius is not None:
        tables["rotor_radius"] = {"value": radius, "unit": "m", "source": "test"}
    return rf.load_scenario("land-after-fault-hummingbird", {"vehicle": tables, **settings})


@needs_simd
def test_a_landing_is_softer() -> None:
    flown = [rf.fly(landing(radius)).summary() for radius in (None, R)]
    assert [one["outcome"] for one in flown] == ["landed", "landed"]
    plain, soft = (one["landing"] for one in flown)
    assert soft["speed"] < plain["speed"] - 0.005
    assert soft["touch_down_time"] > plain["touch_down_time"]


@every_engine
def test_engines_agree(engine: str) -> None:
    scenario = landing(R, duration=0.1, **{"start.position": [0.0, 0.0, 0.05], "reference.position": [0, 0, 0.1]})
    wanted = run(scenario, "python").signals
    np.testing.assert_allclose(run(scenario, engine).signals, wanted, rtol=1e-7, atol=1e-7)


def operations(scenario: Scenario) -> int:
    batch = assemble(scenario)
    return program(trace(batch, same_for_all(batch)), 4, False).operations.total()


def test_without_radius_or_ground_it_is_not_there() -> None:
    plain, near_ground = operations(landing(None)), operations(landing(R))
    assert near_ground > plain
    away = {"ground": "", "on_fault": "continue"}
    tables = [landing(radius).as_tables() for radius in (None, R)]
    for one in tables:
        one.pop("ground")
        one["on_fault"] = {"kind": away["on_fault"]}
    one, other = (scenario_from(table, "test") for table in tables)
    assert operations(one) == operations(other)


def test_vehicles_with_and_without_have_one_shape_and_0_is_nothing() -> None:
    """So that they may fly in one batch."""
    plain, other = alike([VEHICLE._replace(discs=()), VEHICLE])
    assert other.discs == Discs(R)
    thrust = PerRotor(1.0, 2.0, -3.0, 0.5)
    for height in (3.0, 0.0, -1.0):
        state = State(Vec3(0.0, 0.0, height), zeros(), Quat.from_euler(zeros()), zeros())
        assert list(thrust_near_ground(plain, thrust, state, 0.0)) == list(thrust)


@needs_simd
def test_a_radius_is_varied_like_any_number() -> None:
    many = rf.fly_many(landing(R, duration=9.0), {"vehicle.rotor_radius.value": [0.05, R, 0.15]}).table
    assert (np.diff(many["landing.speed"]) < 0.0).all()
