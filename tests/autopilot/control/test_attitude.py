"""Tracking on SO(3): error, rates and accelerations of the wanted frame, against SciPy and against differences."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from cascade_step import Array, arr, attitudes, cascade, control_inputs, estimate
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from rotorfault.autopilot.control.attitude import TRACKINGS, AttitudeReference, Wanted
from rotorfault.autopilot.control.sdre import gyroscopic_drift
from rotorfault.maths.geometry import Vec3, zeros
from rotorfault.maths.rotation import Quat
from rotorfault.model.block import Context
from rotorfault.model.motion import angular_acceleration
from rotorfault.model.signals import Estimate, Reference
from rotorfault.model.vehicle_file import load_vehicle

SO3 = TRACKINGS["so3"]
BANDWIDTH, DT = 25.0, 1e-3
small = st.floats(-0.8, 0.8)
rate = st.floats(-5.0, 5.0)
states = st.builds(
    AttitudeReference, st.builds(Vec3, small, small, st.floats(-3.0, 3.0)), st.builds(Vec3, rate, rate, rate)
)


def wanted_at(
    state: AttitudeReference, q_WB: Quat, omega_B: Vec3 | None = None, reference: Reference | None = None
) -> Wanted:
    """What is tracked; by default towards level, at yaw 0."""
    seen = Estimate(zeros(), zeros(), q_WB, omega_B or zeros())
    wanted = reference or Reference(zeros(), zeros(), zeros(), 0.0, 0.0, 0.0)
    return SO3.track(state, seen, q_WB.matrix(), Vec3(0.0, 0.0, 9.81), wanted, BANDWIDTH, DT)


def axis_of(n: Array) -> Array:
    """The thrust axis whose tilt coordinates are n: stereographic projection from below."""
    half = n[:2] / 2.0
    return np.array([*(2.0 * half), 1.0 - half @ half]) / (1.0 + half @ half)


def rotation(q_WB: Quat) -> Rotation:
    return Rotation.from_quat(np.array([float(x) for x in q_WB]), scalar_first=True)


def frame(n: Array, q_WB: Rotation) -> Rotation:
    """The attitude turned the shortest way onto the wanted thrust axis."""
    is_, shall = q_WB.apply([0.0, 0.0, 1.0]), axis_of(n)
    axis = np.cross(is_, shall)
    sine = float(np.linalg.norm(axis))
    turn = math.atan2(sine, float(is_ @ shall))
    return Rotation.from_rotvec(axis * (turn / sine if sine > 0.0 else 1.0)) * q_WB


@given(state=states, attitude=attitudes)
def test_the_error_is_the_shortest_turn_and_the_heading_left(state: AttitudeReference, attitude: Vec3) -> None:
    q_WB = Quat.from_euler(attitude)
    found, body = wanted_at(state, q_WB), rotation(q_WB)
    target = frame(arr(state.attitude), body)
    tilt = (target.inv() * body).as_rotvec()
    np.testing.assert_allclose(arr(found.e)[:2], tilt[:2], atol=1e-9)
    heading = target.as_euler("ZYX")[0] - float(state.attitude.z)
    assert math.remainder(float(found.e.z) - heading, 2.0 * math.pi) == pytest.approx(0.0, abs=1e-9)


@given(n=st.tuples(small, small), yaw=st.floats(-3.0, 3.0), off=st.floats(-3.0, 3.0))
def test_a_heading_that_is_off_costs_the_thrust_axis_nothing(n: tuple[float, float], yaw: float, off: float) -> None:
    body = frame(np.array(n), Rotation.from_euler("Z", yaw + off))
    found = wanted_at(AttitudeReference(Vec3(*n, yaw), zeros()), Quat(*body.as_quat(scalar_first=True)))
    np.testing.assert_allclose(arr(found.e)[:2], 0.0, atol=1e-9)


@pytest.mark.parametrize("attitude", [(math.pi, 0.0, 0.3), (0.0, math.pi / 2.0, 0.0), (2.0, -1.0, 1.0)])
def test_every_attitude_has_a_finite_error(attitude: tuple[float, float, float]) -> None:
    q_WB = Quat.from_euler(Vec3(*attitude))
    found = wanted_at(SO3.start(q_WB, 1.0), q_WB)
    assert all(np.isfinite([*arr(found.e), *arr(found.rate), *arr(found.acceleration)]))
    upside_down = wanted_at(AttitudeReference(zeros(), zeros()), q_WB)
    assert all(np.isfinite([*arr(upside_down.e), *arr(upside_down.rate), *arr(upside_down.acceleration)]))


def test_the_command_of_a_body_upside_down_begins_at_the_largest_tilt_that_way() -> None:
    most = math.tan(0.7)
    for tilt in (2.0, 3.0, math.pi):
        q_WB = Quat.from_euler(Vec3(tilt, 0.0, 0.4))
        n = arr(SO3.start(q_WB, most).attitude)[:2]
        assert 2.0 * math.atan(0.5 * math.hypot(*n)) <= 0.7 + 1e-9
        if tilt < math.pi:  # hanging straight down it has no side
            axis = q_WB.z_axis()
            np.testing.assert_allclose(n / math.hypot(*n), arr(axis)[:2] / math.hypot(axis.x, axis.y), atol=1e-9)
            assert 2.0 * math.atan(0.5 * math.hypot(*n)) == pytest.approx(0.7)
    # At less than a right angle it begins where the body is, beyond the largest tilt too.
    n = arr(SO3.start(Quat.from_euler(Vec3(1.2, 0.0, 0.0)), most).attitude)[:2]
    assert 2.0 * math.atan(0.5 * math.hypot(*n)) == pytest.approx(1.2)


@given(state=states, spin=st.floats(-20.0, 20.0))
def test_rates_and_accelerations_are_the_derivatives_of_the_wanted_frame(
    state: AttitudeReference, spin: float
) -> None:
    """A body that follows the wanted axis and heading exactly: what it turns at, by differences of its attitude."""
    n, n_dot = arr(state.attitude), np.array([float(state.rate.x), float(state.rate.y), spin])
    turning = AttitudeReference(state.attitude, Vec3(*map(float, n_dot)))
    reference = Reference(zeros(), zeros(), zeros(), 0.3, 0.5, -2.0)
    h = 1e-4

    def there(t: float, bend: Array) -> Rotation:
        """The attitude on the course: its thrust axis and heading, with the filter's acceleration."""
        now = n + n_dot * t + 0.5 * bend * t * t
        tilted = frame(now, Rotation.from_euler("Z", now[2]))
        # The shortest turn leaves a little heading: taken out about the thrust axis.
        # Each turn leaves a share of it that grows with the tilt: two thirds at 47 degrees.
        for _ in range(300):
            left = math.remainder(tilted.as_euler("ZYX")[0] - now[2], 2.0 * math.pi)
            if abs(left) < 1e-14:
                break
            tilted = Rotation.from_rotvec(axis_of(now) * -left) * tilted
        return tilted

    lean = np.array([0.0, 0.0, 0.3])
    gap = np.array([n[0], n[1], math.remainder(n[2] - lean[2], 2.0 * math.pi)])
    bend = -(BANDWIDTH**2) * gap - 2.0 * BANDWIDTH * (n_dot - [0.0, 0.0, 0.5]) + [0.0, 0.0, -2.0]
    before, here, after = (there(t, bend) for t in (-h, 0.0, h))
    omega = (before.inv() * after).as_rotvec() / (2.0 * h)
    alpha = ((here.inv() * after).as_rotvec() - (before.inv() * here).as_rotvec()) / (h * h)
    q_WB = Quat(*here.as_quat(scalar_first=True))
    found = wanted_at(turning, q_WB, Vec3(*omega), reference)
    scale = 1.0 + np.abs(bend).max() + omega @ omega
    np.testing.assert_allclose(arr(found.e), 0.0, atol=1e-7)
    np.testing.assert_allclose(arr(found.rate), omega, atol=1e-5 * scale)
    np.testing.assert_allclose(arr(found.acceleration), alpha, atol=2e-4 * scale)


