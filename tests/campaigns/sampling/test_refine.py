"""Adaptive sampling: where flights go, when it ends, and that intervals hold although results decided it."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.stats import binom

from rotorfault.base.config import validate
from rotorfault.base.errors import InputError
from rotorfault.campaigns.sampling.refine import Refinement, finished, further_flights, intervals, looks
from rotorfault.campaigns.sampling.sampling_plan import Plan, sampling_plan
from rotorfault.campaigns.sampling.statistics import clopper_pearson, wilson

Counts = NDArray[np.int64]


def fine(**changes: Any) -> Refinement:
    """Narrower intervals and smaller steps than studies have by default, so that plans are long."""
    return Refinement(**{"growth": 0.1, "width": 0.1, "most": 600, **changes})


SUCCESS_RATES = np.array([0.01, 0.1, 0.5, 0.99])
PLANS = {
    "as_set": (looks(fine()), 0.1),
    "small_blocks": (looks(fine(initial=16, block=8, most=300)), 0.15),
    "large_blocks": (looks(fine(initial=50, block=100, growth=0.5, most=2000)), 0.05),
    "few_flights": ((5, 10, 20), 0.3),
    "fixed": ((60,), 0.1),
}


def campaign(p: NDArray[np.float64], settings: Refinement, seed: int) -> tuple[Counts, Counts, list[Counts]]:
    """Fly until the rule says that it is over: successes, flights, and the rounds."""
    rng, s, n, rounds = np.random.default_rng(seed), np.zeros(p.shape, int), np.zeros(p.shape, int), []
    while (further := further_flights(s, n, settings)).any():
        s, n = s + rng.binomial(further, p), n + further
        rounds.append(further)
    return s, n, rounds


def step_function(columns: int = 20) -> NDArray[np.float64]:
    """One controller, success rate 0.98 to the left of a slanted edge and 0.02 to the right."""
    row, column = np.mgrid[:10, :columns]
    return np.where(column < 5 + row / 2.0, 0.98, 0.02)[None]


# ----------------------------------------------------------------------------------------------------------- coverage


@pytest.mark.parametrize("budget", [None, 1_000_000, 400_000])
def test_intervals_cover_although_results_decide_when_flights_end(budget: int | None) -> None:
    """2,000 rows of one grid, each with all four rates: neighbours decide as well, and the budget may end all."""
    settings = fine(budget=budget)
    p = np.tile(SUCCESS_RATES, (1, 2000, 1))
    s, n, _ = campaign(p, settings, seed=11)
    lower, upper = intervals(s, n, settings)
    coverage = ((lower <= p) & (p <= upper)).mean(axis=(0, 1))
    assert (coverage >= 0.94).all(), coverage
    done = finished(s, n, settings)
    assert done.all() == (budget is None)
    assert ((upper - lower)[done & (n < settings.most)] <= settings.width).all()


class Chances(NamedTuple):
    """Of a plan, at one probability."""

    fails_at_end: float
    fails_anywhere: float  # at any look before the end or at it
    flights: float  # on average
    total: float  # of all ends


def chances(plan: Plan, p: float) -> Chances:
    """Computed from look to look by binomial steps: not the equations by which the plan was made."""
    going, sound, before = np.ones(1), np.ones(1), 0  # by successes: not ended; neither ended nor failed
    fails = total = flights = held = 0.0
    for k, n in enumerate(plan.looks.tolist()):
        step = binom.pmf(np.arange(n - before + 1), n - before, p)
        going, sound, before = np.convolve(going, step), np.convolve(sound, step), n
        done = plan.done[k, : n + 1]
        wrong = (plan.lower[k, : n + 1] > p) | (plan.upper[k, : n + 1] < p)
        fails += going[done & wrong].sum()
        total += going[done].sum()
        flights += n * going[done].sum()
        held += sound[done & ~wrong].sum()
        going, sound = np.where(done, 0.0, going), np.where(done | wrong, 0.0, sound)
    return Chances(fails, 1.0 - held, flights, total)


@pytest.mark.parametrize("name", PLANS)
@pytest.mark.parametrize("level", [0.95, 0.8])
def test_plan_covers_exactly(name: str, level: float) -> None:
    """Computed, not sampled, by other equations than the plan's own: the end, and the worst that can stop a cell."""
    plan = sampling_plan(*PLANS[name], level)
    for p in [0.0001, 0.001, *np.linspace(0.005, 0.995, 199), 0.999, 0.9999]:
        found = chances(plan, float(p))
        assert found.total == pytest.approx(1.0, abs=1e-9)
        assert found.fails_at_end <= (1.0 - level) * 0.9 + 1e-6
        assert found.fails_anywhere <= 1.0 - level + 1e-9


