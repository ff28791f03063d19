"""What a wrong model shows as lost thrust is what the threshold expects of it, and noise is measured as it is."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from gates import needs_simd

import rotorfault as rf
from rotorfault.autopilot.diagnosis.luenberger import place
from rotorfault.autopilot.diagnosis.model_error import noise_gain
from rotorfault.scenario.scenario import scenario_from

T = 1e-3
HOVER = 1.22625  # N, of a rotor of the Hummingbird
HEALTHY: dict[str, Any] = {
    "name": "healthy",
    "vehicle": "hummingbird",
    "duration": 6.0,
    "period": T,
    "controller": {"kind": "smc", "preset": "gentle"},
    "reference": {
        "kind": "square", "amplitude": [2.0, 2.0, 0.5], "period": [4.0, 5.0, 6.0], "time_constant": [0.5, 0.5, 0.5],
    },
    "start": {"position": [2.0, 2.0, 0.5]},
    # Nothing is flagged, so the commands do not depend on what is found.
    "diagnosis": {"kind": "luenberger", "decision": {"threshold": 0.99, "clear_threshold": 0.1, "noise": 0.0}},
}  # fmt: skip


def flown(**changes: Any) -> rf.Flight:
    return rf.fly(scenario_from({**HEALTHY, **changes}, "test"))


def missing(flight: rf.Flight) -> Any:
    """Thrust by which each rotor seems to fall behind the second best, in N, by time and rotor."""
    residual = flight.data["thrust_residual"].values
    return np.sort(residual, axis=1)[:, 2:3] - residual


def bound(flight: rf.Flight) -> Any:
    """The part of the threshold that is laid to the model, in N."""
    thrust = flight.data["expected_thrust"].values
    base = 0.99 * np.maximum(thrust, HOVER)
    return np.sqrt(np.maximum(flight.data["diagnosis.threshold"].values ** 2 - base**2, 0.0))


@needs_simd
@pytest.mark.parametrize(
    ("mismatch", "kept"),
    [({"inertia": [0.8, 0.8, 0.8]}, "inertia"), ({"inertia": [1.2, 0.8, 1.0]}, "inertia"),
     ({"rotor_bandwidth": 0.7}, "bandwidth"), ({"rotor_bandwidth": 1.4}, "bandwidth")],
)  # fmt: skip
def test_a_wrong_model_shows_no_more_than_the_threshold_allows_it(mismatch: dict[str, Any], kept: str) -> None:
    """With the share of the other error set to 0: each covers its own, and is needed."""
    other = {"inertia": "bandwidth", "bandwidth": "inertia"}[kept]
    diagnosis = {"kind": "luenberger", "decision": {**HEALTHY["diagnosis"]["decision"], other: 0.0}}
    flight = flown(mismatch=mismatch, diagnosis=diagnosis)
    right = missing(flown(diagnosis=diagnosis))
    shown, allowed = missing(flight), bound(flight)
    assert shown.max() > 0.15  # N: an eighth of hover thrust; more than the threshold of a rotor in hover
    assert right.max() < 0.05  # of the right model: what is left is the order of the observer
    # To first order: of the bandwidth, 0.7 and 1.4 are far from 1.
    assert (shown - right.max() <= allowed).mean() > 0.99
    assert (shown - allowed).max() < 0.1 * HOVER  # within the threshold, which is there for the rest


@needs_simd
def test_in_steady_hover_a_wrong_model_is_no_excuse() -> None:
    """Nothing turns and no rotor lags, with a rotor that has lost a quarter of its thrust too."""
    still = {"kind": "set_point", "position": [0.0, 0.0, 0.0]}
    lost = [{"kind": "step", "rotor": 2, "time": 1.0, "loss": 0.25}]
    flight = flown(reference=still, start={}, fault=lost, diagnosis={"kind": "luenberger"}, duration=4.0)
    assert flight.summary()["detections"][0]["delay"] < 0.03
    threshold = flight.data["diagnosis.threshold"].values
    calm = 0.1 * np.maximum(flight.data["expected_thrust"].values, HOVER)
    np.testing.assert_allclose(threshold[950], calm[950], rtol=1e-3)
    np.testing.assert_allclose(threshold[-1], calm[-1], rtol=3e-2)
    assert threshold[1030:1100].max() > 1.2 * calm[950].max()  # while the body turns


@needs_simd
def test_noise_is_measured_as_the_difference_of_residuals_has_it() -> None:
    decision = {"threshold": 1e-6, "clear_threshold": 1e-7, "noise": 4.0, "inertia": 0.0, "bandwidth": 0.0}
    still = {"kind": "set_point", "position": [0.0, 0.0, 0.0]}
    for rate in (0.005, 0.02):
        common = {"sensors": {"kind": "noisy", "rate": rate}, "reference": still, "start": {}}
        judged = flown(**common).data["thrust_residual"].values[1000:]
        measured = flown(**common, diagnosis={"kind": "luenberger", "decision": decision})
        sigma = measured.data["diagnosis.threshold"].values[1000:, 0] / 4.0
        assert np.median(sigma) == pytest.approx(np.std(judged[:, 0] - judged[:, 2]), rel=0.1)


@pytest.mark.parametrize("poles", [(120.0, 180.0), (40.0, 60.0)])
def test_noise_gain_is_that_of_a_run(poles: tuple[float, float]) -> None:
    """Of one channel on white noise."""
    L1, L2 = place(T, 1.0, (np.exp(-poles[0] * T), np.exp(-poles[1] * T)))
    rate = deviation = 0.0
    innovations, deviations = [], []
    for measured in np.random.default_rng(3).normal(size=40_000):
        ahead = rate + T * deviation
        innovation = measured - ahead
        rate, deviation = ahead + L1 * innovation, deviation + L2 * innovation
        innovations.append(innovation)
        deviations.append(deviation)
    assert noise_gain(L1, L2, T) == pytest.approx(np.std(deviations) / np.std(innovations), rel=0.05)
