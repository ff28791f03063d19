"""Intervals and tests of counts of successes: against SciPy, published cases and properties."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import binom, binomtest

from rotorfault.base.errors import InputError
from rotorfault.campaigns.sampling import paired, statistics
from rotorfault.campaigns.sampling.statistics import Interval, clopper_pearson, holm, wilson

METHODS = [wilson, clopper_pearson]
Method = Callable[..., Interval]


@st.composite
def counts(draw: st.DrawFn, most: int = 400) -> tuple[int, int]:
    n = draw(st.integers(1, most))
    return draw(st.integers(0, n)), n


@st.composite
def pairs(draw: st.DrawFn, most: int = 300) -> tuple[int, int, int]:
    n = draw(st.integers(1, most))
    b = draw(st.integers(0, n))
    return b, draw(st.integers(0, n - b)), n


# ---------------------------------------------------------------------------------------------------------- intervals


@cache
def binomial(successes: int, trials: int) -> Any:
    return binomtest(successes, trials)


@pytest.mark.parametrize("level", [0.8, 0.95, 0.999])
@pytest.mark.parametrize("n", [1, 2, 17, 300])
@pytest.mark.parametrize(("method", "name"), [(wilson, "wilson"), (clopper_pearson, "exact")])
def test_intervals_are_those_of_scipy(method: Method, name: str, n: int, level: float) -> None:
    # Of many counts those near the ends, where intervals are not like elsewhere, and each ninth between.
    s = np.unique([*range(min(n, 12) + 1), *range(0, n, 9), *range(max(n - 12, 0), n + 1)])
    expected = np.array([binomial(k, n).proportion_ci(level, name) for k in s]).T
    np.testing.assert_allclose(method(s, n, level), expected, atol=1e-12)


def test_intervals_of_published_counts() -> None:
    """R. G. Newcombe, Stat. Med. 17 (1998) 857-872, table I, methods 3 and 5."""
    s, n = [81, 15, 0, 1], [263, 148, 20, 29]
    expected = [[0.2553, 0.0624, 0.0, 0.0061], [0.3662, 0.1605, 0.1611, 0.1718]]
    np.testing.assert_allclose(wilson(s, n), expected, atol=5e-5)
    expected = [[0.2527, 0.0578, 0.0, 0.0009], [0.3676, 0.1617, 0.1684, 0.1776]]
    np.testing.assert_allclose(clopper_pearson(s, n), expected, atol=5e-5)


@pytest.mark.parametrize("method", METHODS)
@given(data=counts(), level=st.floats(0.5, 0.999))
def test_interval_contains_the_estimate_and_is_a_share(method: Method, data: tuple[int, int], level: float) -> None:
    s, n = data
    lower, upper = method(s, n, level)
    assert 0.0 <= lower <= s / n <= upper <= 1.0
    assert (lower == 0.0) == (s == 0)
    assert (upper == 1.0) == (s == n)


@pytest.mark.parametrize("method", METHODS)
@given(data=counts())
def test_successes_and_failures_may_change_places(method: Method, data: tuple[int, int]) -> None:
    s, n = data
    lower, upper = method(s, n)
    np.testing.assert_allclose(method(n - s, n), (1.0 - upper, 1.0 - lower), atol=1e-12)


@pytest.mark.parametrize("method", METHODS)
@given(data=counts(), times=st.integers(2, 9))
def test_interval_shrinks_with_the_number_of_flights(method: Method, data: tuple[int, int], times: int) -> None:
    s, n = data
    few, many = method(s, n), method(times * s, times * n)
    assert many.upper - many.lower < few.upper - few.lower


@pytest.mark.parametrize("method", METHODS)
@given(n=st.integers(1, 400), level=st.floats(0.5, 0.99))
def test_bounds_rise_with_successes_and_part_with_the_level(method: Method, n: int, level: float) -> None:
    lower, upper = method(np.arange(n + 1), n, level)
    assert (np.diff(lower) > 0.0).all()
    assert (np.diff(upper) > 0.0).all()
    wider = method(np.arange(n + 1), n, level + 0.005)
    assert (wider.lower <= lower).all()
    assert (wider.upper >= upper).all()


@pytest.mark.parametrize("method", METHODS)
def test_nothing_is_known_without_flights(method: Method) -> None:
    assert method(0, 0) == (0.0, 1.0)
    assert method(np.zeros((2, 3)), 4).lower.shape == (2, 3)


def test_what_cannot_be_counts_is_refused() -> None:
    with pytest.raises(InputError, match="successes"):
        wilson([1, 3], 2)
    with pytest.raises(InputError, match="successes"):
        clopper_pearson(-1, 2)
    with pytest.raises(InputError, match=r"level: got 95"):
        wilson(1, 2, 95)


# -------------------------------------------------------------------------------------------------------------- pairs

# Complete response before and after consolidation therapy (Cavo et al. 2012), an example of M. W. Fagerland, S.
# Lydersen and P. Laake, "Statistical Analysis of Contingency Tables" (2017), chapter 8; results from the package
# contingencytables.
CAVO = (6, 16, 161)


def test_published_pairs() -> None:
    np.testing.assert_allclose(paired.paired_difference(*CAVO), [-0.0621, -0.1240, -0.0054], atol=5e-5)


@given(data=pairs(60))
def test_mcnemar_at_any_time_is_no_bolder_than_the_binomial_test(data: tuple[int, int, int]) -> None:
    b, c, _ = data
    exact = binomtest(b, b + c, 0.5).pvalue if b + c else 1.0
    assert paired.mcnemar_anytime(b, c) >= min(exact, 0.99)


@pytest.mark.parametrize("compare", [paired.paired_difference, paired.difference_anytime])
@given(data=pairs())
def test_difference_lies_in_its_interval_and_changes_sign_with_the_order(compare, data) -> None:  # type: ignore[no-untyped-def]
    b, c, n = data
    estimate, lower, upper = compare(b, c, n)
    assert estimate == (b - c) / n
    assert -1.0 <= lower <= estimate <= upper <= 1.0
    np.testing.assert_allclose(compare(c, b, n), (-estimate, -upper, -lower), atol=1e-9)


@given(data=pairs())
def test_score_interval_ends_where_the_score_test_does(data: tuple[int, int, int]) -> None:
    """At zero Tango's statistic is McNemar's (b - c)/sqrt(b + c)."""
    b, c, n = data
    _, lower, upper = paired.paired_difference(b, c, n)
    if b != c:
        assert (lower > 0.0 or upper < 0.0) == ((b - c) ** 2 > 3.841458820694124 * (b + c))


def test_score_interval_without_discordant_pairs() -> None:
    """By hand: n d / sqrt(n d (1 - d)) = z, so d = z^2/(n + z^2)."""
    bound = 3.841458820694124 / (50 + 3.841458820694124)
    np.testing.assert_allclose(paired.paired_difference(0, 0, 50), (0.0, -bound, bound), atol=1e-12)


def test_differences_without_pairs_are_unknown() -> None:
    for compare in (paired.paired_difference, paired.difference_anytime):
        np.testing.assert_equal(compare(0, 0, 0), (np.nan, -1.0, 1.0))


@pytest.fixture
def coarse(monkeypatch: pytest.MonkeyPatch) -> None:
    """Bounds to 1e-7: what many repeats say of chances needs no more."""
    monkeypatch.setattr(paired, "HALVINGS", 24)


@pytest.mark.usefixtures("coarse")
def test_anytime_comparisons_hold_however_often_one_looks() -> None:
    """400 pairs, looked at after each: none of the looks may mislead in more than 5 % of repeats."""
    rng, repeats, n = np.random.default_rng(5), 600, np.arange(1, 401)
    first, second = rng.random((2, repeats, 400)) < 0.7
    b, c = np.cumsum(first & ~second, axis=1), np.cumsum(second & ~first, axis=1)
    _, lower, upper = paired.difference_anytime(b, c, n)
    assert ((lower > 0.0) | (upper < 0.0)).any(axis=1).mean() <= 0.05
    assert (paired.mcnemar_anytime(b, c) <= 0.05).any(axis=1).mean() <= 0.05
    exact = np.minimum(2.0 * binom.cdf(np.minimum(b, c), b + c, 0.5), 1.0)  # McNemar's test
    assert (exact <= 0.05).any(axis=1).mean() > 0.1  # what they are for


def test_overall_difference_weighs_cells_alike() -> None:
    b, c, n = [10, 0, 0], [0, 0, 0], [20, 100, 0]
    cells = paired.paired_difference(b, c, n)
    estimate, lower, upper = paired.overall_difference(b, c, n)
    assert estimate == 0.25
    np.testing.assert_allclose(lower, 0.25 - 0.5 * np.hypot(0.5 - cells.lower[0], cells.lower[1]))
    np.testing.assert_allclose(upper, 0.25 + 0.5 * np.hypot(cells.upper[0] - 0.5, cells.upper[1]))
    alone = paired.overall_difference(b, c, n, weights=[1, 0, 7])
    np.testing.assert_allclose(alone, [each[0] for each in cells])
    with pytest.raises(InputError, match="weights"):
        paired.overall_difference(b, c, n, weights=[0, 0, 1])


@pytest.mark.usefixtures("coarse")
def test_overall_difference_covers() -> None:
    rng = np.random.default_rng(3)
    p_first, p_second = np.array([0.99, 0.8, 0.5, 0.1]), np.array([0.97, 0.6, 0.5, 0.05])
    own, shared = rng.random((500, 4, 2, 60)), rng.random((500, 4, 1, 60))
    luck = np.where(rng.random((500, 4, 2, 60)) < 0.5, own, shared)  # alike, as flights of one seed are
    first, second = (luck[:, :, k] < p[:, None] for k, p in enumerate((p_first, p_second)))
    counts = [(first & ~second).sum(axis=-1), (second & ~first).sum(axis=-1), np.full((500, 4), 60)]
    truth = (p_first - p_second).mean()
    inside = 0
    for i in range(500):
        _, lower, upper = paired.overall_difference(*(each[i] for each in counts))
        inside += bool(lower <= truth <= upper)
    assert 0.93 <= inside / 500 <= 0.99


def test_what_cannot_be_pairs_is_refused() -> None:
    with pytest.raises(InputError, match="pairs"):
        paired.paired_difference(3, 3, 5)
    with pytest.raises(InputError, match="fewer than 0"):
        paired.mcnemar_anytime(-1, 3)


# --------------------------------------------------------------------------------------------------------- many cells


def test_holm_by_hand() -> None:
    """5 x 0.01, 4 x 0.02, 3 x 0.03, 2 x 0.04, 1 x 0.05, none below the one before."""
    p = np.array([[0.03, 0.01, np.nan], [0.05, 0.04, 0.02]])
    np.testing.assert_allclose(holm(p), [[0.09, 0.05, np.nan], [0.09, 0.09, 0.08]])
    np.testing.assert_equal(holm([0.5, 0.6]), [1.0, 1.0])
    assert holm([]).shape == (0,)


@given(st.lists(st.floats(0.0, 1.0), min_size=1, max_size=30))
def test_holm_lies_between_the_value_and_bonferroni(values: list[float]) -> None:
    p = np.array(values)
    corrected = holm(p)
    assert (corrected >= p).all()
    assert (corrected <= np.minimum(p * len(p), 1.0)).all()


def test_level_is_checked_by_name() -> None:
    with pytest.raises(InputError, match="between 0 and 1"):
        statistics.check_level(1.0)
