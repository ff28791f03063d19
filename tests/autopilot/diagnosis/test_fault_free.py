"""The model of sound rotors: what the air does to it about yaw, and how far a wrong model may go."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import rotorfault as rf
from rotorfault.autopilot.diagnosis import fault_free
from rotorfault.autopilot.diagnosis.air_of_model import airspeed_felt, drag_about_yaw, drag_of_each
from rotorfault.autopilot.diagnosis.kalman import diagonal
from rotorfault.autopilot.diagnosis.touch import TouchMemory, pushed, touch_parameters
from rotorfault.maths.geometry import PerRotor, Vec3, zeros
from rotorfault.maths.rotation import Quat
from rotorfault.model.aerodynamics import air_wrench, still_air
from rotorfault.model.block import Context
from rotorfault.model.motion import mean_bandwidth
from rotorfault.model.signals import Estimate
from rotorfault.model.vehicle import Vehicle, rotor_places
from rotorfault.model.vehicle_file import load_vehicle

OF_ROTORS = {"value": 1.03e-6, "unit": "kg/rad", "source": "test"}


def crazyflie(shift: tuple[float, float] = (0.0, 0.0)) -> Vehicle:
    """With drag at its rotors alone, and its centre of mass elsewhere."""
    vehicle = load_vehicle("crazyflie-2.1").vehicle
    return vehicle._replace(
        linear_drag=0.0,
        air=still_air()._replace(rotor_drag=1.03e-6),
        rotor_x=vehicle.rotor_x - shift[0],
        rotor_y=vehicle.rotor_y - shift[1],
    )


@pytest.mark.parametrize("shift", [(0.0, 0.0), (0.008, -0.005)])
def test_drag_about_yaw_is_that_of_the_air_at_each_rotor(shift: tuple[float, float]) -> None:
    """The plant's sum over rotors, of unlike speeds, about a centre of mass that is not where it is believed."""
    believed, true = crazyflie(), crazyflie(shift)
    speeds = PerRotor.of((2400.0, 1500.0, 2100.0, 1100.0))
    force, torque = air_wrench(true.air, rotor_places(true), speeds, Vec3(7.0, -4.0, 1.0), zeros())  # type: ignore[arg-type]
    m, g, J = true.mass, true.gravity, true.inertia
    turned, rows = drag_about_yaw(believed, speeds, force.x / m, force.y / m, 1.0)
    # What the shift does in hover, over the inertia: the offsets that the filter learns.
    offsets = (-shift[1] * m * g / J.x, shift[0] * m * g / J.y)
    assert turned + rows[0] * offsets[0] + rows[1] * offsets[1] == pytest.approx(torque.z / J.z, rel=1e-9)
    assert abs(torque.z / J.z) > 1.0


@pytest.mark.parametrize("linear", [0.0, 3e-3])
@pytest.mark.parametrize("frame", [0.0, 4e-4])
def test_what_is_felt_tells_the_airspeed(linear: float, frame: float) -> None:
    """Of a body that leans and climbs in level wind."""
    vehicle = crazyflie()._replace(linear_drag=linear)
    air = vehicle.air._replace(frame_drag=Vec3(frame, frame, 0.0))  # type: ignore[union-attr]
    speeds, q = PerRotor.of((2400.0, 0.0, 2100.0, 1100.0)), Quat.from_euler(Vec3(0.3, -0.4, 1.1))
    v_W, wind_W = Vec3(1.0, -2.0, 0.7), Vec3(-9.0, 4.0, 0.0)
    v = q.matrix().T @ (v_W - wind_W)
    assert abs(v.z) > 1.0
    # The frame's drag goes with the size of all of the airspeed, of which the part along body z is left out.
    places = rotor_places(vehicle)
    force, torque = air_wrench(air, places, speeds, Vec3(v.x, v.y, 0.0), zeros())
    vehicle = vehicle._replace(air=air)
    force = force - v * linear
    now = Estimate(zeros(), v_W, q, zeros(), force / vehicle.mass)
    found = airspeed_felt(vehicle, now, speeds, speeds)
    assert [*found] == pytest.approx([*v], rel=1e-9)
    each = drag_of_each(vehicle, found, speeds)
    assert each.sum() == pytest.approx(torque.z)
    assert each[1] == 0.0
    still = Estimate(zeros(), zeros(), q, zeros(), zeros())
    assert [*airspeed_felt(vehicle, still, speeds, speeds)] == [0.0] * 3


WHOLE_AIR: dict[str, Any] = {
    f"vehicle.air.{key}": {"value": value, "unit": unit, "source": "RotorPy"}
    for key, value, unit in (
        ("inflow", 2.32e-4, "kg/rad"),
        ("translational_lift", 3.39e-3, "kg/m"),
        ("frame_drag_x", 0.5e-2, "kg/m"),
        ("frame_drag_y", 0.5e-2, "kg/m"),
        ("frame_drag_z", 1e-2, "kg/m"),
    )
}


