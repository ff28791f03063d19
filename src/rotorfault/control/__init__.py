"""Control: what the autopilot does with its belief. Nothing here knows the plant.

Importing the package registers every controller and every response to a fault, so that the registries are complete.
"""

from rotorfault.control.cascade import register_law
from rotorfault.control.ismc import Ismc
from rotorfault.control.landing import RESPONSES
from rotorfault.control.protocol import CONTROLLERS
from rotorfault.control.roismc import Roismc
from rotorfault.control.sdre import Sdre
from rotorfault.control.smc import Smc

register_law("roismc", Roismc)
register_law("smc", Smc)
register_law("ismc", Ismc)
register_law("sdre", Sdre)

__all__ = ["CONTROLLERS", "RESPONSES"]
