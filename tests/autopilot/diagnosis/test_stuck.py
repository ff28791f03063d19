"""Stuck, or a loss: by which of the two explains what a rotor gives while its command moves."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from rotorfault.autopilot.diagnosis.stuck import Seen, StuckParameters, judged, nobody_judged
from rotorfault.maths.geometry import PerRotor
from rotorfault.model.signals import Stuck

HOVER, T = 2.0, 1e-3  # N, s
SLOW, FAST = 120.0, 180.0  # rad/s: the observer's poles
NUMBERS = StuckParameters(4.0 / SLOW, 0.06)


def moving(time: float) -> float:
    """Thrust of a sound rotor that a busy controller asks for, in N."""
    return HOVER * (1.0 + 0.5 * math.sin(9.0 * time) + 0.2 * math.sin(31.0 * time))


def steady(time: float) -> float:
    return HOVER


def watch(
    gives: Callable[[float], float],
    asked: Callable[[float], float] = moving,
    flags: tuple[float, float, float, float] = (0.0, 1.0, 0.0, 0.0),
    yaw: Callable[[float], float] = lambda time: 0.0,
    steps: int = 600,
) -> list[Stuck]:
    """Rotor 2 gives a thrust of the thrust asked for, as an observer with two poles shows it.

    `yaw` is what the observer gets wrong about the yaw axis, in N of each rotor: of the partners 1 and 2 alike.
    """
    memory, told, late = nobody_judged(), [], asked(0.0)
    first = shown = gives(asked(0.0)) - asked(0.0)
    for k in range(steps):
        f = asked(k * T)
        first += (gives(f) - f - first) * (1.0 - math.exp(-SLOW * T))
        shown += (first - shown) * (1.0 - math.exp(-FAST * T))
        late += (f - late) * T / (1.0 / SLOW + 1.0 / FAST + T)
        e = yaw(k * T)
        seen = Seen(
            thrust=PerRotor(HOVER, late, HOVER, HOVER),
            residual=PerRotor(e, shown + e, -e, -e),
            partner=PerRotor(shown + e, e, -e, -e),
            partner_flagged=PerRotor(flags[1], flags[0], flags[3], flags[2]),
            flagged=PerRotor(*flags),
        )
        memory, stuck = judged(memory, seen, 0.0, HOVER, NUMBERS, T)
        told.append(stuck)
    return told


@pytest.mark.parametrize("share", [0.3, 0.6, 0.9, 1.1, 1.4])
def test_a_rotor_that_does_not_follow_is_believed_stuck_at_what_it_gives(share: float) -> None:
    told = watch(lambda f: share * HOVER)
    # The command has moved enough by then, also for a rotor that gives little.
    assert [stuck.rotor.r2 for stuck in told[-100:]] == [1.0] * 100
    assert told[-1].thrust.r2 == pytest.approx(share * HOVER, abs=0.06 * HOVER)
    assert all(list(stuck.rotor)[::2] == [0.0, 0.0] for stuck in told)
    # Not before the observer has shown it.
    assert not any(stuck.rotor.r2 for stuck in told[: int(NUMBERS.settled / T) - 1])


@pytest.mark.parametrize("loss", [0.1, 0.3, 0.6, 0.9, 1.0])
@pytest.mark.parametrize("asked", [moving, steady])
def test_a_loss_is_never_taken_for_a_stuck_rotor(loss: float, asked: Callable[[float], float]) -> None:
    assert not any(any(stuck.rotor) for stuck in watch(lambda f: (1.0 - loss) * f, asked))


def test_while_the_command_stands_still_a_loss_explains_it_too() -> None:
    assert not any(any(stuck.rotor) for stuck in watch(lambda f: 0.6 * HOVER, steady))
    assert watch(lambda f: 1.3 * HOVER, steady)[-1].rotor.r2 == 1.0  # but no loss gives more than there was


def test_what_is_wrong_about_yaw_is_the_partner_s_as_well() -> None:
    """As large as half of hover, as from the reaction of a rotor that is believed to change its speed."""

    def wrong(time: float) -> float:
        return 0.5 * HOVER * math.sin(40.0 * time)

    told = watch(lambda f: 0.7 * HOVER, yaw=wrong)
    assert told[-1].rotor.r2 == 1.0
    assert told[-1].thrust.r2 == pytest.approx(0.7 * HOVER, abs=0.06 * HOVER)
    assert not any(any(stuck.rotor) for stuck in watch(lambda f: 0.7 * f, yaw=wrong))


def test_where_three_are_flagged_nothing_is_known() -> None:
    assert not any(any(stuck.rotor) for stuck in watch(lambda f: 0.7 * HOVER, flags=(1.0, 1.0, 1.0, 0.0)))


def test_the_rotor_that_was_flagged_first_is_judged() -> None:
    memory = nobody_judged()
    for k in range(400):
        f = moving(k * T)
        flagged = PerRotor(1.0 if k > 100 else 0.0, 1.0, 0.0, 0.0)
        residual = PerRotor(0.0, 0.7 * HOVER - f, 0.0, 0.0)
        seen = Seen(PerRotor(f, f, f, f), residual, PerRotor(residual.r2, 0.0, 0.0, 0.0), flagged, flagged)
        memory, stuck = judged(memory, seen, 0.0, HOVER, NUMBERS, T)
        assert list(memory.judged) == [0.0, 1.0, 0.0, 0.0]
    assert list(stuck.rotor) == [0.0, 1.0, 0.0, 0.0]


def test_a_rotor_stuck_at_any_thrust_is_believed() -> None:
    """Twice its thrust may be more lift than its pair can shed: the body then spins, about an axis of its own."""
    for share in (1.55, 1.8, 2.5):
        assert watch(lambda f, share=share: share * HOVER)[-1].rotor.r2 == 1.0


def test_what_is_no_number_is_no_stuck_rotor() -> None:
    told = watch(lambda f: math.nan)
    assert not any(any(stuck.rotor) for stuck in told)
    assert np.array([list(stuck.thrust) for stuck in told]).sum() == 0.0
