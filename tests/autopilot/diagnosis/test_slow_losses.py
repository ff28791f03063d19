"""Slow losses: what is said of states that move is the least-squares answer, and a ramp is found in flight."""

from __future__ import annotations

import numpy as np
import pytest
from gates import needs_simd

import rotorfault as rf
from rotorfault.autopilot.diagnosis import slow_losses
from rotorfault.autopilot.diagnosis.fault_free import LOSSES, ModelParameters, model_parameters
from rotorfault.autopilot.diagnosis.kalman import Belief, diagonal
from rotorfault.autopilot.diagnosis.model_settings import ModelSettings
from rotorfault.model.block import Context
from rotorfault.model.vehicle_file import load_vehicle
from rotorfault.scenario.scenario import scenario_from

VEHICLE = load_vehicle("x500").vehicle
DT = 0.01


@pytest.fixture
def numbers() -> ModelParameters:
    return model_parameters(ModelSettings(), Context(VEHICLE, DT))


def known(mean: np.ndarray, P: np.ndarray) -> Belief:
    """A belief of which only the states that are watched count."""
    n, places = LOSSES + 4, list(slow_losses.PLACES)
    x, whole = np.zeros(n), np.eye(n)
    x[places] = mean
    whole[np.ix_(places, places)] = P
    return Belief(tuple(x), tuple(tuple(whole[i, i:]) for i in range(n)))


def test_it_is_generalised_least_squares(numbers: ModelParameters) -> None:
    rng = np.random.default_rng(4)
    root = rng.normal(size=(4, 4))
    before, after = root @ root.T + 4.0 * np.eye(4), 0.1 * np.eye(4)
    start, moved = rng.normal(size=4), rng.normal(size=4)
    slow = slow_losses.at_start(known(start, before))
    now = known(start + moved, after)
    for window in slow_losses.windows(slow, now, numbers, VEHICLE):
        assert all(float(one.information) < 1e-6 for one in window.rotors), "what was not known cannot move"
    # The oldest take over after five seconds what was known after one.
    for _ in range(round(6.0 / DT)):
        slow = slow_losses.watch(slow, known(start, before), numbers, DT)
    steps = round(5.0 / DT)
    walk = np.array([float(numbers.walk[i - slow_losses.OFFSETS]) for i in slow_losses.PLACES]) * steps * DT
    spread = np.array([float(numbers.start[i - slow_losses.OFFSETS]) for i in slow_losses.PLACES]) * slow_losses.SURE
    inverse = np.linalg.inv(before + np.diag(walk + spread) - after)
    for window in slow_losses.windows(slow, now, numbers, VEHICLE)[1:]:
        for one, move in zip(window.rotors, slow_losses.signatures(VEHICLE), strict=True):
            v = np.array([float(x) for x in move])
            assert one.score == pytest.approx(v @ inverse @ moved, rel=1e-9)
            assert one.information == pytest.approx(v @ inverse @ v, rel=1e-9)
            assert [-one.error[i] for i in slow_losses.PLACES] == pytest.approx([*v])


def test_windows_look_back_to_when_they_began_and_take_over(numbers: ModelParameters) -> None:
    """The oldest to the first second, until that is sixteen seconds ago, and then four seconds at least."""
    slow = slow_losses.at_start(diagonal((0.0,) * (LOSSES + 4), (1.0,) * (LOSSES + 4)))
    ages = []
    for k in range(1, 4001):
        slow = slow_losses.watch(slow, known(np.full(4, k * DT), np.eye(4)), numbers, DT)
        ages.append([k * DT - float(one.mean[0]) for one in slow])
    then = np.array(ages)
    np.testing.assert_allclose(then[600:1600, -1], np.arange(601, 1601) * DT - 1.0, atol=2.5 * DT)
    for k, length in enumerate(slow_losses.LENGTHS):
        assert then[2000:, k].max() < length + 2.0 * DT
        assert then[2000:, k].min() > 0.25 * length - 1.0 - 2.0 * DT


@needs_simd
@pytest.mark.long
def test_a_ramp_of_ten_percent_in_ten_seconds_is_found_and_a_sound_rotor_is_not() -> None:
    square = {"amplitude": [2.0, 2.0, 0.5], "period": [4.0, 5.0, 6.0], "time_constant": [0.4, 0.4, 0.4]}
    table = {
        "name": "slow",
        "period": 0.001,
        "vehicle": "x500",
        "controller": {"kind": "roismc", "preset": "midsize"},
        "reference": {"kind": "square", **square},
        "sensors": {"kind": "mocap"},
        "diagnosis": "multiple_model",
        "duration": 14.0,
        "fault": [{"kind": "ramp", "rotor": 2, "start": 2.0, "end": 12.0, "loss": 0.1}],
    }
    losses = [0.1, 0.1, 0.1, 0.1, 0.0, 0.0]
    flights = rf.fly_many(scenario_from(table, "test"), {"seed": range(6), "fault.0.loss": losses}, warn=False).table
    assert np.isfinite(flights["detected.2"][:4]).sum() >= 3
    assert not flights["false_alarms"][4:].any()
