"""A user's controller that is any Python object: wrapped so that the closed loop can fly it.

The object has one method, called at every sampling instant with floats:

    def update(self, time, measurement, reference, vehicle): return Wrench(thrust, Vec3(roll, pitch, yaw))

It may keep whatever state it likes and use whatever library it likes, and so runs in the python engine only. A
controller that shall run in every engine is a block in the scalar style instead: see
`rotorfault.autopilot.control.protocol.Controller`.
"""

from __future__ import annotations

import traceback
from typing import Any, NamedTuple, Protocol

from rotorfault.autopilot.control.protocol import ControlInputs, Controller, ControlOutput, no_telemetry
from rotorfault.base.errors import InputError
from rotorfault.maths.geometry import Vec3, zeros
from rotorfault.maths.records import flatten
from rotorfault.maths.scalar import Scalar
from rotorfault.model.signals import Measurement, Reference, Wrench
from rotorfault.model.vehicle import Vehicle


class Updates(Protocol):
    """What a plain Python controller has."""

    def update(self, time: float, measurement: Measurement, reference: Reference, vehicle: Vehicle) -> Wrench:
        """Demanded wrench in N and N m, body axes, at a time in s."""


class Clock(NamedTuple):
    """Counted sampling instants."""

    steps: Scalar


class Sampling(NamedTuple):
    """Numbers of the wrapper."""

    period: Scalar  # s


class PythonController:
    """Wraps an object with ``update`` as a controller of the python engine."""

    python_only = True

    def __init__(self, inner: Updates) -> None:
        self.inner = inner

    def parameters(self, vehicle: Vehicle, period: float) -> Sampling:
        """The sampling period."""
        return Sampling(period)

    def initial(self, measurement: Measurement, reference: Reference, parameters: Sampling) -> Clock:
        """No step counted."""
        return Clock(0.0)

    def step(
        self, memory: Clock, inputs: ControlInputs, parameters: Sampling, dt: Scalar
    ) -> tuple[Clock, ControlOutput]:
        """Ask the object.

        Raises
        ------
        InputError
            If it raises anything, or what it returns is no wrench of four numbers.
        """
        time = memory.steps * parameters.period
        name = type(self.inner).__name__
        try:
            wrench = self.inner.update(time, inputs.measurement, inputs.reference, inputs.vehicle)
        except Exception as error:
            # Told at once: the engine would take a division by zero in here for a flight that is lost.
            frame = traceback.extract_tb(error.__traceback__)[-1]
            raise InputError(
                f"controller {name}.update at t = {time:g} s: {type(error).__name__}: {' '.join(str(error).split())} "
                f"({frame.filename}, line {frame.lineno})"
            ) from error
        try:
            thrust, roll, pitch, yaw = (float(x) for x in flatten(wrench))
        except (TypeError, ValueError):
            raise InputError(
                f"controller {name}.update returned {wrench!r}; allowed: Wrench(thrust, Vec3(roll, pitch, yaw))"
            ) from None
        output = ControlOutput(Wrench(thrust, Vec3(roll, pitch, yaw)), zeros(), no_telemetry())
        return Clock(memory.steps + 1.0), output


def as_controller(given: Any) -> Controller:
    """A controller from what a user hands in: a block as it is, an object with ``update`` wrapped.

    Raises
    ------
    InputError
        If it is neither.
    """
    if isinstance(given, type):
        raise InputError(f"controller {given.__name__} is a class; hand in an object: {given.__name__}()")
    if all(callable(getattr(given, name, None)) for name in ("parameters", "initial", "step")):
        return given  # type: ignore[no-any-return]
    if callable(getattr(given, "update", None)):
        return PythonController(given)
    raise InputError(
        f"controller {type(given).__name__}: allowed are the name of a registered controller, a block with "
        "parameters, initial and step, or an object with update"
    )
