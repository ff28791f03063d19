"""Forces of the air beyond linear drag: against RotorPy, limits, and energy that is never won."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from plant_flights import fly, plant_of

import rotorfault as rf
from rotorfault.maths.geometry import PerRotor, Vec3, zeros
from rotorfault.model.aerodynamics import Aerodynamics, air_wrench, still_air
from rotorfault.model.vehicle import rotor_places
from rotorfault.model.vehicle_file import load_vehicle

VEHICLE = load_vehicle("hummingbird").vehicle._replace(rotor_z=PerRotor.all(0.02))
HUMMINGBIRD = Aerodynamics(
    1.19e-4, 2.32e-4, 3.39e-3, 1e-5, Vec3(0.5e-2, 0.5e-2, 1e-2),
    Vec3(1e-3, 1e-3, 2.75e-3), Vec3(0.0, 0.0, 1e-4),
)  # fmt: skip
number = st.floats(-8.0, 8.0)
speed = st.floats(0.0, 900.0)


def wrench(air: Aerodynamics, speeds: PerRotor, v: Vec3, omega: Vec3) -> tuple[np.ndarray, np.ndarray]:
    found = air_wrench(air, rotor_places(VEHICLE), speeds, v, omega)
    return tuple(np.array([*part], dtype=float) for part in found)  # type: ignore[return-value]


@given(st.tuples(*(number,) * 6, *(speed,) * 4))
def test_it_is_the_wrench_of_rotorpy(x: tuple[float, ...]) -> None:
    """The equations of RotorPy's `Multirotor.compute_body_wrench`, in NumPy's words; damping is not in them."""
    v, omega, speeds = np.array(x[:3]), np.array(x[3:6]), np.array(x[6:])
    air = HUMMINGBIRD._replace(damping=zeros(), damping_squared=zeros())
    places = np.array([[*place] for place in rotor_places(VEHICLE)]).T
    local = v[:, None] + np.cross(omega, places.T).T
    pull = -speeds * (np.diag([air.rotor_drag, air.rotor_drag, air.inflow]) @ local)
    pull[2] += air.translational_lift * (local[0] ** 2 + local[1] ** 2)
    flap = -air.flapping * speeds * np.cross(local.T, [0.0, 0.0, 1.0]).T
    force = pull.sum(axis=1) - np.linalg.norm(v) * np.diag([*air.frame_drag]) @ v
    torque = np.cross(places.T, pull.T).sum(axis=0) + flap.sum(axis=1)
    got = wrench(air, PerRotor.of(speeds.tolist()), Vec3(*v.tolist()), Vec3(*omega.tolist()))
    np.testing.assert_allclose(got[0], force, atol=1e-12)
    np.testing.assert_allclose(got[1], torque, atol=1e-12)


@given(st.tuples(*(number,) * 6, *(speed,) * 4))
def test_drag_and_damping_never_give_energy(x: tuple[float, ...]) -> None:
    """Lift across the axis and the moment of the blades are paid by the motors; they are left out."""
    v, omega = Vec3(*x[:3]), Vec3(*x[3:6])
    air = HUMMINGBIRD._replace(translational_lift=0.0, flapping=0.0)
    force, torque = wrench(air, PerRotor(*x[6:]), v, omega)
    assert force @ np.array(x[:3]) + torque @ np.array(x[3:6]) <= 1e-12


def test_nothing_is_nothing() -> None:
    force, torque = wrench(still_air(), PerRotor.all(500.0, 4), Vec3(3.0, -2.0, 1.0), Vec3(1.0, 2.0, 3.0))
    assert not force.any()
    assert not torque.any()


def test_a_spinning_body_is_damped_to_where_torque_and_damping_balance() -> None:
    """tau = gamma r (Mueller and D'Andrea 2014): here with a yaw torque that two rotors leave over."""
    gamma = 2.75e-3
    air = still_air()._replace(damping=Vec3(0.0, 0.0, gamma))
    vehicle = VEHICLE._replace(air=air, rotor_reaction=0.0)
    weight = vehicle.mass * vehicle.gravity
    thrust = PerRotor(0.26 * weight, 0.26 * weight, 0.24 * weight, 0.24 * weight)
    state, _ = fly(plant_of(), vehicle, thrust, 6_000, start=thrust)
    spin = vehicle.torque_ratio * 0.04 * weight / gamma
    settled = 1.0 - math.exp(-6.0 * gamma / vehicle.inertia.z)
    assert float(state.body.omega_B.z) == pytest.approx(spin * settled, rel=1e-3)


def with_air(**coefficients: tuple[float, str]) -> dict[str, Any]:
    tables = rf.load_scenario("hover-fault", {"vehicle": "hummingbird"}).as_tables()["vehicle"]
    tables["air"] = {key: {"value": v, "unit": unit, "source": "test"} for key, (v, unit) in coefficients.items()}
    return tables


def test_a_file_has_it_and_engines_agree() -> None:
    vehicle = with_air(rotor_drag=(1.19e-4, "kg/rad"), damping_yaw=(2.75e-3, "N m s"), flapping=(1e-5, "kg m/rad"))
    settings = {"vehicle": vehicle, "duration": 0.1, "wind": {"kind": "constant", "velocity_W": [5.0, 1.0, 0.0]}}
    flights = [rf.fly("hover-fault", settings=settings, engine=engine) for engine in ("python", "numpy")]
    for name in ("position", "body_rates", "specific_force"):
        one, other = (flight.data[name].values for flight in flights)
        np.testing.assert_allclose(one, other, atol=1e-12)
    plain = rf.fly("hover-fault", settings={**settings, "vehicle": "hummingbird"}, engine="python")
    assert np.abs(plain.data["velocity"].values - flights[0].data["velocity"].values).max() > 1e-3


def test_zero_costs_nothing() -> None:
    from rotorfault.engine.program import program, same_for_all, trace
    from rotorfault.flight.assembly import assemble

    counts = []
    for vehicle in ("hummingbird", with_air(rotor_drag=(0.0, "kg/rad"))):
        batch = assemble(rf.load_scenario("hover-fault", {"vehicle": vehicle}))
        found = program(trace(batch, same_for_all(batch)), 4, False).operations
        counts.append({sort: found[sort] for sort in ("fmul", "fma", "fadd", "sqrt", "fdiv")})
    assert counts[0] == counts[1]


def test_a_batch_of_vehicles_with_and_without() -> None:
    scenario = rf.load_scenario("hover-fault", {"vehicle": with_air(damping_yaw=(1e-3, "N m s")), "duration": 0.1})
    many = rf.fly_many(scenario, {"vehicle.air.damping_yaw.value": [0.0, 1e-3, 2e-3]}, engine="numpy")
    assert many.table["survived"].all()
