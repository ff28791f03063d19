"""Boundaries of success on maps whose crossings are known."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from rotorfault.base.errors import InputError
from rotorfault.campaigns.sampling.boundary import boundary
from rotorfault.campaigns.sampling.refine import Refinement, further_flights, intervals
from rotorfault.campaigns.sampling.statistics import Interval, clopper_pearson

WIND = np.linspace(0.0, 10.0, 21)  # m/s, an axis that is not of whole numbers
FLIGHTS = 1000


def counts(rate: NDArray[np.float64]) -> NDArray[np.int64]:
    return np.rint(rate * FLIGHTS).astype(int)


def slope(edge: NDArray[np.float64], steepness: float = 0.2) -> NDArray[np.float64]:
    """Survival that falls straight from 1 to 0, through 0.5 at the edge; one row per edge."""
    return np.clip(0.5 - steepness * (WIND - edge[:, None]), 0.0, 1.0)


def test_straight_slopes_are_crossed_where_they_cross() -> None:
    edges = np.array([3.0, 4.2, 5.1, 6.6])
    half = boundary(counts(slope(edges)), FLIGHTS, WIND, 0.5)
    np.testing.assert_allclose(half.position[:, 0], edges, atol=1e-3 / 0.2)
    assert half.position.shape == (4, 1)
    assert (half.direction == -1.0).all()
    high = boundary(counts(slope(edges)), FLIGHTS, WIND, 0.99)
    assert (high.position < half.position).all()


def test_interval_is_where_the_bounds_of_the_cells_cross() -> None:
    """Bounds that run beside the slope at a known distance, 0.1 of the success rate or 0.5 m/s."""
    p = slope(np.array([5.0]))
    found = boundary(counts(p), FLIGHTS, WIND, 0.5, interval=Interval(p - 0.1, p + 0.1))
    np.testing.assert_allclose((found.lower[0, 0], found.upper[0, 0]), (4.5, 5.5), atol=1e-9)


def test_columns_are_rows_of_the_other_axis() -> None:
    s = counts(slope(np.array([3.0, 4.2])))
    for across, along in zip(boundary(s.T, FLIGHTS, WIND, 0.5, axis=0), boundary(s, FLIGHTS, WIND, 0.5), strict=True):
        np.testing.assert_array_equal(across, along)


def test_several_crossings_where_success_comes_back() -> None:
    """Survival 0.5 + 0.4 cos(2 pi x/8): through one half at 2, 6 and 10, falling, rising, falling."""
    p = 0.5 + 0.4 * np.cos(2.0 * np.pi * np.linspace(0.0, 11.0, 111) / 8.0)
    s = np.vstack([np.rint(p * FLIGHTS), np.full(111, FLIGHTS)]).astype(int)
    found = boundary(s, FLIGHTS, np.linspace(0.0, 11.0, 111), 0.5)
    np.testing.assert_allclose(found.position[0], [2.0, 6.0, 10.0], atol=5e-3)
    np.testing.assert_array_equal(found.direction[0], [-1.0, 1.0, -1.0])
    assert (found.lower[0] < found.position[0]).all()
    assert (found.position[0] < found.upper[0]).all()
    assert (found.upper[0, :-1] < found.lower[0, 1:]).all()
    assert np.isnan(found.position[1]).all()


def test_what_is_not_reached_is_nan() -> None:
    never = boundary(np.zeros((3, 21), int), FLIGHTS, WIND, 0.5)
    assert never.position.shape == (3, 0)
    # One line that crosses makes a column; the others have NaN there.
    s = counts(slope(np.array([5.0, 30.0])))
    found = boundary(s, FLIGHTS, WIND, 0.5)
    np.testing.assert_array_equal(np.isnan(found.position), [[False], [True]])
    np.testing.assert_array_equal(np.isnan(found.direction), [[False], [True]])


def test_an_interval_that_leaves_the_map_is_open() -> None:
    """24 of 24 flights do not show 99 %: towards the calm end nothing bounds the crossing."""
    s = np.array([[24, 24, 24, 20, 0, 0]])
    found = boundary(s, 24, np.arange(6.0), 0.99)
    assert 2.0 < found.position[0, 0] < 3.0
    assert np.isnan(found.lower[0, 0])
    assert 2.0 < found.upper[0, 0] < 4.0


def test_nothing_is_said_across_a_gap() -> None:
    s, n = np.array([[24, 24, 0, 0, 0]]), np.array([[24, 24, 0, 24, 24]])
    assert boundary(s, n, np.arange(5.0), 0.5).position.shape == (1, 0)
    s[0, 2], n[0, 2] = 12, 24
    assert boundary(s, n, np.arange(5.0), 0.5).position.tolist() == [[2.0]]


def test_a_cell_on_the_level_is_crossed_once() -> None:
    for s in ([10, 5, 0], [0, 5, 10]):
        assert boundary(np.array([s]), 10, np.arange(3.0), 0.5).position.tolist() == [[1.0]]


def test_monotone_smoothing_by_hand() -> None:
    """4, 6 out of order with equal weights become 5, 5."""
    s = np.array([[10, 4, 6, 0]])
    assert boundary(s, 10, np.arange(4.0), 0.55).position.shape == (1, 3)
    found = boundary(s, 10, np.arange(4.0), 0.55, monotone="falling")
    np.testing.assert_allclose(found.position, [[0.9]])
    # With four times the flights in the cell of 4 of 10: (4 x 0.4 + 0.6)/5 = 0.44.
    weighed = boundary(
        np.array([[10, 16, 6, 0]]), np.array([[10, 40, 10, 10]]), np.arange(4.0), 0.55, monotone="falling"
    )
    np.testing.assert_allclose(weighed.position, [[0.45 / 0.56]])
    mirrored = boundary(s[:, ::-1], 10, np.arange(4.0), 0.55, monotone="rising")
    np.testing.assert_allclose(mirrored.position, [[2.1]])


@given(st.lists(st.integers(0, 30), min_size=2, max_size=12), st.floats(0.01, 0.99), st.booleans())
def test_crossings_lie_in_their_intervals_and_alternate(s: list[int], level: float, smooth: bool) -> None:
    found = boundary([s], 30, np.arange(len(s)), level, monotone="falling" if smooth else None)
    at, lower, upper, direction = (row[0] for row in found)
    assert (np.diff(at) >= 0.0).all()
    assert (direction[1:] == -direction[:-1]).all()
    assert ((lower <= at) | np.isnan(lower)).all()
    assert ((at <= upper) | np.isnan(upper)).all()
    assert len(at) <= 1 or not smooth
    # Upside down the same is found, but for cells that are on the level themselves.
    if not smooth and not (np.array(s) / 30 == level).any():
        turned = boundary([s[::-1]], 30, np.arange(len(s)), level)
        np.testing.assert_allclose(turned.position[0, ::-1], len(s) - 1 - at, atol=1e-9)


def test_intervals_hold_the_true_boundary_after_refinement() -> None:
    """40 maps of ten rows, refined: the interval of the 50 % crossing holds the true one in at least 95 %."""
    rng, x, settings = np.random.default_rng(8), np.arange(0.0, 8.0, 0.5), Refinement(growth=0.1, width=0.2, most=300)
    edges = np.tile(np.linspace(2.1, 5.9, 10), 40)
    p = 1.0 / (1.0 + np.exp(2.0 * (x - edges[:, None])))
    s, n = np.zeros((2, *p.shape), int)
    while (further := further_flights(s[None], n[None], settings)[0]).any():
        s, n = s + rng.binomial(further, p), n + further
    found = boundary(s, n, x, 0.5, interval=intervals(s, n, settings), monotone="falling")
    inside = (found.lower[:, 0] <= edges) & (edges <= found.upper[:, 0])
    assert inside.mean() >= 0.95
    assert np.nanmedian(found.upper - found.lower) < 0.7
    assert abs(np.nanmean(found.position[:, 0] - edges)) < 0.02


def test_what_does_not_fit_is_refused() -> None:
    s = np.zeros((2, 3), int)
    with pytest.raises(InputError, match="level"):
        boundary(s, 5, np.arange(3.0), 99.0)
    with pytest.raises(InputError, match="did you mean 'falling'"):
        boundary(s, 5, np.arange(3.0), 0.5, monotone="faling")
    with pytest.raises(InputError, match=r"positions: got shape \(2,\)"):
        boundary(s, 5, np.arange(2.0), 0.5)
    with pytest.raises(InputError, match="ascending"):
        boundary(s, 5, [0.0, 2.0, 1.0], 0.5)
    with pytest.raises(InputError, match="1 axes"):
        boundary(s[0], 5, np.arange(3.0), 0.5)
    with pytest.raises(InputError, match="interval"):
        boundary(s, 5, np.arange(3.0), 0.5, interval=clopper_pearson(s[:1], 5))
