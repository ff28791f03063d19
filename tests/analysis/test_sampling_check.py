"""The sampled-data check of a controller's gains, against exact sampling and against the whole loop."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from cascade_step import CONTROLLERS, estimate
from scipy.linalg import expm

from rotorfault.analysis.linearisation import linearise
from rotorfault.analysis.sampling_check import (
    AxisGains,
    damping,
    sampled_data_check,
    sampled_data_warnings,
    sampled_poles,
)
from rotorfault.analysis.trim import hover_loop
from rotorfault.autopilot.control import ControlInputs
from rotorfault.autopilot.control.cascade import Cascade
from rotorfault.autopilot.control.ismc import Ismc
from rotorfault.autopilot.control.python_controller import PythonController
from rotorfault.maths.geometry import Vec3, zeros
from rotorfault.model.signals import Estimate, Reference, Wrench, healthy
from rotorfault.model.vehicle import Vehicle
from rotorfault.scenario.library import load_scenario


@pytest.mark.parametrize("direct", [False, True])
def test_sampled_poles_are_those_of_the_matrix_exponential(direct: bool) -> None:
    lag, period = 50.0, 0.004
    if direct:
        rows = [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, 0.0]]
    else:
        rows = [[0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, -lag, lag], [0.0, 0.0, 0.0, 0.0]]
    n = len(rows) - 1
    held = expm(np.array(rows) * period)
    K = np.array([90.0, 14.0, 0.0])[:n]
    expected = np.sort_complex(np.linalg.eigvals(held[:n, :n] - np.outer(held[:n, n], K)))
    found = np.sort_complex(sampled_poles(AxisGains("roll", 90.0, 14.0, direct), period, lag))
    np.testing.assert_allclose(found, expected, atol=1e-12)


def test_damping() -> None:
    zeta, omega, period = 0.3, 20.0, 0.01
    s = omega * complex(-zeta, math.sqrt(1.0 - zeta * zeta))
    assert damping(np.exp(np.array([s, s.conjugate(), -5.0]) * period)) == pytest.approx(zeta)
    assert damping(np.array([0.5 + 0j, 1.01 + 0j])) < 0.0
    assert damping(np.array([0.5 + 0j, 0j])) == 1.0


def test_weights_in_torque_units_are_warned_of() -> None:
    """R = 0.0088 on torque is 0.0088 J^2 on acceleration: the pole of B = 1/I_x at -4935 rad/s."""
    J = load_scenario("paper-set-point").vehicle.vehicle.inertia
    scenario = load_scenario(
        "paper-set-point",
        {
            "controller.kind": "sdre",
            "controller.preset": "none",
            "controller.law.attitude_q_angle": [1.0, 1.0, 1.0],
            "controller.law.attitude_q_rate": [1.0, 1.0, 1.0],
            "controller.law.attitude_r": [0.0088 * moment * moment for moment in J],
        },
    )
    warnings = sampled_data_warnings(scenario)
    assert [line.split()[0] for line in warnings] == ["roll", "pitch", "yaw"]
    assert "-4935 rad/s" in warnings[0]
    assert "|p| T = 4.9" in warnings[0]
    assert "unstable" in warnings[0]


@pytest.mark.parametrize("kind", ["roismc", "smc", "ismc", "sdre"])
def test_default_presets_are_not_warned_of(kind: str) -> None:
    assert sampled_data_warnings(load_scenario("paper-set-point", {"controller.kind": kind})) == []


def test_slow_sampling_and_slow_rotors_are_warned_of(paper_vehicle: Vehicle) -> None:
    kind = CONTROLLERS["ismc"]
    controller = kind(kind.Settings())
    slow = paper_vehicle._replace(rotor_bandwidth=7.0)
    assert sampled_data_check(controller, paper_vehicle, 0.001) == []
    for lines in (sampled_data_check(controller, paper_vehicle, 0.1), sampled_data_check(controller, slow, 0.001)):
        assert any("roll" in line for line in lines)


def test_the_warning_is_right_about_the_whole_loop(paper_vehicle: Vehicle) -> None:
    """Where the axis alone is unstable, so is the linearised flight; sdre has no part but its nominal gains."""
    kind = CONTROLLERS["sdre"]
    slow = paper_vehicle._replace(rotor_bandwidth=6.0)
    weights = kind.Settings().law.model_copy(update={"attitude_q_angle": (1000.0, 1000.0, 1000.0)})
    controller = kind(kind.Settings(law=weights))
    assert len([line for line in sampled_data_check(controller, slow, 0.001) if "unstable" in line]) >= 1
    assert not linearise(*hover_loop(slow, controller, 0.001)).stable


def test_six_inputs_bypass_the_rotors() -> None:
    """With a tiny error floor the position gains explode at the target only where something lags behind them."""
    settings: dict[str, object] = {
        "controller.kind": "sdre",
        "controller.preset": "none",
        "controller.law.error_floor": [1e-3, 1e-3, 0.1],
    }
    lagging = sampled_data_warnings(load_scenario("paper-set-point", settings))
    assert any(line.startswith("x at the target") for line in lagging)
    settings["controller.cascade.six_inputs"] = True
    direct = sampled_data_warnings(load_scenario("paper-set-point", settings))
    assert not any(line.startswith(("x ", "y ")) for line in direct)


def test_a_controller_that_reports_nothing_is_not_stepped(paper_vehicle: Vehicle) -> None:
    class Counter:
        calls = 0

        def update(self, time: float, seen: Estimate, reference: Reference, vehicle: Vehicle) -> Wrench:
            self.calls += 1
            return Wrench(0.0, zeros())

    counter = Counter()
    assert sampled_data_check(PythonController(counter), paper_vehicle, 0.001) == []
    assert counter.calls == 0


def test_gains_at_the_start_are_checked(paper_vehicle: Vehicle) -> None:
    """A position law that is fast far away only, as SDRE with Q growing with the error."""

    class Far(Cascade):
        def step(self, memory: Any, inputs: Any, parameters: Any, dt: float) -> Any:
            after, output, told = super().step(memory, inputs, parameters, dt)
            far = 1.0 + 1e3 * inputs.estimate.p_W.z
            return after, output, told._replace(gain_position=told.gain_position * far)

    settings = CONTROLLERS["ismc"].Settings()
    controller = Far(Ismc(settings.law), settings.cascade, CONTROLLERS["ismc"].Telemetry)
    start = estimate(Vec3(0.0, 0.0, 5.0), zeros(), zeros(), zeros())
    assert sampled_data_check(controller, paper_vehicle, 0.001) == []
    lines = sampled_data_check(controller, paper_vehicle, 0.001, start)
    assert any(line.startswith("z at the start") for line in lines)


def test_what_it_shows_a_controller_hovers(paper_vehicle: Vehicle) -> None:
    """The trial steps are those of a vehicle whose rotors carry it: it feels its weight, and no rotor is at fault."""
    shown: list[ControlInputs] = []

    class Watching(Cascade):
        def step(self, memory: Any, inputs: Any, parameters: Any, dt: float) -> Any:
            shown.append(inputs)
            return super().step(memory, inputs, parameters, dt)

    kind = CONTROLLERS["ismc"]
    controller = Watching(Ismc(kind.Settings().law), kind.Settings().cascade, kind.Telemetry)
    scenario = load_scenario("paper-set-point", {"start.position": [0.0, 0.0, 1.0]})
    sampled_data_warnings(scenario, controller)
    assert {inputs.estimate.p_W.z for inputs in shown} >= {0.0, 1.0}
    for inputs in shown:
        assert inputs.estimate.specific_force_B == Vec3(0.0, 0.0, paper_vehicle.gravity)
        assert inputs.diagnosis == healthy()
        assert inputs.expected_thrust.sum() == pytest.approx(paper_vehicle.mass * paper_vehicle.gravity)
        assert inputs.command * paper_vehicle.rotor_gain == inputs.expected_thrust
