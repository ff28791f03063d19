"""Shear and gust fronts: against plain NumPy and SciPy, in their limits, and on every engine."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from engine_flights import every_engine, run
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from plant_flights import array, fly, plant_of, wind
from scipy.integrate import solve_ivp

import rotorfault as rf
from rotorfault.base.errors import InputError
from rotorfault.engine.taylor import fly_taylor
from rotorfault.flight.assembly import assemble
from rotorfault.maths.geometry import PerRotor, Vec3
from rotorfault.model.aerodynamics import Aerodynamics
from rotorfault.model.block import Context, Nothing
from rotorfault.model.vehicle_file import load_vehicle
from rotorfault.scenario.scenario import Scenario, scenario_from

Array = NDArray[np.float64]
MEAN = (-2.0, 1.0, 0.2)
FRONT = {
    "velocity_W": [1.0, -0.5, 2.5], "length": 0.8, "speed": 6.0, "direction": 0.7, "arrival": 0.1, "shape": "pulse",
}  # fmt: skip
SHEAR = {"law": "log", "reference_height": 5.0, "roughness": 0.05, "ground": -4.0}
AIR = Aerodynamics(
    1.19e-4, 2.32e-4, 3.39e-3, 1e-5, Vec3(5e-3, 5e-3, 1e-2), Vec3(1e-3, 1e-3, 2e-3),
    Vec3(0.0, 0.0, 1e-4),
)  # fmt: skip
HEIGHTS = PerRotor(0.02, 0.02, -0.01, 0.0)
VEHICLE = load_vehicle("hummingbird").vehicle._replace(air=AIR, rotor_z=HEIGHTS, rotor_inertia=0.0)
place = st.floats(-20.0, 20.0)


def blowing(**settings: Any) -> Any:
    return wind("constant", **({"velocity_W": MEAN} | settings))


def air(made: Any, p: Any, time: float) -> Array:
    numbers = made.parameters(Context(VEHICLE, 1e-3))
    return array(made.velocity_at(Vec3(*map(float, p)), time, Nothing(), numbers))


def plain_air(p: Array, time: float, front: dict[str, Any] | None, shear: dict[str, Any] | None) -> Array:
    """The laws once more, in other words: angles, masks and logarithms of NumPy."""
    velocity = np.array(MEAN)
    if shear is not None:
        above = p[2] - shear["ground"]
        if shear["law"] == "log":
            z0 = shear["roughness"]
            velocity = velocity * (
                np.log10(above / z0) / np.log10(shear["reference_height"] / z0) if above > z0 else 0.0
            )
        else:
            velocity = velocity * (max(above, 0.01) / shear["reference_height"]) ** shear["exponent"]
    if front is not None:
        angle = front["direction"]
        phase = np.pi * (front["speed"] * (time - front["arrival"]) - p[0] * np.cos(angle) - p[1] * np.sin(angle))
        phase /= front["length"]
        share = 0.0 if phase < 0.0 else np.sin(phase / 2.0) ** 2
        if phase > np.pi and front["shape"] == "step":
            share = 1.0
        if phase > 2.0 * np.pi:
            share = 0.0 if front["shape"] == "pulse" else 1.0
        velocity = velocity + share * np.array(front["velocity_W"])
    return velocity


@given(st.tuples(place, place, place), st.floats(0.0, 5.0), st.sampled_from(("pulse", "step")))
def test_the_air_is_that_of_the_plain_laws(p: tuple[float, ...], time: float, shape: str) -> None:
    front = FRONT | {"shape": shape, "length": 3.0}
    for shear in (None, SHEAR, SHEAR | {"law": "power", "exponent": 0.2}):
        made = blowing(front=front, **({} if shear is None else {"shear": shear}))
        np.testing.assert_allclose(air(made, p, time), plain_air(np.array(p), time, front, shear), atol=1e-12)


def plain_flight(thrust: Array, v: Array, duration: float) -> Array:
    """Velocity, position, rotation and rates at the end: one ODE for SciPy, which shares no line with the plant."""
    places = np.array([[*VEHICLE.rotor_x], [*VEHICLE.rotor_y], [*HEIGHTS]]).T
    J, mass = np.diag([*VEHICLE.inertia]), VEHICLE.mass
    speeds = np.sqrt(thrust / VEHICLE.thrust_coefficient)
    up = np.array([0.0, 0.0, 1.0])

    def slope(time: float, x: Array) -> Array:
        p, v, R, omega = x[:3], x[3:6], x[6:15].reshape(3, 3), x[15:]
        here = R.T @ (v - plain_air(p, time, FRONT, SHEAR))
        drag = np.diag([*AIR.frame_drag]) @ here * np.linalg.norm(here)
        force = np.sum(thrust) * up - drag - VEHICLE.linear_drag * here
        torque = VEHICLE.torque_ratio * np.dot([*VEHICLE.rotor_yaw_sign], thrust) * up
        torque = torque - [*AIR.damping] * omega - [*AIR.damping_squared] * omega * np.abs(omega)
        for r, f, speed in zip(places, thrust, speeds, strict=True):
            local = R.T @ (v - plain_air(p + R @ r, time, FRONT, SHEAR)) + np.cross(omega, r)
            across = local * [1.0, 1.0, 0.0]
            pull = -speed * (AIR.rotor_drag * across + AIR.inflow * local[2] * up)
            pull = pull + AIR.translational_lift * across @ across * up
            force = force + pull
            torque = torque + np.cross(r, pull + f * up) - AIR.flapping * speed * np.cross(local, up)
        turn = np.array([[0, -omega[2], omega[1]], [omega[2], 0, -omega[0]], [-omega[1], omega[0], 0]])
        v_dot = R @ force / mass - VEHICLE.gravity * up
        omega_dot = np.linalg.solve(J, torque - np.cross(omega, J @ omega))
        return np.concatenate([v, v_dot, (R @ turn).ravel(), omega_dot])

    x = np.concatenate([[0.0, 0.0, 0.0], v, np.eye(3).ravel(), [0.0, 0.0, 0.0]])
    found = solve_ivp(slope, (0.0, duration), x, method="DOP853", rtol=1e-11, atol=1e-12, max_step=0.01)
    return np.asarray(found.y[:, -1])


def test_a_flight_through_a_front_is_that_of_plain_numpy() -> None:
    """The gust acts on each rotor's inflow at its own place: with one for all the rates would differ by much."""
    thrust = np.array([1.26, 1.22, 1.23, 1.24])
    v = np.array([2.0, -1.0, 0.5])
    plant = plant_of(air=blowing(front=FRONT, shear=SHEAR))
    state, _ = fly(plant, VEHICLE, PerRotor(*thrust.tolist()), 400, v=Vec3(*v.tolist()))
    body, wanted = state.body, plain_flight(thrust, v, 0.4)
    found = np.concatenate([*map(array, (body.p_W, body.v_W, body.q_WB.matrix(), body.omega_B))])
    np.testing.assert_allclose(found, wanted, atol=1e-6)
    assert np.abs(wanted[15:]).max() > 0.5, "nothing turned"


