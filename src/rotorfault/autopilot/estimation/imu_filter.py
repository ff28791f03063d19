"""What stands between the inertial unit and all that reads it, and the slot of such filters."""

from __future__ import annotations

from typing import Any, NamedTuple, final

from rotorfault.autopilot.instant import Instant
from rotorfault.autopilot.rotor_model import RotorModel
from rotorfault.base.one_line import record_line
from rotorfault.maths.geometry import PerRotor
from rotorfault.maths.scalar import Scalar
from rotorfault.model.block import Block, Context, MemoryT, Nothing, ParametersT, Record
from rotorfault.model.sensor_model import SensorModel
from rotorfault.model.signals import Readings
from rotorfault.model.slot import Slot, register
from rotorfault.model.vehicle import Vehicle


class FilterInputs(NamedTuple):
    """All that a filter may use at one sampling instant."""

    readings: Readings  # as the sensors give them; those not valid that are held for frozen
    rotors: RotorModel  # N: what sound rotors give
    speed: PerRotor  # rad/s: believed of sound rotors now, by the commands that were sent
    sped: PerRotor  # rad/s: by which that has changed over the last period
    vehicle: Vehicle  # belief

    def __repr__(self) -> str:
        return record_line(self)


class ImuFilter(Block[FilterInputs, Readings, MemoryT, ParametersT]):
    """Takes out of the readings of gyro and accelerometer what is no motion of the body."""

    def left(self, sensors: SensorModel, context: Context) -> SensorModel:
        """What may be believed of the sensors behind it; the same as before, if a part says nothing.

        Parameters
        ----------
        sensors : SensorModel
            As the set of sensors says it.
        context : Context
            Vehicle and sampling period.
        """
        return sensors


def behind(between: ImuFilter[Any, Any] | None, sensors: SensorModel, context: Context) -> SensorModel:
    """What is believed of sensors behind a filter, if there is one; see `ImuFilter.left`."""
    return sensors if between is None else between.left(sensors, context)


def _inputs(instant: Instant) -> FilterInputs:
    speed = instant.speed
    return FilterInputs(instant.checked, instant.past.rotors, speed, speed - instant.past.speed, instant.vehicle)


IMU_FILTER = Slot(
    "imu_filter",
    ImuFilter,
    "belief",
    "what takes vibration out of gyro and accelerometer before anything reads them",
    "filters",
    sort="IMU filter",
    default="off",
    calm="off",
    inputs=_inputs,
)


@final
@register("off")
class Unfiltered(ImuFilter[Nothing, Nothing]):
    """Readings as they come."""

    def step(
        self, memory: Nothing, inputs: FilterInputs, parameters: Nothing, dt: Scalar
    ) -> tuple[Nothing, Readings, Record]:
        """Nothing is taken out."""
        return memory, inputs.readings, Nothing()
