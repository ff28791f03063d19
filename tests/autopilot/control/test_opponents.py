"""Controllers of other people: what their equations promise, and that they fly."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from gates import needs_simd
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy import linalg

import rotorfault as rf
from rotorfault.autopilot.control.geometric import frame_of
from rotorfault.autopilot.control.pid_cascade import attitude_rates
from rotorfault.autopilot.control.primary_axis import turn_to
from rotorfault.autopilot.control.relaxed_equilibrium import reachable, relaxed_equilibrium, riccati_gain
from rotorfault.maths.geometry import Vec3
from rotorfault.maths.rotation import Quat
from rotorfault.model.vehicle_file import load_vehicle

part = st.floats(-1.0, 1.0)
unit = st.tuples(part, part, part).filter(lambda v: math.hypot(*v) > 0.1).map(lambda v: Vec3(*v) / math.hypot(*v))


def arr(v: Any) -> Any:
    return np.array([float(x) for x in v])


@given(axis=unit, wanted=unit)
def test_a_turn_takes_one_axis_to_the_other_the_shortest_way(axis: Vec3, wanted: Vec3) -> None:
    assume(axis.dot(wanted) > -0.999)  # opposite ones have no shortest turn
    turn = arr(turn_to(axis, wanted))
    angle = float(np.linalg.norm(turn))
    assert angle == pytest.approx(math.acos(max(-1.0, min(1.0, axis.dot(wanted)))), abs=1e-6)
    if 1e-6 < angle < math.pi - 1e-3:
        k, v = turn / angle, arr(axis)
        rodrigues = v * math.cos(angle) + np.cross(k, v) * math.sin(angle) + k * (k @ v) * (1.0 - math.cos(angle))
        np.testing.assert_allclose(rodrigues, arr(wanted), atol=1e-7)


@given(force=unit, change=unit, yaw=st.floats(-3.0, 3.0), yaw_rate=part)
def test_the_geometric_frame_turns_at_the_rate_it_says(
    force: Vec3, change: Vec3, yaw: float, yaw_rate: float
) -> None:
    force = Vec3(force.x, force.y, abs(force.z) + 1.0) * 5.0
    step = 1e-5

    def frame(t: float) -> Any:
        return arr(frame_of(force + change * t, change, yaw + yaw_rate * t, yaw_rate)[0]).reshape(3, 3)

    R, omega = frame(0.0), frame_of(force, change, yaw, yaw_rate)[1]
    np.testing.assert_allclose(R.T @ R, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(R[:, 2], arr(force) / np.linalg.norm(arr(force)), atol=1e-12)
    skew = R.T @ (frame(step) - frame(-step)) / (2.0 * step)
    np.testing.assert_allclose([skew[2, 1], skew[0, 2], skew[1, 0]], arr(omega), atol=1e-6)


@given(roll=st.floats(-1.0, 1.0), pitch=st.floats(-1.0, 1.0), yaw=st.floats(-3.0, 3.0), force=unit)
@settings(max_examples=50)
def test_the_share_of_the_heading_costs_the_thrust_axis_nothing(
    roll: float, pitch: float, yaw: float, force: Vec3
) -> None:
    """To first order the rates across the thrust axis are those that turn it to the force, whatever the weight."""
    up = Vec3(0.3 * force.x, 0.3 * force.y, 1.0)
    q = Quat.from_euler(Vec3(roll, pitch, yaw))
    wanted = up / math.hypot(*up)
    rates = attitude_rates(q, up, 0.7, Vec3(1.0, 1.0, 1.0), 0.0)
    # Without the heading it is the turn of the axis alone: twice the sine of half of it, in body axes.
    turn = q.matrix().T @ turn_to(q.z_axis(), wanted)
    angle = math.hypot(*turn)
    np.testing.assert_allclose(arr(rates), arr(turn) * (2.0 * math.sin(angle / 2.0) / max(angle, 1e-12)), atol=1e-6)


def test_a_heading_that_is_off_is_answered_by_yaw_alone() -> None:
    level = Vec3(0.0, 0.0, 9.81)
    for weight in (0.2, 0.4, 1.0):
        rates = attitude_rates(Quat.about_z(-0.1), level, 0.0, Vec3(5.0, 5.0, 2.0), weight)
        assert arr(rates) == pytest.approx([0.0, 0.0, 0.2], abs=1e-3), weight


FLIGHT: dict[str, Any] = {"vehicle": "mueller-2014", "controller.preset": "none", "duration": 8.0}
UNTOLD = ("pid_cascade", "geometric_adaptive", "uniform_passive")
TRIED = ("indi", "ndi_primary_axis", "lqr_relaxed_hover", "geometric", *UNTOLD)


@needs_simd
@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("kind", TRIED)
def test_it_holds_a_noisy_hover_with_a_rotor_half_lost(kind: str) -> None:
    told = {"diagnosis": "off"} if kind in UNTOLD else {}
    flown = rf.fly("hover-fault", controller=kind, settings={**FLIGHT, "fault.0.loss": 0.5, **told})
    assert flown.scores["survived"]
    # Without an integral or a diagnosis an offset is left.
    assert abs(flown.scores["position_error_end.z"]) < (1.0 if kind == "geometric" else 0.3)


def lost(kind: str, dead: tuple[int, ...], **more: Any) -> Any:
    faults = [{"kind": "total", "rotor": rotor, "time": 1.0} for rotor in dead]
    start: dict[str, Any] = {"start.position": [0.0, 0.0, 10.0], "reference.position": [0.0, 0.0, 10.0]}
    wind = {"wind.velocity_W": [4.0, 0.0, 0.0], "wind.wind_at_6m": 4.0, "wind.altitude": 10.0}
    chosen = {**FLIGHT, **start, **wind, "controller.kind": kind, "fault": faults, **more}
    return rf.fly_many("hover-fault", {"seed": list(range(8))}, settings=chosen).table.to_pandas()


@needs_simd
@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("kind", ["indi", "ndi_primary_axis", "lqr_relaxed_hover"])
def test_it_flies_on_without_a_rotor_or_two(kind: str) -> None:
    for dead in ((1,), (4,), (1, 2)):
        flown = lost(kind, dead)
        assert flown["survived"].all(), (dead, flown["outcome"].tolist())
        assert flown["position_error_end.z"].abs().max() < 1.0


@needs_simd
@pytest.mark.filterwarnings("ignore")
def test_a_cascade_that_holds_yaw_at_any_price_does_not() -> None:
    assert not lost("pid_cascade", (1,))["survived"].any()


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("kind", ["pid_cascade", "uniform_passive"])
def test_it_is_told_nothing(kind: str) -> None:
    """The diagnosis changes no bit of its flight."""
    one, other = (
        rf.fly("hover-fault", controller=kind, settings={**FLIGHT, "duration": 2.0, "diagnosis": diagnosis})
        for diagnosis in ("luenberger", "off")
    )
    np.testing.assert_array_equal(one.data["position"], other.data["position"])


@needs_simd
@pytest.mark.filterwarnings("ignore")
def test_indi_makes_up_for_what_nobody_told_it() -> None:
    """A centre of mass that is off turns the body steadily: without the integral of position, INDI still stands."""
    off = {**FLIGHT, "fault": [], "mismatch.centre_of_mass": [0.01, 0.0, 0.0], "duration": 6.0}
    still = {"controller.position.integral": 0.0}
    indi = rf.fly("hover-fault", controller="indi", settings={**off, **still}).scores
    ndi = rf.fly(
        "hover-fault", controller="ndi_primary_axis", settings={**off, **still, "controller.integral": 0.0}
    ).scores
    assert abs(indi["position_error_end.x"]) < 0.02
    assert abs(ndi["position_error_end.x"]) > 5.0 * abs(indi["position_error_end.x"])


def anchors() -> Any:
    """Mueller and D'Andrea's vehicle, as they print it."""
    return load_vehicle("mueller-2014").vehicle


@pytest.mark.parametrize("dead", [(), (0,), (2,), (0, 1)])
def test_the_gain_about_relaxed_hover_is_that_of_scipy(dead: tuple[int, ...]) -> None:
    """And the closed loop is stable: of the system written anew here, from Euler's equations by differences."""
    vehicle = anchors()
    about = relaxed_equilibrium(vehicle, dead, 0.3)
    K = riccati_gain(vehicle, dead, about, 60.0, 1.0)
    J = np.diag(arr(vehicle.inertia))
    n, w, r = arr(about.n_B), arr(about.omega_B), float(about.omega_B.z)
    w0 = float(vehicle.rotor_bandwidth)
    spun = np.array([0.0, 0.0, about.momentum])

    def motion(x: Any) -> Any:
        h = np.array([x[0], x[1], math.sqrt(1.0 - x[0] ** 2 - x[1] ** 2)])
        omega, tau = np.array([x[2], x[3], r]), np.array([x[4], x[5], 0.0])
        turn = np.linalg.solve(J, tau - np.cross(omega, J @ omega + spun))
        return np.array([*np.cross(h, omega)[:2], *turn[:2], -w0 * x[4], -w0 * x[5]])

    x = np.array([n[0], n[1], w[0], w[1], 0.0, 0.0])
    step = 1e-6
    A = np.array([(motion(x + step * e) - motion(x - step * e)) / (2.0 * step) for e in np.eye(6)]).T
    reach = reachable(vehicle, dead)
    B = np.vstack([np.zeros((4, reach.shape[1])), w0 * reach])
    arm = math.sqrt(float((arr(vehicle.rotor_x) ** 2 + arr(vehicle.rotor_y) ** 2).mean()))
    R = np.eye(B.shape[1]) / (float(vehicle.thrust_max) * arm) ** 2
    P = linalg.solve_continuous_are(A, B, np.diag([60.0, 60.0, 1.0, 1.0, 0.0, 0.0]), R)
    np.testing.assert_allclose(K, reach @ np.linalg.solve(R, B.T @ P), rtol=1e-4, atol=1e-5)
    assert np.linalg.eigvals(A - w0 * np.vstack([np.zeros((4, 6)), K])).real.max() < -0.5


