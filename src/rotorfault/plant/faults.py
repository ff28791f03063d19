"""Rotor faults as a declarative timeline: what is wrong with which rotor, from when on.

A *loss* is the lost share of thrust; the *effectiveness* is what remains, 1 - loss. Losses on one rotor combine as
the product of what they leave. A stuck rotor delivers a thrust of its own, whatever is commanded and whatever else
is wrong with it. Times and losses are numbers in the parameters, so that they may differ between the flights of a
batch; which rotor is hit is a choice of structure.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple, Protocol, final

from pydantic import Field, model_validator

from rotorfault.base.config import Strict, refusal
from rotorfault.base.registry import Registry
from rotorfault.maths.geometry import PerRotor
from rotorfault.maths.scalar import (
    Scalar,
    absolute,
    both,
    clip,
    either,
    greater_equal,
    less,
    less_equal,
    select,
    wrap_angle,
)

# Times are counted steps times a period, and may fall short of the time that was meant by rounding.
TIME_TOLERANCE = 1e-9  # s


class RotorFault(NamedTuple):
    """State of the four rotors at one time."""

    effectiveness: PerRotor  # 1 sound .. 0 dead
    stuck: PerRotor  # 1 where the rotor does not follow its command
    stuck_thrust: PerRotor  # N, delivered where stuck


class StuckAt(NamedTuple):
    """Whether a rotor has stopped following its command, and what it delivers then."""

    active: Scalar  # 1/0
    thrust: Scalar  # N


class Fault(Protocol):
    """A fault of one rotor: either it takes effectiveness or it holds the thrust; the other says nothing."""

    settings: Any

    def parameters(self) -> Any:
        """Times in s, losses and thrusts as a record of numbers."""

    @property
    def onset(self) -> float:
        """Time of its first effect in s."""

    @staticmethod
    def true_loss(settings: Any) -> float:
        """Largest loss that it reaches, for reports; NaN where it is no loss."""

    def effectiveness(self, time: Scalar, parameters: Any) -> Scalar:
        """What it leaves of the thrust at a time in s."""
        return 1.0

    def stuck(self, time: Scalar, parameters: Any) -> StuckAt:
        """Whether it holds the thrust at a time in s, and where."""
        return StuckAt(0.0, 0.0)


FAULTS: Registry[type] = Registry("fault")


def since(time: Scalar, start: Scalar) -> Scalar:
    """1 from `start` on, robust against rounding of the time; both in s."""
    return greater_equal(time, start - TIME_TOLERANCE)


def rotor_faults(faults: Sequence[Fault], parameters: Sequence[Any], time: Scalar) -> RotorFault:
    """Combine all faults at one time.

    Parameters
    ----------
    faults : sequence of Fault
    parameters : sequence of records
        One for each fault.
    time : scalar, s
        Since the start of the flight.

    Returns
    -------
    RotorFault
        Remaining effectiveness is a product; of several stuck faults of one rotor that are active, the last listed
        holds.
    """
    effectiveness: list[Scalar] = [1.0] * 4
    stuck: list[Scalar] = [0.0] * 4
    thrust: list[Scalar] = [0.0] * 4
    for fault, numbers in zip(faults, parameters, strict=True):
        i = fault.settings.rotor - 1
        effectiveness[i] = effectiveness[i] * fault.effectiveness(time, numbers)
        held = fault.stuck(time, numbers)
        stuck[i] = either(stuck[i], held.active)
        thrust[i] = select(held.active, held.thrust, thrust[i])
    return RotorFault(PerRotor(*effectiveness), PerRotor(*stuck), PerRotor(*thrust))


class OneRotor(Strict):
    """What every fault has: the rotor that it hits."""

    rotor: int = Field(ge=1, le=4, description="number of the rotor, 1 to 4")


class OneRotorInterval(OneRotor):
    """A fault between two times."""

    start: float = Field(ge=0.0, description="time of the first effect [s]")
    end: float = Field(ge=0.0, description="time of the end [s], after start")

    @model_validator(mode="after")
    def _ordered(self) -> OneRotorInterval:
        if not self.end > self.start:
            raise refusal("end", f"got {self.end!r} s; allowed: later than start = {self.start!r} s")
        return self


class StepParameters(NamedTuple):
    """Numbers of a sudden loss."""

    time: Scalar  # s
    loss: Scalar  # 1


@final
@FAULTS.register("step")
class Step(Fault):
    """Sudden partial loss of one rotor's thrust, for good."""

    class Settings(OneRotor):
        """When and how much."""

        time: float = Field(ge=0.0, description="time of the loss [s]")
        loss: float = Field(ge=0.0, le=1.0, description="lost share of the thrust, 0 to 1")

    def __init__(self, settings: Settings) -> None:
        self.settings = settings

    def parameters(self) -> StepParameters:
        """Time and loss."""
        return StepParameters(self.settings.time, self.settings.loss)

    @property
    def onset(self) -> float:
        """Time of the loss in s."""
        return self.settings.time

    @staticmethod
    def true_loss(settings: Settings) -> float:
        """The loss."""
        return settings.loss

    def effectiveness(self, time: Scalar, parameters: StepParameters) -> Scalar:
        """1 before, 1 - loss from the time on."""
        return 1.0 - parameters.loss * since(time, parameters.time)