@pytest.mark.parametrize("air", [{}, WHOLE_AIR])
def test_wind_is_no_reason_to_blame_a_rotor_or_to_take_a_total_loss_back(air: dict[str, Any]) -> None:
    """In 15 m/s: rotors of unlike speeds have unlike drag and inflow, which is no thrust of another rotor."""
    settings: dict[str, Any] = {
        "vehicle": "hummingbird",
        "vehicle.linear_drag.value": 0.0,
        "vehicle.air.rotor_drag": {"value": 1.19e-4, "unit": "kg/rad", "source": "RotorPy"},
        "controller.preset": "hummingbird",
        "duration": 3.0,
        "fault": [{"kind": "total", "rotor": 1, "time": 0.8}],
        **air,
    }
    directions = np.arange(6) * math.pi / 3.0
    blown = {"wind.velocity_W.0": 15.0 * np.cos(directions), "wind.velocity_W.1": 15.0 * np.sin(directions)}
    flown = rf.fly_many("hover-fault", {"seed": np.arange(6), **blown}, settings=settings).table
    assert min(flown["loss_believed.1"]) > 0.9
    assert max(flown["false_alarms"]) == 0


def test_a_wrong_model_goes_no_further_than_one_can_be() -> None:
    """Else a share of inertia below -1 turns torques round, and what nothing brings back drifts for ever."""
    n = fault_free.LOSSES + 4
    mean = [0.0] * n
    mean[fault_free.INERTIA], mean[fault_free.BANDWIDTH], mean[fault_free.MASS] = -1.9, 2.3, 0.2
    held = fault_free.within_bounds(diagonal(mean, [1.0] * n))
    assert held.mean[fault_free.INERTIA] == -fault_free.MOST_WRONG
    assert held.mean[fault_free.BANDWIDTH] == 1.0
    assert held.mean[fault_free.MASS] == 0.2
    assert held.covariance == diagonal(mean, [1.0] * n).covariance


@pytest.mark.long
def test_drag_at_the_rotors_blames_none_in_fast_flight() -> None:
    """Forward at 10 m/s in gusts, the centre of mass off by a fifth of the arm: 32 flags where drag takes thrust."""
    settings: dict[str, Any] = {
        "duration": 3.0, "vehicle": "crazyflie-2.1", "vehicle.linear_drag.value": 0.0,
        "vehicle.air.rotor_drag": OF_ROTORS,
        "sensors": "mocap", "estimator": "eskf", "diagnosis": "multiple_model", "controller.preset": "gentle",
        "reference": {"kind": "sinusoid", "amplitude": [250.0, 0.0, 0.0], "frequency": [0.04, 1.0, 1.0],
                      "phase": [-0.4, 0.0, 0.0], "offset": [97.354586, 0.0, 0.0]},
        "ground.height": -30.0, "start.position": [0.0, 0.0, 0.0], "start.velocity": [9.21061, 0.0, 0.0],
        "wind.wind_at_6m": 8.0, "wind.velocity_W": [-3.0, 3.0, 0.0], "fault": [],
        "mismatch.centre_of_mass": [0.007, -0.007, 0.0],
    }  # fmt: skip
    flights = rf.fly_many(rf.load_scenario("hover-fault", settings), {"seed": range(8)}, warn=False)
    assert not flights.table["false_alarms"].any()


def test_a_push_from_below_may_turn_the_body_as_far_as_its_arms_reach() -> None:
    """For 30 ms, and a while after; neither noise nor lost thrust is a push."""
    vehicle, arms = load_vehicle("x500").vehicle, 0.246
    context = Context(vehicle, 0.001)
    p = touch_parameters(context, arms)
    noise = np.random.default_rng(1).normal(size=400)

    def turned(upwards: np.ndarray) -> np.ndarray:
        """Standard deviation of what a push turns about roll within a rotor's lag, over what it does at the arms."""
        memory, found = TouchMemory(), []
        whole = vehicle.mass * arms / vehicle.inertia.x
        for one in upwards:
            memory, density = pushed(memory, float(one), 0.25, p)
            found.append(math.sqrt(float(density.x) * mean_bandwidth(vehicle)) / whole)
        return np.array(found)

    assert turned(0.5 * noise).max() < 0.1
    assert turned(0.5 * noise - 2.0).max() < 0.1
    push = np.where((np.arange(400) >= 100) & (np.arange(400) < 130), 2.0, 0.0)
    found = turned(push)
    assert found[129] == pytest.approx(2.0 * (1.0 - math.exp(-3.0)) - 0.5 * p.noise, abs=0.05)  # type: ignore[operator]
    assert found[330] == pytest.approx(found[130] * math.exp(-1.0), rel=0.02)
