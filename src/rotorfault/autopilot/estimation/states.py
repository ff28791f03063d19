"""The error states of the Kalman filter, in order: fifteen, then slow errors, ground and wind where there are any."""

from __future__ import annotations

from typing import Any, NamedTuple

from rotorfault.maths.geometry import Vec3, zeros
from rotorfault.maths.scalar import Scalar
from rotorfault.model.sensor_model import SensorModel, SensorNoise

P, V, ERROR, FORCE_BIAS, GYRO_BIAS = 0, 3, 6, 9, 12  # first of three each; ERROR that of attitude
BASIC = 15


class SlowError(NamedTuple):
    """A slow error of a sensor."""

    sensor: str
    states: tuple[int, ...]
    noise: Any  # SensorNoise


class States(NamedTuple):
    """Which states there are, and how many."""

    number: int
    slow: tuple[SlowError, ...]
    floor: int | None = None  # height of the ground, where the distance to it is measured
    wind: tuple[int, ...] = ()  # of its velocity along x, y, z of the world, where that is estimated

    @classmethod
    def of(cls, sensors: SensorModel, wind: bool = False) -> States:
        """Of a set of sensors as believed, and of the wind if that is wanted."""
        slow, used = [], BASIC
        for name, width in (("position", 3), ("pressure_altitude", 1)):
            noise = getattr(sensors, name)
            if isinstance(noise, SensorNoise) and not isinstance(noise.wander, tuple):
                slow.append(SlowError(name, tuple(range(used, used + width)), noise))
                used += width
        floor = used if isinstance(sensors.range, SensorNoise) else None
        used += 0 if floor is None else 1
        blown = tuple(range(used, used + 3)) if wind else ()
        return cls(used + len(blown), tuple(slow), floor, blown)

    def no_slow_errors(self) -> tuple[Any, ...]:
        """The slow errors at the start, from which they are counted."""
        return tuple(zeros() if len(one.states) == 3 else 0.0 for one in self.slow)

    def of_sensor(self, sensor: str, slow: tuple[Any, ...]) -> tuple[tuple[int, ...], Any]:
        """States and value of the slow error of a sensor; none if it has none."""
        for one, value in zip(self.slow, slow, strict=True):
            if one.sensor == sensor:
                return one.states, value
        return (), None

    def slow_corrected(self, slow: tuple[Any, ...], error: list[Scalar]) -> tuple[Any, ...]:
        """Slow errors after the corrections of an instant."""
        return tuple(
            value + (Vec3(*(error[i] for i in one.states)) if len(one.states) == 3 else error[one.states[0]])
            for one, value in zip(self.slow, slow, strict=True)
        )
