"""What a response to a fault is, and the slot of those that exist: it stands between diagnosis and control."""

from __future__ import annotations

from typing import ClassVar, NamedTuple

from rotorfault.autopilot.allocation.protocol import LEAST_EFFECTIVENESS
from rotorfault.autopilot.instant import Decision, Instant
from rotorfault.autopilot.prediction import Expectation
from rotorfault.base.one_line import record_line
from rotorfault.maths.scalar import Scalar, greater_equal, maximum, select
from rotorfault.model.block import Block, MemoryT, ParametersT
from rotorfault.model.signals import Diagnosis, Estimate, Reference
from rotorfault.model.slot import Slot
from rotorfault.model.vehicle import Vehicle

# Detectors tell losses to within 0.1 (`threshold` and `least` of their settings); the blend begins at twice that.
NEARLY_DEAD = 0.8


class ResponseInputs(NamedTuple):
    """All that a response to a fault may use at one sampling instant."""

    estimate: Estimate
    reference: Reference  # the scenario's
    diagnosis: Diagnosis
    expectation: Expectation  # what sound rotors would have done over the last period
    vehicle: Vehicle  # belief

    def __repr__(self) -> str:
        return record_line(self)


class Response(Block[ResponseInputs, Decision, MemoryT, ParametersT]):
    """Decides what is flown and what is believed once a fault is declared.

    Attributes
    ----------
    lands : bool
        Whether it may put the vehicle down: its decisions have a stage, and a scenario needs ground for it.
    """

    lands: ClassVar[bool] = False


def counted_upon(loss: Scalar) -> Scalar:
    """The loss that is flown with: of a rotor of which hardly anything is left, all of it.

    A detector approaches the loss of a dead rotor from below and stays some percent short of it. An autopilot that
    counts upon those percent waits for torque that never comes. From a loss of `NEARLY_DEAD` on what is believed to
    be left shrinks, to nothing where half of the rest is gone, and what allocation would not ask for counts for
    nothing: a controller that counts upon it demands a tilt torque that is out of reach, if only just, and in a body
    that spins tilt that is out of reach yields to thrust.

    Parameters
    ----------
    loss : scalar
        Believed, 0 to 1.
    """
    counted = maximum(loss, 2.0 * loss - NEARLY_DEAD)
    return select(greater_equal(counted, 1.0 - LEAST_EFFECTIVENESS), 1.0, counted)


def _inputs(instant: Instant) -> ResponseInputs:
    seen = instant.diagnosis
    believed = seen._replace(loss=seen.loss.map(counted_upon))
    return ResponseInputs(instant.estimate, instant.reference, believed, instant.expectation, instant.vehicle)


ON_FAULT = Slot(
    "on_fault",
    Response,
    "belief",
    "what the autopilot does about a confirmed fault",
    "responses",
    sort="response to a fault",
    default="continue",
    calm="continue",
    inputs=_inputs,
)
