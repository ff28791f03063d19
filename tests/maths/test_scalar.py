"""Every function of `rotorfault.maths.scalar`, on every number type, with ordinary numbers, edges and NaN."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from rotorfault.maths import scalar

NAN, INF = math.nan, math.inf

ONE = (
    "sqrt", "reciprocal", "exp", "log", "sin", "cos", "tan", "asin", "tanh", "absolute", "sign", "saturate",
    "nearest", "wrap_angle",
)  # fmt: skip
TWO = ("atan2", "minimum", "maximum")
COMPARISONS = ("less", "less_equal", "greater", "greater_equal")
CONDITIONS_2 = ("both", "either")

NUMBERS = [-3.5, -1.0, -0.3, 0.0, 1e-12, 0.3, 1.0, 2.0, 40.0]
EXPECTED: dict[str, Callable[..., float]] = {
    "sqrt": lambda x: math.sqrt(x) if x >= 0 else NAN,
    "reciprocal": lambda x: 1.0 / x if x != 0.0 else math.copysign(INF, x),
    "exp": math.exp,
    "log": lambda x: math.log(x) if x > 0 else NAN,
    "sin": math.sin,
    "cos": math.cos,
    "tan": math.tan,
    "asin": lambda x: math.asin(x) if abs(x) <= 1 else NAN,
    "tanh": math.tanh,
    "absolute": abs,
    "sign": lambda x: float(np.sign(x)),
    "saturate": lambda x: min(max(x, -1.0), 1.0),
    "nearest": lambda x: float(round(x)),
    "wrap_angle": lambda x: math.remainder(x, 2 * math.pi),
    "atan2": math.atan2,
    "minimum": min,
    "maximum": max,
    "less": lambda a, b: float(a < b),
    "less_equal": lambda a, b: float(a <= b),
    "greater": lambda a, b: float(a > b),
    "greater_equal": lambda a, b: float(a >= b),
    "clip": lambda x, low, high: min(max(x, low), high),
    "select": lambda c, a, b: a if c else b,
    "is_finite": lambda x: float(math.isfinite(x)),
    "both": lambda a, b: float(a and b),
    "either": lambda a, b: float(a or b),
    "any_of": lambda *conditions: float(any(conditions)),
    "negated": lambda a: 1.0 - a,
}


def on_floats(function: Callable[..., Any], rows: np.ndarray) -> np.ndarray:
    return np.array([function(*map(float, row)) for row in rows])


def on_arrays(function: Callable[..., Any], rows: np.ndarray) -> np.ndarray:
    return np.asarray(function(*rows.T.copy()))


def on_terms(function: Callable[..., Any], rows: np.ndarray) -> np.ndarray:
    pytest.importorskip("llvmlite")
    from rotorfault.engine.function import CompiledFunction

    compiled = CompiledFunction(function, *[0.0] * rows.shape[1])
    return np.asarray(compiled(rows.T.copy())[0])


def on_heyoka(function: Callable[..., Any], rows: np.ndarray) -> np.ndarray:
    hy = pytest.importorskip("heyoka")
    symbols = [hy.expression(f"x{i}") for i in range(rows.shape[1])]
    compiled = hy.cfunc([function(*symbols)], symbols)
    return np.array([compiled(row)[0] for row in np.ascontiguousarray(rows)])


def on_casadi(function: Callable[..., Any], rows: np.ndarray) -> np.ndarray:
    ca = pytest.importorskip("casadi")
    symbols = [ca.SX.sym(f"x{i}") for i in range(rows.shape[1])]
    compiled = ca.Function("f", symbols, [function(*symbols)])
    return np.array([float(compiled(*row)) for row in rows])


ENGINES = pytest.mark.parametrize(
    "engine",
    [on_floats, on_arrays, on_terms, on_heyoka, on_casadi],
    ids=["floats", "arrays", "terms", "heyoka", "casadi"],
)


def grid(*axes: list[float]) -> np.ndarray:
    return np.array(np.meshgrid(*axes, indexing="ij")).reshape(len(axes), -1).T


def arguments(name: str) -> np.ndarray:
    if name == "clip":
        return grid(NUMBERS, [-1.0, -0.3], [0.3, 2.0])
    if name == "nearest":
        return grid([x for x in NUMBERS if x != -3.5])  # of two that are equally near, either will do
    if name == "select":
        return grid([0.0, 1.0], NUMBERS, [7.0, -7.0])
    if name in (*CONDITIONS_2, "negated", "any_of"):
        return grid(*[[0.0, 1.0]] * {"negated": 1, "any_of": 3}.get(name, 2))
    return grid(*[NUMBERS] * (1 if name in (*ONE, "is_finite") else 2))


def function(name: str) -> Callable[..., Any]:
    """A function of the module, of as many arguments as it has scalars."""
    return (lambda *conditions: scalar.any_of(conditions)) if name == "any_of" else getattr(scalar, name)


def public_functions() -> set[str]:
    """Functions of numbers; what tells a kind of number from another gives a truth value of Python."""
    return {
        name
        for name, thing in vars(scalar).items()
        if callable(thing) and getattr(thing, "__module__", "") == scalar.__name__ and not name.startswith("_")
        if getattr(thing, "__annotations__", {}).get("return") != "bool"
    }


def test_every_function_of_the_module_is_tested_here() -> None:
    assert public_functions() == set(EXPECTED)


@ENGINES
@pytest.mark.parametrize("name", sorted(EXPECTED))
def test_agrees_with_the_definition(engine: Callable[..., np.ndarray], name: str) -> None:
    rows = arguments(name)
    with np.errstate(invalid="ignore", divide="ignore"):
        got = engine(function(name), rows)
    want = np.array([EXPECTED[name](*map(float, row)) for row in rows])
    np.testing.assert_allclose(got, want, rtol=4e-15, atol=4e-15)


@ENGINES
@pytest.mark.parametrize("name", [*ONE, *TWO, "clip"])
def test_nan_in_any_argument_comes_out(engine: Callable[..., np.ndarray], name: str) -> None:
    count = arguments(name).shape[1]
    rows = np.full((count, count), 0.5)
    np.fill_diagonal(rows, NAN)
    assert np.isnan(engine(function(name), rows)).all()


@ENGINES
@pytest.mark.parametrize("name", COMPARISONS)
def test_comparison_with_nan_is_false(engine: Callable[..., np.ndarray], name: str) -> None:
    rows = np.array([[NAN, 1.0], [1.0, NAN], [NAN, NAN]])
    assert (engine(function(name), rows) == 0.0).all()


@ENGINES
def test_select_passes_only_the_branch_it_takes(engine: Callable[..., np.ndarray]) -> None:
    got = engine(scalar.select, np.array([[1.0, 2.0, NAN], [0.0, NAN, 3.0], [1.0, NAN, 3.0], [0.0, 2.0, NAN]]))
    np.testing.assert_array_equal(got, [2.0, 3.0, NAN, NAN])


@ENGINES
def test_is_finite_knows_nan_and_both_infinities(engine: Callable[..., np.ndarray]) -> None:
    assert list(engine(scalar.is_finite, np.array([[NAN], [INF], [-INF], [1.7e308], [0.0]]))) == [0, 0, 0, 1, 1]


@ENGINES
def test_constants_mix_with_the_number_type_in_any_place(engine: Callable[..., np.ndarray]) -> None:
    rows = np.array([[-2.0], [0.5], [3.0]])
    for function, want in (
        (lambda x: scalar.clip(x, 0.0, 1.0), [0.0, 0.5, 1.0]),
        (lambda x: scalar.clip(0.7, x, x + 1.0), [-1.0, 0.7, 3.0]),
        (lambda x: scalar.maximum(1.0, x), [1.0, 1.0, 3.0]),
        (lambda x: scalar.select(scalar.less(1.0, x), 5, -5), [-5.0, -5.0, 5.0]),
        (lambda x: scalar.select(1.0, x, 0.0), [-2.0, 0.5, 3.0]),
        (lambda x: scalar.atan2(1.0, x), [math.atan2(1, -2), math.atan2(1, 0.5), math.atan2(1, 3)]),
    ):
        np.testing.assert_allclose(engine(function, rows), want, rtol=1e-15)


def test_any_of_no_conditions_does_not_hold() -> None:
    assert scalar.any_of(()) == 0.0


def test_floats_never_raise_where_ieee_arithmetic_gives_nan_or_infinity() -> None:
    assert math.isnan(scalar.sqrt(-1.0))
    assert math.isnan(scalar.asin(1.0000001))
    assert scalar.exp(1000.0) == INF
    assert scalar.reciprocal(-0.0) == -INF
    assert scalar.exp(-1000.0) == 0.0
    for function in (scalar.sin, scalar.cos, scalar.tan):
        assert math.isnan(function(INF))
        assert math.isnan(function(-INF))


def test_numpy_scalars_count_as_floats() -> None:
    assert scalar.maximum(np.float64(1.0), 2) == 2.0
    assert scalar.sqrt(np.float32(4.0)) == 2.0


def test_a_reciprocal_divides_once_however_often_it_is_used() -> None:
    hy = pytest.importorskip("heyoka")
    x, y, z = (hy.expression(name) for name in "xyz")
    inverse = scalar.reciprocal(x)
    operations = [str(part) for part in hy.cfunc([y * inverse, z * inverse], [x, y, z]).dc]
    assert sum("**-1" in part or "div" in part for part in operations) == 1


def test_refuses_what_is_no_scalar() -> None:
    with pytest.raises(TypeError, match="no scalar"):
        scalar.sin("0.5")


def test_wrapped_angle_lies_in_the_half_open_turn() -> None:
    angle = np.linspace(-20.0, 20.0, 4001)
    wrapped = scalar.wrap_angle(angle)
    assert (np.abs(wrapped) <= math.pi).all()
    turns = (angle - wrapped) / (2 * math.pi)
    np.testing.assert_allclose(turns, np.round(turns), atol=1e-12)
