"""Parts of the truth that act between the sampling instants too: their output is a function of time.

The integrator asks for them at times of its own (`Timed.at`); their memory is held over a sampling period, and
`step` brings it to the next one.
"""

from __future__ import annotations

from typing import NamedTuple

from rotorfault.maths.scalar import Scalar
from rotorfault.model.block import Block, MemoryT, Nothing, OutputT, ParametersT, Record

LONGEST_STEP = 0.001  # s: integration step of a scenario that gives none; attitude moves in tens of milliseconds


class TimeInputs(NamedTuple):
    """What a part of the truth gets at a sampling instant."""

    time: Scalar  # s since the start of the flight
    normals: tuple[Scalar, ...] = ()  # independent standard normal numbers, as many as the part says it needs


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
