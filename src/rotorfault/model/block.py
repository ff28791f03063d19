"""What every part of a flight is: numbers in a record, memory passed through a pure step, signals of its own.

A *block* (controller, wind, estimator, ...) holds its choices in `settings`, checked once. Its numbers are a record
that `parameters` makes, so that they may differ between the flights of a batch; its memory is a record that `initial`
makes and `step` passes on. `step` is pure and written on scalars (`rotorfault.maths.scalar`): the same source runs on
floats, on arrays and compiled. Each kind of part has a base class of its own, which says what goes in and what comes
out (`rotorfault.model.slot`).
"""

from __future__ import annotations

from typing import Any, ClassVar, Generic, NamedTuple, TypeAlias, TypeVar, cast

from rotorfault.base.config import Strict
from rotorfault.base.one_line import in_a_line, record_line
from rotorfault.maths.scalar import Scalar
from rotorfault.model.sensor_model import SensorModel
from rotorfault.model.vehicle import Vehicle

InputsT = TypeVar("InputsT")
OutputT = TypeVar("OutputT")
MemoryT = TypeVar("MemoryT")
ParametersT = TypeVar("ParametersT")

Record: TypeAlias = tuple[Any, ...]
"""A NamedTuple of scalars, value types and records; its leaves are of the number type of an engine."""


class Context(NamedTuple):
    """What a part may know when its numbers are made."""

    vehicle: Vehicle  # the true one for parts of the truth, the believed one for parts of the autopilot
    period: float  # s, sampling period
    sensors: SensorModel | tuple[()] = ()  # what the autopilot believes of its sensors; empty for parts of the truth

    def __repr__(self) -> str:
        return record_line(self)


class TimeGrid(NamedTuple):
    """The instants at which a flight is computed."""

    period: float  # s, between sampling instants
    step: float  # s, between two instants of the integration

    def __repr__(self) -> str:
        return record_line(self)


class Nothing(NamedTuple):
    """The record without numbers: for parts without parameters, memory or signals."""


class NoSettings(Strict):
    """Nothing to choose."""


class Block(Generic[InputsT, OutputT, MemoryT, ParametersT]):
    """A part of a flight. Derive from the base class of its kind (`Controller`, `Wind`, ...), not from this.

    Attributes
    ----------
    Settings : type of Strict
        What a user may choose, with defaults, bounds and descriptions.
    Telemetry : type of NamedTuple
        Signals that `step` returns for the record, each annotated with a `rotorfault.model.telemetry.Quantity`.
    normals : int
        Independent standard normal numbers that `step` gets in its inputs at every sampling instant.
    first_normals : int or None
        The same for `initial`; None for those of the first sampling instant.
    python_only : bool
        Whether it runs on Python floats only, because it keeps state or makes choices that cannot be traced.
    limits_grid : bool
        Whether there are time grids that cannot carry it, which `off_grid` then tells.
    """

    Settings: ClassVar[type[Strict]] = NoSettings
    Telemetry: ClassVar[type[Record]] = Nothing
    normals: ClassVar[int] = 0
    first_normals: ClassVar[int | None] = None
    python_only: ClassVar[bool] = False
    limits_grid: ClassVar[bool] = False
    slot: ClassVar[object] = None  # the `Slot` of the kind, set where the kind is defined

    def __init__(self, settings: Any = None) -> None:
        # Of the part's own class of settings, which a type parameter more would name at every use.
        self.settings: Any = self.Settings() if settings is None else settings

    def __repr__(self) -> str:
        settings = getattr(self, "settings", None)  # a part of a user's may have none
        fields = type(settings).model_fields if isinstance(settings, Strict) else {}
        return in_a_line(type(self).__name__, ((key, getattr(settings, key, None)) for key in fields))

    def off_grid(self, grid: TimeGrid) -> tuple[str, str] | None:
        """Why a time grid cannot carry this part of the truth or task, if `limits_grid`; None if it can.

        Parameters
        ----------
        grid : TimeGrid

        Returns
        -------
        (str, str) or None
            The setting that is at fault, empty for the step itself; what came, what is allowed, how to mend it.
        """
        return None

    def parameters(self, context: Context) -> ParametersT:
        """Numbers as a record; none, unless a part has some.

        Parameters
        ----------
        context : Context
            Vehicle and sampling period.
        """
        return cast("ParametersT", Nothing())

    def initial(self, inputs: InputsT, parameters: ParametersT) -> MemoryT:
        """Memory before the first step; none, unless a part has some.

        Parameters
        ----------
        inputs : record
            Those of the first step.
        parameters : record
            From `parameters`.
        """
        return cast("MemoryT", Nothing())

    def step(
        self, memory: MemoryT, inputs: InputsT, parameters: ParametersT, dt: Scalar
    ) -> tuple[MemoryT, OutputT, Record]:
        """One sampling instant; pure.

        Parameters
        ----------
        memory : record
            From `initial` or the step before.
        inputs : record
            Of the kind of part.
        parameters : record
            From `parameters`.
        dt : scalar, s
            Sampling period.

        Returns
        -------
        memory : record
            Of the same shape.
        output : record
            Of the kind of part.
        telemetry : record
            An instance of `Telemetry`.
        """
        raise NotImplementedError(f"{type(self).__name__} has no step")