@given(state=states, attitude=attitudes, omega=st.builds(Vec3, rate, rate, rate), residual=st.floats(-1500.0, 1500.0))
def test_rate_error_dynamics_are_those_designed_for(
    state: AttitudeReference, attitude: Vec3, omega: Vec3, residual: float
) -> None:
    """The wanted acceleration, the law's and the drift together are the true body's under the torque asked for."""
    uneven = load_vehicle("paper").vehicle._replace(inertia=Vec3(0.03, 0.05, 0.06), rotor_inertia=1e-3)
    made: Any = cascade("smc")
    numbers = made.parameters(Context(uneven, DT))
    seen = estimate(zeros(), zeros(), attitude, omega)
    wanted = Reference(zeros(), zeros(), zeros(), 0.4, 0.3, 0.0)
    inputs = control_inputs(uneven, seen, wanted, residual)
    # No lag to lead: rotors that give no torque now.
    memory = made.initial(inputs, numbers)._replace(reference=state)
    _, output, told = made.step(memory, inputs, numbers, DT)
    limited = told.attitude_demand
    q_WB = Quat.from_euler(attitude)
    axis = Quat.from_euler(Vec3(float(limited.x), float(limited.y), float(q_WB.heading()))).z_axis()
    target = SO3.track(state, seen, q_WB.matrix(), axis, wanted, BANDWIDTH, DT)
    true = angular_acceleration(uneven, output.demand.torque_B, omega, residual) - target.acceleration
    designed = gyroscopic_drift(uneven, omega, residual) @ (omega - target.rate) + told.virtual_attitude
    scale = 1.0 + np.abs(arr(target.acceleration)).max() + np.abs(arr(told.virtual_attitude)).max() + abs(residual)
    np.testing.assert_allclose(arr(true), arr(designed), atol=1e-9 * scale)


