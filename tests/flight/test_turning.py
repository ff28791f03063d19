"""Flights that turn: circles at a held heading, spins on the spot, and outcomes that see yaw."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from gates import needs_simd

import rotorfault as rf


def yaw_gap(flight: rf.Flight) -> np.ndarray[Any, Any]:
    """Heading less the reference's yaw at each record, in rad, the short way round."""
    gap = flight.data["attitude"].values[:, 2] - flight.data["yaw_reference"].values
    return np.arctan2(np.sin(gap), np.cos(gap))


def circle(vehicle: str, speed: float, **more: Any) -> dict[str, Any]:
    """A circle of 1 m at a rate in rad/s, heading held."""
    return {
        "name": "circle",
        "vehicle": vehicle,
        "duration": 6.0,
        "period": 0.002,
        "diagnosis": "off",
        "start": {"position": [0.0, 1.0, 1.0], "velocity": [speed, 0.0, 0.0]},
        "reference": {
            "kind": "sinusoid",
            "amplitude": [1.0, 1.0, 0.0],
            "frequency": [speed, speed, 0.0],
            "phase": [0.0, math.pi / 2.0, 0.0],
            "offset": [0.0, 0.0, 1.0],
        },
        **more,
    }


@needs_simd
@pytest.mark.parametrize("law", ["roismc", "smc", "ismc", "sdre"])
def test_a_heading_is_held_on_a_fast_circle(law: str) -> None:
    flight = rf.fly(circle("paper", 3.0), controller=law)
    assert flight.summary()["tilt_max"] > 0.6
    assert np.abs(yaw_gap(flight)[1500:]).max() < 0.1
    if law == "roismc":  # the others fly a circle that is too small by more than 5 % of its width
        assert flight.summary()["outcome"] == "tracked"
        assert flight.summary()["late_yaw_rms"] < 0.03


@needs_simd
def test_euler_rates_taken_for_body_rates_lose_the_heading() -> None:
    """As the paper's literal law does; the outcome says so."""
    flight = rf.fly(circle("paper", 3.0), controller="roismc", settings={"controller.cascade.tracking": "euler"})
    assert np.abs(yaw_gap(flight)[1500:]).max() > 1.0
    assert flight.summary()["outcome"] == "offset"
    assert flight.summary()["late_yaw_rms"] > 1.0


def spin(vehicle: str, rate: float, law: str = "smc", preset: str = "gentle", **more: Any) -> dict[str, Any]:
    """Turning on the spot from rest to a rate in rad/s within 4 s, then on at it."""
    points = [
        {"time": 0.5, "position": [0.0, 0.0, 1.0]},
        # Half of a minimum-jerk way: fastest in its middle, at 1.875 times its mean rate.
        {"time": 8.5, "position": [0.0, 0.0, 1.0], "yaw": 8.0 * rate / 1.875},
    ]
    return {
        "name": "spin",
        "vehicle": vehicle,
        "duration": 8.0,
        "period": 0.002,
        "diagnosis": "off",
        "controller": {"kind": law, "preset": preset},
        "start": {"position": [0.0, 0.0, 1.0]},
        "reference": {"kind": "waypoints", "points": points},
        **more,
    }


@needs_simd
@pytest.mark.parametrize("vehicle", ["hummingbird", "crazyflie-2.1", "paper"])
@pytest.mark.parametrize("law", ["smc", "roismc"])
def test_it_spins_on_the_spot_at_what_the_plant_allows(vehicle: str, law: str) -> None:
    flight = rf.fly(spin(vehicle, 18.0, law))
    summary = flight.summary()
    assert summary["outcome"] == "tracked"
    assert flight.data["body_rates"].values[:, 2].max() > 17.5
    assert summary["tilt_max"] < 0.01
    assert np.abs(yaw_gap(flight)).max() < 0.05


@needs_simd
def test_it_spins_in_a_wind() -> None:
    """A tilt held in the world is a tilt that turns in the body: the rotors' lag must not turn it away."""
    wind = {"kind": "constant", "velocity_W": [2.0, 0.0, 0.0]}
    flight = rf.fly(spin("hummingbird", 10.0, "roismc", wind=wind))
    assert flight.summary()["outcome"] == "tracked"
    assert flight.summary()["late_position_rms"] < 0.02
    assert np.abs(yaw_gap(flight)).max() < 0.05


@needs_simd
def test_constant_place_and_turning_yaw_is_no_constant_reference() -> None:
    points = [
        {"time": 0.0, "position": [0.0, 0.0, 0.0]},
        {"time": 20.0, "position": [0.0, 0.0, 0.0], "yaw": 427.0},
    ]
    reference = {"kind": "waypoints", "points": points}
    base = {"name": "turning", "vehicle": "paper", "duration": 4.0, "period": 0.002, "reference": reference}
    assert rf.fly(base | {"diagnosis": "off"}, controller="smc").summary()["outcome"] == "tracked"


@needs_simd
@pytest.mark.parametrize(("yaw", "outcome"), [(0.0, "settled"), (1.0, "offset")])
def test_a_place_held_at_another_heading_is_not_settled(yaw: float, outcome: str) -> None:
    class Holds:
        """Keeps place and level well enough, and the heading at 0 whatever is wanted."""

        def update(self, time: float, m: Any, reference: Any, v: Any) -> rf.Wrench:
            e, w = m.attitude, m.omega_B
            torque = rf.Vec3(
                -v.inertia.x * (60.0 * e.x + 15.0 * w.x),
                -v.inertia.y * (60.0 * e.y + 15.0 * w.y),
                -v.inertia.z * (20.0 * e.z + 8.0 * w.z),
            )
            return rf.Wrench(v.mass * (v.gravity - 4.0 * (m.p_W.z - reference.p_W.z) - 3.0 * m.v_W.z), torque)

    task = {
        "name": "heading",
        "vehicle": "hummingbird",
        "duration": 2.0,
        "period": 0.002,
        "diagnosis": "off",
        "start": {"position": [0.0, 0.0, 1.0]},
        "reference": {"kind": "set_point", "position": [0.0, 0.0, 1.0], "yaw": yaw},
    }
    summary = rf.fly(task, controller=Holds()).summary()
    assert summary["outcome"] == outcome
    assert summary["yaw_error_end"] == pytest.approx(-yaw, abs=1e-6)
