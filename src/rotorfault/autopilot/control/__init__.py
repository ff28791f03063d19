"""Control: what the autopilot does with its belief. Nothing here knows the plant.

Importing the package registers every controller, so that the registry is complete.
"""

from rotorfault.autopilot.control.cascade import register_law
from rotorfault.autopilot.control.ismc import Ismc
from rotorfault.autopilot.control.protocol import CONTROLLER, ControlInputs, Controller, ControlOutput
from rotorfault.autopilot.control.python_controller import PythonController
from rotorfault.autopilot.control.roismc import Roismc
from rotorfault.autopilot.control.sdre import Sdre
from rotorfault.autopilot.control.smc import Smc

register_law("roismc", Roismc)
register_law("smc", Smc)
register_law("ismc", Ismc)
register_law("sdre", Sdre)

__all__ = ["CONTROLLER", "ControlInputs", "ControlOutput", "Controller", "PythonController"]
