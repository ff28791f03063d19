"""Faults of sensors, in the timeline of those of rotors: a bias that jumps, a reading that freezes or drops out.

They stand between the sensors and the autopilot, whatever the set: what is read goes through them. A reading that
freezes keeps its value and says that it is valid; one that drops out keeps its value too, and says that it is not.
No rotor is at fault then: scores of detection count them not at all, and a flag that they cause is a false one.
"""

from __future__ import annotations

from typing import Any, ClassVar, Literal, NamedTuple, final

from pydantic import Field, model_validator

from rotorfault.base.config import Strict, Three, refusal
from rotorfault.base.errors import InputError
from rotorfault.maths.geometry import Vec3
from rotorfault.maths.records import select_record
from rotorfault.maths.rotation import Quat
from rotorfault.maths.scalar import Scalar, less, select
from rotorfault.model.block import Context, MemoryT, ParametersT
from rotorfault.model.signals import Flow, Reading, Readings
from rotorfault.model.slot import register
from rotorfault.plant.faults import TIME_TOLERANCE, Effect, Fault, since

SensorName = Literal[
    "gyro", "accelerometer", "magnetometer", "barometer", "position", "rotor_speeds", "flow", "range"
]  # fmt: skip
READ: dict[str, tuple[str, ...]] = {
    "gyro": ("rates",),
    "accelerometer": ("specific_force",),
    "magnetometer": ("magnetic_field",),
    "barometer": ("pressure_altitude",),
    "position": ("position", "velocity", "attitude"),
    "rotor_speeds": ("rotor_speeds",),
    "flow": ("flow",),
    "range": ("range",),
}
"""Readings that a sensor gives; with a position come velocity and attitude where one source gives them all."""


class OneSensor(Strict):
    """The sensor that a fault hits."""

    sensor: SensorName = Field(description="which one; with `position` go velocity and attitude of the same source")


class OneSensorInterval(OneSensor):
    """From when to when."""

    start: float = Field(ge=0.0, description="time of the first effect [s]")
    end: float = Field(ge=0.0, description="time of the end [s], after start")

    @model_validator(mode="after")
    def _ordered(self) -> OneSensorInterval:
        if not self.end > self.start:
            raise refusal("end", f"got {self.end!r} s; allowed: later than start = {self.start!r} s")
        return self


class SensorFault(Fault[MemoryT, ParametersT]):
    """A fault of one sensor. Which one is a choice of structure, times and sizes are numbers."""

    of_sensors: ClassVar[bool] = True

    def names(self, readings: Readings) -> tuple[str, ...]:
        """The readings that it changes.

        Parameters
        ----------
        readings : Readings
            That there are.

        Raises
        ------
        InputError
            If there is none of that sensor.
        """
        found = tuple(name for name in READ[self.settings.sensor] if getattr(readings, name) != ())
        if not found:
            there = [name for name, fields in READ.items() if any(getattr(readings, field) != () for field in fields)]
            raise InputError(
                f"fault of the sensor '{self.settings.sensor}': the sensors have none; allowed: {', '.join(there)}"
            )
        return found

    def first(self, readings: Readings, parameters: ParametersT) -> Any:
        """Memory before the first instant, from its readings."""
        self.names(readings)
        return ()

    def through(self, memory: Any, readings: Readings, time: Scalar, parameters: ParametersT) -> tuple[Any, Readings]:
        """Memory after an instant, and what comes through.

        Parameters
        ----------
        memory : record
        readings : Readings
            Of the sensors.
        time : scalar, s
        parameters : record
        """
        raise NotImplementedError(f"{type(self).__name__} does nothing to readings")

    def at(self, time: Scalar, memory: MemoryT, parameters: ParametersT) -> Effect:
        """Nothing happens to any rotor."""
        return Effect()


class JumpParameters(NamedTuple):
    """Numbers of a bias that jumps."""

    time: Scalar  # s
    bias: Vec3  # in the unit of the reading


@final
@register("sensor_bias")
class SensorBias(SensorFault[Any, JumpParameters]):
    """The bias of a sensor jumps, for good."""

    class Settings(OneSensor):
        """Which, when and by how much."""

        time: float = Field(ge=0.0, description="time of the jump [s]")
        bias: Three = Field(
            description="what is added from then on, in the unit of the reading and its axes; of a height, the first"
        )

    def parameters(self, context: Context) -> JumpParameters:
        """Time and size."""
        return JumpParameters(self.settings.time, Vec3.of(self.settings.bias))

    def onset(self, parameters: JumpParameters) -> Scalar:
        """Time of the jump in s."""
        return parameters.time

    def through(
        self, memory: Any, readings: Readings, time: Scalar, parameters: JumpParameters
    ) -> tuple[Any, Readings]:
        """The reading with the bias; of a position, the position alone."""
        name = self.names(readings)[0]
        reading = getattr(readings, name)
        bias: Vec3 = parameters.bias * since(time, parameters.time)
        value = reading.value
        if isinstance(value, Quat):
            moved: Any = value @ Quat.small(bias)
        elif isinstance(value, Vec3):
            moved = value + bias
        elif isinstance(value, Flow):
            moved = Flow(value.x + bias.x, value.y + bias.y)
        else:
            moved = value + bias.x
        return memory, readings._replace(**{name: reading._replace(value=moved)})


class SpellParameters(NamedTuple):
    """Numbers of a spell."""

    start: Scalar  # s
    end: Scalar  # s


class _Held(SensorFault[Any, SpellParameters]):
    """A fault for a while, in which the reading keeps its last value."""

    valid: ClassVar[bool] = True

    Settings = OneSensorInterval

    def parameters(self, context: Context) -> SpellParameters:
        """Both times."""
        return SpellParameters(self.settings.start, self.settings.end)

    def onset(self, parameters: SpellParameters) -> Scalar:
        """The beginning in s."""
        return parameters.start

    def first(self, readings: Readings, parameters: SpellParameters) -> Any:
        """The first values, and that they are none too old."""
        return tuple(getattr(readings, name).value for name in self.names(readings))

    def through(
        self, memory: Any, readings: Readings, time: Scalar, parameters: SpellParameters
    ) -> tuple[Any, Readings]:
        """The reading outside the spell, the last value within."""
        within = since(time, parameters.start) * less(time, parameters.end - TIME_TOLERANCE)
        kept, changed = [], {}
        for name, last in zip(self.names(readings), memory, strict=True):
            reading: Reading[Any] = getattr(readings, name)
            value = select_record(within, last, reading.value)
            valid = reading.valid if self.valid else select(within, 0.0, reading.valid)
            kept.append(value)
            changed[name] = reading._replace(value=value, valid=valid)
        return tuple(kept), readings._replace(**changed)


@final
@register("sensor_freeze")
class SensorFreeze(_Held):
    """A sensor gives its last value for a while, as if it were new."""


@final
@register("sensor_dropout")
class SensorDropout(_Held):
    """A sensor gives nothing for a while."""

    valid = False
