"""Estimation: from readings to what the autopilot believes of its motion.

Importing the package registers every estimator, so that the registry is complete.
"""

from rotorfault.autopilot.estimation.complementary import Complementary
from rotorfault.autopilot.estimation.direct import Direct
from rotorfault.autopilot.estimation.eskf import Eskf
from rotorfault.autopilot.estimation.imu_filter import IMU_FILTER, FilterInputs, ImuFilter, Unfiltered
from rotorfault.autopilot.estimation.protocol import ESTIMATOR, Estimator, EstimatorInputs
from rotorfault.autopilot.estimation.rotor_notch import RotorNotch
from rotorfault.autopilot.estimation.sensor_check import (
    SENSOR_CHECK,
    CheckInputs,
    Repeats,
    SensorCheck,
    Unchecked,
)

__all__ = [
    "ESTIMATOR",
    "IMU_FILTER",
    "SENSOR_CHECK",
    "CheckInputs",
    "Complementary",
    "Direct",
    "Eskf",
    "Estimator",
    "EstimatorInputs",
    "FilterInputs",
    "ImuFilter",
    "Repeats",
    "RotorNotch",
    "SensorCheck",
    "Unchecked",
    "Unfiltered",
]