def test_the_relaxed_equilibrium_turns_steadily() -> None:
    """Torques balance, its axis lies along its rates, and it is that of the analysis."""
    vehicle = anchors()
    about = relaxed_equilibrium(vehicle, (0,), 0.3)
    n, omega = arr(about.n_B), arr(about.omega_B)
    np.testing.assert_allclose(np.cross(n, omega), 0.0, atol=1e-9)
    J, spun = np.diag(arr(vehicle.inertia)), np.array([0.0, 0.0, about.momentum])
    damping = np.array([0.0, 0.0, 2.75e-3]) * omega
    np.testing.assert_allclose(arr(about.torque_B) - damping, np.cross(omega, J @ omega + spun), atol=1e-6)


@needs_simd
@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("dead", [(1,), (1, 2)])
def test_a_law_that_is_told_nothing_flies_on_too(dead: tuple[int, ...]) -> None:
    """Two opposite rotors always; without one it falls far before its observers have caught it, and not always."""
    faults = [{"kind": "total", "rotor": rotor, "time": 1.0} for rotor in dead]
    high: dict[str, Any] = {"start.position": [0.0, 0.0, 30.0], "reference.position": [0.0, 0.0, 30.0]}
    chosen = {**FLIGHT, **high, "controller.kind": "uniform_passive", "fault": faults, "diagnosis": "off"}
    flown = rf.fly_many("hover-fault", {"seed": list(range(8))}, settings=chosen).table.to_pandas()
    assert flown["survived"].all(), flown["outcome"].tolist()


@needs_simd
@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("kind", ["indi", "lqr_relaxed_hover", "ndi_primary_axis"])
def test_its_preset_for_total_losses_flies_slow_rotors(kind: str) -> None:
    drag = {"vehicle.air.rotor_drag": {"value": 1.19e-4, "unit": "kg/rad", "source": "RotorPy's parameters"}}
    slow = {"vehicle": "hummingbird", "controller.preset": "spin", "vehicle.linear_drag.value": 0.0, **drag}
    assert lost(kind, (1,), **slow)["survived"].all()
