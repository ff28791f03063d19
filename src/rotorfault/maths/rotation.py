"""Rotations: unit quaternions, rotation matrices, Euler angles.

The world frame W has x forward, y left, z up; the body frame B is the same at zero attitude. A rotation matrix
``R_WB`` takes body coordinates to world coordinates. Quaternions are Hamilton's, scalar first (w, x, y, z), body to
world; this file is the only place that knows the order. Euler angles are (roll, pitch, yaw) with
``R_WB = Rz(yaw) Ry(pitch) Rx(roll)``, so positive pitch is nose down.
"""

from __future__ import annotations

import math

from rotorfault.maths.geometry import Mat3, Value, Vec3
from rotorfault.maths.scalar import Scalar, absolute, atan2, cos, less, select, sin, sqrt


class Quat(Value):
    """A Hamilton quaternion (w, x, y, z); as an attitude q_WB it rotates body coordinates into the world."""

    __slots__ = ("w", "x", "y", "z")

    def __init__(self, w: Scalar, x: Scalar, y: Scalar, z: Scalar) -> None:
        self.w, self.x, self.y, self.z = w, x, y, z

    def __eq__(self, other: object) -> bool:
        # Whether it still knows its angles (`OfAngles`) makes no other quaternion of it.
        return isinstance(other, Quat) and all(a == b for a, b in zip(self, other, strict=True))

    __hash__ = None

    @classmethod
    def identity(cls) -> Quat:
        """The zero rotation."""
        return cls(1.0, 0.0, 0.0, 0.0)

    @staticmethod
    def from_euler(euler: Vec3) -> Quat:
        """Quaternion of Euler angles (roll, pitch, yaw) in rad."""
        half = euler * 0.5
        cr, cp, cy = half.map(cos)
        sr, sp, sy = half.map(sin)
        return OfAngles(
            cr * cp * cy + sr * sp * sy,
            sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy,
            euler,
        )

    def __add__(self, other: Quat) -> Quat:
        return Quat(self.w + other.w, self.x + other.x, self.y + other.y, self.z + other.z)

    def __mul__(self, factor: Scalar) -> Quat:
        return Quat(self.w * factor, self.x * factor, self.y * factor, self.z * factor)

    __rmul__ = __mul__

    def __matmul__(self, other: Quat) -> Quat:
        """Hamilton product: first `other`, then `self`."""
        a, b = self, other
        return Quat(
            a.w * b.w - a.x * b.x - a.y * b.y - a.z * b.z,
            a.w * b.x + a.x * b.w + a.y * b.z - a.z * b.y,
            a.w * b.y - a.x * b.z + a.y * b.w + a.z * b.x,
            a.w * b.z + a.x * b.y - a.y * b.x + a.z * b.w,
        )

    def conjugate(self) -> Quat:
        """The inverse rotation, for a unit quaternion."""
        return Quat(self.w, -self.x, -self.y, -self.z)

    def dot(self, other: Quat) -> Scalar:
        """Scalar product of the four components."""
        return self.w * other.w + self.x * other.x + self.y * other.y + self.z * other.z

    def normalised(self) -> Quat:
        """The unit quaternion along this one."""
        unit: Quat = self * (1.0 / sqrt(self.dot(self)))
        return unit

    def derivative(self, omega_B: Vec3) -> Quat:
        """Time derivative q_dot = q (0, omega_B) / 2 for body rates in rad/s."""
        return (self @ Quat(0.0, omega_B.x, omega_B.y, omega_B.z)) * 0.5

    def matrix(self) -> Mat3:
        """Rotation matrix R_WB of a unit quaternion."""
        w, x, y, z = self.w, self.x, self.y, self.z
        return Mat3(
            1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y),
            2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x),
            2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y),
        )  # fmt: skip

    def z_axis(self) -> Vec3:
        """The body z axis, along which rotors pull, in world coordinates: the third column of `matrix`."""
        w, x, y, z = self.w, self.x, self.y, self.z
        return Vec3(2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y))

    def euler(self) -> Vec3:
        """Euler angles (roll, pitch, yaw) in rad; pitch in [-pi/2, pi/2], where it is singular at the ends."""
        R = self.matrix()
        return Vec3(atan2(R.zy, R.zz), atan2(-R.zx, sqrt(R.xx * R.xx + R.yx * R.yx)), atan2(R.yx, R.xx))

    def heading(self) -> Scalar:
        """Yaw in rad: where the body x axis points, seen from above; not defined where it points straight up."""
        R = self.matrix()
        return atan2(R.yx, R.xx)

    @classmethod
    def about_z(cls, yaw: Scalar) -> Quat:
        """The rotation by a yaw in rad."""
        return cls(cos(yaw * 0.5), 0.0, 0.0, sin(yaw * 0.5))

    def turned(self, yaw: Scalar) -> Quat:
        """The same attitude turned about the world's vertical by an angle in rad."""
        return Quat.about_z(yaw) @ self

    @classmethod
    def small(cls, rotation: Vec3) -> Quat:
        """The rotation by a small rotation vector in rad; of unit length; its angle lacks a twelfth of the cube."""
        half = rotation * 0.5
        scale = 1.0 / sqrt(1.0 + half.dot(half))
        return cls(scale, half.x * scale, half.y * scale, half.z * scale)

    def rotation_vector(self) -> Vec3:
        """Axis times angle in rad, the short way round (up to pi), of a unit quaternion; smooth at zero rotation."""
        v = Vec3(self.x, self.y, self.z)
        # The small term is lost in rounding but at zero rotation, where it keeps the quotient at its limit.
        sine = sqrt(v.dot(v) + 1e-40)
        factor = 2.0 * atan2(sine, absolute(self.w)) / sine
        vector: Vec3 = v * select(less(self.w, 0.0), -factor, factor)
        return vector


