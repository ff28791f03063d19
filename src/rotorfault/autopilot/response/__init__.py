"""Responses: what the autopilot does about a confirmed fault.

Importing the package registers every response, so that the registry is complete.
"""

from rotorfault.autopilot.response.auto import Auto
from rotorfault.autopilot.response.fly_on import FlyOn
from rotorfault.autopilot.response.land import Land
from rotorfault.autopilot.response.protocol import ON_FAULT, Response, ResponseInputs
from rotorfault.autopilot.response.spin import Spin
from rotorfault.model.slot import register

register("continue")(FlyOn)
register("land")(Land)
register("spin")(Spin)
register("auto")(Auto)

__all__ = ["ON_FAULT", "Auto", "FlyOn", "Land", "Response", "ResponseInputs", "Spin"]
