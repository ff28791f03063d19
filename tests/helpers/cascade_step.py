"""What the tests of the laws and of the cascade share: one instant of a cascade around a law."""

from __future__ import annotations

from typing import Any

import numpy as np
from hypothesis import strategies as st
from numpy.typing import NDArray

from rotorfault.autopilot.allocation.available import thrust_available
from rotorfault.autopilot.control import CONTROLLERS
from rotorfault.autopilot.control.cascade import Cascade, CascadeSettings
from rotorfault.autopilot.control.protocol import ControlInputs
from rotorfault.autopilot.prediction import Prediction
from rotorfault.maths.geometry import PerRotor, Vec3, zeros
from rotorfault.model.signals import Measurement, Reference
from rotorfault.model.vehicle import Vehicle
from rotorfault.model.vehicle_file import load_vehicle

Array = NDArray[np.float64]
VEHICLE = load_vehicle("paper").vehicle
number = st.floats(-20.0, 20.0)
small_angle = st.floats(-1.2, 1.2)
attitudes = st.builds(Vec3, small_angle, small_angle, st.floats(-3.1, 3.1))


def arr(v: Vec3) -> Array:
    return np.array(list(v), dtype=float)


def sound_thrust(vehicle: Vehicle) -> float:
    """Thrust in N that there is while no rotor is at fault."""
    return float(thrust_available(vehicle, PerRotor.all(0.0)))


def cascade(name: str = "sdre", **settings: Any) -> Cascade:
    kind = CONTROLLERS[name]
    return Cascade(kind.law(kind.law.Settings()), CascadeSettings(**settings))


def controller_step(made: Cascade, vehicle: Vehicle, seen: Measurement, wanted: Reference, **inputs: Any) -> Any:
    """One instant: (memory before, memory after, output). `reference` puts the command filter somewhere."""
    numbers = made.parameters(vehicle, 1e-3)
    memory = made.initial(seen, wanted, numbers)
    if "reference" in inputs:
        memory = memory._replace(reference=inputs["reference"])
    nothing, residual = Prediction(zeros(), zeros()), inputs.get("residual", 0.0)
    given = ControlInputs(seen, wanted, vehicle, nothing, residual, sound_thrust(vehicle))
    after, output = made.step(memory, given, numbers, 1e-3)
    return memory, after, output
