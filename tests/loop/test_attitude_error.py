"""The attitude error that scores count: a rotation vector, without any angle at which it fails."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from engine_flights import every_engine, run, short
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from rotorfault.flight.assembly import assemble
from rotorfault.loop.cost import attitude_error
from rotorfault.maths.geometry import Vec3
from rotorfault.maths.rotation import Quat
from rotorfault.results.score_table import score_table

Array = NDArray[np.float64]
UPRIGHT = 0.5 * math.pi
angle = st.floats(-3.1, 3.1)


def plain(attitude: Vec3) -> Quat:
    """A quaternion that has forgotten the angles that it was made of, as that of a body in flight."""
    return Quat(*Quat.from_euler(attitude))


def arr(v: Any) -> Array:
    return np.array(list(v), dtype=float)


def by_scipy(attitude: Vec3, yaw: float) -> Array:
    turned = Rotation.from_euler("ZYX", [attitude.z, attitude.y, attitude.x])
    return np.asarray((Rotation.from_euler("Z", -yaw) * turned).as_rotvec())


@given(st.builds(Vec3, angle, st.floats(-1.5, 1.5), angle), angle)
def test_it_is_the_rotation_vector_from_the_level_attitude(attitude: Vec3, yaw: float) -> None:
    wanted = by_scipy(attitude, yaw)
    found = arr(attitude_error(plain(attitude), yaw))
    # Half a turn either way round is the same.
    if np.linalg.norm(wanted) > math.pi - 1e-6:
        wanted = wanted * np.sign(wanted @ found)
    np.testing.assert_allclose(found, wanted, atol=1e-7)


@given(st.builds(Vec3, *[st.floats(-1e-3, 1e-3)] * 3), angle)
def test_in_the_small_it_is_roll_pitch_and_yaw_error(error: Vec3, yaw: float) -> None:
    for made in (Quat.from_euler, plain):  # as it was before, to first order
        found = attitude_error(made(error + Vec3(0.0, 0.0, yaw)), yaw)
        np.testing.assert_allclose(arr(found), arr(error), atol=2e-6)


@pytest.mark.parametrize("pitch", [UPRIGHT, UPRIGHT - 1e-9, -UPRIGHT])
def test_nose_down_or_up_it_changes_little_with_little_turns(pitch: float) -> None:
    """Where roll and yaw jump by anything: a small turn of the body changes the error by no more than twice that."""
    draw = np.random.default_rng(4)
    at = plain(Vec3(0.0, pitch, 0.3))
    here = arr(attitude_error(at, 0.3))
    np.testing.assert_allclose(here, [0.0, pitch, 0.0], atol=1e-7)
    jumps = []
    for _ in range(200):
        turn = Vec3(*draw.normal(size=3)) * 1e-6
        there = at @ Quat.small(turn)
        assert np.linalg.norm(arr(attitude_error(there, 0.3)) - here) <= 2.0 * turn.norm() + 1e-15
        jumps.append(abs(there.euler().x))
    assert max(jumps) > 1.0, "the angles do jump there"


@every_engine
def test_a_flight_that_begins_nose_down_has_a_finite_error(engine: str) -> None:
    """A hair before it counts as tumbled; the error of its first instant is a quarter turn about y."""
    pitch = UPRIGHT - 1e-7
    scenario = short(
        start={"attitude": [0.0, pitch, 0.7]},
        reference={"kind": "set_point", "position": [0.0, 0.0, 0.0], "yaw": 0.7},
        duration=0.005,
        fault=[],
        sensors="ideal",
        wind="none",
    )
    batch = assemble(scenario)
    row = score_table(batch, run(batch, engine).state).row(0)
    found = [row[f"attitude_mse.{name}"] for name in ("roll", "pitch", "yaw")]
    np.testing.assert_allclose(found, [0.0, pitch**2, 0.0], atol=1e-12)
    assert row["survived"]
    assert np.isfinite(row["cost"])
    assert row["tilt_max"] == pytest.approx(pitch, abs=1e-6)
