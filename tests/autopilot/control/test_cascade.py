"""The cascade that flies the laws: attitude demand, limits, command filter, six_inputs, attitude pairs."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from cascade_step import (
    CONTROLLERS,
    VEHICLE,
    Array,
    arr,
    attitudes,
    cascade,
    controller_step,
    estimate,
    number,
    sound_thrust,
)
from gates import needs_simd
from hypothesis import given
from hypothesis import strategies as st
from scipy.signal import cont2discrete

from rotorfault.autopilot.control.attitude import AttitudeReference, attitude_for, filtered
from rotorfault.autopilot.control.cascade import CascadeSettings, limited_force
from rotorfault.engine import have_simd, load_engine
from rotorfault.engine.batch import no_watch
from rotorfault.flight.assembly import assemble, assemble_all
from rotorfault.maths.geometry import Vec3, zeros
from rotorfault.maths.rotation import body_z_axis
from rotorfault.model.block import Context
from rotorfault.model.signals import Reference
from rotorfault.scenario.scenario import Scenario, scenario_from

each_controller = pytest.mark.parametrize("name", list(CONTROLLERS))


@given(attitude=attitudes, size=st.floats(0.1, 50.0), yaw_ref=number)
def test_attitude_for_inverts_the_thrust_axis(attitude: Vec3, size: float, yaw_ref: float) -> None:
    found = attitude_for(body_z_axis(attitude) * size, math.cos(attitude.z), math.sin(attitude.z), yaw_ref)
    np.testing.assert_allclose(arr(found), [attitude.x, attitude.y, yaw_ref], atol=1e-12)


@given(f=st.builds(Vec3, *[st.floats(-60.0, 60.0)] * 3), tilt=st.floats(0.1, 1.4), share=st.floats(0.6, 1.0))
def test_force_limits(f: Vec3, tilt: float, share: float) -> None:
    numbers = cascade(tilt_max=tilt, thrust_share=share, fall_share=0.3).parameters(Context(VEHICLE, 1e-3))
    most, least = share * 4.0 * VEHICLE.thrust_max / VEHICLE.mass, 0.3 * VEHICLE.gravity
    given_, wanted = arr(limited_force(f, sound_thrust(VEHICLE), VEHICLE, numbers)), arr(f)
    # The vertical part comes first: whatever is asked for sideways, it is cut by its own limits only.
    assert given_[2] == min(max(wanted[2], least), most)
    assert math.hypot(*given_) <= most * (1.0 + 1e-12)
    assert math.hypot(*given_[:2]) <= math.tan(tilt) * given_[2] * (1.0 + 1e-12)
    # Sideways: same direction, nothing added, and as much as there is room for.
    assert abs(given_[0] * wanted[1] - given_[1] * wanted[0]) <= 1e-9
    assert given_[0] * wanted[0] >= 0.0
    asked, got = math.hypot(*wanted[:2]), math.hypot(*given_[:2])
    room = min(math.sqrt(max(most**2 - given_[2] ** 2, 0.0)), math.tan(tilt) * given_[2])
    assert got == pytest.approx(min(asked, room), abs=1e-6)


def test_tilt_counts_from_the_force_that_holds_against_the_wind() -> None:
    numbers = cascade(tilt_max=0.3, thrust_share=1.0, fall_share=0.3).parameters(Context(VEHICLE, 1e-3))
    most, reach = 4.0 * VEHICLE.thrust_max / VEHICLE.mass, math.tan(0.3) * VEHICLE.gravity

    def sideways(wanted: float, steady: float) -> float:
        f = Vec3(wanted, 0.0, VEHICLE.gravity)
        return float(limited_force(f, sound_thrust(VEHICLE), VEHICLE, numbers, Vec3(steady, 0.0, 0.0)).x)

    # As far to either side of it, up to the largest tilt again and to what thrust carries.
    assert sideways(9.0 * reach, 0.5 * reach) == pytest.approx(1.5 * reach)
    assert sideways(-9.0 * reach, 0.5 * reach) == pytest.approx(-0.5 * reach)
    assert sideways(9.0 * reach, 9.0 * reach) == pytest.approx(2.0 * reach)
    assert sideways(1.2 * reach, 0.5 * reach) == pytest.approx(1.2 * reach)
    weak = numbers._replace(thrust_share=1.05 * VEHICLE.gravity / most)
    f = limited_force(
        Vec3(9.0 * reach, 0.0, VEHICLE.gravity), sound_thrust(VEHICLE), VEHICLE, weak, Vec3(reach, 0.0, 0.0)
    )
    assert math.hypot(f.x, f.z) == pytest.approx(1.05 * VEHICLE.gravity)


@pytest.mark.parametrize(("bandwidth", "dt"), [(25.0, 1e-3), (25.0, 0.1), (300.0, 0.05)])
def test_command_filter_is_exact(bandwidth: float, dt: float) -> None:
    """Against SciPy's zero-order hold of w^2/(s + w)^2, also where w dt is far beyond any explicit scheme."""
    A, B = np.array([[0.0, 1.0], [-(bandwidth**2), -2.0 * bandwidth]]), np.array([[0.0], [bandwidth**2]])
    A, B, *_ = cont2discrete((A, B, np.eye(2), 0), dt)
    draw = np.random.default_rng(3)
    state = AttitudeReference(Vec3(*draw.normal(size=3)), Vec3(*draw.normal(size=3)))
    x = np.array([arr(state.attitude), arr(state.rate)])
    for _ in range(60):
        demand = draw.uniform(-1.0, 1.0, 3)
        expected = bandwidth**2 * (demand - x[0]) - 2.0 * bandwidth * x[1]
        state, found = filtered(state, Vec3(*demand), bandwidth, dt)
        np.testing.assert_allclose(arr(found), expected, rtol=1e-9, atol=1e-9 * bandwidth**2)
        x = A @ x + B @ demand[None, :]
        np.testing.assert_allclose(arr(state.attitude), x[0], atol=1e-11)
        np.testing.assert_allclose(arr(state.rate), x[1], atol=1e-11 * bandwidth)