def test_the_plain_rule_does_not_cover() -> None:
    """What all this is for: ending when Wilson's interval is narrow loses coverage."""
    at = PLANS["as_set"][0]
    done = np.zeros((len(at), at[-1] + 1), dtype=bool)
    lower, upper = np.full((2, *done.shape), np.nan)
    for k, n in enumerate(at):
        lower[k, : n + 1], upper[k, : n + 1] = wilson(np.arange(n + 1), n)
        done[k, : n + 1] = (upper - lower)[k, : n + 1] <= 0.1
    done[-1] = True
    plain = Plan(np.array(at), done, done, lower, upper)
    assert max(chances(plain, p).fails_at_end for p in np.linspace(0.005, 0.1, 96)) > 0.08


@pytest.mark.parametrize(("p", "most"), [(0.5, 1.2), (0.9, 1.2), (0.99, 1.6)])
def test_not_many_more_flights_than_if_the_success_rate_were_known(p: float, most: float) -> None:
    width = 0.1
    for known in range(10, 1000):
        lower, upper = clopper_pearson(np.arange(known + 1), known)
        if (binom.pmf(np.arange(known + 1), known, p) * (upper - lower)).sum() <= width:
            break
    assert chances(sampling_plan(looks(fine(most=1000)), width), p).flights < most * known


# --------------------------------------------------------------------------------------------------- plan, properties


@pytest.mark.parametrize("name", PLANS)
def test_plan_is_the_same_with_successes_and_failures_exchanged(name: str) -> None:
    plan = sampling_plan(*PLANS[name])
    for k, n in enumerate(plan.looks):
        row = k, slice(n + 1)
        np.testing.assert_array_equal(plan.done[row], plan.done[row][::-1])
        np.testing.assert_allclose(plan.lower[row], 1.0 - plan.upper[row][::-1], atol=1e-12)


@pytest.mark.parametrize("name", PLANS)
def test_intervals_hold_the_estimate_rise_with_it_and_keep_to_the_width(name: str) -> None:
    plan = sampling_plan(*PLANS[name])
    for k, n in enumerate(plan.looks):
        s = np.flatnonzero(plan.reachable[k])
        lower, upper = plan.lower[k, s], plan.upper[k, s]
        assert ((lower <= s / n) & (s / n <= upper)).all()
        if n < plan.looks[-1]:
            assert (upper - lower)[plan.done[k, s]].max(initial=0.0) <= PLANS[name][1]
        for group in (plan.done[k, s], ~plan.done[k, s]):
            assert (np.diff(lower[group]) >= 0.0).all()


def test_one_look_is_clopper_and_pearson() -> None:
    plan = sampling_plan((60,), 0.1, 0.95, 0.0)
    np.testing.assert_allclose((plan.lower[0], plan.upper[0]), clopper_pearson(np.arange(61), 60), atol=2e-6)


def test_without_reserve_nothing_is_said_before_the_end() -> None:
    plan = sampling_plan((20, 40), 0.2, 0.95, 0.0)
    assert (plan.lower[0, 10], plan.upper[0, 10]) == (0.0, 1.0)
    assert not plan.done[0, 10]


def test_plans_are_shared_and_cannot_be_written() -> None:
    plan = sampling_plan((20, 40), 0.2)
    assert sampling_plan((20, 40), 0.2) is plan
    with pytest.raises(ValueError, match="read-only"):
        plan.lower[0, 0] = 1.0


# ------------------------------------------------------------------------------------------------- where flights go


def test_the_same_counts_give_the_same_rounds() -> None:
    settings = fine(budget=20_000)
    once, again = (campaign(step_function(), settings, seed=3) for _ in range(2))
    np.testing.assert_array_equal(once[1], again[1])
    assert len(once[2]) == len(again[2])


def test_flights_go_where_success_is_uncertain() -> None:
    p = np.array([[1.0, 0.999, 0.9, 0.5, 0.1, 0.001, 0.0]])
    _, n, rounds = campaign(p, fine(), seed=1)
    assert (np.diff(n[0, :4]) >= 0).all()
    assert n[0, 3] > 4 * n[0, 0]
    assert (rounds[0] == 24).all()
    assert len(rounds) < len(looks(fine())) + 1