def test_a_heading_that_turns_is_followed_without_lag() -> None:
    """The command filter about a reference that turns evenly stays on it; one that starts beside it comes to it."""
    for begin in (0.0, 0.7):
        state = AttitudeReference(Vec3(0.0, 0.0, begin), Vec3(0.0, 0.0, 12.0 if begin == 0.0 else 0.0))
        for step in range(1500):
            wanted = Reference(zeros(), zeros(), zeros(), 12.0 * DT * step, 12.0, 0.0)
            level = Quat.identity()
            state = SO3.track(
                state, Estimate(zeros(), zeros(), level, zeros()), level.matrix(), Vec3(0.0, 0.0, 1.0), wanted,
                BANDWIDTH, DT,
            ).after  # fmt: skip
            if begin == 0.0:
                assert float(state.attitude.z) == pytest.approx(12.0 * DT * (step + 1), abs=1e-9)
        assert float(state.attitude.z) == pytest.approx(12.0 * DT * 1500, abs=1e-9)
        assert float(state.rate.z) == pytest.approx(12.0, abs=1e-7)


@pytest.mark.parametrize("spin", [-25.0, 3.0, 20.0])
def test_the_lag_of_a_spinning_body_is_that_of_one_that_does_not_spin(spin: float) -> None:
    """A first-order lag in the body, driven as told, seen from the world: the step response of a plain lag."""
    w0, h = 20.0, 5e-4
    wanted_W, now_B = np.array([0.7, -0.4]), np.zeros(2)
    for step in range(1000):
        turn = Rotation.from_euler("Z", spin * h * step).as_matrix()[:2, :2]
        plain = wanted_W * (1.0 - math.exp(-w0 * h * step))
        np.testing.assert_allclose(turn @ now_B, plain, atol=0.02)
        asked_B = turn.T @ wanted_W
        ahead = arr(SO3.ahead_of_lag(Vec3(*asked_B, 0.0), Vec3(*now_B, 0.0), Vec3(0.0, 0.0, spin), w0))[:2]
        now_B = ahead + (now_B - ahead) * math.exp(-w0 * h)
