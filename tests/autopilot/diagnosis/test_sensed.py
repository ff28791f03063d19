"""What a gyroscope at the end of its range says, and what it does not: no rotor is blamed for it."""

from __future__ import annotations

import pytest

from rotorfault.autopilot.diagnosis import DiagnosisInputs, fault_free
from rotorfault.autopilot.diagnosis.glr import Glr, GlrMemory, GlrSettings
from rotorfault.autopilot.prediction import Expectation
from rotorfault.maths.geometry import PerRotor, Vec3, zeros
from rotorfault.maths.rotation import Quat
from rotorfault.model.block import Context
from rotorfault.model.mixer import hover_thrust
from rotorfault.model.sensor_model import SensorModel, SensorNoise
from rotorfault.model.signals import Estimate, Reading, Readings, motion_of
from rotorfault.model.vehicle import residual_speed, rotor_speeds
from rotorfault.model.vehicle_file import load_vehicle

VEHICLE = load_vehicle("crazyflie-2.1").vehicle
T, END = 0.001, 35.0  # s, rad/s


def spun(limit: float, instants: int = 40) -> tuple[GlrMemory, bool, float]:
    """A body whose true yaw rate grows beyond what its gyroscope can say; memory, whether flagged, last rate."""
    context = Context(VEHICLE, T, SensorModel(rates=SensorNoise(0.002, limit=limit)))
    glr = Glr(GlrSettings())
    parameters = glr.parameters(context)
    thrust = hover_thrust(VEHICLE)
    # Rotors 1 and 2 turn one way, 3 and 4 the other: they turn the body faster and faster.
    thrust = PerRotor(thrust[0] * 1.5, thrust[1] * 1.5, thrust[2] * 0.5, thrust[3] * 0.5)
    speed = rotor_speeds(VEHICLE, thrust)
    felt = Vec3(0.0, 0.0, thrust.sum() / VEHICLE.mass)

    def estimate(rate: float) -> Estimate:
        return Estimate(zeros(), zeros(), Quat(1.0, 0.0, 0.0, 0.0), Vec3(0.0, 0.0, rate), felt)

    memory, before, flagged = None, estimate(END), False
    for k in range(instants):
        now = estimate(END)  # whatever the true rate is
        expectation = Expectation(
            motion_of(now), motion_of(before), thrust, thrust, residual_speed(VEHICLE, speed), speed,
            PerRotor.all(0.0), zeros(), T if k else 0.0,
        )  # fmt: skip
        command = thrust / VEHICLE.rotor_gain
        inputs = DiagnosisInputs(now, expectation, command, VEHICLE, Readings(rates=Reading(now.omega_B)))
        if memory is None:
            first = glr.initial(inputs, parameters)
            memory = first._replace(model=first.model._replace(lagged=command))
        memory, told, _ = glr.step(memory, inputs, parameters, T)
        flagged = flagged or max(told.flagged) > 0.0
        before = now
    assert memory is not None
    return memory, flagged, memory.model.belief.mean[fault_free.RATES + 2]


def test_a_rate_beyond_the_range_is_no_evidence_against_a_rotor() -> None:
    memory, flagged, rate = spun(END)
    assert not flagged
    assert rate == pytest.approx(END, abs=1e-3)  # what the reading says, for what it is worth
    offset = fault_free.OFFSETS + 2
    free, _, _ = spun(2.0 * END)
    assert abs(free.model.belief.mean[offset]) > 1.0  # rad/s^2: a rate that stands still within the range says much
    assert abs(memory.model.belief.mean[offset]) < 1e-3 * abs(free.model.belief.mean[offset])


def test_noise_is_not_learned_from_a_reading_at_its_end() -> None:
    memory, _, _ = spun(END)
    assert memory.model.noise == Vec3(*(memory.model.noise.x,) * 3)
