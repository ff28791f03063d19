"""What the error-state Kalman filter records."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from rotorfault.autopilot.estimation.air_felt import WindSignals
from rotorfault.maths.geometry import Vec3
from rotorfault.maths.scalar import Scalar
from rotorfault.model.telemetry import BODY, NO_FRAME, WORLD, Quantity, joined


class EskfSignals(NamedTuple):
    """How well the filter believes to know, and what measurements say of that."""

    position_std: Annotated[Vec3, Quantity("m", WORLD, "standard deviation of the estimated position")]
    velocity_std: Annotated[Vec3, Quantity("m/s", WORLD, "standard deviation of the estimated velocity")]
    attitude_std: Annotated[Vec3, Quantity("rad", WORLD, "its standard deviation, about the world's axes")]
    rates_std: Annotated[Vec3, Quantity("rad/s", BODY, "standard deviation of the estimated rates")]
    gyro_bias: Annotated[Vec3, Quantity("rad/s", BODY, "estimated bias of the gyro")]
    gyro_bias_std: Annotated[Vec3, Quantity("rad/s", BODY, "its standard deviation")]
    accelerometer_bias: Annotated[Vec3, Quantity("m/s^2", BODY, "estimated bias of the accelerometer")]
    accelerometer_bias_std: Annotated[Vec3, Quantity("m/s^2", BODY, "its standard deviation")]
    innovation: Annotated[Vec3, Quantity("m", WORLD, "measured less predicted position; 0 without a measurement")]
    nis: Annotated[Scalar, Quantity("1", NO_FRAME, "normalised innovations squared, summed over this instant")]
    measured: Annotated[Scalar, Quantity("1", NO_FRAME, "scalar measurements taken in at this instant")]


SIGNALS_WITH_WIND = joined("EskfWindSignals", EskfSignals, WindSignals)
