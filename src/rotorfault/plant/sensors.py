"""Sensors: from the truth to what the autopilot sees.

Noise enters as an input of standard normal numbers, drawn outside per flight and step, so that a flight is the same
alone and in a batch and on every engine.
"""

from __future__ import annotations

from typing import Any, ClassVar, NamedTuple, Protocol, final

from pydantic import Field

from rotorfault.base.config import Strict
from rotorfault.base.registry import Registry
from rotorfault.maths.geometry import Vec3, zeros
from rotorfault.maths.scalar import Scalar
from rotorfault.model.signals import Measurement


class Normals(NamedTuple):
    """Twelve independent standard normal numbers."""

    position: Vec3
    velocity: Vec3
    attitude: Vec3
    rate: Vec3


def no_noise() -> Normals:
    """The input of sensors that need none."""
    return Normals(zeros(), zeros(), zeros(), zeros())


class Sensors(Protocol):
    """Sensors: choices in `Settings`, numbers in `parameters`, a pure function in `sense`."""

    needs_noise: ClassVar[bool]

    @property
    def delay(self) -> int:
        """Sampling periods by which the autopilot gets its measurements late."""

    def parameters(self) -> Any:
        """Numbers of the sensors as a record."""

    def sense(self, measurement: Measurement, normals: Normals, parameters: Any) -> Measurement:
        """What the autopilot sees of a true measurement."""


SENSORS: Registry[type] = Registry("sensors")


class IdealParameters(NamedTuple):
    """The record without numbers."""


@final
@SENSORS.register("ideal")
class Ideal:
    """Perfect sensors."""

    needs_noise: ClassVar[bool] = False
    delay = 0

    class Settings(Strict):
        """Nothing to choose."""

    def __init__(self, settings: Settings) -> None:
        self.settings = settings

    def parameters(self) -> IdealParameters:
        """No numbers."""
        return IdealParameters()

    def sense(self, measurement: Measurement, normals: Normals, parameters: IdealParameters) -> Measurement:
        """The truth."""
        return measurement


class NoisyParameters(NamedTuple):
    """Standard deviations per component."""

    position: Scalar  # m
    velocity: Scalar  # m/s
    attitude: Scalar  # rad
    rate: Scalar  # rad/s


@final
@SENSORS.register("noisy")
class Noisy:
    """White Gaussian noise on position, velocity, attitude and rates, and a delay."""

    needs_noise: ClassVar[bool] = True

    class Settings(Strict):
        """Standard deviation of each component; new numbers at every sampling instant."""

        position: float = Field(0.005, ge=0.0, description="standard deviation of position [m]")
        velocity: float = Field(0.01, ge=0.0, description="standard deviation of velocity [m/s]")
        attitude: float = Field(0.002, ge=0.0, description="standard deviation of roll, pitch and yaw [rad]")
        rate: float = Field(0.005, ge=0.0, description="standard deviation of the rates [rad/s]")
        delay: int = Field(0, ge=0, le=100, description="sampling periods by which measurements come late")

    def __init__(self, settings: Settings) -> None:
        self.settings = settings

    @property
    def delay(self) -> int:
        """Sampling periods by which measurements come late."""
        return self.settings.delay

    def parameters(self) -> NoisyParameters:
        """The four standard deviations."""
        s = self.settings
        return NoisyParameters(s.position, s.velocity, s.attitude, s.rate)

    def sense(self, measurement: Measurement, normals: Normals, parameters: NoisyParameters) -> Measurement:
        """Truth plus noise."""
        m, n, std = measurement, normals, parameters
        return Measurement(
            p_W=m.p_W + n.position * std.position,
            v_W=m.v_W + n.velocity * std.velocity,
            attitude=m.attitude + n.attitude * std.attitude,
            omega_B=m.omega_B + n.rate * std.rate,
        )
