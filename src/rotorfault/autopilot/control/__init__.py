"""Control: what the autopilot does with its belief. Nothing here knows the plant.

Importing the package registers every controller and every response to a fault, so that the registries are complete.
"""

from rotorfault.autopilot.control.cascade import register_law
from rotorfault.autopilot.control.ismc import Ismc
from rotorfault.autopilot.control.landing import RESPONSES
from rotorfault.autopilot.control.protocol import CONTROLLERS
from rotorfault.autopilot.control.roismc import Roismc
from rotorfault.autopilot.control.sdre import Sdre
from rotorfault.autopilot.control.smc import Smc

register_law("roismc", Roismc)
register_law("smc", Smc)
register_law("ismc", Ismc)
register_law("sdre", Sdre)

__all__ = ["CONTROLLERS", "RESPONSES"]
