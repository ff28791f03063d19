"""What the tests of the laws and of the cascade share: one instant of a cascade around a law."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from hypothesis import strategies as st
from numpy.typing import NDArray

from rotorfault.autopilot.allocation.available import thrust_available
from rotorfault.autopilot.control import CONTROLLER, ControlInputs
from rotorfault.autopilot.control.attitude import AttitudeReference
from rotorfault.autopilot.control.cascade import Cascade, CascadeKind, CascadeMemory, CascadeSettings
from rotorfault.autopilot.prediction import Prediction
from rotorfault.maths.geometry import PerRotor, Vec3, zeros
from rotorfault.maths.rotation import Quat
from rotorfault.model.block import Context
from rotorfault.model.mixer import hover_thrust
from rotorfault.model.signals import Estimate, Reference, Wrench, healthy
from rotorfault.model.vehicle import Vehicle
from rotorfault.model.vehicle_file import load_vehicle

Array = NDArray[np.float64]
VEHICLE = load_vehicle("paper").vehicle
# Those of a law; other controllers have no cascade.
CONTROLLERS: Any = {name: kind for name, kind in CONTROLLER.registry.items() if isinstance(kind, CascadeKind)}
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
    return Cascade(kind.law(kind.law.Settings()), CascadeSettings(**settings), kind.Telemetry)


def estimate(p_W: Vec3, v_W: Vec3, attitude: Vec3, omega_B: Vec3) -> Estimate:
    return Estimate(p_W, v_W, Quat.from_euler(attitude), omega_B)


def control_inputs(vehicle: Vehicle, seen: Estimate, wanted: Reference, residual: float = 0.0) -> ControlInputs:
    """What a controller sees while nothing is diagnosed and the rotors hover."""
    hover = hover_thrust(vehicle)
    return ControlInputs(
        estimate=seen,
        reference=wanted,
        vehicle=vehicle,
        diagnosis=healthy(),
        command=hover / vehicle.rotor_gain,
        expected_thrust=hover,
        prediction=Prediction(zeros(), zeros()),
        residual_speed=residual,
        thrust_available=sound_thrust(vehicle),
    )


class Instant(NamedTuple):
    """One instant of a controller."""

    before: CascadeMemory
    after: CascadeMemory
    wrench: Wrench
    telemetry: Any


def controller_step(
    made: Cascade,
    vehicle: Vehicle,
    seen: Estimate,
    wanted: Reference,
    reference: AttitudeReference | None = None,
    residual: float = 0.0,
) -> Instant:
    """One instant; `reference` puts the command filter somewhere."""
    numbers = made.parameters(Context(vehicle, 1e-3))
    inputs = control_inputs(vehicle, seen, wanted, residual)
    memory = made.initial(inputs, numbers)
    if reference is not None:
        memory = memory._replace(reference=reference)
    after, output, telemetry = made.step(memory, inputs, numbers, 1e-3)
    assert isinstance(output.demand, Wrench)
    return Instant(memory, after, output.demand, telemetry)
