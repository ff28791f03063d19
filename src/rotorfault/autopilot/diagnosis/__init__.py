"""Diagnosis: what the autopilot believes about its rotors.

Importing the package registers every source of diagnosis, so that the registry is complete.
"""

from rotorfault.autopilot.diagnosis.effectiveness_kalman import EffectivenessKalman
from rotorfault.autopilot.diagnosis.glr import Glr
from rotorfault.autopilot.diagnosis.injected import Injected
from rotorfault.autopilot.diagnosis.luenberger import Luenberger
from rotorfault.autopilot.diagnosis.multiple_model import MultipleModel
from rotorfault.autopilot.diagnosis.off import Off
from rotorfault.autopilot.diagnosis.oracle import Delayed, Present
from rotorfault.autopilot.diagnosis.protocol import DIAGNOSIS, Diagnoser, DiagnosisInputs, Oracle

__all__ = [
    "DIAGNOSIS",
    "Delayed",
    "Diagnoser",
    "DiagnosisInputs",
    "EffectivenessKalman",
    "Glr",
    "Injected",
    "Luenberger",
    "MultipleModel",
    "Off",
    "Oracle",
    "Present",
]
