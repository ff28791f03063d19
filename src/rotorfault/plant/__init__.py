"""The truth: vehicle dynamics, wind, faults and sensors. Autopilots never import it.

Importing the package registers every plant model, wind, fault and sensor suite, so that the registries are
complete.
"""

from rotorfault.plant.dryden import Dryden
from rotorfault.plant.faults import FAULTS, Fault, RotorFault, rotor_faults
from rotorfault.plant.ground import Ground
from rotorfault.plant.models import PLANTS, BodyModel
from rotorfault.plant.paper_model import PaperModel
from rotorfault.plant.plant import Plant, PlantParameters, PlantState, Truth
from rotorfault.plant.rigid_body import RigidBody
from rotorfault.plant.sensors import SENSORS, Normals, Sensors, no_noise
from rotorfault.plant.wind import WINDS, Air, FirstNormals, Wind, no_first_normals

__all__ = [
    "FAULTS",
    "PLANTS",
    "SENSORS",
    "WINDS",
    "Air",
    "BodyModel",
    "Dryden",
    "Fault",
    "FirstNormals",
    "Ground",
    "Normals",
    "PaperModel",
    "Plant",
    "PlantParameters",
    "PlantState",
    "RigidBody",
    "RotorFault",
    "Sensors",
    "Truth",
    "Wind",
    "no_first_normals",
    "no_noise",
    "rotor_faults",
]
