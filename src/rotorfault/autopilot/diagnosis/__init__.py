"""Diagnosis: what the autopilot believes about its rotors.

Importing the package registers every source of diagnosis, so that `DIAGNOSES` is complete.
"""

from rotorfault.autopilot.diagnosis.luenberger import Luenberger
from rotorfault.autopilot.diagnosis.oracle import Delayed, Off, Oracle
from rotorfault.autopilot.diagnosis.protocol import DIAGNOSES

__all__ = ["DIAGNOSES", "Delayed", "Luenberger", "Off", "Oracle"]
