"""The axis of relaxed hover and the torque about it, against the hover itself and by what must not change."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rotorfault.analysis.relaxed_hover import relaxed_hover
from rotorfault.autopilot.control.relaxed import (
    RelaxedAxis,
    RelaxedParameters,
    SpinWeights,
    TurningError,
    at_rest,
    relaxed_axis,
    relaxed_parameters,
    relaxed_torque,
)
from rotorfault.maths.geometry import PerRotor, Vec3, zeros
from rotorfault.model.aerodynamics import still_air
from rotorfault.model.motion import angular_acceleration
from rotorfault.model.signals import healthy
from rotorfault.model.vehicle import Vehicle, residual_speed, rotor_speeds, wrench_of
from rotorfault.model.vehicle_file import load_vehicle

WEIGHTS = SpinWeights(6e4, 10.0)


def mueller() -> Vehicle:
    found = load_vehicle("mueller-2014").vehicle
    return found._replace(air=still_air()._replace(damping=Vec3(0.0, 0.0, 2.75e-3)), thrust_min=0.0)


def axis_of(
    vehicle: Vehicle, dead: int, omega: Vec3, residual: float, parameters: RelaxedParameters, steps: int = 4000
) -> RelaxedAxis:
    """Where the axis settles."""
    loss = PerRotor.of(float(rotor == dead) for rotor in range(1, 5))
    believed = healthy(4)._replace(loss=loss)
    memory = at_rest(parameters, vehicle)
    for _ in range(steps):
        axis = relaxed_axis(memory, vehicle, believed, 0.0, omega, residual, parameters, 1e-3)
        memory = axis.memory
    return axis


@pytest.mark.parametrize("dead", [1, 2, 3, 4])
def test_the_axis_is_that_of_relaxed_hover_with_those_thrusts(dead: int) -> None:
    vehicle = mueller()
    parameters = relaxed_parameters(0.3, 1.2, 0.1, WEIGHTS)
    hover = relaxed_hover(vehicle, [dead])
    speeds = rotor_speeds(vehicle, hover.thrust)
    axis = axis_of(vehicle, dead, hover.omega_B, float(residual_speed(vehicle, speeds)), parameters)
    wanted = np.array([hover.axis_B.x, hover.axis_B.y]) / float(hover.axis_B.z)
    found = np.array([float(axis.memory.lean.x), float(axis.memory.lean.y)])
    # The hover's thrusts were chosen by power and have another tilt torque; the lean is in proportion to it.
    torque = wrench_of(vehicle, hover.thrust).torque_B
    alike = PerRotor.of(0.0 if rotor == dead else vehicle.mass * vehicle.gravity / 3.0 for rotor in range(1, 5))
    asked = wrench_of(vehicle, alike).torque_B * 0.3
    share = math.hypot(torque.x, torque.y) / math.hypot(asked.x, asked.y)
    np.testing.assert_allclose(found * share, wanted, rtol=1e-3, atol=1e-6)


def test_in_balance_nothing_but_the_balance_is_asked_for() -> None:
    vehicle = mueller()
    hover = relaxed_hover(vehicle, [1])
    parameters = relaxed_parameters(0.3, 1.2, 0.5, WEIGHTS)
    residual = float(residual_speed(vehicle, rotor_speeds(vehicle, hover.thrust)))
    axis = axis_of(vehicle, 1, hover.omega_B, residual, parameters)
    # The axis put exactly where hover has it.
    lean = Vec3(hover.axis_B.x / hover.axis_B.z, hover.axis_B.y / hover.axis_B.z, 0.0)
    axis = relaxed_axis(
        axis.memory._replace(lean=lean), vehicle, healthy(4), 0.0, hover.omega_B, residual, parameters, 0.0
    )
    given = wrench_of(vehicle, hover.thrust).torque_B
    error = TurningError(zeros(), axis.to_B.T @ hover.omega_B, zeros(), zeros())
    _, torque = relaxed_torque(axis, error, given, zeros(), vehicle, residual, parameters)
    np.testing.assert_allclose([torque.x, torque.y], [given.x, given.y], atol=1e-7)
    turn = angular_acceleration(vehicle, torque, hover.omega_B, residual)
    np.testing.assert_allclose([turn.x, turn.y], 0.0, atol=1e-4)


def test_with_yaw_in_balance_nothing_is_given_up() -> None:
    vehicle = mueller()
    parameters = relaxed_parameters(0.3, 0.35, 0.5, WEIGHTS)
    weight = float(vehicle.mass * vehicle.gravity)
    for with_yaw, given_up in ((2.0 * weight, 0.0), (weight, 0.0), (0.975 * weight, 0.5), (0.0, 1.0)):
        axis = relaxed_axis(
            at_rest(parameters, vehicle), vehicle, healthy(4), with_yaw, Vec3(0.0, 0.0, 20.0), 0.0, parameters, 1e-3
        )
        assert float(axis.given_up) == pytest.approx(given_up, abs=1e-12)
        if given_up == 0.0:
            assert [*axis.to_B] == [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]


def test_the_axis_stays_within_its_limit_and_is_finite_at_rest() -> None:
    vehicle = mueller()
    parameters = relaxed_parameters(1.0, 0.2, 0.5, WEIGHTS)
    for spin in (0.0, 1e-9, 0.5, 3.0, -3.0):
        axis = axis_of(vehicle, 1, Vec3(0.0, 0.0, spin), 0.0, parameters, steps=3000)
        lean = math.hypot(axis.memory.lean.x, axis.memory.lean.y)
        assert lean <= math.tan(0.2) + 1e-12
    dead = healthy(4)._replace(loss=PerRotor.all(1.0))
    none = relaxed_axis(at_rest(parameters, vehicle), vehicle, dead, 0.0, Vec3(0.0, 0.0, 5.0), 0.0, parameters, 1e-3)
    assert all(np.isfinite([*none.to_B]))
