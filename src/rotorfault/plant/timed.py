"""Parts of the truth that act between the sampling instants too: their output is a function of time.

The integrator asks for them at times of its own (`Timed.at`); their memory is held over a sampling period, and
`step` brings it to the next one.
"""

from __future__ import annotations

from typing import NamedTuple

from rotorfault.base.one_line import record_line
from rotorfault.maths.scalar import Scalar, clip
from rotorfault.model.block import Block, MemoryT, Nothing, OutputT, ParametersT, Record

LONGEST_STEP = 0.001  # s: integration step of a scenario that gives none; attitude moves in tens of milliseconds
_ROUNDING = 1e-6  # of an integration step: a share that differs by less from none or all of it is that


class TimeInputs(NamedTuple):
    """What a part of the truth gets at a sampling instant."""

    time: Scalar  # s since the start of the flight
    normals: tuple[Scalar, ...] = ()  # independent standard normal numbers, as many as the part says it needs

    def __repr__(self) -> str:
        return record_line(self)


class Timed(Block[TimeInputs, OutputT, MemoryT, ParametersT]):
    """A part whose output is asked for at any time."""

    def at(self, time: Scalar, memory: MemoryT, parameters: ParametersT) -> OutputT:
        """What it does at a time.

        Parameters
        ----------
        time : scalar, s
            Since the start of the flight.
        memory : record
            Of the sampling period that the time lies in.
        parameters : record
        """
        raise NotImplementedError(f"{type(self).__name__} says nothing of any time")

    def step(
        self, memory: MemoryT, inputs: TimeInputs, parameters: ParametersT, dt: Scalar
    ) -> tuple[MemoryT, OutputT, Record]:
        """Memory of the sampling period that begins, and the output at its beginning."""
        return memory, self.at(inputs.time, memory, parameters), Nothing()


def share_since(time: Scalar, dt: Scalar, start: Scalar) -> Scalar:
    """Share of the step of length `dt` from `time` on that is not before `start`; all in s."""
    return rounded_share((time + dt - start) / dt)


def rounded_share(share: Scalar) -> Scalar:
    """A share of a step, 0 and 1 where it is that but for rounding."""
    return clip((share - _ROUNDING) * (1.0 / (1.0 - 2.0 * _ROUNDING)), 0.0, 1.0)
