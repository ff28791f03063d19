r"""What looks for sensors that have stopped before anything reads them, and the slot of such checks.

A sensor that freezes gives its last value and says that it is valid. Noise tells: readings are digitised in steps no
coarser than their noise, for which converters are chosen, so two of them of the same number are alike with the chance

.. math:: p \le \frac{q}{2\sqrt\pi\,\sigma} \le \frac{1}{2\sqrt\pi} = 0.28

for steps q and noise :math:`\sigma` (the density of the difference at 0, times a step); that of a motion is smaller
still. A reading of d numbers repeats n times in a row with the chance :math:`p^{nd}`. It is held for frozen where
that is so small that it would happen by chance in no more than `rate` readings of an hour. A number at the end of its
range is cut to it and repeats by itself: it counts for nothing.

From then on the reading is not valid, and as old as it is, until it changes. So who knows to do without a silent
sensor does without a frozen one. One without noise is never held for frozen.
"""

from __future__ import annotations

import math
from typing import Annotated, Any, NamedTuple, final

from pydantic import Field

from rotorfault.autopilot.instant import Instant
from rotorfault.base.config import Strict
from rotorfault.base.one_line import record_line
from rotorfault.maths.records import flatten, select_record
from rotorfault.maths.rotation import Quat
from rotorfault.maths.scalar import Scalar, absolute, both, greater, greater_equal, less, less_equal, maximum, select
from rotorfault.model.block import Block, Context, MemoryT, Nothing, ParametersT, Record
from rotorfault.model.sensor_model import SensorModel, SensorNoise
from rotorfault.model.signals import Reading, Readings
from rotorfault.model.slot import Slot, register
from rotorfault.model.telemetry import NO_FRAME, Quantity

HOUR = 3600.0  # s
LIKELIEST = math.log(2.0 * math.sqrt(math.pi))  # of the chance that a number repeats, the logarithm, less its sign
ROUNDING = 1e-9  # share by which a reading at the end of a range may miss it


class CheckInputs(NamedTuple):
    """All that a check may use at one sampling instant."""

    readings: Readings  # as the sensors give them

    def __repr__(self) -> str:
        return record_line(self)


class SensorCheck(Block[CheckInputs, Readings, MemoryT, ParametersT]):
    """Takes from readings that are none the word that they are valid."""


def _inputs(instant: Instant) -> CheckInputs:
    return CheckInputs(instant.read)


SENSOR_CHECK = Slot(
    "sensor_check",
    SensorCheck,
    "belief",
    "what looks for sensors that have stopped before anything reads them",
    "checks",
    sort="sensor check",
    default="off",
    calm="off",
    inputs=_inputs,
)


@final
@register("off")
class Unchecked(SensorCheck[Nothing, Nothing]):
    """Readings as they come."""

    def step(
        self, memory: Nothing, inputs: CheckInputs, parameters: Nothing, dt: Scalar
    ) -> tuple[Nothing, Readings, Record]:
        """Nothing is looked for."""
        return memory, inputs.readings, Nothing()


class Looked(NamedTuple):
    """Numbers of a sensor that is looked at."""

    needed: Scalar  # numbers that repeat in a row before it is held for frozen
    end: Scalar  # of the range, in the unit of the reading


class RepeatsParameters(NamedTuple):
    """Numbers of the check."""

    rate: Scalar  # 1/h
    each: tuple[
        Looked | tuple[()], ...
    ]  # for each field of `Readings`; empty where nothing is known, or it comes once


class Seen(NamedTuple):
    """What has been read of a sensor."""

    value: Any  # last that arrived
    repeated: Scalar  # numbers in a row that have
    since: Scalar  # s: since a value that was new


class RepeatsSignals(NamedTuple):
    """What it has found."""

    frozen: Annotated[Scalar, Quantity("1", NO_FRAME, "readings that are held for frozen")]


@final
@register("repeats")
class Repeats(SensorCheck[tuple[Any, ...], RepeatsParameters]):
    """A reading that repeats to the last bit for longer than its noise allows is held for frozen."""

    Telemetry = RepeatsSignals

    class Settings(Strict):
        """How sure it must be."""

        rate: float = Field(
            0.01, gt=0.0, le=3600.0, description="readings of each sensor held for frozen by chance, at most [1/h]"
        )

    def parameters(self, context: Context) -> RepeatsParameters:
        """What each sensor's noise and rate make of the wanted rate."""
        sensors = context.sensors if isinstance(context.sensors, SensorModel) else SensorModel()
        each = tuple(self._looked(getattr(sensors, name), context.period) for name in Readings._fields)
        return RepeatsParameters(self.settings.rate, each)

    def _looked(self, noise: SensorNoise | tuple[()], period: float) -> Looked | tuple[()]:
        if not isinstance(noise, SensorNoise) or noise.timing.every == 0:
            return ()
        readings = HOUR / (noise.timing.every * period)
        needed = math.log(readings / self.settings.rate) / LIKELIEST
        return Looked(max(needed, 1.0) if float(noise.std) > 0.0 else math.inf, noise.limit)

    def initial(self, inputs: CheckInputs, parameters: RepeatsParameters) -> tuple[Any, ...]:
        """The first values, which are read once more at the first instant."""
        return tuple(
            Seen(reading.value, -_freedom(reading.value), 0.0)
            if isinstance(reading, Reading) and isinstance(looked, Looked)
            else ()
            for reading, looked in zip(inputs.readings, parameters.each, strict=True)
        )

    def step(
        self, memory: tuple[Any, ...], inputs: CheckInputs, parameters: RepeatsParameters, dt: Scalar
    ) -> tuple[tuple[Any, ...], Readings, Record]:
        """One sampling instant."""
        given, count = dict(inputs.readings._asdict()), 0.0
        after: list[Any] = []
        for name, seen, looked in zip(Readings._fields, memory, parameters.each, strict=True):
            if not (isinstance(seen, Seen) and isinstance(looked, Looked)):
                after.append(())
                continue
            reading = given[name]
            now = _read_on(seen, reading, looked, dt)
            frozen = greater_equal(now.repeated, looked.needed)
            given[name] = reading._replace(
                valid=reading.valid * (1.0 - frozen),
                age=select(frozen, maximum(reading.age, now.since), reading.age),
            )
            after.append(now)
            count = count + frozen
        return tuple(after), Readings(**given), RepeatsSignals(count)


def _freedom(value: Any) -> float:
    """In how many ways a reading may be off: one for each number, three of an attitude."""
    return 3.0 if isinstance(value, Quat) else float(len(flatten(value)))


def _read_on(seen: Seen, reading: Reading[Any], looked: Looked, dt: Scalar) -> Seen:
    """What has been read after one more instant."""
    arrived, same = greater(reading.valid, 0.5), 1.0
    numbers, before = flatten(reading.value), flatten(seen.value)
    for x, last in zip(numbers, before, strict=True):
        same = both(same, less_equal(absolute(x - last), 0.0))
    told: Scalar = 3.0
    if not isinstance(reading.value, Quat):
        told = 0.0
        for x in numbers:
            told = told + less(absolute(x), looked.end * (1.0 - ROUNDING))
    fresh = both(arrived, 1.0 - same)
    return Seen(
        select_record(arrived, reading.value, seen.value),
        select(arrived, same * (seen.repeated + told), seen.repeated),
        select(fresh, 0.0, seen.since + dt),
    )