class OfAngles(Quat):
    """A quaternion that was made of Euler angles and still knows them.

    So whoever asks for angles, matrix or thrust axis gets them without a detour by the components, and a yaw that
    counts on beyond a turn, as that of the paper's model, is not cut. Whatever is computed with it is plain again.

    Parameters
    ----------
    w, x, y, z : scalar
    angles : Vec3, rad, optional
        Not there where the quaternion was put together again of its components.
    """

    def __init__(self, w: Scalar, x: Scalar, y: Scalar, z: Scalar, angles: Vec3 | None = None) -> None:
        super().__init__(w, x, y, z)
        self.angles = angles

    def euler(self) -> Vec3:
        """The angles that it was made of."""
        return super().euler() if self.angles is None else self.angles

    def turned(self, yaw: Scalar) -> Quat:
        """The same attitude turned about the world's vertical by an angle in rad."""
        if self.angles is None:
            return super().turned(yaw)
        return Quat.from_euler(self.angles + Vec3(0.0, 0.0, yaw))

    def matrix(self) -> Mat3:
        """Rotation matrix R_WB."""
        return super().matrix() if self.angles is None else euler_matrix(self.angles)

    def heading(self) -> Scalar:
        """Yaw in rad, which may count on beyond a turn: where the body x axis points, seen from above."""
        if self.angles is None:
            return super().heading()
        # Upside down it points the other way.
        turned = select(less(_turns(self.angles)[0].y, 0.0), math.pi, 0.0)
        heading: Scalar = self.angles.z + turned
        return heading

    def z_axis(self) -> Vec3:
        """The body z axis in world coordinates."""
        return super().z_axis() if self.angles is None else body_z_axis(self.angles)


def _turns(euler: Vec3) -> tuple[Vec3, Vec3]:
    """Cosines and sines of angles, from those of their halves: a quaternion needs these, and so they serve both."""
    half = euler * 0.5
    c, s = half.map(cos), half.map(sin)
    sines: Vec3 = c.times(s) * 2.0
    return Vec3(*(1.0 - 2.0 * (x * x) for x in s)), sines


def euler_matrix(euler: Vec3) -> Mat3:
    """Rotation matrix R_WB = Rz(yaw) Ry(pitch) Rx(roll) of Euler angles in rad."""
    (c_roll, c_pitch, c_yaw), (s_roll, s_pitch, s_yaw) = _turns(euler)
    return Mat3(
        c_yaw * c_pitch, c_yaw * s_pitch * s_roll - s_yaw * c_roll, c_yaw * s_pitch * c_roll + s_yaw * s_roll,
        s_yaw * c_pitch, s_yaw * s_pitch * s_roll + c_yaw * c_roll, s_yaw * s_pitch * c_roll - c_yaw * s_roll,
        -s_pitch, c_pitch * s_roll, c_pitch * c_roll,
    )  # fmt: skip


def body_z_axis(euler: Vec3) -> Vec3:
    """The thrust axis R_WB e_z in world coordinates: the third column of `euler_matrix`, as in (3)."""
    (c_roll, c_pitch, c_yaw), (s_roll, s_pitch, s_yaw) = _turns(euler)
    return Vec3(
        c_yaw * s_pitch * c_roll + s_yaw * s_roll,
        s_yaw * s_pitch * c_roll - c_yaw * s_roll,
        c_pitch * c_roll,
    )
