"""A flight whose numbers are none at its very end is no sound flight."""

from __future__ import annotations

import math
from typing import Any

import pytest

import rotorfault as rf

PERIOD, STEPS = 0.001, 10


class Failing:
    """Asks for hover, and from some time on for a thrust that is no number."""

    def __init__(self, until: float, instead: float) -> None:
        self.until, self.instead = until, instead

    def update(self, time: float, estimate: Any, reference: Any, vehicle: Any) -> rf.Wrench:
        """Thrust of hover, or not."""
        thrust = vehicle.mass * vehicle.gravity if time < self.until else self.instead
        return rf.Wrench(thrust, rf.Vec3(0.0, 0.0, 0.0))


@pytest.mark.parametrize("instead", [math.nan, math.inf])
@pytest.mark.parametrize("steps", [STEPS - 1, STEPS // 2])
def test_commands_that_are_none_end_a_flight(steps: int, instead: float) -> None:
    """Also those of the last instant, which move nothing any more."""
    until = (steps - 0.5) * PERIOD
    flight = rf.fly("paper-set-point", Failing(until, instead), settings={"duration": STEPS * PERIOD})
    assert flight.outcome.kind == "diverged"
    assert flight.outcome.time == pytest.approx(steps * PERIOD)


def test_a_sound_flight_ends_with_numbers() -> None:
    flight = rf.fly("paper-set-point", Failing(1.0, math.nan), settings={"duration": STEPS * PERIOD})
    assert flight.outcome.survived


@pytest.mark.parametrize("engine", ["python", "numpy"])
def test_what_a_controller_records_must_be_a_number(engine: str) -> None:
    """Here its Lyapunov function overflows, while the commands are numbers and the motion goes on."""
    settings = {"duration": STEPS * PERIOD, "controller.law.position.weight": [1e170, 1e170, 1e170]}
    flight = rf.fly("paper-set-point", "roismc", settings=settings, engine=engine)
    assert flight.outcome.kind == "diverged"
