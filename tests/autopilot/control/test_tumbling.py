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
from rotorfault.autopilot.control.tumbling import APPROACH, STOPS_WITHIN, without_haste
from rotorfault.maths.geometry import PerRotor, Vec3
from rotorfault.model.signals import Diagnosis, healthy
from rotorfault.model.vehicle import Vehicle
from rotorfault.model.vehicle_file import load_vehicle

rates = st.floats(-30.0, 30.0)
torques = st.floats(-1.0, 1.0)


def mueller() -> Vehicle:
    return load_vehicle("mueller-2014").vehicle


def without(*dead: int) -> Diagnosis:
    loss = PerRotor.of(float(rotor in dead) for rotor in range(1, 5))
    return healthy(4)._replace(loss=loss)


@given(p=rates, q=rates, r=rates, residual=st.floats(-1500.0, 1500.0), tau=st.tuples(torques, torques))
def test_only_what_speeds_up_a_rate_that_cannot_be_braked_is_taken(
    p: float, q: float, r: float, residual: float, tau: tuple[float, float]
) -> None:
    vehicle, omega, torque = mueller(), Vec3(p, q, r), Vec3(*tau, 0.02)
    found = without_haste(torque, omega, vehicle, without(1), residual)
    assert found.z == torque.z
    size = math.hypot(p, q)
    a = np.array([p, q]) / max(size, 1e-9)
    beside = np.array([-a[1], a[0]])
    wanted, kept = np.array(tau), np.array([found.x, found.y])
    # Along the rate: never more, and never more taken than turns an acceleration into none.
    along = wanted @ a
    # The rotors that push against it, one by one, from their places: rotors 2, 3 and 4 at their largest.
    places = {2: (0.0, 0.17), 3: (0.17, 0.0), 4: (-0.17, 0.0)}
    brake = sum(max(0.0, -(y * a[0] - x * a[1])) * 3.8 for x, y in places.values())
    J, Jz, w0 = 0.0032, 0.0055, 66.67
    most = math.sqrt(2.0 * STOPS_WITHIN * brake / J) + STOPS_WITHIN * abs(r) * Jz / J
    allowed = max(most - size, 0.0) * J * APPROACH * w0
    assert (wanted - kept) @ a == pytest.approx(max(along - allowed, 0.0), abs=1e-3)
    # Across it all stays within the bound, and nothing does from twice the bound on.
    across, left = wanted @ beside, kept @ beside
    if size <= most - 1e-3:
        assert left == pytest.approx(across, abs=1e-6)
    if size >= 2.0 * most + 1e-3 and size > 1e-3:
        pace = (size - most) * J * APPROACH * w0
        assert abs(left) == pytest.approx(pace, rel=1e-2, abs=1e-3)
        # The gyroscopic torque of body and rotors, from the cross products.
        momentum = np.array([J * p, J * q, Jz * r + vehicle.rotor_inertia * residual])
        gyroscopic = -np.cross([p, q, r], momentum)[:2] @ beside
        if abs(gyroscopic) > 1e-3:
            assert np.sign(left) == np.sign(gyroscopic)


def test_one_way_is_forbidden_and_the_other_is_not() -> None:
    """Without rotor 1 nothing brakes a roll that rotor 2 has begun; what rotors 3 and 4 turn they stop."""
    vehicle = mueller()
    begun = without_haste(Vec3(0.3, 0.0, 0.0), Vec3(5.0, 0.0, 0.0), vehicle, without(1), 0.0)
    assert begun.x == pytest.approx(0.0, abs=1e-6)
    for sign in (1.0, -1.0):
        turned = without_haste(Vec3(0.0, 0.3 * sign, 0.0), Vec3(0.0, 5.0 * sign, 0.0), vehicle, without(1), 0.0)
        assert turned.y == pytest.approx(0.3 * sign)
    sound = without_haste(Vec3(0.3, 0.0, 0.0), Vec3(5.0, 0.0, 0.0), vehicle, without(), 0.0)
    assert sound.x == pytest.approx(0.3)


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
    assert int(np.sum(survived)) >= 29
