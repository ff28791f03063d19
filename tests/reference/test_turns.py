"""Yaw turns the way that was meant, whatever tables and functions lose of full turns."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from rotorfault.base.config import validate
from rotorfault.base.errors import InputError
from rotorfault.maths.geometry import Vec3, zeros
from rotorfault.model.signals import Reference
from rotorfault.reference import REFERENCE, ReferenceTable
from rotorfault.reference.turns import TURN, continuous_yaw

Array = NDArray[np.float64]
PERIOD = 0.002


def wrapped(angle: Array | float) -> Any:
    return np.arctan2(np.sin(angle), np.cos(angle))


def compass(angle: Array) -> Array:
    return np.mod(angle, TURN)


def tabulated(function: Any, duration: float = 12.0) -> ReferenceTable:
    kind: Any = REFERENCE.registry["function"]
    table: ReferenceTable = kind(validate(kind.Settings, {"function": function}, "function")).table(
        np.arange(0.0, duration, PERIOD)
    )
    return table


def csv(rows: list[tuple[float, ...]], columns: str = "t,x,y,z,yaw") -> Any:
    text = "\n".join([columns, *(",".join(map(repr, row)) for row in rows)])
    kind: Any = REFERENCE.registry["csv"]
    return kind(validate(kind.Settings, {"file": "way.csv", "text": text}, "reference"))


# --------------------------------------------------------------------------------------------------------- function


@pytest.mark.parametrize("rate", [0.7, -0.7, 3.0])
@pytest.mark.parametrize("cut", [wrapped, compass])
def test_a_heading_from_an_arc_tangent_turns_on_at_the_border(rate: float, cut: Any) -> None:
    """Along a circle, whose heading passes the border of a turn several times."""
    start = cut(math.pi / 2)
    table = tabulated(lambda t: (math.cos(rate * t), math.sin(rate * t), 1.0, float(cut(rate * t + math.pi / 2))))
    times = np.arange(0.0, 12.0, PERIOD)
    np.testing.assert_allclose(table.yaw, start + rate * times, atol=1e-9)
    np.testing.assert_allclose(table.yaw_rate, rate, atol=1e-9)
    np.testing.assert_allclose(table.yaw_acceleration, 0.0, atol=1e-6)


def test_a_reference_with_derivatives_of_its_own_turns_on_at_the_border() -> None:
    def spin(t: float) -> Reference:
        return Reference(Vec3(0.0, 0.0, 1.0), zeros(), zeros(), float(wrapped(2.0 * t)), 2.0, 0.0)

    table = tabulated(spin)
    np.testing.assert_allclose(table.yaw, 2.0 * np.arange(0.0, 12.0, PERIOD), atol=1e-9)
    assert set(table.yaw_rate) == {2.0}


def test_a_function_that_counts_turns_is_left_alone() -> None:
    table = tabulated(lambda t: (0.0, 0.0, 1.0, -9.0 * t))
    np.testing.assert_array_equal(table.yaw, [-9.0 * t for t in np.arange(0.0, 12.0, PERIOD)])


def test_second_derivatives_stay_clean_late_in_a_long_flight() -> None:
    kind: Any = REFERENCE.registry["function"]
    reference = kind(validate(kind.Settings, {"function": lambda t: (5.0 * t, 0.0, 1.0, 0.0)}, "function"))
    table = reference.table(3600.0 - PERIOD * np.arange(1.0, 200.0))
    np.testing.assert_allclose(table.a_W, 0.0, atol=5e-4)  # 18 km away, of which a double shows 4e-12 m
    np.testing.assert_allclose(table.v_W[:, 0], 5.0, atol=1e-7)


@pytest.mark.parametrize(
    "answer", [("0", "0", "1", "0"), (True, 0, 1, 0), "0010", (0, 0, 1), {"x": 1}, None, (0, 0, [1], 0)], ids=repr
)
def test_a_function_returns_numbers(answer: Any) -> None:
    with pytest.raises(InputError, match=r"at t = 0 s: got .*; allowed: four finite numbers"):
        tabulated(lambda t: answer)


def test_a_function_may_return_numbers_of_numpy() -> None:
    assert tabulated(lambda t: np.array([t, 0, 1, 0], dtype=np.float32)).p_W[0].tolist() == [0.0, 0.0, 1.0]


# -------------------------------------------------------------------------------------------------------------- csv


@pytest.mark.parametrize("cut", [lambda yaw: yaw, wrapped, compass])
@pytest.mark.parametrize("rate", [4.0, -4.0, 1.0, 5.9])
def test_rates_tell_how_far_yaw_turns_between_two_rows(rate: float, cut: Any) -> None:
    """A row each second: at 4 rad/s more than half a turn apart, so that the least change would be the wrong way."""
    t = np.arange(11.0)
    reference = csv(
        [(float(k), 0.0, 0.0, 1.0, float(yaw), rate) for k, yaw in zip(t, cut(rate * t), strict=True)],
        "t,x,y,z,yaw,yaw_rate",
    )
    times = np.linspace(0.0, 10.0, 501)
    table = reference.table(times)
    np.testing.assert_allclose(table.yaw - table.yaw[0], rate * times, atol=1e-9)
    np.testing.assert_allclose(table.yaw_rate, rate, atol=1e-9)


@pytest.mark.parametrize("cut", [wrapped, compass])
def test_without_rates_a_heading_turns_the_shorter_way(cut: Any) -> None:
    t = np.arange(0.0, 20.0, 0.5)
    reference = csv([(float(k), 0.0, 0.0, 1.0, float(cut(1.3 * k))) for k in t])
    np.testing.assert_allclose(reference.table(t).yaw - cut(0.0), 1.3 * t, atol=1e-9)


def test_a_table_of_more_than_a_turn_counts_turns_itself() -> None:
    reference = csv([(float(k), 0.0, 0.0, 1.0, 4.0 * k) for k in range(10)])
    np.testing.assert_allclose(reference.table(np.array([0.0, 4.5, 9.0])).yaw, [0.0, 18.0, 36.0], atol=1e-9)


@pytest.mark.parametrize(
    ("columns", "rows"),
    [
        ("t,x,y,z,yaw", [(0.0, 0.0, 0.0, 1.0, 0.0), (9.0, 0.0, 0.0, 1.0, 4.0)]),
        ("t,x,y,z,yaw", [(0.0, 0.0, 0.0, 1.0, -1.7), (9.0, 0.0, 0.0, 1.0, 1.7)]),
        ("t,x,y,z,yaw,yaw_rate", [(0.0, 0.0, 0.0, 1.0, 0.0, 0.0), (9.0, 0.0, 0.0, 1.0, 4.0, 0.0)]),
    ],
)
def test_what_may_turn_either_way_is_refused(columns: str, rows: list[tuple[float, ...]]) -> None:
    with pytest.raises(InputError) as caught:
        csv(rows, columns)
    message = str(caught.value)
    change = rows[1][4] - rows[0][4]
    for part in ("between t = 0 s and 9 s", f"{change:.4g} rad", f"{change - TURN:.4g} rad", "rows closer in time"):
        assert part in message
    assert ("or add the column yaw_rate" in message) == ("yaw_rate" not in columns)


def test_any_continuous_yaw_is_found_again() -> None:
    """Of smooth yaw in any convention, with the rates that belong to it: up to full turns before the first row."""
    draw = np.random.default_rng(3)
    for _ in range(50):
        t = np.cumsum(draw.uniform(0.02, 0.4, 60))
        a, w, slope = draw.uniform(0.0, 3.0), draw.uniform(0.1, 2.0), draw.uniform(-6.0, 6.0)
        truth, rates = a * np.sin(w * t) + slope * t, a * w * np.cos(w * t) + slope
        for cut in (wrapped, compass):
            found, unclear = continuous_yaw(t, cut(truth), rates)
            assert not len(unclear)
            np.testing.assert_allclose(found - found[0], truth - truth[0], atol=1e-9)
