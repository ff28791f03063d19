"""Rotor faults as a declarative timeline: what is wrong with which rotor, from when on.

A *loss* is the lost share of thrust; the *effectiveness* is what remains, 1 - loss. Losses on one rotor combine as
the product of what they leave. A stuck rotor delivers a thrust of its own, whatever is commanded and whatever else
is wrong with it. Times and losses are numbers in the parameters, so that they may differ between the flights of a
batch; which rotor is hit is a choice of structure.

A fault is asked two things: what it does at a time (`Fault.at`: what is recorded and measured), and what it does on
average over an integration step (`Fault.over`: what acts on the body). The second is known in closed form, so that an
onset between two steps acts from its own time on, with its share of the step, and a burst lasts as long as it should.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple, final

from pydantic import Field, model_validator

from rotorfault.base.config import Strict, refusal
from rotorfault.base.one_line import record_line
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
    minimum,
    nearest,
    wrap_angle,
)
from rotorfault.model.block import Context, MemoryT, Nothing, ParametersT, TimeGrid
from rotorfault.model.slot import Slot, register
from rotorfault.model.vehicle import MOST_ROTORS
from rotorfault.plant.timed import Timed, rounded_share, share_since

# Times are counted steps times a period, and may fall short of the time that was meant by rounding.
TIME_TOLERANCE = 1e-9  # s


class RotorFault(NamedTuple):
    """State of the rotors at one time."""

    effectiveness: PerRotor  # 1 sound .. 0 dead
    stuck: PerRotor  # 1 where the rotor does not follow its command; over a step, the share in which it does not
    stuck_thrust: PerRotor  # N, delivered where stuck, times that share


class Effect(NamedTuple):
    """What a fault does to its rotor at one time, or on average over a step."""

    effectiveness: Scalar = 1.0  # what it leaves of the thrust
    stuck: Scalar = 0.0  # 1 where the rotor does not follow its command; over a step, the share in which it does not
    stuck_thrust: Scalar = 0.0  # N, delivered then

    def __repr__(self) -> str:
        return record_line(self)


class OneRotor(Strict):
    """The rotor that a fault hits."""

    rotor: int = Field(ge=1, le=MOST_ROTORS, description="number of the rotor, from 1")


class Fault(Timed[Effect, MemoryT, ParametersT]):
    """A fault of one rotor: either it takes effectiveness or it holds the thrust.

    Its settings have the field `rotor`. Which rotor is hit is a choice of structure, times and losses are numbers.
    """

    @property
    def rotor(self) -> int:
        """Number of the rotor that it hits, from 1."""
        number: int = self.settings.rotor
        return number

    def over(self, time: Scalar, dt: Scalar, memory: MemoryT, parameters: ParametersT) -> Effect:
        """What it does on average over an integration step; what it does in the middle of it, if a part says no more.

        Parameters
        ----------
        time : scalar, s
            At the beginning of the step.
        dt : scalar, s
            Its length.
        memory : record
            Of the sampling period that it lies in.
        parameters : record
        """
        return self.at(time + 0.5 * dt, memory, parameters)

    def onset(self, parameters: ParametersT) -> Scalar:
        """Time of its first effect in s."""
        raise NotImplementedError(f"{type(self).__name__} has no onset")

    def final_loss(self, parameters: ParametersT) -> Scalar | None:
        """Lost share of the thrust that remains for good; None where the loss depends on the command."""
        return None


FAULT = Slot(
    "fault",
    Fault,
    "truth",
    "what goes wrong with the rotors, in the order given: [[fault]] tables",
    "faults",
    many=True,
    calm="",
)


def since(time: Scalar, start: Scalar) -> Scalar:
    """1 from `start` on, robust against rounding; both in s."""
    return greater_equal(time, start - TIME_TOLERANCE)


def rotor_faults(
    faults: Sequence[Fault[Any, Any]],
    memories: Sequence[Any],
    parameters: Sequence[Any],
    time: Scalar,
    dt: Scalar | None = None,
    rotors: int = 4,
) -> RotorFault:
    """Combine all faults at one time, or over an integration step.

    Parameters
    ----------
    faults : sequence of Fault
    memories, parameters : sequence of records, one for each
    time : scalar, s
        Since the start of the flight.
    dt : scalar, s, optional
        Length of the step that begins then; the time alone if not given.
    rotors : int
        Of the vehicle.

    Returns
    -------
    RotorFault
        Remaining effectiveness is a product; of stuck faults of one rotor that are active, the last listed holds.
    """
    effectiveness: list[Scalar] = [1.0] * rotors
    stuck, thrust = ([0.0] * rotors for _ in range(2))
    for fault, memory, numbers in zip(faults, memories, parameters, strict=True):
        i = fault.rotor - 1
        effect = fault.at(time, memory, numbers) if dt is None else fault.over(time, dt, memory, numbers)
        effectiveness[i] = effectiveness[i] * effect.effectiveness
        stuck[i] = either(stuck[i], effect.stuck)
        thrust[i] = (1.0 - effect.stuck) * thrust[i] + effect.stuck * effect.stuck_thrust
    return RotorFault(PerRotor(*effectiveness), PerRotor(*stuck), PerRotor(*thrust))


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
@register("step")
class Step(Fault[Nothing, StepParameters]):
    """Sudden partial loss of one rotor's thrust, for good."""

    class Settings(OneRotor):
        """When and how much."""

        time: float = Field(ge=0.0, description="time of the loss [s]")
        loss: float = Field(ge=0.0, le=1.0, description="lost share of the thrust, 0 to 1")

    def parameters(self, context: Context) -> StepParameters:
        """Time and loss."""
        return StepParameters(self.settings.time, self.settings.loss)

    def onset(self, parameters: StepParameters) -> Scalar:
        """Time of the loss in s."""
        return parameters.time

    def final_loss(self, parameters: StepParameters) -> Scalar:
        """The loss."""
        return parameters.loss

    def at(self, time: Scalar, memory: Nothing, parameters: StepParameters) -> Effect:
        """1 before, 1 - loss from the time on."""
        return Effect(1.0 - parameters.loss * since(time, parameters.time))

    def over(self, time: Scalar, dt: Scalar, memory: Nothing, parameters: StepParameters) -> Effect:
        """The loss in the share of the step that comes after its time."""
        return Effect(1.0 - parameters.loss * share_since(time, dt, parameters.time))