def test_command_filter_turns_the_short_way() -> None:
    state = AttitudeReference(Vec3(0.0, 0.0, 3.1), zeros())
    after, acceleration_ = filtered(state, Vec3(0.0, 0.0, -3.1), 25.0, 1e-3)
    assert acceleration_.z > 0.0
    for _ in range(1000):
        after, _ = filtered(after, Vec3(0.0, 0.0, -3.1), 25.0, 1e-3)
    assert after.attitude.z == pytest.approx(2.0 * math.pi - 3.1, abs=1e-6)


@each_controller
def test_command_filter_starts_at_the_measured_attitude(name: str) -> None:
    attitude = Vec3(0.6, -0.5, 2.0)
    seen = estimate(zeros(), zeros(), attitude, Vec3(0.3, 0.2, 0.1))
    wanted = Reference(Vec3(1.0, 1.0, 1.0), zeros(), zeros(), 0.0, 0.0, 0.0)
    by_angles = controller_step(cascade(name, tracking="euler"), VEHICLE, seen, wanted)
    assert by_angles.before.reference == AttitudeReference(attitude, zeros())
    for tracking in ("euler", "so3"):
        first = controller_step(cascade(name, tracking=tracking), VEHICLE, seen, wanted)
        np.testing.assert_allclose(arr(first.telemetry.attitude_command), arr(attitude), atol=1e-12)
    level = controller_step(cascade(name, six_inputs=True), VEHICLE, seen, wanted)
    assert level.before.reference == AttitudeReference(zeros(), zeros())


def flown(tables: dict[str, Any]) -> dict[str, Array]:
    """Rows of one scenario's flight by name."""
    batch = assemble(scenario_from({"name": "test", "vehicle": "paper"} | tables, "test"))
    recording = load_engine("simd" if have_simd() else "python")(batch, no_watch)
    return dict(zip(batch.loop.layout.rows, recording.signals[:, :, 0].T, strict=True))


def test_six_inputs_is_labelled_and_acts() -> None:
    """x and y move with a level body: no quadrotor does that."""
    field = CascadeSettings.model_fields["six_inputs"]
    assert field.default is False
    assert "unphysical" in (field.description or "")
    task = {
        "duration": 4.0,
        "period": 0.01,
        "step": 0.01,
        "reference": {"kind": "set_point", "position": [0.5, -0.5, 0.0]},
    }
    tilts = {}
    for six_inputs in (True, False):
        controller = {"kind": "ismc", "preset": "none", "cascade": {"six_inputs": six_inputs}}
        signals = flown(task | {"controller": controller})
        tilts[six_inputs] = max(np.abs(signals[f"attitude.{axis}"]).max() for axis in "xy")
        assert signals["position.x"][-1] == pytest.approx(0.5, abs=0.05)
        assert signals["position.y"][-1] == pytest.approx(-0.5, abs=0.05)
    assert tilts[True] < 1e-9
    assert tilts[False] > 0.05


def attitude_pair(yaw: float, start: tuple[float, float, float], controller: str) -> Scenario:
    return scenario_from(
        {
            "name": f"from {start} to {yaw}",
            "vehicle": "paper",
            "plant": "rigid_body",
            "duration": 16.0,  # the slowest tuned yaw loop has a pole at 0.5 rad/s
            "period": 0.004,
            "step": 0.004,
            "record_period": 0.012,
            "start": {"attitude": list(start), "body_rates": [1.0, -1.0, 0.5]},
            "reference": {"kind": "set_point", "position": [0.0, 0.0, 0.0], "yaw": yaw},
            "controller": controller,
        },
        "test",
    )


@needs_simd
@each_controller
def test_attitude_pairs_converge(name: str) -> None:
    """From every attitude to every yaw, the long way round never taken, the full rigid body comes to rest."""
    starts = [(r, p, y) for r, p in ((0.8, 0.0), (-0.6, 0.7), (0.0, -0.9)) for y in (0.0, 1.6, 3.1, -3.1)]
    for yaw in (0.0, 3.1, -3.1):
        batch = assemble_all([attitude_pair(yaw, start, name) for start in starts])
        signals = load_engine("simd")(batch, no_watch).signals
        place = batch.loop.layout.place
        last = {part: signals[-1, place(part)] for part in ("position", "velocity", "attitude", "body_rates")}
        gap = last["attitude"][2] - yaw
        assert np.abs(np.arctan2(np.sin(gap), np.cos(gap))).max() < 0.01
        assert np.abs(last["attitude"][:2]).max() < 0.01
        for part in ("position", "velocity", "body_rates"):
            assert np.abs(last[part]).max() < 0.02, part
        course = np.unwrap(signals[:, place("attitude")][:, 2], axis=0)
        turned = np.abs(np.diff(course, axis=0)).sum(axis=0)
        assert turned.max() < 6.0
