"""Vectors, matrices, quaternions: group axioms near 0 and pi, round trips, and the traps of NumPy."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rotorfault.maths.geometry import Mat3, PerRotor, Vec3, zeros
from rotorfault.maths.rotation import Quat, body_z_axis, euler_matrix

component = st.floats(-100.0, 100.0)
vectors = st.builds(Vec3, component, component, component)
# Where rotations go wrong: next to no turn, half a turn and a whole one.
angles = st.one_of(
    st.floats(-math.pi, math.pi),
    st.builds(
        lambda centre, off: centre + off,
        st.sampled_from([0.0, math.pi, -math.pi, 2 * math.pi]),
        st.sampled_from([0.0, 1e-12, -1e-12, 1e-8, -1e-8, 1e-4]),
    ),
)
axes = vectors.filter(lambda v: v.norm() > 1e-3).map(lambda v: v / v.norm())


def turn(axis: Vec3, angle: float) -> Quat:
    return Quat(math.cos(angle / 2), *(axis * math.sin(angle / 2)))


rotations = st.builds(turn, axes, angles)
eulers = st.builds(Vec3, angles, st.floats(-1.5, 1.5), angles)


def array(value: Vec3 | Mat3 | Quat) -> np.ndarray:
    numbers = np.array(list(value))
    return numbers.reshape(3, 3) if isinstance(value, Mat3) else numbers


def close(a: object, b: object, tolerance: float = 1e-12) -> None:
    np.testing.assert_allclose(array(a), array(b), rtol=0, atol=tolerance)  # type: ignore[arg-type]


def same_rotation(a: Quat, b: Quat, tolerance: float = 1e-12) -> None:
    assert abs(abs(a.dot(b)) - 1.0) <= tolerance


@given(rotations, rotations, rotations)
def test_quaternions_are_a_group(a: Quat, b: Quat, c: Quat) -> None:
    close((a @ b) @ c, a @ (b @ c))
    close(a @ Quat.identity(), a)
    close(Quat.identity() @ a, a)
    close(a @ a.conjugate(), Quat.identity())
    assert (a @ b).dot(a @ b) == pytest.approx(1.0, abs=1e-12)


@given(rotations, rotations, vectors)
def test_product_of_quaternions_is_product_of_matrices(a: Quat, b: Quat, v: Vec3) -> None:
    close((a @ b).matrix(), a.matrix() @ b.matrix())
    close((a @ b).matrix() @ v, a.matrix() @ (b.matrix() @ v), 1e-10)


@given(rotations)
def test_rotation_matrix_is_orthogonal_and_right_handed(q: Quat) -> None:
    R = q.matrix()
    close(R.T @ R, Mat3.identity())
    assert R.det() == pytest.approx(1.0, abs=1e-12)
    close(R.inverse(), R.T)


@given(axes, angles)
def test_a_rotation_keeps_its_axis_and_turns_by_its_angle(axis: Vec3, angle: float) -> None:
    R = turn(axis, angle).matrix()
    close(R @ axis, axis)
    assert R.trace() == pytest.approx(1.0 + 2.0 * math.cos(angle), abs=1e-12)


@given(eulers)
def test_euler_angles_survive_the_round_trip(euler: Vec3) -> None:
    q = Quat.from_euler(euler)
    close(q.matrix(), euler_matrix(euler))
    back = q.euler()
    same_rotation(Quat.from_euler(back), q)
    assert abs(back.y - euler.y) < 1e-7
    assert abs(math.remainder(back.x - euler.x, 2 * math.pi)) < 1e-9
    assert abs(math.remainder(back.z - euler.z, 2 * math.pi)) < 1e-9


@given(rotations)
def test_quaternion_survives_the_round_trip_up_to_its_sign(q: Quat) -> None:
    # At +-90 degrees of pitch asin loses half of the digits.
    same_rotation(Quat.from_euler(q.euler()), q, 1e-7)


@given(rotations)
def test_both_signs_of_a_quaternion_are_one_attitude(q: Quat) -> None:
    close((q * -1.0).matrix(), q.matrix())
    close((q * -1.0).euler(), q.euler())


def test_pitch_at_its_end_is_a_number_despite_rounding() -> None:
    half = math.sqrt(0.5)
    for scale in (1.0, 1.0 + 1e-15, 1.0 - 1e-15):
        assert (Quat(half, 0.0, half, 0.0) * scale).euler().y == pytest.approx(math.pi / 2, abs=1e-6)


@given(eulers)
def test_body_z_axis_is_the_third_column(euler: Vec3) -> None:
    close(body_z_axis(euler), euler_matrix(euler) @ Vec3(0.0, 0.0, 1.0))


def test_positive_roll_leans_right_positive_pitch_forward_and_yaw_turns_left() -> None:
    assert body_z_axis(Vec3(0.1, 0.0, 0.0)).y < 0.0
    assert body_z_axis(Vec3(0.0, 0.1, 0.0)).x > 0.0
    assert (euler_matrix(Vec3(0.0, 0.0, 0.1)) @ Vec3(1.0, 0.0, 0.0)).y > 0.0


@given(rotations, vectors)
def test_quaternion_derivative_keeps_the_length(q: Quat, omega_B: Vec3) -> None:
    assert q.dot(q.derivative(omega_B)) == pytest.approx(0.0, abs=1e-12 * (1.0 + omega_B.norm()))


@given(rotations, vectors)
def test_quaternion_derivative_turns_the_body_with_the_body_rate(q: Quat, omega_B: Vec3) -> None:
    dt = 1e-6
    after, before = q + q.derivative(omega_B) * dt, q + q.derivative(omega_B) * -dt
    R_dot = (after.matrix() - before.matrix()) / (2.0 * dt)
    close(R_dot, q.matrix() @ Mat3.skew(omega_B), 1e-6)


@given(vectors, vectors, vectors)
def test_vector_products(a: Vec3, b: Vec3, c: Vec3) -> None:
    np.testing.assert_allclose(array(a.cross(b)), np.cross(array(a), array(b)), atol=1e-9)
    close(a.cross(b), -(b.cross(a)))
    close(Mat3.skew(a) @ b, a.cross(b), 1e-9)
    assert a.cross(b).dot(a) == pytest.approx(0.0, abs=1e-7)
    close(a.cross(b.cross(c)), b * a.dot(c) - c * a.dot(b), 1e-6)


@given(st.builds(Mat3, *[st.floats(-3.0, 3.0)] * 9), st.builds(Mat3, *[st.floats(-3.0, 3.0)] * 9), vectors)
def test_matrix_operations_agree_with_numpy(m: Mat3, n: Mat3, v: Vec3) -> None:
    M, N = array(m), array(n)
    np.testing.assert_allclose(array(m @ n), M @ N, atol=1e-12)
    np.testing.assert_allclose(array(m @ v), M @ array(v), atol=1e-9)
    np.testing.assert_allclose(array(m.T), M.T)
    np.testing.assert_allclose(array(m + n - n * 2.0), M - N, atol=1e-12)
    np.testing.assert_allclose(m.det(), np.linalg.det(M), atol=1e-10)
    np.testing.assert_allclose(array(m @ m.adjugate()), m.det() * np.eye(3), atol=1e-9)
    np.testing.assert_allclose(m.norm(), np.linalg.norm(M), atol=1e-12)
    np.testing.assert_array_equal(array(m.times(n)), M * N)


def test_the_inverse_of_a_singular_matrix_is_not_finite() -> None:
    singular = Mat3(1.0, 2.0, 3.0, 2.0, 4.0, 6.0, 1.0, 0.0, 1.0)
    assert not np.isfinite(array(singular.inverse())).any()


@pytest.mark.parametrize(
    "value", [Vec3(1.0, 2.0, 3.0), PerRotor(1.0, 2.0, 3.0, 4.0), Quat.identity(), Mat3.identity()], ids=repr
)
def test_an_array_scales_a_value_from_either_side_and_never_swallows_it(value: Vec3) -> None:
    factor = np.array([1.0, 10.0])
    for product in (factor * value, value * factor):
        assert type(product) is type(value)
        for got, was in zip(product, value, strict=True):
            np.testing.assert_array_equal(got, was * factor)
    with pytest.raises(TypeError):
        factor @ value  # type: ignore[operator]


def test_an_array_added_to_a_vector_is_refused() -> None:
    with pytest.raises((TypeError, AttributeError)):
        np.array([1.0, 2.0, 3.0]) + Vec3(1.0, 2.0, 3.0)  # type: ignore[operator]
    with pytest.raises((TypeError, AttributeError)):
        Vec3(1.0, 2.0, 3.0) + np.array([1.0, 2.0, 3.0])  # type: ignore[operator]


def test_values_compare_by_their_numbers_and_type() -> None:
    assert Vec3(1.0, 2.0, 3.0) == Vec3(1.0, 2.0, 3.0)
    assert Vec3(1.0, 2.0, 3.0) != Vec3(1.0, 2.0, 3.5)
    assert Quat(1.0, 2.0, 3.0, 4.0) != PerRotor(1.0, 2.0, 3.0, 4.0)
    assert zeros() == Vec3(0.0, 0.0, 0.0)
    with pytest.raises(TypeError):
        hash(zeros())


def test_per_rotor_works_rotor_by_rotor() -> None:
    a, b = PerRotor(1.0, 2.0, 3.0, 4.0), PerRotor(5.0, 6.0, 7.0, 8.0)
    assert a + b == PerRotor(6.0, 8.0, 10.0, 12.0)
    assert 1.0 - a == PerRotor(0.0, -1.0, -2.0, -3.0)
    assert a * b == b * a == PerRotor(5.0, 12.0, 21.0, 32.0)
    assert b / a == PerRotor(5.0, 3.0, 7.0 / 3.0, 2.0)
    assert a.map(max, b) == b
    assert (a.sum(), a.dot(b), a.reduce(min), a.reduce(max)) == (10.0, 70.0, 1.0, 4.0)