def rates_in(front: dict[str, Any], time: float) -> Array:
    still = {"velocity_W": (0.0, 0.0, 0.0)}
    thrust = PerRotor.all(VEHICLE.mass * VEHICLE.gravity / 4.0)
    state, _ = fly(plant_of(air=blowing(front=front, **still)), VEHICLE, thrust, round(time / 1e-3))
    return array(state.body.omega_B)


def test_a_front_lifts_first_what_it_meets_first() -> None:
    """Upwards, and from ahead: the nose goes up (negative pitch), then down; from behind the other way round."""
    front = {"velocity_W": [0.0, 0.0, 3.0], "length": 0.5, "speed": 8.0, "arrival": 0.05, "shape": "pulse"}
    ahead, behind = (rates_in(front | {"direction": angle}, 0.06) for angle in (math.pi, 0.0))
    assert ahead[1] < -0.05
    np.testing.assert_allclose(ahead[1], -behind[1], rtol=1e-3)
    assert rates_in(front | {"direction": math.pi / 2}, 0.06)[0] < -0.05  # from the right: it rises


@pytest.mark.parametrize(
    "nothing",
    [
        {"front": FRONT | {"velocity_W": [0.0, 0.0, 0.0]}},
        {"front": FRONT | {"arrival": 1e3}},
        {"shear": {"law": "power", "exponent": 0.0}},
    ],
    ids=["no gust", "far away", "no exponent"],
)
def test_in_the_limit_it_is_the_steady_wind_to_the_last_bit(nothing: dict[str, Any]) -> None:
    thrust = PerRotor(1.26, 1.22, 1.23, 1.24)
    ends = [
        fly(plant_of(air=blowing(**settings)), VEHICLE, thrust, 200, v=Vec3(1.0, 2.0, 0.0))[0]
        for settings in ({}, nothing)
    ]
    assert array(ends[0]).tolist() == array(ends[1]).tolist()


