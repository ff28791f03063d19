"""Elementary functions in machine code: within about one unit in the last place of the true value, edges included."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from rotorfault.maths import scalar

pytest.importorskip("llvmlite")

from rotorfault.engine.code import Code
from rotorfault.engine.function import CompiledFunction

RNG = np.random.default_rng(1)
COUNT = 20_000


def evaluate(function: Callable[..., Any], *arguments: np.ndarray) -> np.ndarray:
    return np.asarray(CompiledFunction(function, *[0.0] * len(arguments))(np.array(arguments))[0])


def units(found: np.ndarray, wanted: np.ndarray) -> float:
    """Largest distance in units in the last place of what is wanted."""
    return float((np.abs(found - wanted) / np.spacing(np.abs(wanted))).max())


def around(*scales: float) -> np.ndarray:
    return np.concatenate([RNG.uniform(-scale, scale, COUNT) for scale in scales])


# NumPy's own error, about one unit, is in these bounds.
CASES: tuple[tuple[str, tuple[np.ndarray, ...], float], ...] = (
    ("sin", (around(1e-3, 10.0, 1e6, 1e12),), 3.0),
    ("cos", (around(1e-3, 10.0, 1e6, 1e12),), 3.0),
    ("tan", (around(1e-3, 10.0, 1e6),), 4.0),
    ("exp", (around(1e-3, 1.0, 700.0),), 2.0),
    ("log", (np.abs(around(1e-3, 2.0, 1e300)),), 3.0),
    ("asin", (around(1e-3, 1.0),), 4.0),
    ("tanh", (around(1e-3, 0.2, 20.0),), 5.0),
    ("sqrt", (np.abs(around(1.0, 1e300)),), 0.0),
)
NUMPY: dict[str, Any] = {"asin": np.arcsin}


@pytest.mark.parametrize(("name", "arguments", "bound"), CASES, ids=[case[0] for case in CASES])
def test_within_a_unit_or_so(name: str, arguments: tuple[np.ndarray, ...], bound: float) -> None:
    found = evaluate(getattr(scalar, name), *arguments)
    assert units(found, NUMPY.get(name, getattr(np, name, None))(*arguments)) <= bound


def test_arc_tangent_of_points_everywhere() -> None:
    y, x = RNG.normal(size=COUNT) * 10.0 ** RNG.uniform(-8, 8, COUNT), RNG.normal(size=COUNT)
    assert units(evaluate(scalar.atan2, y, x), np.arctan2(y, x)) <= 3.0


def test_sine_of_an_arc_tangent_needs_none() -> None:
    """The legs of a triangle: what Euler angles are made of and taken apart into."""
    y, x = RNG.normal(size=(2, COUNT))
    compiled = CompiledFunction(
        lambda b, a: (scalar.sin(scalar.atan2(b, a)), scalar.cos(scalar.atan2(b, a))), 0.0, 0.0
    )
    found, angle = compiled(np.array([y, x])), np.arctan2(y, x)
    np.testing.assert_allclose(found, [np.sin(angle), np.cos(angle)], rtol=1e-15, atol=1e-15)
    assert compiled.operations["fdiv"] == 1
    edges = compiled(np.array([[0.0, math.nan], [0.0, 1.0]]))
    np.testing.assert_array_equal(edges, [[0.0, math.nan], [1.0, math.nan]])


SPECIAL = [0.0, -0.0, 1.0, -1.0, math.inf, -math.inf, math.nan, 1e300, -1e300, 5e-324]


@pytest.mark.parametrize("name", ["exp", "asin", "tanh", "sqrt"])
def test_edges_of_one_argument(name: str) -> None:
    x = np.array(SPECIAL)
    with np.errstate(all="ignore"):
        wanted = NUMPY.get(name, getattr(np, name, None))(x)
    np.testing.assert_allclose(evaluate(getattr(scalar, name), x), wanted, rtol=3e-16, atol=0.0)


def test_a_logarithm_is_that_of_a_positive_number() -> None:
    x = np.array([math.inf, 1.0, 2.0**-1022, 0.0, -0.0, -1.0, -math.inf, math.nan])
    found = evaluate(scalar.log, x)
    np.testing.assert_allclose(found[:3], [math.inf, 0.0, -1022.0 * math.log(2.0)], rtol=3e-16)
    assert np.isnan(found[3:]).all()


@pytest.mark.parametrize("name", ["sin", "cos", "tan"])
def test_no_angle_beyond_the_largest(name: str) -> None:
    x = np.array([math.inf, -math.inf, math.nan, 1.1e14, -1e300])
    assert np.isnan(evaluate(getattr(scalar, name), x)).all()


def test_arc_tangent_at_all_edges() -> None:
    y, x = (grid.ravel() for grid in np.meshgrid(SPECIAL, SPECIAL))
    found, wanted = evaluate(scalar.atan2, y, x), np.arctan2(y, x)
    np.testing.assert_allclose(found, wanted, rtol=3e-16, atol=0.0)
    number = ~np.isnan(wanted)
    np.testing.assert_array_equal(np.signbit(found)[number], np.signbit(wanted)[number])


def test_exponential_near_overflow_and_underflow() -> None:
    x = np.concatenate([np.linspace(-746.0, -700.0, 997), np.linspace(700.0, 711.0, 997)])
    with np.errstate(all="ignore"):
        wanted = np.exp(x)
    np.testing.assert_allclose(evaluate(scalar.exp, x), wanted, rtol=5e-16, atol=1e-323)


def test_what_one_lane_holds_is_nothing_to_the_others() -> None:
    x = around(10.0)[:4000]
    for name in ("sin", "exp", "tanh"):
        alone = evaluate(getattr(scalar, name), x)
        mixed = x.copy()
        mixed[::3] = np.tile([math.nan, math.inf, 1e200], len(mixed[::3]) // 3 + 1)[: len(mixed[::3])]
        np.testing.assert_array_equal(evaluate(getattr(scalar, name), mixed)[1::3], alone[1::3])


def test_an_instruction_is_written_once() -> None:
    code = Code(8)
    assert code.op("fadd", "%a", "%b") == code.op("fadd", "%a", "%b")
    assert len(code.lines) == 1


# -------------------------------------------------------------------------------------------------------------- terms


def test_products_are_fused_where_nobody_else_sees_them() -> None:
    def one(a, b, c):  # type: ignore[no-untyped-def]
        return a * b + c

    def two(a, b, c):  # type: ignore[no-untyped-def]
        return a * b - scalar.minimum(a * b, c)

    assert CompiledFunction(one, 0.0, 0.0, 0.0).operations["fma"] == 1
    compiled = CompiledFunction(two, 0.0, 0.0, 0.0)
    assert compiled.operations["fma"] == 0
    a, b = RNG.uniform(-3.0, 3.0, (2, COUNT))
    assert compiled(np.array([a, b, np.full(COUNT, 1e3)])).max() == 0.0


def test_a_symbol_cannot_be_asked_for_its_truth() -> None:
    with pytest.raises(TypeError, match=r"use rotorfault\.maths\.scalar\.select"):
        CompiledFunction(lambda a: 1.0 if a else 2.0, 0.0)
