"""Where the vehicle should be, as functions of time.

Importing the package registers every reference, so that the registry is complete.
"""

from rotorfault.reference.protocol import REFERENCE, ReferenceSource, ReferenceTable
from rotorfault.reference.sources import Csv, SetPoint, Sinusoid, Square, Waypoints

from rotorfault.reference.function import Function  # isort: skip  # registered, and so listed, last

__all__ = [
    "REFERENCE",
    "Csv",
    "Function",
    "ReferenceSource",
    "ReferenceTable",
    "SetPoint",
    "Sinusoid",
    "Square",
    "Waypoints",
]
