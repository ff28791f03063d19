"""Speeding up a rotor turns the body the other way: only torques from outside change what both have together."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from engine_flights import assert_same, every_engine, run
from gates import needs_simd
from plant_flights import MODELS, T, array, fault, numbers_of, plant_of, step, truth_of

import rotorfault as rf
from rotorfault.base.config import parse_toml, validate
from rotorfault.maths.geometry import PerRotor, Vec3, zeros
from rotorfault.model.motion import lag_held
from rotorfault.model.signals import Command, Wrench
from rotorfault.model.vehicle import residual_speed, rotor_momentum, rotor_speeds, wrench_of
from rotorfault.model.vehicle_file import VehicleFile, load_vehicle, new_vehicle, vehicle_names
from rotorfault.scenario.scenario import scenario_from

VEHICLE = load_vehicle("hummingbird").vehicle
HOVER = VEHICLE.mass * VEHICLE.gravity / 4.0


def momentum(vehicle: Any, truth: Any) -> float:
    """Of body and rotors about body z."""
    return float(
        vehicle.inertia.z * truth.state.omega_B.z
        + rotor_momentum(vehicle, residual_speed(vehicle, truth.rotor_speed))
    )


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("bandwidth", [20.0, 3000.0])
def test_a_yaw_doublet_changes_momentum_by_the_drag_torque_alone(model: str, bandwidth: float) -> None:
    vehicle = VEHICLE._replace(rotor_bandwidth=bandwidth)
    plant = plant_of(model)
    parameters = numbers_of(plant, vehicle)
    state = plant.initial(zeros(), zeros(), zeros(), zeros(), PerRotor.all(HOVER), parameters)
    gained, largest, before = 0.0, 0.0, momentum(vehicle, truth_of(plant, state, 0.0, parameters))
    for k in range(300):
        more = 0.6 if k < 100 else -HOVER if k < 200 else 0.0  # down to standing rotors
        command = PerRotor(HOVER + more, HOVER + more, HOVER - more, HOVER - more)
        command = plant.limited(Command(command, zeros()), parameters).thrust
        mean = PerRotor.of(lag_held(v, u, bandwidth, T)[1] for v, u in zip(state.rotors, command, strict=True))
        gained += wrench_of(vehicle, mean).torque_B.z * T
        state = step(plant, state, Command(command, zeros()), k * T, parameters)
        truth = truth_of(plant, state, (k + 1) * T, parameters)
        assert momentum(vehicle, truth) - before == pytest.approx(gained, abs=1e-14)
        largest = max(largest, abs(vehicle.inertia.z * truth.state.omega_B.z - gained))
    assert largest > 1e-3  # N m s: most of what turns the body is the reaction


def test_momentum_is_kept_in_space_while_it_tumbles_and_rotors_change() -> None:
    """All rotors at the centre without drag torque: nothing acts from outside. What is left falls with the step."""
    still = PerRotor.all(0.0)
    vehicle = VEHICLE._replace(rotor_x=still, rotor_y=still, torque_ratio=0.0)

    def drift(substeps: int) -> float:
        plant = plant_of(substeps=substeps)
        parameters = numbers_of(plant, vehicle, 0.01)
        state = plant.initial(zeros(), zeros(), zeros(), Vec3(2.0, -3.0, 1.0), PerRotor.all(HOVER), parameters)

        def total(time: float) -> Any:
            truth = truth_of(plant, state, time, parameters)
            inside = vehicle.inertia.times(truth.state.omega_B)
            inside = inside + Vec3(0.0, 0.0, rotor_momentum(vehicle, residual_speed(vehicle, truth.rotor_speed)))
            return array(truth.state.q_WB.matrix() @ inside)

        first = total(0.0)
        for k in range(50):
            more = 0.8 * np.sin(0.3 * k)
            command = Command(PerRotor(HOVER + more, HOVER, HOVER - more, HOVER - 0.5 * more), zeros())
            state = step(plant, state, command, k * 0.01, parameters, 0.01)
        assert abs(truth_of(plant, state, 0.5, parameters).state.omega_B.z - 1.0) > 0.1
        return float(np.linalg.norm(total(0.5) - first))

    coarse, fine = drift(2), drift(4)
    assert fine < 1e-9
    assert fine < coarse / 12.0


def test_without_the_reaction_a_rotor_turns_the_body_by_its_drag_alone() -> None:
    ends = {}
    for share in (0.0, 1.0):
        vehicle = VEHICLE._replace(rotor_reaction=share)
        plant = plant_of()
        parameters = numbers_of(plant, vehicle)
        state = plant.initial(zeros(), zeros(), zeros(), zeros(), PerRotor.all(HOVER), parameters)
        command = PerRotor(HOVER + 0.5, HOVER + 0.5, HOVER - 0.5, HOVER - 0.5)
        state = step(plant, state, Command(command, zeros()), 0.0, parameters)
        ends[share] = truth_of(plant, state, T, parameters).state.omega_B.z
        mean = PerRotor.of(lag_held(HOVER, u, vehicle.rotor_bandwidth, T)[1] for u in command)
    assert ends[0.0] == pytest.approx(wrench_of(VEHICLE, mean).torque_B.z * T / VEHICLE.inertia.z, rel=1e-9)
    assert ends[1.0] > 20.0 * ends[0.0]  # the same way, at first by far the most


def test_the_jump_of_a_rotor_that_gets_stuck_turns_nothing_and_it_reacts_no_more() -> None:
    plant = plant_of(faults=[fault("stuck", rotor=1, time=0.01, thrust=0.0)])
    parameters = numbers_of(plant, VEHICLE)
    state = plant.initial(zeros(), zeros(), zeros(), zeros(), PerRotor.all(HOVER), parameters)
    rates = []
    for k in range(30):
        rates.append(truth_of(plant, state, k * T, parameters).state.omega_B.z)
        more = 0.5 if k >= 20 else 0.0
        state = step(plant, state, Command(PerRotor(HOVER + more, HOVER, HOVER, HOVER), zeros()), k * T, parameters)
    turns = np.diff(rates)
    drag = VEHICLE.torque_ratio * HOVER / VEHICLE.inertia.z * T
    np.testing.assert_allclose(turns[:10], 0.0, atol=1e-14)
    np.testing.assert_allclose(turns[10:], -drag, rtol=1e-3)


def test_a_reversed_rotor_turns_the_other_way_with_all_that_comes_of_it() -> None:
    thrust = PerRotor(1.2, -1.2, 0.0, -0.3)
    speeds = array(rotor_speeds(VEHICLE, thrust))
    np.testing.assert_allclose(speeds * np.abs(speeds) * VEHICLE.thrust_coefficient, array(thrust), rtol=1e-12)
    assert residual_speed(VEHICLE, rotor_speeds(VEHICLE, PerRotor(1.2, -1.2, 0.7, -0.7))) == 0.0
    reversed_ = wrench_of(VEHICLE, PerRotor(-1.2, 0.0, 0.0, 0.0)).torque_B.z
    assert reversed_ == -wrench_of(VEHICLE, PerRotor(1.2, 0.0, 0.0, 0.0)).torque_B.z


# ---------------------------------------------------------------------------------------- what is believed, and flown


class Doublet:
    """Yaw to and fro."""

    def update(self, time: float, measurement: Any, reference: Any, vehicle: Any) -> Wrench:
        yaw = 0.005 if 0.2 < time < 0.3 else -0.005 if 0.3 < time < 0.4 else 0.0
        return Wrench(vehicle.mass * vehicle.gravity, Vec3(0.0, 0.0, yaw))


DOUBLET: dict[str, Any] = {
    "name": "doublet", "vehicle": "hummingbird", "duration": 0.6, "diagnosis": "luenberger",
    "reference": {"kind": "set_point", "position": [0.0, 0.0, 0.0]},
}  # fmt: skip


def test_the_observer_takes_the_reaction_for_what_it_is() -> None:
    flight = rf.fly(DOUBLET, controller=Doublet())
    assert np.abs(flight.data["body_rates"].values[:, 2]).max() > 0.1
    assert np.abs(flight.data["thrust_residual"].values).max() < 1e-3


@every_engine
def test_all_engines_fly_it_alike(engine: str) -> None:
    tables = {k: v for k, v in DOUBLET.items() if k != "name"} | {"duration": 0.2, "plant": "rigid_body"}
    turning = {
        "reference": {"kind": "set_point", "position": [0.2, 0.0, 0.1]},
        "start": {"attitude": [0.0, 0.1, 0.5]},
    }
    flight = scenario_from(
        {"name": "turn", **tables, **turning, "controller": {"kind": "smc", "preset": "gentle"}}, "test"
    )
    assert_same(run(flight, engine).signals, run(flight, "python").signals)


@needs_simd
def test_it_varies_between_the_flights_of_a_batch() -> None:
    settings = {"start.attitude": [0.0, 0.0, 0.5], "controller.kind": "smc", "controller.preset": "gentle"}
    shares = [0.0, 1.0]
    many = rf.fly_many(DOUBLET, {"vehicle.rotor_reaction.value": shares}, settings=settings).table
    costs = [
        rf.fly(DOUBLET, settings=settings | {"vehicle.rotor_reaction.value": r}).summary()["cost"] for r in shares
    ]
    np.testing.assert_allclose(np.array(many["cost"]), costs, rtol=1e-12)
    assert costs[0] != costs[1]


def test_vehicles_have_it_unless_they_say_otherwise() -> None:
    on = {name for name in vehicle_names() if load_vehicle(name).vehicle.rotor_reaction == 1.0}
    off = {name for name in vehicle_names() if load_vehicle(name).vehicle.rotor_reaction == 0.0}
    assert off == {"paper", "paper-arm-0225", "paper-iz-33e-4"}
    assert on | off == set(vehicle_names())
    tables = parse_toml(new_vehicle("mine"), "mine")
    del tables["rotor_reaction"]
    assert validate(VehicleFile, tables, "mine").vehicle.rotor_reaction == 1.0
    for wrong in (-0.1, 1.1):
        with pytest.raises(rf.InputError, match=rf"rotor_reaction\.value: got {wrong} 1; allowed: 0 "):
            rf.fly(DOUBLET, settings={"vehicle.rotor_reaction.value": wrong})
