"""Value types with operators.

`Vec3` and `Mat3` hold scalars of any kind (see `rotorfault.maths.scalar`), so equations read as in a paper:
``thrust_W / mass + g_W``, ``omega.cross(J @ omega)``, ``Y.T @ Y``. `PerRotor` holds one scalar per rotor, in
the order of the vehicle, and works elementwise.

Rotations are in `rotorfault.maths.rotation`.
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Iterable, Iterator
from typing import ClassVar, overload

from rotorfault.base.one_line import brief
from rotorfault.maths.scalar import Scalar, reciprocal, sqrt


class Value:
    """A fixed number of scalars under names. Immutable by convention; subclasses add operators."""

    __slots__: ClassVar[tuple[str, ...]] = ()
    # Without this, ndarray * Vec3 would be broadcast by NumPy into an array of objects.
    __array_ufunc__ = None

    @property
    def names(self) -> tuple[str, ...]:
        """Of the scalars, in their order."""
        return self.__slots__

    def __iter__(self) -> Iterator[Scalar]:
        return (getattr(self, name) for name in self.__slots__)

    def __repr__(self) -> str:
        # Numbers with all their digits, arrays by their shape.
        texts = [repr(value) if isinstance(value, float) else brief(value) for value in self]
        inside = ", ".join(f"{name}={text}" for name, text in zip(self.names, texts, strict=True))
        return f"{type(self).__name__}({inside})"

    def __eq__(self, other: object) -> bool:
        return type(other) is type(self) and [*self] == [*other]

    __hash__ = None  # type: ignore[assignment]


class Vec3(Value):
    """Three components along x, y, z of one frame."""

    __slots__ = ("x", "y", "z")

    def __init__(self, x: Scalar, y: Scalar, z: Scalar) -> None:
        self.x, self.y, self.z = x, y, z

    def __iter__(self) -> Iterator[Scalar]:
        return iter((self.x, self.y, self.z))

    @classmethod
    def of(cls, components: Iterable[Scalar]) -> Vec3:
        """Make a vector of three components in an iterable."""
        x, y, z = components
        return cls(x, y, z)

    def __add__(self, other: Vec3) -> Vec3:
        return Vec3(self.x + other.x, self.y + other.y, self.z + other.z)

    def __sub__(self, other: Vec3) -> Vec3:
        return Vec3(self.x - other.x, self.y - other.y, self.z - other.z)

    def __neg__(self) -> Vec3:
        return Vec3(-self.x, -self.y, -self.z)

    def __mul__(self, factor: Scalar) -> Vec3:
        return Vec3(self.x * factor, self.y * factor, self.z * factor)

    __rmul__ = __mul__

    def __truediv__(self, divisor: Scalar) -> Vec3:
        return Vec3(self.x / divisor, self.y / divisor, self.z / divisor)

    def times(self, other: Vec3) -> Vec3:
        """Componentwise product."""
        return Vec3(self.x * other.x, self.y * other.y, self.z * other.z)

    def over(self, other: Vec3) -> Vec3:
        """Componentwise quotient."""
        return Vec3(self.x / other.x, self.y / other.y, self.z / other.z)

    def map(self, function: Callable[[Scalar], Scalar]) -> Vec3:
        """Apply a function to each component."""
        return Vec3(function(self.x), function(self.y), function(self.z))

    def dot(self, other: Vec3) -> Scalar:
        """Scalar product."""
        return self.x * other.x + self.y * other.y + self.z * other.z

    def cross(self, other: Vec3) -> Vec3:
        """Vector product."""
        return Vec3(
            self.y * other.z - self.z * other.y,
            self.z * other.x - self.x * other.z,
            self.x * other.y - self.y * other.x,
        )

    def sum(self) -> Scalar:
        """Sum of the components."""
        return self.x + self.y + self.z

    def norm(self) -> Scalar:
        """Euclidean length."""
        return sqrt(self.dot(self))


class Mat3(Value):
    """A 3x3 matrix, elements named by row and column."""

    __slots__ = ("xx", "xy", "xz", "yx", "yy", "yz", "zx", "zy", "zz")

    def __init__(
        self,
        xx: Scalar, xy: Scalar, xz: Scalar,
        yx: Scalar, yy: Scalar, yz: Scalar,
        zx: Scalar, zy: Scalar, zz: Scalar,
    ) -> None:  # fmt: skip
        self.xx, self.xy, self.xz = xx, xy, xz
        self.yx, self.yy, self.yz = yx, yy, yz
        self.zx, self.zy, self.zz = zx, zy, zz

    def __iter__(self) -> Iterator[Scalar]:
        return iter((self.xx, self.xy, self.xz, self.yx, self.yy, self.yz, self.zx, self.zy, self.zz))

    @classmethod
    def diagonal(cls, d: Vec3) -> Mat3:
        """Diagonal matrix."""
        return cls(d.x, 0.0, 0.0, 0.0, d.y, 0.0, 0.0, 0.0, d.z)

    @classmethod
    def identity(cls) -> Mat3:
        """Unit matrix."""
        return cls(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)

    @classmethod
    def skew(cls, v: Vec3) -> Mat3:
        """The matrix S with S u = v x u."""
        return cls(0.0, -v.z, v.y, v.z, 0.0, -v.x, -v.y, v.x, 0.0)

    @property
    def T(self) -> Mat3:
        """Transpose."""
        return Mat3(self.xx, self.yx, self.zx, self.xy, self.yy, self.zy, self.xz, self.yz, self.zz)

    @property
    def rows(self) -> tuple[Vec3, Vec3, Vec3]:
        """The three rows."""
        return (
            Vec3(self.xx, self.xy, self.xz),
            Vec3(self.yx, self.yy, self.yz),
            Vec3(self.zx, self.zy, self.zz),
        )

    @property
    def diag(self) -> Vec3:
        """The diagonal."""
        return Vec3(self.xx, self.yy, self.zz)

    def map(self, function: Callable[[Scalar], Scalar]) -> Mat3:
        """Apply a function to each element."""
        return Mat3(*map(function, self))

    def __add__(self, other: Mat3) -> Mat3:
        return Mat3(*map(operator.add, self, other))

    def __sub__(self, other: Mat3) -> Mat3:
        return Mat3(*map(operator.sub, self, other))

    def __neg__(self) -> Mat3:
        return Mat3(*map(operator.neg, self))

    def __mul__(self, factor: Scalar) -> Mat3:
        return Mat3(*[a * factor for a in self])

    __rmul__ = __mul__

    def __truediv__(self, divisor: Scalar) -> Mat3:
        quotient: Mat3 = self * (1.0 / divisor)
        return quotient

    @overload
    def __matmul__(self, other: Vec3) -> Vec3: ...
    @overload
    def __matmul__(self, other: Mat3) -> Mat3: ...
    def __matmul__(self, other: Vec3 | Mat3) -> Vec3 | Mat3:
        if isinstance(other, Vec3):
            a, b, c = self.rows
            return Vec3(a.dot(other), b.dot(other), c.dot(other))
        m, n = self, other
        return Mat3(
            m.xx * n.xx + m.xy * n.yx + m.xz * n.zx,
            m.xx * n.xy + m.xy * n.yy + m.xz * n.zy,
            m.xx * n.xz + m.xy * n.yz + m.xz * n.zz,
            m.yx * n.xx + m.yy * n.yx + m.yz * n.zx,
            m.yx * n.xy + m.yy * n.yy + m.yz * n.zy,
            m.yx * n.xz + m.yy * n.yz + m.yz * n.zz,
            m.zx * n.xx + m.zy * n.yx + m.zz * n.zx,
            m.zx * n.xy + m.zy * n.yy + m.zz * n.zy,
            m.zx * n.xz + m.zy * n.yz + m.zz * n.zz,
        )

    def times(self, other: Mat3) -> Mat3:
        """Elementwise product."""
        return Mat3(*map(operator.mul, self, other))

    def trace(self) -> Scalar:
        """Sum of the diagonal."""
        return self.xx + self.yy + self.zz

    def adjugate(self) -> Mat3:
        """Adjugate: self @ self.adjugate() = det(self) I."""
        return Mat3(
            self.yy * self.zz - self.yz * self.zy,
            self.xz * self.zy - self.xy * self.zz,
            self.xy * self.yz - self.xz * self.yy,
            self.yz * self.zx - self.yx * self.zz,
            self.xx * self.zz - self.xz * self.zx,
            self.xz * self.yx - self.xx * self.yz,
            self.yx * self.zy - self.yy * self.zx,
            self.xy * self.zx - self.xx * self.zy,
            self.xx * self.yy - self.xy * self.yx,
        )

    def det(self) -> Scalar:
        """Determinant, by minors as `adjugate` has them: a compiled function computes them once."""
        return (
            self.xx * (self.yy * self.zz - self.yz * self.zy)
            + self.xy * (self.yz * self.zx - self.yx * self.zz)
            + self.xz * (self.yx * self.zy - self.yy * self.zx)
        )

    def inverse(self) -> Mat3:
        """Inverse by the adjugate, not for near-singular matrices; not finite where the determinant is zero."""
        inverse: Mat3 = self.adjugate() * reciprocal(self.det())
        return inverse

    def norm(self) -> Scalar:
        """Frobenius norm."""
        return sqrt(sum(element * element for element in self))


class PerRotor(Value):
    """One scalar per rotor, in the order of the vehicle; all operators work elementwise.

    Parameters
    ----------
    *values : scalar
        Of rotor 1, 2, ...; as many as the vehicle has rotors.
    """

    __slots__ = ("_values",)

    def __init__(self, *values: Scalar) -> None:
        self._values = values

    @classmethod
    def all(cls, value: Scalar, count: int = 4) -> PerRotor:
        """The same value for each of so many rotors."""
        return cls(*(value,) * count)

    @classmethod
    def of(cls, values: Iterable[Scalar]) -> PerRotor:
        """Make it of the values in an iterable."""
        return cls(*values)

    @property
    def names(self) -> tuple[str, ...]:
        """r1, r2, ..."""
        return tuple(f"r{number}" for number in range(1, len(self._values) + 1))

    def __iter__(self) -> Iterator[Scalar]:
        return iter(self._values)

    def __len__(self) -> int:
        return len(self._values)

    def __getitem__(self, index: int) -> Scalar:
        """The value of a rotor; 0 is rotor 1."""
        return self._values[index]

    def __getattr__(self, name: str) -> Scalar:
        # r1, r2, ...: looked up only where there is no other attribute of that name.
        if name[:1] == "r" and name[1:].isdecimal() and 0 < int(name[1:]) <= len(self._values):
            return self._values[int(name[1:]) - 1]
        raise AttributeError(f"{type(self).__name__} has no {name}")

    def _with(self, other: PerRotor | Scalar, operation: Callable[[Scalar, Scalar], Scalar]) -> PerRotor:
        if isinstance(other, PerRotor):
            return self.map(operation, other)
        return PerRotor(*map(operation, self._values, (other,) * len(self._values)))

    def __add__(self, other: PerRotor | Scalar) -> PerRotor:
        return self._with(other, operator.add)

    __radd__ = __add__

    def __sub__(self, other: PerRotor | Scalar) -> PerRotor:
        return self._with(other, operator.sub)

    def __rsub__(self, other: Scalar) -> PerRotor:
        return self._with(other, lambda a, b: b - a)

    def __neg__(self) -> PerRotor:
        return PerRotor(*(-a for a in self._values))

    def __mul__(self, other: PerRotor | Scalar) -> PerRotor:
        return self._with(other, operator.mul)

    __rmul__ = __mul__

    def __truediv__(self, other: PerRotor | Scalar) -> PerRotor:
        return self._with(other, operator.truediv)

    def map(self, function: Callable[..., Scalar], *others: PerRotor) -> PerRotor:
        """Apply ``function(own, *others)`` rotor by rotor."""
        count = len(self._values)
        for other in others:
            if len(other) != count:
                raise ValueError(f"numbers of {count} rotors and of {len(other)}; allowed: of equally many")
        return PerRotor(*map(function, self._values, *others))

    def dot(self, other: PerRotor) -> Scalar:
        """Sum over the rotors of the products."""
        first, *more = (a * b for a, b in zip(self._values, other._values, strict=True))
        return sum(more, first)

    def sum(self) -> Scalar:
        """Sum over the rotors."""
        first, *more = self._values
        return sum(more, first)

    def reduce(self, function: Callable[[Scalar, Scalar], Scalar]) -> Scalar:
        """Fold the values with a function of two, such as `rotorfault.maths.scalar.minimum`, in pairs."""
        values = [*self._values]
        while len(values) > 1:
            paired = [function(a, b) for a, b in zip(values[::2], values[1::2], strict=False)]
            values = paired + values[2 * len(paired) :]
        return values[0]


def per_rotor(function: Callable[..., Scalar], *values: Scalar) -> Scalar:
    """Apply ``function(*values)`` rotor by rotor where any value is a `PerRotor`, else once.

    Parameters
    ----------
    function : callable
        Of scalars.
    *values : scalar or PerRotor
        A scalar counts for every rotor.

    Returns
    -------
    scalar or PerRotor
    """
    rotors = next((value for value in values if isinstance(value, PerRotor)), None)
    if rotors is None:
        return function(*values)
    first, *others = (spread(value, len(rotors)) for value in values)
    return first.map(function, *others)


def spread(value: PerRotor | Scalar, rotors: int) -> PerRotor:
    """A number for each of so many rotors; one scalar is that of all."""
    return value if isinstance(value, PerRotor) else PerRotor.all(value, rotors)


def zeros() -> Vec3:
    """The zero vector."""
    return Vec3(0.0, 0.0, 0.0)