class RampParameters(NamedTuple):
    """Numbers of a gradual loss."""

    start: Scalar  # s
    end: Scalar  # s
    loss: Scalar  # 1


@final
@register("ramp")
class Ramp(Fault[Nothing, RampParameters]):
    """Gradual partial loss of one rotor's thrust, linear in time, then constant."""

    class Settings(OneRotorInterval):
        """From when to when, and how much in the end."""

        loss: float = Field(ge=0.0, le=1.0, description="share of the thrust lost in the end, 0 to 1")

    def parameters(self, context: Context) -> RampParameters:
        """Both times and the final loss."""
        return RampParameters(self.settings.start, self.settings.end, self.settings.loss)

    def onset(self, parameters: RampParameters) -> Scalar:
        """Start of the ramp in s."""
        return parameters.start

    def final_loss(self, parameters: RampParameters) -> Scalar:
        """The loss at the end of the ramp."""
        return parameters.loss

    def at(self, time: Scalar, memory: Nothing, parameters: RampParameters) -> Effect:
        """Falls linearly from 1 to 1 - loss between the two times."""
        share = clip((time - parameters.start) / (parameters.end - parameters.start), 0.0, 1.0)
        return Effect(1.0 - parameters.loss * share)

    def over(self, time: Scalar, dt: Scalar, memory: Nothing, parameters: RampParameters) -> Effect:
        """The mean of what lies of it in the step, and of what is constant before and after."""
        # All in steps, from the beginning of this one.
        start, end = (parameters.start - time) / dt, (parameters.end - time) / dt
        first, last = clip(start, 0.0, 1.0), clip(end, 0.0, 1.0)
        rising = 0.5 * (last - first) * ((first - start) + (last - start)) / (end - start)
        return Effect(1.0 - parameters.loss * (rising + (1.0 - last)))


class IntermittentParameters(NamedTuple):
    """Numbers of a loss that comes and goes."""

    start: Scalar  # s
    end: Scalar  # s
    period: Scalar  # s
    duty: Scalar  # 1, share of each period in which the loss is there
    loss: Scalar  # 1


