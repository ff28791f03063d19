"""What an estimator is, and the slot of those that exist."""

from __future__ import annotations

from typing import Any, NamedTuple

from rotorfault.autopilot.instant import Instant
from rotorfault.base.errors import InputError
from rotorfault.base.one_line import record_line
from rotorfault.maths.geometry import PerRotor
from rotorfault.model.block import Block, MemoryT, ParametersT
from rotorfault.model.signals import Estimate, Reading, Readings
from rotorfault.model.slot import Slot
from rotorfault.model.vehicle import Vehicle


class EstimatorInputs(NamedTuple):
    """All that an estimator may use at one sampling instant."""

    readings: Readings
    vehicle: Vehicle  # belief
    command: PerRotor  # N, sent at the last instant
    thrust: PerRotor | tuple[()] = ()  # N: of the believed rotors since then; empty unless `asks_for_thrust`

    @property
    def believed_thrust(self) -> PerRotor:
        """Thrust of the believed rotors over the last period in N; what was commanded, where nothing else is told."""
        return self.thrust if isinstance(self.thrust, PerRotor) else self.command

    def __repr__(self) -> str:
        return record_line(self)


class Estimator(Block[EstimatorInputs, Estimate, MemoryT, ParametersT]):
    """Turns readings into an estimate of position, velocity, attitude and rates."""

    @property
    def asks_for_thrust(self) -> bool:
        """Whether it is told what the believed rotors gave since the last instant; it costs memory."""
        return False


def _inputs(instant: Instant) -> EstimatorInputs:
    past = instant.past
    return EstimatorInputs(instant.readings, instant.vehicle, past.command.thrust, past.believed)


ESTIMATOR = Slot(
    "estimator",
    Estimator,
    "belief",
    "from readings to position, velocity, attitude and rates as believed",
    "estimators",
    default="direct",
    inputs=_inputs,
)


def required(readings: Readings, name: str, estimator: str) -> Reading[Any]:
    """A reading that an estimator cannot do without.

    Parameters
    ----------
    readings : Readings
    name : str
        Field of `Readings`.
    estimator : str
        Who needs it, for the message.

    Raises
    ------
    InputError
        If the sensors have none.
    """
    reading = getattr(readings, name)
    if reading == ():
        there = [field for field, value in readings._asdict().items() if value != ()]
        raise InputError(
            f"estimator '{estimator}' needs a reading of {name}, and the sensors give {', '.join(there) or 'none'}; "
            "choose other sensors or another estimator"
        )
    return reading  # type: ignore[no-any-return]
