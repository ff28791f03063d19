"""Likelihood ratios: the filter against plain NumPy, thresholds against chance, flights against faults."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.stats import norm

import rotorfault as rf
from rotorfault.autopilot.diagnosis import alarm_rate, jumps
from rotorfault.autopilot.diagnosis.fault_free import Step
from rotorfault.autopilot.diagnosis.kalman import Belief, diagonal, follow, innovation, predict
from rotorfault.scenario.scenario import scenario_from


def matrix(belief: Belief) -> np.ndarray:
    n = len(belief.mean)
    return np.array([[belief.of(i, j) for j in range(n)] for i in range(n)])


def dense(row: dict[int, float], n: int) -> np.ndarray:
    return np.array([row.get(k, 0.0) for k in range(n)])


def test_the_filter_is_that_of_plain_matrices() -> None:
    """Joseph's form and a matrix of all measurements at once, with NumPy's inverse."""
    rng = np.random.default_rng(3)
    n = 6
    belief = diagonal([*rng.normal(size=n)], [*rng.uniform(0.5, 2.0, n)])
    x, P = np.array(belief.mean), matrix(belief)
    for _ in range(20):
        rows = {k: {j: float(rng.normal()) for j in rng.choice(n, 3, replace=False)} for k in (0, 1)}
        noise = {k: float(rng.uniform(0.01, 0.1)) for k in range(n)}
        belief = predict(belief, rows, {0: 0.3}, noise)
        phi = np.eye(n)
        for k, row in rows.items():
            phi[k] += dense(row, n)
        x = phi @ x + dense({0: 0.3}, n)
        P = phi @ P @ phi.T + np.diag([noise[k] for k in range(n)])

        seen = [({j: float(rng.normal()) for j in (k, k + 2)}, float(rng.normal()), 0.2 + k) for k in range(3)]
        for row, y, r in seen:
            belief = follow(belief, innovation(belief, row, y, r))
        H = np.array([dense(row, n) for row, _, _ in seen])
        R = np.diag([r for _, _, r in seen])
        K = P @ H.T @ np.linalg.inv(H @ P @ H.T + R)
        x = x + K @ (np.array([y for _, y, _ in seen]) - H @ x)
        J = np.eye(n) - K @ H
        P = J @ P @ J.T + K @ R @ K.T
        scale = np.abs(P).max()
        assert np.allclose(belief.mean, x, rtol=1e-9, atol=1e-9 * np.abs(x).max())
        assert np.allclose(matrix(belief), P, rtol=1e-8, atol=1e-10 * scale)


def stationary(steps: int, flights: int, loss: float, at: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """z and estimated loss of one rotor, flights beside each other, of a rate that is driven and measured."""
    rng = np.random.default_rng(seed)
    dt, q, r, effect = 0.001, 1e-4, 2.5e-5, 4.0
    none = np.zeros(flights)
    # A rate, its offset, and 14 states that do nothing.
    belief = diagonal(
        [none + rng.normal(size=flights) * math.sqrt(r), *[none] * 16], [none + r, none + 1.0, *[none] * 15]
    )
    windows = jumps.nothing_seen(17, 1)
    length = jumps.lengths(dt)
    rate, offset, most = none.copy(), rng.normal(size=flights), none - 99.0
    z, estimate = [], []
    for k in range(steps):
        lost = loss if k >= at else 0.0
        rate = rate + (offset - effect * lost) * dt + rng.normal(size=flights) * math.sqrt(q * dt)
        rows = {0: {1: dt}}
        belief = predict(belief, rows, {}, {0: q * dt})
        seen = innovation(belief, {0: 1.0}, rate + rng.normal(size=flights) * math.sqrt(r), r)
        belief = follow(belief, seen)
        step = Step(
            rows,
            ((-effect * dt,),),
            (0.0,),
            (({0: 1.0}, seen), ({2: 0.0}, innovation(belief, {2: 0.0}, none, 1.0))),
            {0: q * dt},
        )
        windows = jumps.watch(windows, length, step, dt)
        found = jumps.best(windows, 0.0)
        z.append(found.excess[0] + none)
        estimate.append(found.loss[0] + none)
        most = np.maximum(most, z[-1])
    return np.array(z), np.array(estimate)


@pytest.mark.long
def test_without_a_fault_the_statistic_exceeds_a_threshold_no_more_often_than_computed() -> None:
    """At thresholds low enough to be exceeded often: 1,500 flights of 0.5 s."""
    steps, flights, dt = 500, 1500, 0.001
    z, _ = stationary(steps, flights, 0.0, 0, 1)
    length = jumps.lengths(dt)
    for per_hour in (200.0, 1000.0):
        b = alarm_rate.windows_threshold(per_hour, 1, length, dt)
        above = (z > b).any(axis=0).sum()
        wanted = per_hour * flights * steps * dt / 3600.0
        assert above <= wanted + 3.0 * math.sqrt(wanted)
        # And not so much less often that the threshold is idle.
        assert above >= 1


def test_a_jump_is_estimated_without_bias_and_its_error_is_as_large_as_said() -> None:
    z, estimate = stationary(340, 300, 0.3, 202, 2)
    error = estimate[-1] - 0.3
    assert abs(error.mean()) < 0.05
    assert (z[-1] > 5.0).mean() > 0.9


def test_thresholds_grow_with_what_may_go_wrong() -> None:
    length = jumps.lengths(0.001)
    of = [alarm_rate.windows_threshold(rate, 4, length, 0.001) for rate in (1.0, 0.1, 0.01)]
    assert of == sorted(of)
    assert alarm_rate.windows_threshold(0.1, 8, length, 0.001) > of[1]
    assert alarm_rate.tail(2.0) == pytest.approx(norm.sf(2.0))


def test_a_window_exceeds_its_threshold_as_often_as_computed() -> None:
    """Brownian motion over the root of an information that grows by a factor of 8, in steps that miss few peaks."""
    rng = np.random.default_rng(5)
    information = np.exp(np.linspace(0.0, math.log(8.0), 2000))
    walk = np.cumsum(rng.normal(size=(4000, 2000)) * np.sqrt(np.diff(information, prepend=0.0)), axis=1)
    most = (walk / np.sqrt(information)).max(axis=1)
    for b in (2.0, 2.5, 3.0):
        share, expected = (most > b).mean(), alarm_rate.window_probability(b, 2.0)  # a factor of 2 in time, 8 in C
        deviation = math.sqrt(expected / len(most))
        assert 0.8 * expected - 3.0 * deviation < share < expected + 3.0 * deviation


TABLES = {
    "name": "glr",
    "vehicle": "hummingbird",
    "duration": 2.0,
    "period": 0.001,
    "sensors": "noisy",
    "diagnosis": "glr",
    "controller": {"kind": "roismc", "preset": "gentle"},
    "reference": {"kind": "set_point", "position": [0.0, 0.0, 0.0]},
    "wind": {"kind": "dryden", "wind_at_6m": 8.0, "velocity_W": [-7.0, 4.0, 0.0]},
    "mismatch": {"inertia": [1.1, 1.1, 0.9], "rotor_bandwidth": 0.8, "mass": 1.1, "centre_of_mass": [0.01, 0.0, 0.0]},
}


@pytest.mark.long
def test_a_loss_is_found_in_gusts_with_a_wrong_model_and_no_other_rotor_is_blamed() -> None:
    fault = [{"kind": "step", "rotor": 2, "time": 1.2, "loss": 0.3}]
    rotors = np.arange(12) % 4 + 1
    for rotor in (1, 3):
        fault[0]["rotor"] = rotor
        flights = rf.fly_many(scenario_from({**TABLES, "fault": fault}, "test"), {"seed": range(len(rotors))})
        delay = flights.table[f"detected.{rotor}"] - flights.table[f"onset.{rotor}"]
        assert (delay > 0.0).all()
        assert (delay < 0.1).all()
        assert not flights.table["false_alarms"].any()
        assert flights.table["survived"].all()


@pytest.mark.long
def test_a_healthy_vehicle_raises_no_alarm_on_squares() -> None:
    square = {"kind": "square", "amplitude": [2.0, 2.0, 0.5], "period": [4.0, 5.0, 6.0], "time_constant": [0.5] * 3}
    flights = rf.fly_many(scenario_from({**TABLES, "reference": square, "duration": 8.0}, "test"), {"seed": range(8)})
    assert not flights.table["false_alarms"].any()


@pytest.mark.long
def test_a_belief_that_is_taken_back_leaves_no_trace() -> None:
    """A fault that heals is believed no longer, and the loss is a state of no variance again."""
    fault = [
        {"kind": "intermittent", "rotor": 2, "loss": 0.4, "period": 4.0, "duty": 0.125, "start": 0.5, "end": 9.0}
    ]
    flights = rf.fly_many(
        scenario_from({**TABLES, "fault": fault, "duration": 2.5}, "test"), {"seed": range(4)}, record=["fault_flag"]
    )
    flags = flights.signals[:, 1]
    assert (flags.max(axis=0) == 1.0).all()
    assert (flags[-1] == 0.0).all()


def test_the_flagged_rotor_is_probable_and_others_are_not() -> None:
    fault = [{"kind": "step", "rotor": 2, "time": 1.2, "loss": 0.3}]
    flown = rf.fly(scenario_from({**TABLES, "fault": fault}, "test"))
    probability = flown.data["diagnosis.probability"].values[-1]
    assert probability[1] > 0.99
    assert max(probability[[0, 2, 3]]) < 0.1
