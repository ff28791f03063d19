"""Control allocation: from the wrench that the controller demands to one thrust command per rotor.

Importing the package registers every allocator, so that the registry is complete.
"""

from rotorfault.autopilot.allocation.dither import Dither
from rotorfault.autopilot.allocation.effectiveness import Effectiveness
from rotorfault.autopilot.allocation.nominal import Nominal
from rotorfault.autopilot.allocation.paper_rule import PaperRule
from rotorfault.autopilot.allocation.protocol import ALLOCATION, AllocationInputs, Allocator
from rotorfault.autopilot.allocation.sequential import Sequential

__all__ = [
    "ALLOCATION",
    "AllocationInputs",
    "Allocator",
    "Dither",
    "Effectiveness",
    "Nominal",
    "PaperRule",
    "Sequential",
]
