"""A user's controller that is any Python object: wrapped so that the closed loop can fly it.

The object has one method, called at every sampling instant with floats:

    def update(self, time, estimate, reference, vehicle): return Wrench(thrust, Vec3(roll, pitch, yaw))

It may keep whatever state it likes and use whatever library it likes, and so runs in the python engine only. A
controller that shall run in every engine is a block in the scalar style instead: see
`rotorfault.autopilot.control.protocol.Controller`.
"""

from __future__ import annotations

import traceback
from collections.abc import Mapping, Set
from typing import Any, ClassVar, NamedTuple, Protocol

from pydantic_core import PydanticCustomError

from rotorfault.autopilot.control.protocol import CONTROLLER, ControlInputs, Controller, ControlOutput
from rotorfault.autopilot.instant import DEMANDS
from rotorfault.base.errors import InputError
from rotorfault.base.number_rule import real, short
from rotorfault.base.registry import Kind
from rotorfault.maths.geometry import PerRotor, Vec3
from rotorfault.maths.records import flatten
from rotorfault.maths.scalar import Scalar
from rotorfault.model.block import Context, NoSettings, Nothing, Record
from rotorfault.model.signals import Estimate, Reference, Wrench
from rotorfault.model.vehicle import Vehicle


class Updates(Protocol):
    """What a plain Python controller has."""

    def update(self, time: float, estimate: Estimate, reference: Reference, vehicle: Vehicle) -> Wrench | PerRotor:
        """Demanded wrench in N and N m, body axes, or thrust commands of the rotors in N, at a time in s."""


class Clock(NamedTuple):
    """Counted sampling instants."""

    steps: Scalar


class Sampling(NamedTuple):
    """Numbers of the wrapper."""

    period: Scalar  # s


class PythonController(Controller[Clock, Sampling]):
    """Wraps an object with ``update`` as a controller of the python engine.

    Parameters
    ----------
    inner : object with ``update``
    """

    python_only: ClassVar[bool] = True

    def __init__(self, inner: Updates) -> None:
        super().__init__()
        self.inner = inner

    def parameters(self, context: Context) -> Sampling:
        """The sampling period."""
        return Sampling(context.period)

    def initial(self, inputs: ControlInputs, parameters: Sampling) -> Clock:
        """No step counted."""
        return Clock(0.0)

    def step(
        self, memory: Clock, inputs: ControlInputs, parameters: Sampling, dt: Scalar
    ) -> tuple[Clock, ControlOutput, Record]:
        """Ask the object.

        Raises
        ------
        InputError
            If it raises anything, or what it returns is neither a `Wrench` nor a `PerRotor`, of four numbers.
        """
        time = memory.steps * parameters.period
        name = type(self.inner).__name__
        try:
            demand = self.inner.update(time, inputs.estimate, inputs.reference, inputs.vehicle)
        except Exception as error:
            # Told at once: the engine would take a division by zero in here for a flight that is lost.
            frame = traceback.extract_tb(error.__traceback__)[-1]
            raise InputError(
                f"controller {name}.update at t = {time:g} s: {type(error).__name__}: {' '.join(str(error).split())} "
                f"({frame.filename}, line {frame.lineno})"
            ) from error
        return Clock(memory.steps + 1.0), ControlOutput(_checked(demand, name, inputs.vehicle.rotors)), Nothing()


def _checked(demand: object, name: str, rotors: int) -> Wrench | PerRotor:
    """A wrench or thrusts, of numbers; nothing else that holds as many, for nobody knows what they are."""
    try:
        if not isinstance(demand, (Wrench, PerRotor)):
            raise TypeError
        numbers = [real(x) for x in flatten(demand)]
    except (TypeError, ValueError, PydanticCustomError):
        raise InputError(f"controller {name}.update returned {short(demand)}; allowed: {DEMANDS}") from None
    if isinstance(demand, PerRotor):
        if len(numbers) != rotors:
            got = f"controller {name}.update returned thrusts of {len(numbers)} rotors"
            raise InputError(f"{got}; allowed: of each of the vehicle's {rotors}")
        return PerRotor(*numbers)
    thrust, *torque = numbers
    return Wrench(thrust, Vec3(*torque))


class PythonKind:
    """A class of plain Python controllers as a kind of controller, to be named in a scenario.

    Parameters
    ----------
    kind : type
        Made without arguments; has ``update``.
    """

    Settings = NoSettings

    def __init__(self, kind: type[Any]) -> None:
        self.kind = kind
        self.__doc__, self.__module__ = kind.__doc__, kind.__module__

    def __call__(self, settings: Any, /) -> PythonController:
        """Make one and wrap it."""
        return PythonController(self.kind())


def _adapted(thing: object) -> Kind[Controller[Any, Any]] | None:
    """A class with ``update`` as a kind of controller; None for anything else."""
    return PythonKind(thing) if isinstance(thing, type) and callable(getattr(thing, "update", None)) else None


CONTROLLER.adapt = _adapted


def as_controller(given: Any) -> Controller[Any, Any]:
    """A controller from what a user hands in: a block as it is, an object with ``update`` wrapped.

    Raises
    ------
    InputError
        If it is neither.
    """
    if isinstance(given, type):
        raise InputError(f"controller {given.__name__} is a class; hand in an object: {given.__name__}()")
    if isinstance(given, Controller):
        return given
    if isinstance(given, (Mapping, Set)):  # their update is another
        raise InputError(
            f"controller is a {type(given).__name__}; settings of a flight are given as settings={{...}}, a "
            "controller is a name or an object"
        )
    if callable(getattr(given, "update", None)):
        return PythonController(given)
    raise InputError(
        f"controller {type(given).__name__}: allowed are the name of a registered controller, an object of a class "
        "that derives from rotorfault.Controller, or an object with update"
    )
