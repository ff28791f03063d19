"""Control: what the autopilot does with its belief. Nothing here knows the plant.

Importing the package registers every controller, so that the registry is complete.
"""

from rotorfault.autopilot.control.cascade import register_law
from rotorfault.autopilot.control.geometric import Geometric, GeometricAdaptive
from rotorfault.autopilot.control.indi import Indi
from rotorfault.autopilot.control.ismc import Ismc
from rotorfault.autopilot.control.lqr_relaxed_hover import LqrRelaxedHover
from rotorfault.autopilot.control.ndi_primary_axis import NdiPrimaryAxis
from rotorfault.autopilot.control.pid_cascade import PidCascade
from rotorfault.autopilot.control.protocol import CONTROLLER, ControlInputs, Controller, ControlOutput
from rotorfault.autopilot.control.python_controller import PythonController
from rotorfault.autopilot.control.roismc import Roismc
from rotorfault.autopilot.control.sdre import Sdre
from rotorfault.autopilot.control.smc import Smc
from rotorfault.autopilot.control.uniform_passive import UniformPassive
from rotorfault.model.slot import register

register_law("roismc", Roismc)
register_law("smc", Smc)
register_law("ismc", Ismc)
register_law("sdre", Sdre)
# Of other people, after our own in every list.
register("indi")(Indi)
register("ndi_primary_axis")(NdiPrimaryAxis)
register("lqr_relaxed_hover")(LqrRelaxedHover)
register("pid_cascade")(PidCascade)
register("geometric")(Geometric)
register("geometric_adaptive")(GeometricAdaptive)
register("uniform_passive")(UniformPassive)

__all__ = [
    "CONTROLLER",
    "ControlInputs",
    "ControlOutput",
    "Controller",
    "Geometric",
    "GeometricAdaptive",
    "Indi",
    "LqrRelaxedHover",
    "NdiPrimaryAxis",
    "PidCascade",
    "PythonController",
    "UniformPassive",
]
