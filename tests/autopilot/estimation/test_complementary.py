"""The complementary filter finds attitude, bias and position from readings that are off."""

from __future__ import annotations

import numpy as np
import pytest

import rotorfault as rf
from rotorfault.autopilot.estimation import Complementary, EstimatorInputs
from rotorfault.engine import have_simd
from rotorfault.maths.geometry import PerRotor, Vec3, zeros
from rotorfault.maths.rotation import Quat
from rotorfault.model.block import Context
from rotorfault.model.sensor_model import SensorModel, SensorNoise, Timing
from rotorfault.model.signals import Reading, Readings
from rotorfault.model.vehicle_file import load_vehicle

VEHICLE = load_vehicle("hummingbird").vehicle
DT = 0.01
FIELD = Vec3(21.6e-6, 0.0, -43.3e-6)
MODEL = SensorModel(position=SensorNoise(0.1, Timing(5)), magnetic_field=SensorNoise(1e-7), field_W=FIELD)
TRUE = Quat.from_euler(Vec3(0.1, -0.2, 0.5))


def test_at_rest_it_finds_attitude_and_bias_of_the_gyro_and_stays_where_it_is() -> None:
    """It begins with what it reads, so the first readings are off: the error falls, and the bias is found."""
    bias = Vec3(0.02, -0.01, 0.03)
    made = Complementary()
    numbers = made.parameters(Context(VEHICLE, DT, MODEL))
    R = TRUE.matrix()
    force = R.T @ Vec3(0.0, 0.0, VEHICLE.gravity)
    memory = None
    for k in range(6000):
        off = Vec3(0.5, 0.3, -0.2) if k == 0 else zeros()
        readings = Readings(
            position=Reading(Vec3(1.0, 2.0, 3.0) + off, 1.0 if k % 5 == 0 else 0.0),
            rates=Reading(bias),
            specific_force=Reading(force + off),
            magnetic_field=Reading(R.T @ FIELD),
        )
        inputs = EstimatorInputs(readings, VEHICLE, PerRotor.all(1.0))
        memory = made.initial(inputs, numbers) if memory is None else memory
        memory, found, _ = made.step(memory, inputs, numbers, DT)
    np.testing.assert_allclose([*(TRUE @ found.q_WB.conjugate()).rotation_vector()], 0.0, atol=1e-3)
    assert isinstance(found.gyro_bias, Vec3)
    np.testing.assert_allclose([*found.gyro_bias], [*bias], atol=1e-3)
    np.testing.assert_allclose([*found.p_W], [1.0, 2.0, 3.0], atol=1e-3)
    np.testing.assert_allclose([*found.v_W], 0.0, atol=1e-3)


@pytest.mark.skipif(not have_simd(), reason="needs llvmlite")
def test_it_flies_and_the_kalman_filter_knows_more() -> None:
    settings = {"sensors": "mocap", "duration": 5.0, "fault": [], "diagnosis": "off"}
    errors = {}
    for kind in ("complementary", "eskf"):
        flight = rf.fly("hover-fault", settings={**settings, "estimator": kind})
        assert flight.outcome.survived
        off = (flight.data["velocity_estimated"] - flight.data["velocity"]).values[2000:]
        errors[kind] = float(np.sqrt((off**2).mean()))
    assert errors["eskf"] < 0.005 < errors["complementary"] < 0.1
