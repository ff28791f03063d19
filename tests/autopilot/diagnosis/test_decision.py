"""From residuals to a decision: thresholds, persistence counted in samples, clearing, NaN, smoothing."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from rotorfault.autopilot.diagnosis.decision import (
    DecisionMemory,
    DecisionParameters,
    DecisionSettings,
    decide,
    decision_parameters,
    relative_loss,
    spread_of,
    undecided,
)
from rotorfault.base.config import validate
from rotorfault.base.errors import InputError
from rotorfault.maths.geometry import PerRotor
from rotorfault.model.vehicle import hover_thrust
from rotorfault.model.vehicle_file import load_vehicle

Array = NDArray[np.float64]
VEHICLE = load_vehicle("paper").vehicle
HOVER = hover_thrust(VEHICLE).r1
T = 1e-3


def arr(values: PerRotor) -> Array:
    return np.array(list(values), dtype=float)


def decisions(
    losses: list[float], dt: float, start: DecisionMemory | None = None, **settings: float
) -> tuple[Array, DecisionMemory]:
    """Flag of rotor 2 after each sample of its loss, at hover thrust."""
    parameters = decision_parameters(DecisionSettings(**settings))
    memory, flags = start or undecided(), []
    for loss in losses:
        residual = PerRotor(0.0, -loss * HOVER, 0.0, 0.0)
        memory, told = decide(memory, residual, PerRotor.all(HOVER), VEHICLE, parameters, dt)
        flags.append(told.flagged.r2)
        assert told.flagged.r1 == told.flagged.r3 == told.flagged.r4 == 0.0
    return np.array(flags), memory


def first(flags: Array, value: float) -> int:
    """Number of samples until the flag has a value, that one included; 0 for never."""
    hits = np.flatnonzero(flags == value)
    return int(hits[0]) + 1 if len(hits) else 0


def test_threshold() -> None:
    assert first(decisions([0.1199999] * 200, T)[0], 1.0) == 0
    assert first(decisions([0.1200001] * 200, T)[0], 1.0) == 8
    assert first(decisions([0.2] * 200, T, threshold=0.3)[0], 1.0) == 0


@pytest.mark.parametrize("dt", [1e-4, 1e-3, 2e-3, 3e-3, 0.01, 0.1])
@pytest.mark.parametrize("persistence", [0.0, 0.008, 0.03, 0.3])
def test_persistence_is_counted_exactly(dt: float, persistence: float) -> None:
    """In samples, however the sum of the periods is rounded: as many as come nearest, one at least."""
    nearest = max(1, math.ceil(persistence / dt - 0.5 - 1e-9))
    flags, _ = decisions([0.5] * (nearest + 5), dt, persistence=persistence)
    assert first(flags, 1.0) == nearest
    # One sample less, then one below, and the count starts anew.
    broken = [*[0.5] * (nearest - 1), 0.1, *[0.5] * (nearest + 5)]
    assert first(decisions(broken, dt, persistence=persistence)[0], 1.0) == 2 * nearest


@pytest.mark.parametrize("dt", [1e-3, 7e-3, 0.01])
def test_clearing_has_hysteresis(dt: float) -> None:
    raised = decisions([0.5] * 50, dt)[1]
    count = math.ceil(0.2 / dt - 0.5)
    # Between the thresholds nothing changes, for any length of time.
    flags, _ = decisions([0.09] * (3 * count), dt, raised)
    assert flags.all()
    flags, _ = decisions([0.05] * (count + 5), dt, raised)
    assert first(flags, 0.0) == count
    # One sample above the lower threshold starts the count anew.
    flags, _ = decisions([*[0.05] * (count - 1), 0.07, *[0.05] * (count + 5)], dt, raised)
    assert first(flags, 0.0) == 2 * count
    # And what was cleared is raised again as the first time.
    cleared = decisions([0.0] * (count + 1), dt, raised)[1]
    assert first(decisions([0.5] * 50, dt, cleared)[0], 1.0) == max(1, math.ceil(0.008 / dt - 0.5))


def test_what_is_no_number_decides_nothing() -> None:
    """NaN neither raises a flag nor clears one, and does not count towards either."""
    assert not decisions([math.nan] * 300, T)[0].any()
    assert first(decisions([*[0.5] * 7, math.nan, *[0.5] * 7], T)[0], 1.0) == 0
    raised = decisions([0.5] * 50, T)[1]
    assert decisions([math.nan] * 500, T, raised)[0].all()
    assert decisions([*[0.01] * 199, math.nan, *[0.01] * 199], T, raised)[0].all()


@given(
    st.lists(st.floats(0.0, 1.0), min_size=3, max_size=3),
    st.lists(st.floats(0.05, 1.0), min_size=4, max_size=4),
    st.floats(-3.0, 3.0),
    st.integers(0, 3),
)
def test_relative_loss_is_what_was_lost(losses: list[float], shares: list[float], common: float, sound: int) -> None:
    """Each rotor misses its share of its own thrust; all four alike are off by a wind, and one rotor is sound."""
    true = np.insert(losses, sound, 0.0)
    thrust = np.array(shares) * VEHICLE.thrust_max
    residual = common - true * thrust
    found = arr(relative_loss(PerRotor(*residual), PerRotor(*thrust), VEHICLE))
    np.testing.assert_allclose(found, true, atol=1e-12)


@given(st.lists(st.floats(-5.0, 5.0), min_size=4, max_size=4), st.lists(st.floats(0.0, 9.0), min_size=4, max_size=4))
def test_relative_loss_is_a_share_and_the_best_rotor_has_none(residual: list[float], thrust: list[float]) -> None:
    found = arr(relative_loss(PerRotor(*residual), PerRotor(*thrust), VEHICLE))
    assert ((found >= 0.0) & (found <= 1.0)).all()
    assert found[int(np.argmax(residual))] == 0.0
    # Of two rotors that pull alike, the one that misses more has lost more.
    alike = arr(relative_loss(PerRotor(*residual), PerRotor.all(5.0), VEHICLE))
    assert (np.diff(alike[np.argsort(residual)]) <= 0.0).all()


def test_a_rotor_that_hardly_pulls_is_measured_against_a_twentieth_of_full_thrust() -> None:
    least = 0.05 * VEHICLE.thrust_max
    residual = PerRotor(0.0, -0.5 * least, -0.5 * least, -0.5 * least)
    found = arr(relative_loss(residual, PerRotor(0.0, 0.0, least, 2.0 * least), VEHICLE))
    np.testing.assert_allclose(found, [0.0, 0.5, 0.5, 0.25], atol=1e-12)


def asked_of(share: float, level: float, thrust: PerRotor, before: PerRotor | None = None) -> bool:
    """Whether rotor 1 is suspected at once for a loss of `share`, with all at a thrust level once before."""
    parameters = decision_parameters(DecisionSettings(persistence=0.0))
    memory = undecided()
    if before is not None:
        memory, _ = decide(memory, PerRotor.all(0.0), before, VEHICLE, parameters, T)
    residual = PerRotor(-share * level, 0.0, 0.0, 0.0)
    return bool(decide(memory, residual, thrust, VEHICLE, parameters, T)[1].flagged.r1)


def test_the_threshold_grows_with_the_spread_of_thrusts() -> None:
    """threshold F + uncertainty s, with s the difference to the partner and half of that between the pairs."""
    thrust = PerRotor(5.0, 3.0, 4.5, 4.0)
    assert list(spread_of(thrust)) == [2.0 + 0.25, 2.0 + 0.25, 0.5 + 0.25, 0.5 + 0.25]
    edge = 0.12 + 0.15 * 2.25 / 5.0
    assert not asked_of(edge - 1e-9, 5.0, thrust)
    assert asked_of(edge + 1e-9, 5.0, thrust)
    # The peak is remembered, and forgotten with its time constant.
    even = PerRotor.all(5.0)
    later = 0.12 + 0.15 * 2.25 * math.exp(-T / 0.03) / 5.0
    assert not asked_of(later - 1e-9, 5.0, even, thrust)
    assert asked_of(later + 1e-9, 5.0, even, thrust)


def missed_torque(D12: float, D34: float, yaw: float, share: float) -> list[float]:
    """Flags where the model misses a share of every torque that these pair differences [N] give."""
    parts = PerRotor(D12 / 2 + yaw, -D12 / 2 + yaw, D34 / 2 - yaw, -D34 / 2 - yaw)
    parameters = decision_parameters(DecisionSettings(persistence=0.0))
    return list(decide(undecided(), parts * share, parts + 4.5, VEHICLE, parameters, T)[1].flagged)


@given(st.floats(-3.0, 3.0), st.floats(-3.0, 3.0), st.floats(-1.0, 1.0), st.floats(-0.249, 0.249))
def test_an_inertia_wrong_by_a_quarter_blames_nobody(D12: float, D34: float, yaw: float, wrong: float) -> None:
    assert missed_torque(D12, D34, yaw, wrong) == [0.0] * 4


def test_much_more_is_taken_for_a_fault() -> None:
    assert missed_torque(3.0, 0.0, 0.0, 0.9)[:2] == [0.0, 1.0]


def test_smoothing_is_first_order_from_the_first_suspicion() -> None:
    parameters = decision_parameters(DecisionSettings())
    memory, believed = undecided(), []
    losses = [0.5] * 8 + [0.3] * 60
    for loss in losses:
        residual = PerRotor(-loss * HOVER, 0.0, 0.0, 0.0)
        memory, told = decide(memory, residual, PerRotor.all(HOVER), VEHICLE, parameters, T)
        believed.append(told.loss.r1)
    assert believed[:7] == [0.0] * 7  # not flagged yet: nothing is believed
    assert believed[7] == pytest.approx(0.5)
    k = np.arange(1, 61)
    np.testing.assert_allclose(believed[8:], 0.3 + 0.2 * np.exp(-k * T / 0.025), atol=1e-12)
    none = DecisionParameters(*parameters)._replace(smoothing=0.0)
    _, told = decide(memory, PerRotor(-0.4 * HOVER, 0.0, 0.0, 0.0), PerRotor.all(HOVER), VEHICLE, none, T)
    assert told.loss.r1 == pytest.approx(0.4)


def test_thresholds_out_of_order_are_refused() -> None:
    with pytest.raises(InputError, match=r"clear_threshold 0\.2 must not exceed threshold 0\.12"):
        validate(DecisionSettings, {"clear_threshold": 0.2}, "test")
