"""The truth: vehicle dynamics, wind, faults, ground and sensors. Autopilots never import it.

Importing the package registers every plant model, wind, fault, ground and sensor suite, so that the registries are
complete.
"""

from rotorfault.plant.dryden import Dryden
from rotorfault.plant.faults import FAULT, Fault, RotorFault, rotor_faults
from rotorfault.plant.ground import GROUND, Ground
from rotorfault.plant.models import PLANT, BodyModel
from rotorfault.plant.paper_model import PaperModel
from rotorfault.plant.plant import Plant, PlantParameters, PlantState, Truth
from rotorfault.plant.rigid_body import RigidBody
from rotorfault.plant.sensor_faults import SensorBias, SensorDropout, SensorFault, SensorFreeze
from rotorfault.plant.sensor_sets import Crazyflie, GpsConsumer, Mocap
from rotorfault.plant.sensors import SENSORS, Sensors
from rotorfault.plant.wind import WIND, Air, Wind

__all__ = [
    "FAULT",
    "GROUND",
    "PLANT",
    "SENSORS",
    "WIND",
    "Air",
    "BodyModel",
    "Crazyflie",
    "Dryden",
    "Fault",
    "GpsConsumer",
    "Ground",
    "Mocap",
    "PaperModel",
    "Plant",
    "PlantParameters",
    "PlantState",
    "RigidBody",
    "RotorFault",
    "SensorBias",
    "SensorDropout",
    "SensorFault",
    "SensorFreeze",
    "Sensors",
    "Truth",
    "Wind",
    "rotor_faults",
]
