"""Rotations between quaternions, small turns, headings and angles; a quaternion that knows its angles is no other."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from rotorfault.maths.geometry import Mat3, Vec3, zeros
from rotorfault.maths.records import flatten, unflatten
from rotorfault.maths.rotation import OfAngles, Quat, body_z_axis, euler_matrix

number = st.floats(-3.0, 3.0)
vectors = st.builds(Vec3, number, number, number)
axes = vectors.filter(lambda v: v.norm() > 1e-3).map(lambda v: v / v.norm())
# Yaw counts on beyond a turn; pitch stays off the ends, where roll and yaw are not told apart.
angles = st.builds(Vec3, st.floats(-3.1, 3.1), st.floats(-1.5, 1.5), st.floats(-12.0, 12.0))
TINY = [0.0, 1e-300, 1e-160, 1e-25, 1e-20, 3e-20, 1e-12, 1e-8, 1e-4]


def array(value: Any) -> np.ndarray:
    return np.array(flatten(value), dtype=float)


def turn(axis: Vec3, angle: float) -> Quat:
    return Quat(math.cos(angle / 2), *(axis * math.sin(angle / 2)))


def plain(q: Quat) -> Quat:
    return Quat(q.w, q.x, q.y, q.z)


def scipy_of(q: Quat) -> Rotation:
    return Rotation.from_quat([q.x, q.y, q.z, q.w])


def close(a: Any, b: Any, tolerance: float = 1e-12) -> None:
    np.testing.assert_allclose(array(a), array(b), rtol=0, atol=tolerance)


# -------------------------------------------------------------------------------------------------- rotation vectors


@given(axes, st.floats(0.0, math.pi - 1e-6))
def test_a_rotation_vector_is_axis_times_angle(axis: Vec3, angle: float) -> None:
    close(turn(axis, angle).rotation_vector(), axis * angle)


@given(axes, st.floats(math.pi + 1e-6, 2.0 * math.pi))
def test_a_rotation_vector_goes_the_short_way_round(axis: Vec3, angle: float) -> None:
    close(turn(axis, angle).rotation_vector(), axis * (angle - 2.0 * math.pi))


@given(axes, st.floats(0.0, 2.0 * math.pi).filter(lambda angle: abs(angle - math.pi) > 1e-6))
def test_both_signs_of_a_quaternion_have_one_rotation_vector(axis: Vec3, angle: float) -> None:
    q = turn(axis, angle)
    close((q * -1.0).rotation_vector(), q.rotation_vector())
    np.testing.assert_allclose(array(q.rotation_vector()), scipy_of(q).as_rotvec(), atol=1e-12)


@given(axes, st.sampled_from([0.0, -0.0, 1e-17, -1e-17, 1e-9, -1e-9]))
def test_half_a_turn_is_pi_about_the_axis_one_way_or_the_other(axis: Vec3, w: float) -> None:
    vector = Quat(w, *axis).rotation_vector()
    assert vector.norm() == pytest.approx(math.pi, abs=1e-8)
    assert abs(vector.dot(axis)) == pytest.approx(math.pi, abs=1e-8)


@pytest.mark.parametrize("angle", TINY)
def test_a_tiny_rotation_keeps_all_its_digits(angle: float) -> None:
    """Twice the vector part of the quaternion; no division by zero at zero, and no jump towards it."""
    vector = Quat(1.0, 0.5 * angle, -0.5 * angle, 0.25 * angle).rotation_vector()
    np.testing.assert_allclose(array(vector), [angle, -angle, 0.5 * angle], rtol=1e-8 if angle == 1e-4 else 1e-15)


def test_a_rotation_vector_has_its_derivative_at_zero_rotation() -> None:
    """What linearisation and trim ask for: 2 per component of the vector part, at identity and beside it."""
    ca = pytest.importorskip("casadi")
    q = [ca.SX.sym(name) for name in "wxyz"]
    vector = ca.vertcat(*flatten(Quat(*q).rotation_vector()))
    jacobian = ca.Function("jacobian", q, [ca.jacobian(vector, ca.vertcat(*q[1:]))])
    for at in (1.0, 0.0, 0.0, 0.0), (1.0, 1e-19, 0.0, -1e-21), (1.0, 1e-9, 1e-9, 0.0), (-1.0, 0.0, 0.0, 0.0):
        np.testing.assert_allclose(np.array(jacobian(*at)), math.copysign(2.0, at[0]) * np.eye(3), atol=1e-8)


def test_a_rotation_vector_of_no_number_is_none() -> None:
    for k in range(4):
        q = [1.0, 0.0, 0.0, 0.0]
        q[k] = math.nan
        assert np.isnan(array(Quat(*q).rotation_vector())).all()


def test_arrays_give_what_floats_give() -> None:
    rng = np.random.default_rng(5)
    rows = rng.normal(size=(4, 200))
    rows[1:, :3], rows[0, 3:5] = 0.0, 0.0
    rows /= np.linalg.norm(rows, axis=0)
    together = array(Quat(*rows).rotation_vector())
    alone = np.array([array(Quat(*row).rotation_vector()) for row in rows.T.tolist()]).T
    np.testing.assert_allclose(together, alone, rtol=1e-15, atol=0)


# ------------------------------------------------------------------------------------------------------ small turns


@given(vectors)
def test_a_small_rotation_has_unit_length_and_its_own_axis(rotation: Vec3) -> None:
    q = Quat.small(rotation)
    assert q.dot(q) == pytest.approx(1.0, abs=1e-15 * 4)
    close(Vec3(q.x, q.y, q.z).cross(rotation), zeros(), 1e-14)
    assert Vec3(q.x, q.y, q.z).dot(rotation) >= 0.0


@given(axes, st.floats(1e-3, 0.3))
def test_the_angle_of_a_small_rotation_is_short_by_a_twelfth_of_its_cube(axis: Vec3, angle: float) -> None:
    short = angle - Quat.small(axis * angle).rotation_vector().norm()
    assert short == pytest.approx(angle**3 / 12.0, rel=0.1, abs=1e-15)


def test_no_rotation_is_exactly_none() -> None:
    assert Quat.small(zeros()) == Quat.identity()
    assert Quat.identity().rotation_vector() == zeros()


# ---------------------------------------------------------------------------------------------------------- heading


@given(st.floats(-math.pi, math.pi))
def test_a_rotation_about_the_vertical_is_its_yaw(yaw: float) -> None:
    close(Quat.about_z(yaw), Quat.from_euler(Vec3(0.0, 0.0, yaw)))
    assert math.remainder(Quat.about_z(yaw).heading() - yaw, 2.0 * math.pi) == pytest.approx(0.0, abs=1e-12)
    close(Quat.about_z(yaw).z_axis(), Vec3(0.0, 0.0, 1.0))


@given(angles)
def test_heading_is_where_the_nose_points_from_above(euler: Vec3) -> None:
    nose = euler_matrix(euler) @ Vec3(1.0, 0.0, 0.0)
    for q in (Quat.from_euler(euler), plain(Quat.from_euler(euler))):
        assert math.remainder(q.heading() - math.atan2(nose.y, nose.x), 2.0 * math.pi) == pytest.approx(0, abs=1e-9)
        assert math.remainder(q.heading() - euler.z, 2.0 * math.pi) == pytest.approx(0.0, abs=1e-9)


@given(angles, st.floats(-7.0, 7.0))
def test_turning_about_the_vertical_adds_to_the_yaw_and_nothing_else(euler: Vec3, yaw: float) -> None:
    turned = Mat3(math.cos(yaw), -math.sin(yaw), 0.0, math.sin(yaw), math.cos(yaw), 0.0, 0.0, 0.0, 1.0)
    for q in (Quat.from_euler(euler), plain(Quat.from_euler(euler))):
        close(q.turned(yaw).matrix(), turned @ euler_matrix(euler))
        assert q.turned(yaw).z_axis().z == pytest.approx(q.z_axis().z, abs=1e-12)
    assert Quat.from_euler(euler).turned(yaw).euler().z == pytest.approx(euler.z + yaw, abs=1e-15)


# -------------------------------------------------------------------------------------- a quaternion of known angles


@given(angles, vectors, angles)
def test_a_quaternion_of_angles_is_the_plain_one_in_all_that_it_does(euler: Vec3, omega_B: Vec3, other: Vec3) -> None:
    knows = Quat.from_euler(euler)
    same, q = plain(knows), plain(Quat.from_euler(other))
    assert isinstance(knows, OfAngles)
    assert type(same) is Quat
    assert array(knows).tolist() == array(same).tolist()
    for act in (
        Quat.matrix, Quat.z_axis, Quat.conjugate, Quat.normalised, Quat.rotation_vector,
        lambda a: a @ q, lambda a: q @ a, lambda a: a + q, lambda a: a * 2.0, lambda a: 2.0 * a,
        lambda a: a.derivative(omega_B), lambda a: a.dot(q), lambda a: a.turned(0.7).matrix(),
    ):  # fmt: skip
        close(act(knows), act(same))
    # It may count on beyond a turn.
    assert math.remainder(knows.heading() - same.heading(), 2.0 * math.pi) == pytest.approx(0.0, abs=1e-9)
    close(knows.matrix(), same.matrix())
    close(knows.z_axis(), same.z_axis())
    close(euler_matrix(knows.euler()), euler_matrix(same.euler()), 1e-9)


@given(angles)
def test_it_still_knows_its_angles_whatever_their_turns(euler: Vec3) -> None:
    assert Quat.from_euler(euler).euler() == euler
    assert plain(Quat.from_euler(euler)).euler().z == pytest.approx(math.remainder(euler.z, 2 * math.pi), abs=1e-9)


@given(angles)
def test_what_is_computed_with_it_forgets_the_angles(euler: Vec3) -> None:
    knows = Quat.from_euler(euler)
    for result in (knows @ Quat.identity(), knows.conjugate(), knows * 1.0, knows.normalised(), knows + knows):
        assert type(result) is Quat
    # Put together again of its numbers, as engines do, it is plain: stale angles would be another attitude.
    moved = plain(Quat.from_euler(euler + Vec3(0.1, 0.0, 0.0)))
    rebuilt = unflatten(knows, flatten(moved))
    assert array(rebuilt).tolist() == array(moved).tolist()
    close(rebuilt.matrix(), moved.matrix())
    close(rebuilt.euler(), moved.euler())
    close(rebuilt.turned(0.3), moved.turned(0.3))
    close(rebuilt.z_axis(), moved.z_axis())


@given(angles)
def test_it_equals_the_plain_one(euler: Vec3) -> None:
    knows = Quat.from_euler(euler)
    assert knows == plain(knows)
    assert plain(knows) == knows
    assert knows != plain(knows) * 0.5
    assert (knows == euler) is False


@given(angles)
def test_third_column_of_the_matrix_is_the_thrust_axis(euler: Vec3) -> None:
    for q in (Quat.from_euler(euler), plain(Quat.from_euler(euler))):
        close(q.z_axis(), q.matrix() @ Vec3(0.0, 0.0, 1.0))
        close(q.z_axis(), body_z_axis(euler))


@given(angles)
def test_angles_and_quaternions_mean_what_they_mean_elsewhere(euler: Vec3) -> None:
    """SciPy's extrinsic x, y, z angles are ours."""
    theirs = Rotation.from_euler("xyz", array(euler))
    np.testing.assert_allclose(theirs.as_matrix().ravel(), array(Quat.from_euler(euler).matrix()), atol=1e-12)
    np.testing.assert_allclose(theirs.as_matrix().ravel(), array(plain(Quat.from_euler(euler)).matrix()), atol=1e-12)