def test_a_scarce_budget_is_spent_at_the_edge_of_a_step() -> None:
    p = step_function()
    first = 24 * p.size
    settings = fine(budget=first + 480)
    _, n, rounds = campaign(p, settings, seed=2)
    edge = np.zeros(p.shape, bool)
    edge[..., 1:] |= p[..., 1:] != p[..., :-1]
    edge[..., :-1] |= p[..., 1:] != p[..., :-1]
    edge[:, 1:] |= p[:, 1:] != p[:, :-1]
    edge[:, :-1] |= p[:, 1:] != p[:, :-1]
    further = n - 24
    assert n.sum() <= settings.budget
    assert further[edge].sum() == further.sum() > 0
    assert (rounds[1][~edge] == 0).all()


def test_neighbours_are_of_one_controller() -> None:
    """One succeeds everywhere, the other nowhere: neither has a boundary."""
    s = np.array([[[24, 24], [24, 24]], [[0, 0], [0, 0]]])
    further = further_flights(s, np.full(s.shape, 24), fine(budget=24 * 8 + 24 * 3))
    assert further.ravel().tolist() == [24, 24, 24, 0, 0, 0, 0, 0]  # none before the other, so in order
    s[1, 1, 1] = 24
    further = further_flights(s, np.full(s.shape, 24), fine(budget=24 * 8 + 24 * 4))
    assert further.ravel().tolist() == [0, 0, 0, 0, 0, 24, 24, 24]


@given(seed=st.integers(0, 10_000), spare=st.integers(0, 3000), shape=st.sampled_from([(1, 6), (2, 3, 2), (3, 1, 1)]))
def test_budget_and_limit_are_kept(seed: int, spare: int, shape: tuple[int, ...]) -> None:
    p = np.random.default_rng(seed).random(shape)
    settings = fine(budget=24 * p.size + spare, most=200)
    s, n, rounds = campaign(p, settings, seed)
    assert n.sum() <= settings.budget
    assert n.max() <= 200
    assert n.min() >= 24
    assert all(round_.min() >= 0 for round_ in rounds)
    assert finished(s, n, settings).all() or settings.budget - n.sum() < 48


@given(start=st.integers(1, 50), block=st.integers(1, 50), growth=st.floats(0.0, 2.0), more=st.integers(0, 150))
def test_looks_ascend_to_the_most(start: int, block: int, growth: float, more: int) -> None:
    at = looks(fine(initial=start, block=block, growth=growth, most=start + more))
    assert at[0] == start
    assert at[-1] == start + more
    assert (np.diff(at) > 0).all()


# ------------------------------------------------------------------------------------------------------------- errors


@pytest.mark.parametrize(
    ("tables", "message"),
    [
        ({"initial": 0}, "initial: .*got 0"),
        ({"block": 0}, "block: .*got 0"),
        ({"most": 10}, "most: got 10; allowed: at least initial, 24"),
        ({"growth": -0.1}, r"growth: .*got -0\.1"),
        ({"width": 1.5}, r"width: .*got 1\.5"),
        ({"level": 95.0}, r"level: .*got 95"),
    ],
)
def test_settings_that_cannot_be_used_are_named(tables: dict[str, float], message: str) -> None:
    with pytest.raises(InputError, match=message):
        validate(Refinement, tables, "refine")


def test_a_budget_must_suffice_for_the_first_round() -> None:
    with pytest.raises(InputError, match="at least 48"):
        further_flights([[0, 0]], [[0, 0]], Refinement(budget=47))


@pytest.mark.parametrize(
    ("s", "n"),
    [(10, 25), (60, 72), (0, 1000)],
    ids=["part of a block", "flown on after it was done", "more than the most"],
)
def test_counts_that_the_rule_does_not_lead_to_are_refused(s: int, n: int) -> None:
    settings = fine(width=0.3)
    with pytest.raises(InputError, match=rf"cell \(0, 1\) has {s} successes of {n} flights"):
        intervals([[0, s]], [[0, n]], settings)


def test_nothing_is_known_of_cells_without_flights() -> None:
    lower, upper = intervals([[0, 24]], [[0, 24]], fine())
    assert (lower[0, 0], upper[0, 0]) == (0.0, 1.0)
    assert lower[0, 1] > 0.5
    lower, upper = intervals(0, 0, fine())
    assert (lower, upper) == (0.0, 1.0)
    assert not finished(0, 0, fine())
    with pytest.raises(InputError, match="successes"):
        intervals(5, 3, fine())
