"""What a source of diagnosis is, and the slot of those that exist.

A source sees what the autopilot estimates. Only one that derives from `Oracle` is told the true losses, by the
closed loop; it serves studies of what a diagnosis can be worth.
"""

from __future__ import annotations

from typing import ClassVar, NamedTuple

from rotorfault.autopilot.instant import Instant
from rotorfault.autopilot.prediction import Expectation
from rotorfault.base.one_line import record_line
from rotorfault.maths.geometry import PerRotor
from rotorfault.maths.scalar import Scalar
from rotorfault.model.block import Block, MemoryT, ParametersT
from rotorfault.model.signals import Diagnosis, Estimate, Readings
from rotorfault.model.slot import Slot
from rotorfault.model.vehicle import Vehicle


class DiagnosisInputs(NamedTuple):
    """All that a source of diagnosis may use at one sampling instant."""

    estimate: Estimate
    expectation: Expectation  # what sound rotors would have done over the last period
    command: PerRotor  # N, sent at the last instant
    vehicle: Vehicle  # belief
    readings: Readings = Readings()  # of this instant, such as rotor speeds where they are measured

    def __repr__(self) -> str:
        return record_line(self)


class Diagnoser(Block[DiagnosisInputs, Diagnosis, MemoryT, ParametersT]):
    """Turns estimates into a belief about the rotors.

    Attributes
    ----------
    looks : bool
        Whether it finds its belief in what it is given; what is told the truth, or made up, does not.
    """

    looks: ClassVar[bool] = True


class Oracle(Diagnoser[MemoryT, ParametersT]):
    """A source that is told the truth: the closed loop calls `told` in place of `step`."""

    looks: ClassVar[bool] = False

    def age(self, parameters: ParametersT) -> Scalar:
        """How old the truth is that it wants, in s."""
        raise NotImplementedError(f"{type(self).__name__} does not say how old a truth it wants")

    def told(self, true_loss: PerRotor, inputs: DiagnosisInputs, parameters: ParametersT) -> Diagnosis:
        """The belief that true losses make.

        Parameters
        ----------
        true_loss : PerRotor
            Of `age` seconds ago.
        inputs : DiagnosisInputs
        parameters : record
        """
        raise NotImplementedError(f"{type(self).__name__} makes nothing of the truth")


def _inputs(instant: Instant) -> DiagnosisInputs:
    command = instant.past.command.thrust
    return DiagnosisInputs(instant.estimate, instant.expectation, command, instant.vehicle, instant.readings)


DIAGNOSIS = Slot(
    "diagnosis",
    Diagnoser,
    "belief",
    "source of diagnosis: which rotors are believed to have lost how much",
    "diagnoses",
    default="luenberger",
    calm="off",
    inputs=_inputs,
)
