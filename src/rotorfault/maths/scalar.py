"""Functions on scalars, whatever number type carries them.

Every equation of rotorfault is written once, on scalars, with ``+ - * /`` and the functions of this module. This
is the only file that knows which number types exist: Python floats, NumPy arrays, the terms of
`rotorfault.engine.trace`, heyoka expressions and CasADi SX. A function looks at *all* its arguments to choose the
type, so that floats and symbols may be mixed.

Rules that every function keeps:

- NaN in any argument gives NaN out (``select`` passes on the branch that it takes). A comparison with NaN is
  false, so conditions are to be written such that NaN counts as *outside*.
- A condition is a number, 1 where it holds and 0 where not; `both`, `either` and `negated` combine conditions.
- ``sqrt`` of a negative float is NaN, not an exception: failure is data.

Symbols' modules are never imported here: their expressions bring their module with them.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterable
from functools import partial
from types import ModuleType
from typing import Any, TypeAlias

import numpy as np

Scalar: TypeAlias = Any
"""A float, a NumPy array, a term, a heyoka expression or a CasADi SX: whatever one engine computes with."""

NAN = math.nan
_ONE_ARGUMENT = ("exp", "log", "sin", "cos", "tan", "asin", "tanh")


class _Derived:
    """What every number type can do by selection; a type that has better overrides it."""

    less: Any
    less_equal: Any
    select: Any

    def reciprocal(self, x: Scalar) -> Scalar:
        return 1.0 / x

    def minimum(self, a: Scalar, b: Scalar) -> Scalar:
        return self.select(self.less(a, b), a, self.select(self.less_equal(b, a), b, a + b))

    def maximum(self, a: Scalar, b: Scalar) -> Scalar:
        return self.select(self.less(b, a), a, self.select(self.less_equal(a, b), b, a + b))

    def absolute(self, x: Scalar) -> Scalar:
        return self.select(self.less(x, 0.0), -x, x)


def _of_angle(function: Callable[[float], float]) -> Callable[[float], float]:
    return lambda x: function(x) if abs(x) < math.inf else NAN


class _Floats:
    """Python floats. ``math`` raises where IEEE arithmetic gives NaN or infinity; here it must not."""

    @staticmethod
    def minimum(a: float, b: float) -> float:
        return a if a < b else b if b <= a else a + b

    @staticmethod
    def maximum(a: float, b: float) -> float:
        return a if b < a else b if a <= b else a + b

    @staticmethod
    def absolute(x: float) -> float:
        return -x if x < 0.0 else x

    @staticmethod
    def sqrt(x: float) -> float:
        return math.sqrt(x) if x >= 0.0 else NAN

    @staticmethod
    def reciprocal(x: float) -> float:
        return 1.0 / x if x != 0.0 else math.copysign(math.inf, x)

    @staticmethod
    def exp(x: float) -> float:
        return math.exp(x) if not x > 709.0 else math.inf

    @staticmethod
    def asin(x: float) -> float:
        return math.asin(x) if -1.0 <= x <= 1.0 else NAN

    sin, cos, tan = (staticmethod(_of_angle(function)) for function in (math.sin, math.cos, math.tan))
    atan2, tanh, log = staticmethod(math.atan2), staticmethod(math.tanh), staticmethod(math.log)

    @staticmethod
    def nearest(x: float) -> float:
        return float(round(x)) if abs(x) < math.inf else x

    @staticmethod
    def less(a: float, b: float) -> float:
        return 1.0 if a < b else 0.0

    @staticmethod
    def less_equal(a: float, b: float) -> float:
        return 1.0 if a <= b else 0.0

    @staticmethod
    def select(condition: float, a: float, b: float) -> float:
        return a if condition else b


class _Arrays(_Derived):
    """NumPy arrays, one element per flight."""

    sqrt, exp, log, sin, cos, tan = np.sqrt, np.exp, np.log, np.sin, np.cos, np.tan
    asin, atan2, tanh, nearest = np.arcsin, np.arctan2, np.tanh, np.rint
    minimum, maximum, absolute = np.minimum, np.maximum, np.absolute  # type: ignore[assignment]

    @staticmethod
    def less(a: Scalar, b: Scalar) -> Scalar:
        return np.less(a, b).astype(float)

    @staticmethod
    def less_equal(a: Scalar, b: Scalar) -> Scalar:
        return np.less_equal(a, b).astype(float)

    @staticmethod
    def select(condition: Scalar, a: Scalar, b: Scalar) -> Scalar:
        return np.where(condition, a, b)


class _Heyoka(_Derived):
    """heyoka expressions. Its functions refuse plain floats and its comparisons are functions, not operators."""

    def __init__(self, module: ModuleType) -> None:
        self._expression = module.expression
        self._lt, self._lte, self._select = module.lt, module.lte, module.select
        self._atan2, self._cos, self._sin = module.atan2, module.cos, module.sin
        self._one_argument = {name: getattr(module, name) for name in _ONE_ARGUMENT}
        self.sqrt = module.sqrt
        self._one = module.expression(1.0)

    def __getattr__(self, name: str) -> Any:
        # Plain one-argument functions need no adaptation: dispatch has seen that the argument is an expression.
        return self._one_argument[name]

    def nearest(self, x: Scalar) -> Scalar:
        # There is no rounding: the distance from the nearest whole number is an angle.
        turn = x * (2.0 * math.pi)
        return x - self._atan2(self._sin(turn), self._cos(turn)) * (0.5 / math.pi)

    def reciprocal(self, x: Scalar) -> Scalar:
        # heyoka turns every product with a bare 1/x into a division of its own. A select of constant condition
        # hides it from heyoka; LLVM then drops the select.
        return self._select(self._one, 1.0 / x, x)

    def _lift(self, x: Scalar) -> Scalar:
        return x if isinstance(x, self._expression) else self._expression(float(x))

    def atan2(self, y: Scalar, x: Scalar) -> Scalar:
        return self._atan2(self._lift(y), self._lift(x))

    def less(self, a: Scalar, b: Scalar) -> Scalar:
        return self._lt(self._lift(a), self._lift(b))

    def less_equal(self, a: Scalar, b: Scalar) -> Scalar:
        return self._lte(self._lift(a), self._lift(b))

    def select(self, condition: Scalar, a: Scalar, b: Scalar) -> Scalar:
        if not isinstance(condition, self._expression):
            return a if condition else b
        return self._select(condition, self._lift(a), self._lift(b))


class _Casadi(_Derived):
    """CasADi SX (or MX), for linearisation and C code."""

    def __init__(self, module: ModuleType) -> None:
        self._module = module
        for name in (*_ONE_ARGUMENT, "sqrt", "atan2"):
            setattr(self, name, getattr(module, name))
        self.less, self.less_equal, self.select = module.lt, module.le, module.if_else

    def nearest(self, x: Scalar) -> Scalar:
        return self._module.floor(x + 0.5)


class _Terms(_Derived):
    """Terms of the compiled engine."""

    def __init__(self, module: ModuleType) -> None:
        self._function = module.function
        self.less, self.less_equal, self.select = module.less, module.less_equal, module.select
        self.minimum, self.maximum = module.minimum, module.maximum  # type: ignore[method-assign]
        self.absolute = module.absolute  # type: ignore[method-assign]

    def __getattr__(self, name: str) -> Any:
        return partial(self._function, "round" if name == "nearest" else name)


_FLOATS, _ARRAYS = _Floats(), _Arrays()
_BY_TYPE: dict[type, Any] = {
    float: _FLOATS,
    int: _FLOATS,
    bool: _FLOATS,
    np.float64: _FLOATS,
    np.ndarray: _ARRAYS,
}


def _adopt(kind: type) -> Any:
    """Find the functions for a number type seen for the first time; its own module is already imported."""
    family = kind.__module__.partition(".")[0]
    if family == "heyoka":
        found: Any = _Heyoka(sys.modules["heyoka"])
    elif family == "casadi":
        found = _Casadi(sys.modules["casadi"])
    elif kind.__module__ == "rotorfault.engine.trace":
        found = _Terms(sys.modules[kind.__module__])
    elif issubclass(kind, (np.ndarray, np.generic)):
        found = _ARRAYS if issubclass(kind, np.ndarray) else _FLOATS
    else:
        raise TypeError(f"{kind.__module__}.{kind.__qualname__} is no scalar that rotorfault computes with")
    _BY_TYPE[kind] = found
    return found


def _of(*arguments: Scalar) -> Any:
    """Choose the functions by all arguments: any array or symbol among them outranks the floats."""
    for argument in arguments:
        kind = type(argument)
        if kind is not float and (functions := _BY_TYPE.get(kind) or _adopt(kind)) is not _FLOATS:
            return functions
    return _FLOATS


# --------------------------------------------------------------------------------------------- elementary functions


def sqrt(x: Scalar) -> Scalar:
    """Square root; NaN below zero."""
    return _of(x).sqrt(x)


def reciprocal(x: Scalar) -> Scalar:
    """1/x, and infinity at zero, where a division of Python floats would raise."""
    return _of(x).reciprocal(x)


def exp(x: Scalar) -> Scalar:
    """Exponential function."""
    return _of(x).exp(x)


def log(x: Scalar) -> Scalar:
    """Natural logarithm; NaN at zero and below."""
    f = _of(x)
    return f.log(f.select(f.less(0.0, x), x, NAN))


def sin(x: Scalar) -> Scalar:
    """Sine of an angle in rad."""
    return _of(x).sin(x)


def cos(x: Scalar) -> Scalar:
    """Cosine of an angle in rad."""
    return _of(x).cos(x)


def tan(x: Scalar) -> Scalar:
    """Tangent of an angle in rad."""
    return _of(x).tan(x)


def asin(x: Scalar) -> Scalar:
    """Inverse sine in rad; NaN outside [-1, 1]."""
    return _of(x).asin(x)


def atan2(y: Scalar, x: Scalar) -> Scalar:
    """Angle of the point (x, y) in rad, in (-pi, pi]."""
    return _of(y, x).atan2(y, x)


def tanh(x: Scalar) -> Scalar:
    """Hyperbolic tangent."""
    return _of(x).tanh(x)


# ------------------------------------------------------------------------------------------ conditions and selection


def less(a: Scalar, b: Scalar) -> Scalar:
    """1 where a < b, else 0; 0 where either is NaN."""
    if type(a) is type(b) is float:
        return 1.0 if a < b else 0.0
    return _of(a, b).less(a, b)


def less_equal(a: Scalar, b: Scalar) -> Scalar:
    """1 where a <= b, else 0; 0 where either is NaN."""
    return _of(a, b).less_equal(a, b)


def greater(a: Scalar, b: Scalar) -> Scalar:
    """1 where a > b, else 0; 0 where either is NaN."""
    return less(b, a)


def greater_equal(a: Scalar, b: Scalar) -> Scalar:
    """1 where a >= b, else 0; 0 where either is NaN."""
    return less_equal(b, a)


def both(a: Scalar, b: Scalar) -> Scalar:
    """Logical and of two conditions."""
    return a * b


def either(a: Scalar, b: Scalar) -> Scalar:
    """Logical or of two conditions."""
    return 1.0 - (1.0 - a) * (1.0 - b)


def any_of(conditions: Iterable[Scalar]) -> Scalar:
    """Logical or of some conditions, 0 of none."""
    first, *others = (*conditions,) or (0.0,)
    for condition in others:
        first = either(first, condition)
    return first


def negated(a: Scalar) -> Scalar:
    """Logical not of a condition."""
    return 1.0 - a


def select(condition: Scalar, a: Scalar, b: Scalar) -> Scalar:
    """`a` where the condition is 1, `b` where it is 0. Both are computed; only the taken one is passed on."""
    if type(a) is type(b) is type(condition) is float:  # the short way of what is asked for most often
        return a if condition else b
    return _of(condition, a, b).select(condition, a, b)


# ---------------------------------------------------------------------------------------- derived: one source for all


def minimum(a: Scalar, b: Scalar) -> Scalar:
    """The smaller of two; NaN if either is NaN."""
    return _of(a, b).minimum(a, b)


def maximum(a: Scalar, b: Scalar) -> Scalar:
    """The larger of two; NaN if either is NaN."""
    return _of(a, b).maximum(a, b)


def absolute(x: Scalar) -> Scalar:
    """Magnitude."""
    return _of(x).absolute(x)


def sign(x: Scalar) -> Scalar:
    """-1, 0 or 1 with the sign of x; NaN for NaN."""
    f = _of(x)
    return f.select(f.less(0.0, x), 1.0, f.select(f.less(x, 0.0), -1.0, x))


def clip(x: Scalar, low: Scalar, high: Scalar) -> Scalar:
    """x limited to [low, high]; NaN if any of the three is NaN."""
    return minimum(maximum(x, low), high)


def saturate(x: Scalar) -> Scalar:
    """sat(x): x limited to [-1, 1], the boundary-layer function of sliding mode control."""
    f = _of(x)
    return f.select(f.less(x, -1.0), -1.0, f.select(f.less(1.0, x), 1.0, x))


def nearest(x: Scalar) -> Scalar:
    """The nearest whole number; of two that are equally near, either."""
    return _of(x).nearest(x)


def wrap_angle(x: Scalar) -> Scalar:
    """The angle equal to x modulo a full turn, in [-pi, pi]; its error grows by 1e-16 rad with each turn."""
    return x - (2.0 * math.pi) * nearest(x * (0.5 / math.pi))


def is_finite(x: Scalar) -> Scalar:
    """1 where x is an ordinary number, 0 where it is NaN or infinite."""
    f = _of(x)
    return f.less_equal(x, sys.float_info.max) * f.less_equal(-sys.float_info.max, x)


def is_condition(x: Scalar) -> bool:
    """Whether it is known to be 1 or 0 by nature, as only of symbols it is."""
    return bool(getattr(x, "truth", False))