class RampParameters(NamedTuple):
    """Numbers of a gradual loss."""

    start: Scalar  # s
    end: Scalar  # s
    loss: Scalar  # 1


@final
@FAULTS.register("ramp")
class Ramp(Fault):
    """Gradual partial loss of one rotor's thrust, linear in time, then constant."""

    class Settings(OneRotorInterval):
        """From when to when, and how much in the end."""

        loss: float = Field(ge=0.0, le=1.0, description="share of the thrust lost in the end, 0 to 1")

    def __init__(self, settings: Settings) -> None:
        self.settings = settings

    def parameters(self) -> RampParameters:
        """Both times and the final loss."""
        return RampParameters(self.settings.start, self.settings.end, self.settings.loss)

    @property
    def onset(self) -> float:
        """Start of the ramp in s."""
        return self.settings.start

    @staticmethod
    def true_loss(settings: Settings) -> float:
        """The loss in the end."""
        return settings.loss

    def effectiveness(self, time: Scalar, parameters: RampParameters) -> Scalar:
        """Falls linearly from 1 to 1 - loss between the two times."""
        share = clip((time - parameters.start) / (parameters.end - parameters.start), 0.0, 1.0)
        return 1.0 - parameters.loss * share


class IntermittentParameters(NamedTuple):
    """Numbers of a loss that comes and goes."""

    start: Scalar  # s
    end: Scalar  # s
    period: Scalar  # s
    duty: Scalar  # 1, share of each period in which the loss is there
    loss: Scalar  # 1


@final
@FAULTS.register("intermittent")
class Intermittent(Fault):
    """Partial loss of one rotor's thrust that comes and goes with a period."""

    class Settings(OneRotorInterval):
        """From when to when, how often, for how long and how much."""

        period: float = Field(gt=0.0, description="time from one onset to the next [s]")
        duty: float = Field(0.5, gt=0.0, le=1.0, description="share of each period in which the loss is there")
        loss: float = Field(ge=0.0, le=1.0, description="lost share of the thrust while it is there, 0 to 1")

    def __init__(self, settings: Settings) -> None:
        self.settings = settings

    def parameters(self) -> IntermittentParameters:
        """Times, duty and loss."""
        s = self.settings
        return IntermittentParameters(s.start, s.end, s.period, s.duty, s.loss)

    @property
    def onset(self) -> float:
        """Time of the first onset in s."""
        return self.settings.start

    @staticmethod
    def true_loss(settings: Settings) -> float:
        """The loss while it is there."""
        return settings.loss

    def effectiveness(self, time: Scalar, parameters: IntermittentParameters) -> Scalar:
        """1 - loss in the first `duty` of each period between start (included) and end (excluded), else 1."""
        p = parameters
        # A remainder without floor, which symbols lack: the angle from the middle of the time on, wrapped to a turn.
        turns = (time - p.start + TIME_TOLERANCE) / p.period
        on = less_equal(absolute(wrap_angle((2.0 * math.pi) * (turns - 0.5 * p.duty))), math.pi * p.duty)
        within = both(since(time, p.start), less(time, p.end - TIME_TOLERANCE))
        return 1.0 - p.loss * both(on, within)


class StuckParameters(NamedTuple):
    """Numbers of a rotor that holds its thrust."""

    time: Scalar  # s
    thrust: Scalar  # N


@final
@FAULTS.register("stuck")
class Stuck(Fault):
    """One rotor delivers a fixed thrust from a time on, whatever is commanded."""

    class Settings(OneRotor):
        """From when on, and what it delivers."""

        time: float = Field(ge=0.0, description="time from which the rotor does not follow its command [s]")
        thrust: float = Field(description="thrust that it delivers from then on [N]; not limited")

    def __init__(self, settings: Settings) -> None:
        self.settings = settings

    def parameters(self) -> StuckParameters:
        """Time and thrust."""
        return StuckParameters(self.settings.time, self.settings.thrust)

    @property
    def onset(self) -> float:
        """Time from which it is stuck, in s."""
        return self.settings.time

    @staticmethod
    def true_loss(settings: Settings) -> float:
        """NaN: which share is lost depends on what is commanded."""
        return math.nan

    def stuck(self, time: Scalar, parameters: StuckParameters) -> StuckAt:
        """Held from the time on."""
        return StuckAt(since(time, parameters.time), parameters.thrust)


class TotalParameters(NamedTuple):
    """Numbers of a total loss."""

    time: Scalar  # s


@final
@FAULTS.register("total")
class Total(Fault):
    """Sudden total loss of one rotor's thrust."""

    class Settings(OneRotor):
        """When."""

        time: float = Field(ge=0.0, description="time of the loss [s]")

    def __init__(self, settings: Settings) -> None:
        self.settings = settings

    def parameters(self) -> TotalParameters:
        """The time."""
        return TotalParameters(self.settings.time)

    @property
    def onset(self) -> float:
        """Time of the loss in s."""
        return self.settings.time

    @staticmethod
    def true_loss(settings: Settings) -> float:
        """Everything."""
        return 1.0

    def effectiveness(self, time: Scalar, parameters: TotalParameters) -> Scalar:
        """1 before, 0 from the time on."""
        return 1.0 - since(time, parameters.time)
