"""Multiple models and the Kalman filter of effectiveness: their statistics against chance, their flights."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import norm

import rotorfault as rf
from rotorfault.autopilot.diagnosis.alarm_rate import HOUR, crossing_threshold, ratio_threshold
from rotorfault.autopilot.diagnosis.jumps import Window
from rotorfault.autopilot.diagnosis.kalman import Hypothesis
from rotorfault.autopilot.diagnosis.multiple_model import log_ratios
from rotorfault.scenario.scenario import scenario_from

TABLES: dict[str, Any] = {
    "name": "test",
    "vehicle": "crazyflie-2.1",
    "duration": 1.6,
    "period": 0.001,
    "sensors": "crazyflie",
    "estimator": "eskf",
    "controller": {"kind": "roismc", "preset": "gentle"},
    "reference": {"kind": "set_point", "position": [0.0, 0.0, 0.0]},
    "wind": {"kind": "dryden", "wind_at_6m": 8.0, "velocity_W": [-7.0, 4.0, 0.0]},
    "mismatch": {"inertia": [1.1, 1.1, 0.9], "rotor_bandwidth": 0.8, "mass": 1.1},
    "fault": [{"kind": "step", "rotor": 2, "time": 1.0, "loss": 0.3}],
}


def ratio(score: float, information: float, spread: float) -> float:
    """R of one onset that stands for itself."""
    windows = (Window(0.1, (Hypothesis((), score, information),)),)
    return math.exp(log_ratios(windows, 0.0, 1.0 / spread**2)[0])


@pytest.mark.parametrize(("score", "information"), [(5.0, 30.0), (40.0, 100.0), (0.5, 400.0)])
def test_the_ratio_is_the_integral_over_all_losses(score: float, information: float) -> None:
    """Of the likelihood ratio exp(loss d - loss^2 C / 2) by the distribution of losses, by quadrature."""
    whole, _ = quad(
        lambda loss: norm.pdf(loss, scale=0.3) * math.exp(loss * score - 0.5 * loss**2 * information), -3.0, 3.0,
        points=[0.0, score / information], limit=200,
    )  # fmt: skip
    assert ratio(score, information, 0.3) == pytest.approx(whole, rel=1e-6)


def test_without_a_fault_the_mean_of_the_ratio_is_at_most_one() -> None:
    """So the level for a rate of alarms is a bound, whatever the information."""
    rng = np.random.default_rng(1)
    for information in (1.0, 30.0, 300.0):
        scores = rng.normal(size=4000) * math.sqrt(information)
        mean = np.mean([ratio(float(score), information, 0.3) for score in scores])
        assert mean <= 1.1


def test_levels_follow_from_the_wanted_rate() -> None:
    assert ratio_threshold(0.1, HOUR / 0.004) == pytest.approx(math.log(HOUR / 0.004 / 0.1))
    thresholds = [crossing_threshold(rate, 4, 0.01) for rate in (1.0, 0.1, 0.01)]
    assert thresholds == sorted(thresholds)


@pytest.mark.long
@pytest.mark.parametrize(("kind", "within"), [("multiple_model", 0.06), ("effectiveness_kalman", 0.3)])
def test_a_loss_is_found_with_real_sensors_and_an_estimator(kind: str, within: float) -> None:
    tables = {**TABLES, "diagnosis": kind}
    flights = rf.fly_many(scenario_from(tables, "test"), {"seed": range(8)}, warn=False)
    delay = flights.table["detected.2"] - flights.table["onset.2"]
    assert (delay > 0.0).all()
    assert (delay < within).all()
    assert not flights.table["false_alarms"].any()


@pytest.mark.long
def test_vibration_raises_no_alarm() -> None:
    """Of 0.3 rad/s and 5 m/s^2 at the rotors' frequency, which the sensors' record tells."""
    imu = {"gyro_vibration": 0.3, "accelerometer_vibration": 5.0}
    tables = {**TABLES, "fault": [], "diagnosis": "multiple_model", "sensors": {"kind": "crazyflie", "imu": imu}}
    flights = rf.fly_many(scenario_from({**tables, "duration": 4.0}, "test"), {"seed": range(8)}, warn=False)
    assert not flights.table["false_alarms"].any()
