"""Rotors that differ, that are tilted, with a slower lag downwards, on a body with products of inertia.

The plant against an integration that shares nothing with it: plain NumPy, adaptive Runge-Kutta of order 8.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from plant_flights import array, fly, numbers_of, plant_of, step, truth_of
from scipy.integrate import solve_ivp

from rotorfault.maths.geometry import PerRotor, Vec3, zeros
from rotorfault.model.motion import lag_bandwidth
from rotorfault.model.signals import Command
from rotorfault.model.tilt import Tilt
from rotorfault.model.vehicle import Reversible, Vehicle, lateral_force, rotor_heights, wrench_of
from rotorfault.model.vehicle_file import load_vehicle
from rotorfault.plant.rotors import lag_step

Array = NDArray[np.float64]
PERIOD = 2e-3  # s
BASE = load_vehicle("f550").vehicle
COUNT = BASE.rotors


def odd_vehicle(seed: int = 3) -> Vehicle:
    """Nothing about it is regular; some of its rotors can turn the other way."""
    rng = np.random.default_rng(seed)

    def each(value: float, spread: float) -> PerRotor:
        return PerRotor(*(value * rng.uniform(1.0 - spread, 1.0 + spread, COUNT)).tolist())

    axes = rng.normal([0.0, 0.0, 1.0], 0.3, (COUNT, 3))
    axes /= np.linalg.norm(axes, axis=1)[:, None]
    x, y, z = (PerRotor(*column.tolist()) for column in axes.T)
    heights = PerRotor(*rng.uniform(-0.05, 0.08, COUNT).tolist())
    return BASE._replace(
        thrust_coefficient=each(BASE.thrust_coefficient, 0.3),
        torque_ratio=each(BASE.torque_ratio, 0.3),
        thrust_min=PerRotor(-4.0, 0.1, 0.0, -4.0, 0.2, 0.0),
        thrust_max=each(BASE.thrust_max, 0.2),
        rotor_bandwidth=each(30.0, 0.4),
        rotor_bandwidth_down=each(15.0, 0.4),
        rotor_gain=each(1.0, 0.1),
        rotor_inertia=2e-4,
        inertia_products=Vec3(0.006, -0.004, 0.003),
        rotor_z=heights,
        tilt=Tilt(x, y, z),
        reversible=Reversible(),
    )


def matrix(moments: Vec3, products: Vec3) -> Array:
    """An inertia matrix."""
    (x, y, z), (xy, xz, yz) = moments, products
    return np.array([[x, xy, xz], [xy, y, yz], [xz, yz, z]])


class Independent:
    """The same vehicle by the book, on arrays."""

    def __init__(self, v: Vehicle) -> None:
        assert isinstance(v.inertia_products, Vec3)
        self.J = matrix(v.inertia, v.inertia_products)
        assert isinstance(v.tilt, Tilt)
        self.axes = np.array([[*v.tilt.x], [*v.tilt.y], [*v.tilt.z]]).T
        self.places = np.array([[*v.rotor_x], [*v.rotor_y], [*rotor_heights(v)]]).T
        self.sign, self.v = np.array([*v.rotor_yaw_sign]), v
        self.b, self.ratio, self.gain, self.up, self.down = (
            np.array([*x])
            for x in (v.thrust_coefficient, v.torque_ratio, v.rotor_gain, v.rotor_bandwidth, v.rotor_bandwidth_down)
        )

    def speeds(self, thrust: Array) -> Array:
        return np.asarray(np.sign(thrust) * np.sqrt(np.abs(thrust) / self.b))

    def momentum(self, state: Array) -> Array:
        """Of body and rotors, body axes."""
        omega, u = state[10:13], state[13:]
        return np.asarray(
            self.J @ omega - self.v.rotor_inertia * (self.sign * self.speeds(self.gain * u)) @ self.axes
        )

    def derivative(self, _: float, state: Array, command: Array) -> Array:
        velocity, q, omega, u = state[3:6], state[6:10], state[10:13], state[13:]
        w, x, y, z = q / np.linalg.norm(q)
        R = np.array([
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ])  # fmt: skip
        u_dot = np.where(command > u, self.up, self.down) * (command - u)
        thrust = self.gain * u
        pull = self.axes * thrust[:, None]
        drag = self.axes * (self.sign * self.ratio * thrust)[:, None]
        torque = (np.cross(self.places, pull) + drag).sum(axis=0)
        # Momentum of the rotors along their axes, against the sense in which their drag turns the body.
        spin = -self.v.rotor_inertia * self.sign * self.speeds(thrust) @ self.axes
        speeding = self.gain * u_dot / (2.0 * self.b * np.abs(self.speeds(thrust)))
        spin_dot = -self.v.rotor_inertia * (self.sign * speeding) @ self.axes
        omega_dot = np.linalg.solve(self.J, torque - spin_dot - np.cross(omega, self.J @ omega + spin))
        push = R @ pull.sum(axis=0) / self.v.mass - [0.0, 0.0, self.v.gravity]
        drift = push - self.v.linear_drag / self.v.mass * velocity
        wx, wy, wz = omega
        turn = 0.5 * np.array([[0, -wx, -wy, -wz], [wx, 0, wz, -wy], [wy, -wz, 0, wx], [wz, wy, -wx, 0]]) @ q
        return np.concatenate([velocity, drift, turn, omega_dot, u_dot])


def commands(steps: int) -> list[PerRotor]:
    """Hard ones, that change every ten periods, and keep each rotor turning the way it does."""
    rng = np.random.default_rng(8)
    drawn = rng.uniform(1.0, 9.0, (steps // 10 + 1, COUNT))
    drawn[:, 0] = -rng.uniform(1.0, 3.5, len(drawn))  # one rotor pulls down
    return [PerRotor(*drawn[k // 10].tolist()) for k in range(steps)]


def flown(vehicle: Vehicle, steps: int, substeps: int) -> Array:
    """State of the plant at the end, in the order of the independent one."""
    plant = plant_of(substeps=substeps)
    parameters = numbers_of(plant, vehicle, PERIOD)
    start = PerRotor(-2.0, 3.0, 4.0, 5.0, 2.0, 3.0)
    state = plant.initial(zeros(), Vec3(1.0, -2.0, 0.5), zeros(), Vec3(2.0, -1.0, 3.0), start, parameters)
    for k, command in enumerate(commands(steps)):
        state = step(plant, state, Command(command, zeros()), k * PERIOD, parameters, PERIOD)
    truth = truth_of(plant, state, steps * PERIOD, parameters)
    return np.concatenate([array(truth.state), array(state.rotors)])


@pytest.fixture(scope="module")
def expected() -> Array:
    vehicle = odd_vehicle()
    independent = Independent(vehicle)
    start = np.array([-2.0, 3.0, 4.0, 5.0, 2.0, 3.0]) / independent.gain
    state = np.concatenate([[0, 0, 0, 1.0, -2.0, 0.5, 1, 0, 0, 0, 2.0, -1.0, 3.0], start])
    low, high = np.array([*vehicle.thrust_min]), np.array([*vehicle.thrust_max])
    for command in commands(100):
        held = np.clip([*command], low, high)
        answer = solve_ivp(
            independent.derivative, (0.0, PERIOD), state, method="DOP853", args=(held,), rtol=1e-12, atol=1e-13
        )
        state = answer.y[:, -1]
    return np.asarray(state)


def test_the_plant_agrees_with_an_independent_integration(expected: Array) -> None:
    off = np.abs(flown(odd_vehicle(), 100, 4) - expected)
    assert off.max() < 2e-7
    assert np.abs(expected[10:13]).max() > 1.0  # it has turned hard


def test_it_is_of_fourth_order_there_too(expected: Array) -> None:
    coarse, fine = (np.abs(flown(odd_vehicle(), 100, n) - expected)[:13].max() for n in (1, 2))
    assert 10.0 < coarse / fine < 24.0


# -------------------------------------------------------------------------------------------------- laws of nature


def test_free_tumbling_keeps_angular_momentum_and_energy_with_any_inertia() -> None:
    products = Vec3(0.006, -0.004, 0.003)
    none = PerRotor.all(0.0, COUNT)
    vehicle = BASE._replace(inertia_products=products, thrust_min=0.0, rotor_inertia=0.0)
    _, truth = fly(plant_of(substeps=4), vehicle, none, 2000, omega=Vec3(6.0, -4.0, 5.0))
    J = matrix(vehicle.inertia, products)
    start, end = np.array([6.0, -4.0, 5.0]), array(truth.state.omega_B)
    R = array(truth.state.q_WB.matrix()).reshape(3, 3)
    np.testing.assert_allclose(R @ J @ end, J @ start, atol=1e-9)
    assert end @ J @ end == pytest.approx(start @ J @ start, rel=1e-9)
    assert np.abs(end - start).max() > 1.0  # it tumbles


def test_rotors_that_speed_up_leave_momentum_as_it_is_along_their_own_axes() -> None:
    """At the centre of mass and without drag torque, thrusts turn nothing: momentum in space stays."""
    none = PerRotor.all(0.0, COUNT)
    vehicle = odd_vehicle()
    assert isinstance(vehicle.tilt, Tilt)
    vehicle = vehicle._replace(rotor_x=none, rotor_y=none, torque_ratio=0.0, rotor_z=none, rotor_inertia=1e-3)
    independent = Independent(vehicle._replace(torque_ratio=none))
    plant = plant_of(substeps=8)
    parameters = numbers_of(plant, vehicle, PERIOD)
    start = PerRotor(-2.0, 3.0, 4.0, 5.0, 2.0, 3.0)
    state = plant.initial(zeros(), zeros(), zeros(), Vec3(1.0, 2.0, -1.0), start, parameters)

    def inside_space(time: float) -> tuple[Array, Array]:
        truth = truth_of(plant, state, time, parameters)
        whole = np.concatenate([array(truth.state), array(state.rotors)])
        return array(truth.state.q_WB.matrix()).reshape(3, 3) @ independent.momentum(whole), whole[10:13]

    (first, turned), largest = inside_space(0.0), 0.0
    for k, command in enumerate(commands(100)):
        state = step(plant, state, Command(command, zeros()), k * PERIOD, parameters, PERIOD)
        now, omega = inside_space((k + 1) * PERIOD)
        np.testing.assert_allclose(now, first, atol=2e-9)
        largest = max(largest, float(np.abs(omega - turned).max()))
    assert largest > 1.0  # rad/s: the body is turned by its rotors


# ------------------------------------------------------------------------------------------------------ one by one


def test_each_rotor_lags_by_its_own_closed_form_up_and_down() -> None:
    up, down = PerRotor(20.0, 30.0, 40.0, 50.0), PerRotor(10.0, 15.0, 60.0, 50.0)
    vehicle = load_vehicle("paper").vehicle._replace(rotor_bandwidth=up, rotor_bandwidth_down=down)
    output, command = PerRotor(1.0, 4.0, 2.0, 3.0), PerRotor(4.0, 1.0, 2.5, 3.0)
    found = lag_step(vehicle, output, command, 0.013).outputs
    for k, rate in enumerate((20.0, 15.0, 40.0, 50.0)):  # rises, falls, rises, stays
        for time, values in zip((0.0, 0.0065, 0.013), found, strict=True):
            exact = command[k] + (output[k] - command[k]) * math.exp(-rate * time)
            assert values[k] == pytest.approx(exact, rel=1e-15)
    assert [*lag_bandwidth(vehicle, output, command)][:3] == [20.0, 15.0, 40.0]


def test_the_same_numbers_for_each_rotor_fly_to_the_last_bit_like_one_for_all() -> None:
    one = load_vehicle("hummingbird").vehicle
    keys = ("thrust_coefficient", "torque_ratio", "thrust_min", "thrust_max", "rotor_bandwidth", "rotor_gain")
    numbers: Any = {key: PerRotor.all(getattr(one, key)) for key in keys}
    each = one._replace(**numbers, rotor_bandwidth_down=PerRotor.all(one.rotor_bandwidth))
    thrust, start = PerRotor(1.0, 2.0, 0.5, 1.5), PerRotor.all(1.2)
    ends = [
        np.concatenate([array(part) for part in fly(plant_of(), v, thrust, 50, start=start)[0]]) for v in (one, each)
    ]
    # The sum of torques is made in another order, so the last bits of it may differ.
    np.testing.assert_allclose(ends[0], ends[1], rtol=1e-13, atol=1e-15)


def test_the_wrench_of_a_tilted_rotor_by_hand() -> None:
    """A rotor 0.2 m ahead and 0.1 m up, leaning by 30 degrees to the left, 2 N."""
    none, half, cosine = PerRotor.all(0.0), 0.5, math.sqrt(0.75)
    vehicle = load_vehicle("hummingbird").vehicle._replace(
        rotor_x=PerRotor(0.2, 0.0, 0.0, 0.0),
        rotor_y=none,
        rotor_yaw_sign=PerRotor(1.0, 1.0, -1.0, -1.0),
        torque_ratio=0.01,
        rotor_z=PerRotor(0.1, 0.0, 0.0, 0.0),
        tilt=Tilt(none, PerRotor(half, 0.0, 0.0, 0.0), PerRotor(cosine, 1.0, 1.0, 1.0)),
        pairs=(),
    )
    wrench = wrench_of(vehicle, PerRotor(2.0, 0.0, 0.0, 0.0))
    assert wrench.thrust == pytest.approx(2.0 * cosine)
    # r x F = (0.2, 0, 0.1) x (0, 1, 1.732) = (-0.1, -0.3464, 0.2); drag torque 0.02 N m along the axis.
    assert [*wrench.torque_B] == pytest.approx([-0.1, -0.2 * 2.0 * cosine + 0.02 * half, 0.2 + 0.02 * cosine])
    assert [*lateral_force(vehicle, PerRotor(2.0, 0.0, 0.0, 0.0))] == [0.0, 1.0, 0.0]
