"""What is believed of a set of sensors: noise, bias, rate, delay and range of each reading, as a data sheet has them.

An estimator weighs readings by it, and a diagnosis computes from it how much of a residual is noise. The set of
sensors says it of itself (`rotorfault.plant.sensors.Sensors.model`); `mismatch.sensor_noise` makes the belief wrong.
Standard deviations are per component.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple, final

from rotorfault.base.one_line import record_line
from rotorfault.maths.geometry import Vec3, zeros
from rotorfault.maths.records import Static
from rotorfault.maths.scalar import Scalar


@final
class Timing(Static):
    """When a sensor measures and when that arrives, in whole sampling periods; the first measurement is at time 0.

    Parameters
    ----------
    every : int
        Sampling periods from one measurement to the next; 0 for a single one, at the start.
    late : int
        Sampling periods from a measurement to its arrival.
    """

    __slots__ = ("every", "late")

    def __init__(self, every: int = 1, late: int = 0) -> None:
        self.every, self.late = every, late

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Timing) and (self.every, self.late) == (other.every, other.late)

    def __hash__(self) -> int:
        return hash((self.every, self.late))

    def __repr__(self) -> str:
        return f"Timing(every={self.every}, late={self.late})"

    @property
    def pending(self) -> int:
        """Measurements that may be on their way at the same time, the one that arrives now among them."""
        return 1 + (self.late // self.every if self.every else 0)


class SensorNoise(NamedTuple):
    """One sensor as its data sheet has it; all per component, in the unit of the reading."""

    std: Scalar  # standard deviation of a single measurement, white
    timing: Timing = Timing()
    bias: Scalar = 0.0  # standard deviation of the bias at the start
    bias_walk: Scalar = 0.0  # unit/sqrt(s): standard deviation that the bias gains in a second
    wander: Scalar | tuple[()] = ()  # standard deviation of a slow error (Gauss-Markov); empty where there is none
    wander_time: Scalar | tuple[()] = ()  # s, its correlation time
    vibration: Scalar = 0.0  # amplitude at the rotors' frequency, at hover
    filtered: Scalar = 0.0  # amplitude that a filter takes out besides, as `Reading.shaken` says for each instant
    limit: Scalar = math.inf  # end of the range; a reading beyond it is cut to it

    def __repr__(self) -> str:
        return record_line(self)

    def scaled(self, factor: Scalar) -> SensorNoise:
        """The same sensor with all errors multiplied by a factor, its range and timing as they are."""
        wander = self.wander if isinstance(self.wander, tuple) else self.wander * factor
        return self._replace(
            std=self.std * factor,
            bias=self.bias * factor,
            bias_walk=self.bias_walk * factor,
            wander=wander,
            vibration=self.vibration * factor,
            filtered=self.filtered * factor,
        )


Unknown = tuple[()]
"""Stands for a sensor that the set has not got, or of which nothing is known."""


class SensorModel(NamedTuple):
    """A set of sensors as believed; the fields are those of `rotorfault.model.signals.Readings`."""

    position: SensorNoise | Unknown = ()  # m
    velocity: SensorNoise | Unknown = ()  # m/s
    attitude: SensorNoise | Unknown = ()  # rad, of small rotations about each axis
    rates: SensorNoise | Unknown = ()  # rad/s
    specific_force: SensorNoise | Unknown = ()  # m/s^2
    magnetic_field: SensorNoise | Unknown = ()  # T
    pressure_altitude: SensorNoise | Unknown = ()  # m
    rotor_speeds: SensorNoise | Unknown = ()  # rad/s
    flow: SensorNoise | Unknown = ()  # rad/s
    range: SensorNoise | Unknown = ()  # m
    imu_at_B: Vec3 = zeros()  # m, of gyro and accelerometer from the centre of mass
    field_W: Vec3 = zeros()  # T, the magnetic field of the place

    def __repr__(self) -> str:
        return record_line(self)

    def scaled(self, factor: Scalar) -> SensorModel:
        """The same set with all errors multiplied by a factor."""
        if factor == 1.0:
            return self
        errors: dict[str, Any] = {
            name: value.scaled(factor) for name, value in self._asdict().items() if isinstance(value, SensorNoise)
        }
        return self._replace(**errors)
