"""From residuals to a decision: thresholds, persistence counted in samples, clearing, NaN, smoothing."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from rotorfault.autopilot.diagnosis.decision import (
    DecisionMemory,
    DecisionParameters,
    DecisionSettings,
    Evidence,
    decide,
    decision_parameters,
    relative_loss,
    second_best,
    undecided,
)
from rotorfault.autopilot.diagnosis.model_error import Misstated
from rotorfault.autopilot.diagnosis.stuck import StuckParameters
from rotorfault.base.config import validate
from rotorfault.base.errors import InputError
from rotorfault.maths.geometry import PerRotor
from rotorfault.model.mixer import hover_thrust
from rotorfault.model.signals import Diagnosis
from rotorfault.model.vehicle_file import load_vehicle

Array = NDArray[np.float64]
VEHICLE = load_vehicle("paper").vehicle
HOVER = hover_thrust(VEHICLE).r1
T = 1e-3
TEST_TIME = 0.1
STUCK = StuckParameters(settled=0.033, missed=0.06)
SLOW, FAST = 120.0, 180.0  # rad/s: poles of an observer


def arr(values: PerRotor) -> Array:
    return np.array(list(values), dtype=float)


def step(
    memory: DecisionMemory,
    residual: PerRotor,
    thrust: PerRotor,
    parameters: DecisionParameters,
    dt: float,
    error: float = 0.0,
    noise: float = 0.0,
) -> tuple[DecisionMemory, Diagnosis]:
    """One instant, with a model error and noise in N."""
    evidence = Evidence(residual, thrust, Misstated(*[PerRotor.all(error * error)] * 2), PerRotor.all(noise))
    return decide(memory, evidence, VEHICLE, parameters, dt)[:2]


def numbers(lateness: float = 0.0, **settings: float) -> DecisionParameters:
    return decision_parameters(DecisionSettings(**settings), lateness, TEST_TIME, STUCK)


def decisions(
    losses: list[float], dt: float, start: DecisionMemory | None = None, **settings: float
) -> tuple[Array, DecisionMemory]:
    """Flag of rotor 2 after each sample of its loss, at hover thrust."""
    parameters = numbers(**settings)
    memory, flags = start or undecided(), []
    for loss in losses:
        residual = PerRotor(0.0, -loss * HOVER, 0.0, 0.0)
        memory, told = step(memory, residual, PerRotor.all(HOVER), parameters, dt)
        flags.append(told.flagged.r2)
        assert told.flagged.r1 == told.flagged.r3 == told.flagged.r4 == 0.0
    return np.array(flags), memory


def first(flags: Array, value: float) -> int:
    """Number of samples until the flag has a value, that one included; 0 for never."""
    hits = np.flatnonzero(flags == value)
    return int(hits[0]) + 1 if len(hits) else 0


def test_threshold() -> None:
    assert first(decisions([0.0999999] * 200, T)[0], 1.0) == 0
    assert first(decisions([0.1000001] * 200, T)[0], 1.0) == 8
    assert first(decisions([0.2] * 200, T, threshold=0.3)[0], 1.0) == 0


@pytest.mark.parametrize("dt", [1e-4, 1e-3, 2e-3, 3e-3, 0.01, 0.1])
@pytest.mark.parametrize("persistence", [0.0, 0.008, 0.03, 0.3])
def test_persistence_is_counted_exactly(dt: float, persistence: float) -> None:
    """In samples, however the sum of the periods is rounded: as many as come nearest, one at least."""
    nearest = max(1, math.ceil(persistence / dt - 0.5 - 1e-9))
    flags, _ = decisions([0.5] * (nearest + 5), dt, persistence=persistence)
    assert first(flags, 1.0) == nearest
    # One sample less, then one below, and the count starts anew.
    broken = [*[0.5] * (nearest - 1), 0.09, *[0.5] * (nearest + 5)]
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
    st.lists(st.floats(0.0, 1.0), min_size=2, max_size=2),
    st.lists(st.floats(0.05, 1.0), min_size=4, max_size=4),
    st.floats(-3.0, 3.0),
    st.permutations(range(4)),
)
def test_relative_loss_is_what_was_lost(
    losses: list[float], shares: list[float], common: float, order: list[int]
) -> None:
    """Two rotors miss a share of their own thrust; all four alike are off by a wind, and two rotors are sound."""
    true = np.array([*losses, 0.0, 0.0])[order]
    thrust = np.array(shares) * VEHICLE.thrust_max
    residual = common - true * thrust
    found = arr(relative_loss(PerRotor(*residual), PerRotor(*thrust), VEHICLE))
    np.testing.assert_allclose(found, true, atol=1e-12)


@given(st.lists(st.floats(-5.0, 5.0), min_size=4, max_size=4), st.lists(st.floats(0.0, 9.0), min_size=4, max_size=4))
def test_relative_loss_is_a_share_and_the_two_best_rotors_have_none(
    residual: list[float], thrust: list[float]
) -> None:
    assert second_best(PerRotor(*residual)) == sorted(residual)[2]
    found = arr(relative_loss(PerRotor(*residual), PerRotor(*thrust), VEHICLE))
    assert ((found >= 0.0) & (found <= 1.0)).all()
    assert (found[np.argsort(residual)[2:]] == 0.0).all()
    # Of two rotors that pull alike, the one that misses more has lost more.
    alike = arr(relative_loss(PerRotor(*residual), PerRotor.all(5.0), VEHICLE))
    assert (np.diff(alike[np.argsort(residual)]) <= 0.0).all()


def test_a_rotor_that_hardly_pulls_is_measured_against_a_twentieth_of_full_thrust() -> None:
    least = 0.05 * VEHICLE.thrust_max
    residual = PerRotor(0.0, 0.0, -0.5 * least, -0.5 * least)
    found = arr(relative_loss(residual, PerRotor(0.0, 0.0, 0.5 * least, 2.0 * least), VEHICLE))
    np.testing.assert_allclose(found, [0.0, 0.0, 0.5, 0.25], atol=1e-12)


def suspected(missing: float, thrust: PerRotor, error: float = 0.0, noise: float = 0.0) -> bool:
    """Whether rotor 1 is flagged at once for thrust that is missing [N]."""
    residual = PerRotor(-missing, 0.0, 0.0, 0.0)
    return bool(step(undecided(), residual, thrust, numbers(persistence=0.0), T, error, noise)[1].flagged.r1)


@pytest.mark.parametrize("thrust", [0.2 * HOVER, HOVER, 1.7 * HOVER])
@pytest.mark.parametrize(("error", "noise"), [(0.0, 0.0), (0.9, 0.0), (0.0, 0.3), (0.9, 0.3), (0.0, 1e-3)])
def test_the_threshold_grows_with_thrust_model_error_and_noise(thrust: float, error: float, noise: float) -> None:
    """A thrust below that of hover is not weighed against less than hover: what hardly pulls shows hardly a loss."""
    edge = math.hypot(max(0.1 * max(thrust, HOVER), 5.5 * noise), error)
    assert not suspected(edge - 1e-9, PerRotor.all(thrust), error, noise)
    assert suspected(edge + 1e-9, PerRotor.all(thrust), error, noise)


def test_a_rotor_that_falls_behind_its_partner_is_not_excused_by_errors_about_yaw() -> None:
    """Errors about yaw weigh on both rotors of a pair alike."""
    errors = Misstated(PerRotor.all(9.0), PerRotor.all(0.01))
    for residual, expected in (
        (PerRotor(-1.0, 0.0, 0.0, 0.0), [1.0, 0.0, 0.0, 0.0]),
        (PerRotor(-1.0, 0.0, -1.5, 0.0), [1.0, 0.0, 1.0, 0.0]),
        (PerRotor(-1.0, -1.0, 0.0, 0.0), [0.0] * 4),  # may well be yaw
        (PerRotor(0.0, 1.0, 0.0, 0.0), [0.0] * 4),  # rotor 1 falls behind its partner only because that gives more
    ):
        evidence = Evidence(residual, PerRotor.all(HOVER), errors, PerRotor.all(0.0))
        told = decide(undecided(), evidence, VEHICLE, numbers(persistence=0.0), T)[1]
        assert list(told.flagged) == expected


def named_in_wind(residual: PerRotor, drag: float) -> Diagnosis:
    """What is told of residuals where the drag of each rotor about yaw is worth so many times the thrust of hover."""
    errors = Misstated(PerRotor.all(1e-4), PerRotor.all(1e-4), PerRotor.all(drag * HOVER))
    evidence = Evidence(residual * HOVER, PerRotor.all(HOVER), errors, PerRotor.all(0.0))
    return decide(undecided(hover=HOVER), evidence, VEHICLE, numbers(persistence=0.0), T)[1]


@pytest.mark.parametrize("shift", [-0.8, 0.0, 0.8])
def test_a_rotor_is_named_and_measured_by_its_partner_whatever_its_drag_did(shift: float) -> None:
    """Its drag may be gone with its blades: that moves both rotors of its pair, and the others the other way."""
    told = named_in_wind(PerRotor(shift - 0.9, shift, -shift, -shift), 2.0)
    assert list(told.flagged) == [1.0, 0.0, 0.0, 0.0]
    assert told.estimate.r1 == pytest.approx(0.9)


def test_drag_excuses_nobody_where_no_rotor_has_lost_any() -> None:
    """Without a difference across an arm none has lost its blades."""
    assert list(named_in_wind(PerRotor(-0.9, -0.9, 0.0, 0.0), 2.0).flagged) == [1.0, 1.0, 0.0, 0.0]
    assert list(named_in_wind(PerRotor(0.0, 0.9, 0.0, 0.0), 0.0).flagged) == [0.0, 1.0, 0.0, 0.0]


@pytest.mark.parametrize("rotor", [0, 1, 2, 3])
def test_a_rotor_that_gives_too_much_is_at_fault_and_not_the_others(rotor: int) -> None:
    """And nothing is taken from it: it does not give less when it is asked for less."""
    residual = PerRotor(*(0.3 * HOVER if k == rotor else 0.0 for k in range(4)))
    memory = undecided()
    for _ in range(50):
        memory, told = step(memory, residual, PerRotor.all(HOVER), numbers(), T)
    assert list(told.flagged) == [float(k == rotor) for k in range(4)]
    assert list(told.loss) == [0.0] * 4


def run(memory: DecisionMemory, loss: float, thrust: float, steps: int, share: float = 0.0) -> Any:
    """Rotor 1 at a thrust, of which it misses a share of its own and one of hover; memory and all that was told."""
    told = []
    for _ in range(steps):
        residual = PerRotor(-loss * thrust - share * HOVER, 0.0, 0.0, 0.0)
        memory, diagnosis = step(memory, residual, PerRotor(thrust, HOVER, HOVER, HOVER), numbers(), T)
        told.append(diagnosis)
    return memory, told


@pytest.mark.parametrize("thrust", [0.15, 0.3, 0.5, 0.8])
def test_a_belief_is_no_larger_than_the_thrust_at_hand_can_show(thrust: float) -> None:
    """What is missing is 15 % of hover, of a rotor that pulls less; 10 % of hover may be noise."""
    _, told = run(undecided(), 0.0, thrust * HOVER, 40, share=0.15)
    assert told[-1].flagged.r1 == 1.0
    margin = 0.1 / thrust - 0.1
    assert told[-1].estimate.r1 == pytest.approx(min(0.15 / thrust, 1.0))
    assert told[7].loss.r1 <= told[7].estimate.r1 - 0.75 * margin
    assert told[-1].loss.r1 < told[-1].estimate.r1


def test_a_rotor_believed_dead_is_tested_at_once_and_again_and_let_off_if_it_gives_thrust() -> None:
    dead, told = run(undecided(), 1.0, HOVER, 300)
    assert told[-1].loss.r1 == pytest.approx(1.0, abs=1e-4)
    # It is held at no thrust, and tested: on once TESTED is passed, for as long as it takes, and every second.
    testing = np.array([diagnosis.test.r1 > 0.0 for diagnosis in told])
    assert testing[np.argmax(testing) :].sum() == round(TEST_TIME / T) - 1
    memory, told = run(dead, 1.0, 0.0, 2500)
    testing = np.array([diagnosis.test.r1 for diagnosis in told])
    assert set(testing) == {0.0, 0.3 * HOVER}
    rises = np.flatnonzero(np.diff(testing) > 0.0)
    assert (np.diff(rises) == round(1.0 / T) + 1).all()
    assert len(rises) >= 2
    # Dead, it gives none of the thrust of the test, and stays what it is.
    memory, told = run(memory, 1.0, 0.3 * HOVER, 100)
    assert told[-1].loss.r1 > 0.99
    assert told[-1].flagged.r1 == 1.0
    # Sound, it gives it all: hardly believed lost within a test, and cleared once it flies as the others do.
    memory, told = run(memory, 0.0, 0.3 * HOVER, 100)
    assert told[-1].loss.r1 < 0.3
    memory, told = run(memory, 0.0, HOVER, 300)
    assert told[-1].flagged.r1 == 0.0


def test_no_rotor_is_cleared_while_its_thrust_shows_nothing() -> None:
    dead, _ = run(undecided(), 1.0, HOVER, 300)
    _, told = run(dead, 1.0, 0.0, 5000)
    assert all(diagnosis.flagged.r1 == 1.0 for diagnosis in told)
    assert told[-1].loss.r1 == pytest.approx(1.0, abs=1e-3)


def test_smoothing_is_first_order_from_the_first_suspicion() -> None:
    parameters = numbers()
    memory, believed = undecided(), []
    losses = [0.5] * 8 + [0.45] * 60
    for loss in losses:
        residual = PerRotor(-loss * HOVER, 0.0, 0.0, 0.0)
        memory, told = step(memory, residual, PerRotor.all(HOVER), parameters, T)
        believed.append(told.loss.r1)
    assert believed[:7] == [0.0] * 7  # not flagged yet: nothing is believed
    assert believed[7] == pytest.approx(0.5)
    k = np.arange(1, 61)
    np.testing.assert_allclose(believed[8:], 0.45 + 0.05 * np.exp(-k * T / 0.025), atol=1e-12)
    none = DecisionParameters(*parameters)._replace(smoothing=0.0)
    _, told = step(memory, PerRotor(-0.4 * HOVER, 0.0, 0.0, 0.0), PerRotor.all(HOVER), none, T)
    assert told.loss.r1 == pytest.approx(0.4)


@pytest.mark.parametrize(("after", "threshold"), [(0.9, 0.1), (0.3, 0.1)])
def test_what_is_farther_off_than_the_threshold_is_believed_at_once(after: float, threshold: float) -> None:
    """Neither noise nor a wrong model shows so much; the rest comes with the smoothing."""
    parameters, (memory, _) = numbers(), run(undecided(), 0.6, HOVER, 300)
    believed = []
    for _ in range(60):
        residual = PerRotor(-after * HOVER, 0.0, 0.0, 0.0)
        memory, told = step(memory, residual, PerRotor.all(HOVER), parameters, T)
        believed.append(told.loss.r1)
    side = math.copysign(threshold, 0.6 - after)
    k = np.arange(1, 61)
    np.testing.assert_allclose(believed, after + side * np.exp(-k * T / 0.025), atol=1e-9)


def test_thresholds_out_of_order_are_refused() -> None:
    with pytest.raises(InputError, match=r"clear_threshold 0\.2 must not exceed threshold 0\.1"):
        validate(DecisionSettings, {"clear_threshold": 0.2}, "test")


@pytest.mark.parametrize("command", [lambda k: 0.3 if k < 50 else 3.0, lambda k: 1.0 + 0.02 * min(k, 100)])
def test_a_dead_rotor_that_is_told_to_give_more_is_believed_dead_all_the_same(
    command: Callable[[int], float],
) -> None:
    """What it lacks shows late; beside the thrust of the same instant it would seem to give a part of it."""

    def least_belief(lateness: float) -> float:
        dead, _ = run(undecided(hover=HOVER), 1.0, HOVER, 300)
        parameters, memory, believed = numbers(lateness), dead._replace(late=PerRotor.all(HOVER)), []
        first = shown = -HOVER
        asked = HOVER
        for k in range(200):
            asked += (command(k) * HOVER - asked) * (1.0 - math.exp(-T / 0.02))
            first += (-asked - first) * (1.0 - math.exp(-SLOW * T))
            shown += (first - shown) * (1.0 - math.exp(-FAST * T))
            memory, told = step(memory, PerRotor(shown, 0.0, 0.0, 0.0), PerRotor.all(asked), parameters, T)
            believed.append(told.loss.r1)
        return min(believed)

    assert least_belief(1.0 / SLOW + 1.0 / FAST) > 0.93
    assert least_belief(0.0) < 0.9