@final
@register("intermittent")
class Intermittent(Fault[Nothing, IntermittentParameters]):
    """Partial loss of one rotor's thrust that comes and goes with a period."""

    limits_grid = True

    class Settings(OneRotorInterval):
        """From when to when, how often, for how long and how much."""

        period: float = Field(gt=0.0, description="time from one onset to the next [s]")
        duty: float = Field(0.5, gt=0.0, le=1.0, description="share of each period in which the loss is there")
        loss: float = Field(ge=0.0, le=1.0, description="lost share of the thrust while it is there, 0 to 1")

    def off_grid(self, grid: TimeGrid) -> tuple[str, str] | None:
        """Bursts, or the times between them, that are shorter than a step."""
        s = self.settings
        on, off = s.duty * s.period, (1.0 - s.duty) * s.period
        short = min(on, off) if s.duty < 1.0 else on
        if short >= grid.step * (1.0 - TIME_TOLERANCE):
            return None
        share = f"{on:.4g} s on and {off:.4g} s off"
        longer = s.period * grid.step / short
        return "period", (
            f"got {s.period:g} s, {share}; allowed: each at least the integration step, {grid.step:g} s; with this "
            f"duty a period of {longer:.4g} s, or a step of {short:.4g} s"
        )

    def parameters(self, context: Context) -> IntermittentParameters:
        """Times, duty and loss."""
        s = self.settings
        return IntermittentParameters(s.start, s.end, s.period, s.duty, s.loss)

    def onset(self, parameters: IntermittentParameters) -> Scalar:
        """Time of the first onset in s."""
        return parameters.start

    def final_loss(self, parameters: IntermittentParameters) -> Scalar:
        """None remains after the end."""
        return 0.0

    def at(self, time: Scalar, memory: Nothing, parameters: IntermittentParameters) -> Effect:
        """1 - loss in the first `duty` of each period between start (included) and end (excluded), else 1."""
        p = parameters
        # The angle from the middle of the time on, wrapped to a turn: a remainder without floor, which symbols lack.
        turns = (time - p.start + TIME_TOLERANCE) / p.period
        on = less_equal(absolute(wrap_angle((2.0 * math.pi) * (turns - 0.5 * p.duty))), math.pi * p.duty)
        within = both(since(time, p.start), less(time, p.end - TIME_TOLERANCE))
        return Effect(1.0 - p.loss * both(on, within))

    def over(self, time: Scalar, dt: Scalar, memory: Nothing, parameters: IntermittentParameters) -> Effect:
        """The loss in the share of the step that bursts fill."""
        p = parameters
        first, last = (clip(t, p.start, p.end) - p.start for t in (time, time + dt))
        # Time on since the start is duty times the time, and what the running period is ahead of that.
        on = p.duty * (last - first) + p.period * (_ahead(last / p.period, p.duty) - _ahead(first / p.period, p.duty))
        return Effect(1.0 - p.loss * rounded_share(on / dt))


def _ahead(turns: Scalar, duty: Scalar) -> Scalar:
    """How far the time on is ahead of its mean after a number of periods, in periods: 0 after whole ones."""
    gone = turns - nearest(turns - 0.5)  # since the running period began; of two nearest, either serves
    return minimum(gone, duty) - duty * gone


class StuckParameters(NamedTuple):
    """Numbers of a rotor that holds its thrust."""

    time: Scalar  # s
    thrust: Scalar  # N


@final
@register("stuck")
class Stuck(Fault[Nothing, StuckParameters]):
    """One rotor delivers a fixed thrust from a time on, whatever is commanded."""

    class Settings(OneRotor):
        """From when on, and what it delivers."""

        time: float = Field(ge=0.0, description="time from which the rotor does not follow its command [s]")
        thrust: float = Field(description="thrust that it delivers from then on [N]; not limited")

    def parameters(self, context: Context) -> StuckParameters:
        """Time and thrust."""
        return StuckParameters(self.settings.time, self.settings.thrust)

    def onset(self, parameters: StuckParameters) -> Scalar:
        """Time from which it is stuck, in s."""
        return parameters.time

    def at(self, time: Scalar, memory: Nothing, parameters: StuckParameters) -> Effect:
        """Held from the time on."""
        return Effect(1.0, since(time, parameters.time), parameters.thrust)

    def over(self, time: Scalar, dt: Scalar, memory: Nothing, parameters: StuckParameters) -> Effect:
        """Held in the share of the step that comes after the time."""
        return Effect(1.0, share_since(time, dt, parameters.time), parameters.thrust)


class TotalParameters(NamedTuple):
    """Numbers of a total loss."""

    time: Scalar  # s


@final
@register("total")
class Total(Fault[Nothing, TotalParameters]):
    """Sudden total loss of one rotor's thrust."""

    class Settings(OneRotor):
        """When."""

        time: float = Field(ge=0.0, description="time of the loss [s]")

    def parameters(self, context: Context) -> TotalParameters:
        """The time."""
        return TotalParameters(self.settings.time)

    def onset(self, parameters: TotalParameters) -> Scalar:
        """Time of the loss in s."""
        return parameters.time

    def final_loss(self, parameters: TotalParameters) -> Scalar:
        """Everything."""
        return 1.0

    def at(self, time: Scalar, memory: Nothing, parameters: TotalParameters) -> Effect:
        """1 before, 0 from the time on."""
        return Effect(1.0 - since(time, parameters.time))

    def over(self, time: Scalar, dt: Scalar, memory: Nothing, parameters: TotalParameters) -> Effect:
        """The whole thrust in the share of the step that comes before the time."""
        return Effect(1.0 - share_since(time, dt, parameters.time))
