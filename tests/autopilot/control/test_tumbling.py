"""What a tumbling body must not be asked for, against the rotors one by one, and flights that are thrown."""

from __future__ import annotations

import math

import numpy as np
import pytest
from gates import needs_simd
from hypothesis import given
from hypothesis import strategies as st

import rotorfault as rf
from rotorfault.autopilot.control.lean import lean_in_balance
from rotorfault.autopilot.control.tumbling import Tumble, time_of_lasting, without_haste
from rotorfault.maths.geometry import PerRotor, Vec3
from rotorfault.model.signals import Diagnosis, healthy
from rotorfault.model.vehicle import Vehicle
from rotorfault.model.vehicle_file import load_vehicle

rates = st.floats(-30.0, 30.0)
torques = st.floats(-1.0, 1.0)
UPRIGHT, STILL = Vec3(0.0, 0.0, 1.0), Vec3(0.0, 0.0, 0.0)


def mueller() -> Vehicle:
    return load_vehicle("mueller-2014").vehicle


def without(*dead: int) -> Diagnosis:
    loss = PerRotor.of(float(rotor in dead) for rotor in range(1, 5))
    return healthy(4)._replace(loss=loss)


def tumble(
    omega: Vec3, up: Vec3 = UPRIGHT, given_B: Vec3 = STILL, spins_up: float = 0.1, residual: float = 0.0
) -> Tumble:
    return Tumble(omega, up, given_B, spins_up, residual)


@given(spin=st.floats(-30.0, 30.0), torque=st.floats(1e-3, 0.5), residual=st.floats(-1500.0, 1500.0))
def test_what_may_last_is_the_least_that_waiting_and_nutation_make_together(
    spin: float, torque: float, residual: float
) -> None:
    """Against all waiting times, one by one; the spin counts in the sense in which the rotors drive it."""
    vehicle = mueller()
    J, Jz = 0.0032, 0.0055
    has = Jz * spin + vehicle.rotor_inertia * residual
    wait = np.linspace(0.0, 300.0, 400_001)
    momentum = has + torque * wait
    angle = np.where(momentum > 0.0, wait + J / np.where(momentum > 0.0, momentum, 1.0), np.inf)
    found = time_of_lasting(tumble(Vec3(0.0, 0.0, spin), spins_up=torque, residual=residual), vehicle)
    assert found == pytest.approx(angle.min(), rel=1e-2)
    mirrored = tumble(Vec3(0.0, 0.0, -spin), spins_up=-torque, residual=-residual)
    assert time_of_lasting(mirrored, vehicle) == pytest.approx(found)


@given(p=rates, q=rates, r=st.floats(-60.0, 60.0), tau=st.tuples(torques, torques))
def test_yaw_is_left_alone_and_a_sound_body_is_not_held_back(
    p: float, q: float, r: float, tau: tuple[float, float]
) -> None:
    vehicle, torque = mueller(), Vec3(*tau, 0.02)
    found = without_haste(torque, tumble(Vec3(p, q, r)), vehicle, without(1))
    assert found.z == torque.z
    assert np.isfinite([found.x, found.y]).all()
    slow = tumble(Vec3(0.1 * p, 0.1 * q, 0.1 * r))
    sound = without_haste(torque, slow, vehicle, without())
    assert (sound.x, sound.y) == pytest.approx(tau, abs=1e-9)


def test_one_way_is_forbidden_and_the_other_is_not() -> None:
    """Without rotor 1 nothing brakes a roll that rotor 2 has begun; what rotors 3 and 4 turn they stop."""
    vehicle = mueller()
    begun = without_haste(Vec3(0.3, 0.0, 0.0), tumble(Vec3(5.0, 0.0, 0.0)), vehicle, without(1))
    assert begun.x == pytest.approx(0.0, abs=1e-6)
    for sign in (1.0, -1.0):
        turned = without_haste(Vec3(0.0, 0.3 * sign, 0.0), tumble(Vec3(0.0, 5.0 * sign, 0.0)), vehicle, without(1))
        assert turned.y == pytest.approx(0.3 * sign)
    sound = without_haste(Vec3(0.3, 0.0, 0.0), tumble(Vec3(5.0, 0.0, 0.0)), vehicle, without())
    assert sound.x == pytest.approx(0.3)


@pytest.mark.parametrize("spin", [-4.0, 2.0])
@pytest.mark.parametrize("residual", [0.0, -1000.0])
def test_a_rate_that_no_rotor_brakes_is_given_to_the_gyroscopic_torque(spin: float, residual: float) -> None:
    """What is asked for across it turns the body so that the cross products, written anew, take the rate back."""
    vehicle, omega = mueller(), Vec3(9.0, 0.0, spin)
    found = without_haste(Vec3(0.0, 0.0, 0.0), tumble(omega, residual=residual), vehicle, without(1))
    momentum = np.array([0.0, 0.0032 * found.y, 0.0055 * spin + vehicle.rotor_inertia * residual])
    gyroscopic = -np.cross([0.0, found.y, spin], momentum)
    assert abs(found.y) > 0.1
    assert gyroscopic[0] < 0.0


def test_the_axis_of_balance_passes_through_body_z() -> None:
    """While the body spins up, its stiffness changes sign; the axis must not jump from one side to the other."""
    vehicle, most = mueller(), 0.36
    tau, residual = Vec3(0.08, 0.0, 0.0), -1100.0
    spins = np.linspace(0.5, 30.0, 4000)
    found = np.array([float(lean_in_balance(vehicle, tau, r, residual, most).y) for r in spins])
    free = np.array([float(lean_in_balance(vehicle, tau, r, residual).y) for r in spins])
    assert np.abs(free).max() > 10.0  # what it would be
    assert np.abs(found).max() <= most * 1.001
    assert found.min() < -0.03
    assert found.max() > 0.3
    assert np.abs(np.diff(found)).max() < 0.01
    bound = np.abs(free) < 0.9 * most
    np.testing.assert_allclose(found[bound], free[bound], rtol=1e-6)


@needs_simd
@pytest.mark.filterwarnings("ignore")
def test_thrown_without_a_rotor_it_comes_back() -> None:
    """Any attitude alike, up to 10 rad/s about each axis, 10 m: 28 of 32 before hasty torque was taken back."""
    draw, count = np.random.default_rng(7), 32
    varied = {
        "seed": np.arange(count),
        "start.attitude.0": draw.uniform(-math.pi, math.pi, count),
        "start.attitude.1": np.arcsin(draw.uniform(-1.0, 1.0, count)),
        "start.attitude.2": draw.uniform(-math.pi, math.pi, count),
        **{f"start.body_rates.{axis}": draw.uniform(-10.0, 10.0, count) for axis in range(3)},
    }
    thrown = {
        "vehicle": "mueller-2014",
        "controller.preset": "hummingbird",
        "duration": 4.0,
        "start.position": [0.0, 0.0, 10.0],
        "reference.position": [0.0, 0.0, 10.0],
        "fault": [{"kind": "total", "rotor": 1, "time": 0.0}],
        "diagnosis": {"kind": "delayed", "delay": 0.0},
    }
    survived = rf.fly_many("hover-fault", varied, settings=thrown).table["survived"]
    assert int(np.sum(survived)) >= 31