def test_what_an_accelerometer_feels_is_the_change_of_momentum() -> None:
    """Of all forces that the plant has, in a front and in shear: m dv/dt = m g + R f."""
    front = FRONT | {"arrival": 0.0}
    plant, thrust, h = plant_of(air=blowing(front=front, shear=SHEAR)), PerRotor(1.3, 1.2, 1.25, 1.2), 1e-4
    flown = [fly(plant, VEHICLE, thrust, k, period=h, v=Vec3(2.0, -1.0, 0.5)) for k in (299, 300, 301)]
    before, now, after = (array(state.body.v_W) for state, _ in flown)
    truth = flown[1][1]
    felt = truth.state.q_WB.matrix() @ truth.specific_force_B + Vec3(0.0, 0.0, -VEHICLE.gravity)
    np.testing.assert_allclose((after - before) / (2.0 * h), array(felt), atol=1e-5)
    assert np.linalg.norm(now - before) > 0.0


def in_front(**tables: Any) -> Scenario:
    """A short closed loop in gusts, shear and a front, on a vehicle that feels them at its rotors."""
    settings = {"vehicle": "hummingbird"}
    vehicle = rf.load_scenario("hover-fault", settings).as_tables()["vehicle"]
    vehicle["air"] = {"inflow": {"value": 2.32e-4, "unit": "kg/rad", "source": "test"}}
    front = {"velocity_W": [0.5, 0.0, 2.0], "length": 1.0, "speed": 8.0, "arrival": 0.05}
    return scenario_from(
        {
            "name": "front",
            "vehicle": vehicle,
            "duration": 0.3,
            "period": 0.005,
            "step": 0.0025,
            "start": {"position": [0.0, 0.0, 3.0]},
            "reference": {"kind": "set_point", "position": [0.0, 0.0, 3.0]},
            "controller": {"kind": "roismc", "preset": "gentle"},
            "fault": [{"kind": "step", "rotor": 2, "time": 0.1, "loss": 0.2}],
            "wind": {"kind": "dryden", "velocity_W": [3.0, 1.0, 0.0], "shear": {}, "front": front},
        }
        | tables,
        "test",
    )


@every_engine
def test_engines_agree(engine: str) -> None:
    wanted = run(in_front(), "python").signals
    np.testing.assert_allclose(run(in_front(), engine).signals, wanted, rtol=1e-7, atol=1e-7)
    assert np.ptp(wanted[:, assemble(in_front()).loop.layout.place("wind")], axis=0).max() > 1.0


def test_a_taylor_series_finds_the_same_flight() -> None:
    """With the front all over the vehicle throughout, for at its edges the air is not smooth.

    On a vehicle that feels the air at its centre alone: with four places more the series takes minutes to compile.
    """
    pytest.importorskip("heyoka")
    front = {"velocity_W": [0.5, 0.0, 2.0], "length": 5.0, "speed": 8.0, "arrival": -0.5}
    gusts = {"kind": "constant", "velocity_W": [3.0, 1.0, 0.0], "shear": {}, "front": front}
    tables: dict[str, Any] = {"wind": gusts, "vehicle": "hummingbird"}
    truth = fly_taylor(assemble(in_front(**tables))).signals[:, :3]
    errors = [
        np.abs(run(in_front(**tables, step=step), "python").signals[:, :3] - truth).max() for step in (0.005, 0.0025)
    ]
    assert errors[1] < 1e-7
    assert math.log2(errors[0] / errors[1]) == pytest.approx(4.0, abs=0.5)


def test_the_wind_on_record_is_that_at_the_vehicle() -> None:
    flight = rf.fly(in_front(wind={"kind": "constant", "velocity_W": [3.0, 1.0, 0.0], "shear": {}}), engine="python")
    height = flight.data["position"].sel(axis="z").values
    share = np.log(height / 0.03) / np.log(10.0 / 0.03)
    np.testing.assert_allclose(flight.data["wind"].values, share[:, None] * [3.0, 1.0, 0.0], rtol=1e-12)


@pytest.mark.parametrize(
    ("settings", "told"),
    [
        ({"front": {"length": 0.001}}, "wind.front.length: got 0.001 m, which pass in"),
        ({"shear": {"reference_height": 0.05}}, "wind.shear.reference_height: got 0.05 m; allowed: at least 0.06 m"),
        ({"front": {"direction": 90.0}}, "if 90 degrees were meant, write 1.5708"),
    ],
)
def test_what_cannot_be_flown_is_refused(settings: dict[str, Any], told: str) -> None:
    with pytest.raises(InputError) as refused:
        rf.load_scenario("paper-set-point", {"wind": {"kind": "constant"} | settings})
    assert told in str(refused.value)


def test_it_is_an_axis_like_any_number() -> None:
    many = rf.fly_many(in_front(), {"wind.front.length": [0.5, 1.0], "wind.shear.roughness": [0.03, 0.3]})
    assert len(set(many.table["tilt_max"])) == 2
