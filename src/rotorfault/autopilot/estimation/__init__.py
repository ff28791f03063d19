"""Estimation: from readings to what the autopilot believes of its motion.

Importing the package registers every estimator, so that the registry is complete.
"""

from rotorfault.autopilot.estimation.complementary import Complementary
from rotorfault.autopilot.estimation.direct import Direct
from rotorfault.autopilot.estimation.eskf import Eskf
from rotorfault.autopilot.estimation.protocol import ESTIMATOR, Estimator, EstimatorInputs

__all__ = ["ESTIMATOR", "Complementary", "Direct", "Eskf", "Estimator", "EstimatorInputs"]
