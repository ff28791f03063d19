"""Responses: what the autopilot does about a confirmed fault.

Importing the package registers every response, so that the registry is complete.
"""

from rotorfault.autopilot.response.fly_on import FlyOn
from rotorfault.autopilot.response.land import Land
from rotorfault.autopilot.response.protocol import ON_FAULT, Response, ResponseInputs

__all__ = ["ON_FAULT", "FlyOn", "Land", "Response", "ResponseInputs"]
