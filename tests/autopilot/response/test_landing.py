"""Landing as the response of the autopilot to a fault: when it begins, how it descends, when it stops."""

from __future__ import annotations

import numpy as np
import pytest

from rotorfault.autopilot.instant import Decision
from rotorfault.autopilot.prediction import Expectation
from rotorfault.autopilot.response.land import Land, LandTelemetry
from rotorfault.autopilot.response.protocol import ResponseInputs
from rotorfault.maths.geometry import PerRotor, Vec3, zeros
from rotorfault.maths.rotation import Quat
from rotorfault.model.block import Context
from rotorfault.model.signals import Diagnosis, Estimate, Reference, healthy, motion_of
from rotorfault.model.vehicle import Vehicle

DT = 0.01
HOVER = Reference(Vec3(1.0, 2.0, 3.0), zeros(), zeros(), 0.0, 0.0, 0.0)


class Pilot:
    """The block `land` alone, with a vehicle that follows its reference exactly unless told otherwise."""

    def __init__(self, vehicle: Vehicle, **settings: float) -> None:
        self.block, self.vehicle = Land(Land.Settings(**settings)), vehicle
        self.parameters = self.block.parameters(Context(vehicle, DT))
        self.at = HOVER
        self.weight = vehicle.mass * vehicle.gravity
        self.memory = self.block.initial(self.inputs(healthy(), 1.0, 0.0), self.parameters)
        self.recorded = LandTelemetry(0.0, 0.0)

    def estimate(self, **seen: Vec3) -> Estimate:
        return Estimate(self.at.p_W, self.at.v_W, Quat.about_z(self.at.yaw), zeros())._replace(**seen)

    def inputs(self, told: Diagnosis, share: float, lift: float, **seen: Vec3) -> ResponseInputs:
        """Believed thrust as share of the weight, on the rotors that no fault hits; unexplained lift in g."""
        estimate = self.estimate(**seen)
        now = motion_of(estimate)
        third = share * self.weight / 3.0
        expectation = Expectation(
            now=now,
            previous=now._replace(v_W=now.v_W - Vec3(0.0, 0.0, lift * self.vehicle.gravity * DT)),
            mean_thrust=PerRotor.all(0.0),
            thrust=PerRotor(third, third, 0.0, third),
            residual_speed=0.0,
            speed=PerRotor.all(0.0),
            sped=PerRotor.all(0.0),
            direct_acceleration_W=zeros(),
            elapsed=0.0,  # so that the model explains no change of the velocity
        )
        return ResponseInputs(estimate, HOVER, told, expectation, self.vehicle)

    def step(
        self, flag: float = 0.0, share: float = 1.0, lift: float = 0.0, told: Diagnosis | None = None, **seen: Vec3
    ) -> Decision:
        """One instant with rotor 3 flagged, or with another diagnosis."""
        if told is None:
            told = healthy()._replace(flagged=PerRotor(0.0, 0.0, flag, 0.0), loss=PerRotor(0.0, 0.0, 0.3 * flag, 0.0))
        inputs = self.inputs(told, share, lift, **seen)
        self.memory, decision, recorded = self.block.step(self.memory, inputs, self.parameters, DT)
        assert isinstance(recorded, LandTelemetry)
        self.recorded = recorded
        self.at = decision.reference
        return decision


def test_without_a_flag_nothing_happens(paper_vehicle: Vehicle) -> None:
    """Whatever else looks like ground: only a declared fault begins a landing."""
    pilot = Pilot(paper_vehicle)
    for _ in range(300):
        decided = pilot.step(flag=0.0, share=0.1, lift=1.0)
        assert decided == Decision(HOVER, healthy(), 0.0, 0.0)


def test_a_flag_must_stand_to_count(paper_vehicle: Vehicle) -> None:
    pilot = Pilot(paper_vehicle, confirmation=0.05)
    for _ in range(10):  # 40 ms, then gone
        assert all(pilot.step(flag=1.0).stage == 0.0 for _ in range(4))
        assert pilot.step(flag=0.0).stage == 0.0
    stages = [pilot.step(flag=1.0).stage for _ in range(6)]
    assert stages == [0.0] * 4 + [1.0] * 2


def test_it_begins_once_and_stays(paper_vehicle: Vehicle) -> None:
    """A flag that is cleared and raised again neither ends the landing nor begins it anew."""
    pilot = Pilot(paper_vehicle)
    for _ in range(10):
        pilot.step(flag=1.0)
    before = pilot.at
    for flag in [0.0] * 50 + [1.0] * 50:
        assert pilot.step(flag=flag).stage == 1.0
    after = pilot.at
    assert before.p_W.z - 1.0 < after.p_W.z < before.p_W.z - 0.2
    assert (after.p_W.x, after.p_W.y, after.yaw) == (before.p_W.x, before.p_W.y, before.yaw)


def test_the_reference_brakes_gently_and_its_derivatives_fit(paper_vehicle: Vehicle) -> None:
    """From 3 m/s: never above the braking limit, position and velocity are integrals, then straight down."""
    pilot = Pilot(paper_vehicle, descent_rate=0.4, braking=2.0, confirmation=0.0)
    pilot.at = HOVER._replace(v_W=Vec3(3.0, -1.0, 0.5), yaw=0.7)
    begun = pilot.estimate()
    path = [pilot.step(flag=1.0).reference for _ in range(800)]
    assert path[0].p_W == begun.p_W
    assert path[0].v_W == begun.v_W
    v = np.array([[*r.v_W] for r in path])
    p, a = np.array([[*r.p_W] for r in path]), np.array([[*r.a_W] for r in path])
    np.testing.assert_allclose(np.diff(v, axis=0), a[:-1] * DT, atol=1e-12)
    np.testing.assert_allclose(np.diff(p, axis=0), 0.5 * (v[1:] + v[:-1]) * DT, atol=1e-12)
    assert np.linalg.norm(a, axis=1).max() <= 2.0 + 1e-9
    np.testing.assert_allclose(v[-1], [0.0, 0.0, -0.4], atol=1e-3)
    fast = np.hypot(v[:, 0], v[:, 1]) > 0.4
    assert (v[fast, 2] > -0.05).all(), "no descent before it has slowed down"
    assert all(r.yaw == 0.7 for r in path)


def descending(vehicle: Vehicle) -> Pilot:
    pilot = Pilot(vehicle, confirmation=0.0)
    for _ in range(400):
        assert pilot.step(flag=1.0).stage == 1.0
    return pilot


def test_no_touch_down_in_flight(paper_vehicle: Vehicle) -> None:
    """Neither low thrust while it sinks, nor standing still with full thrust, nor both for a moment."""
    pilot = descending(paper_vehicle)
    for _ in range(100):
        assert pilot.step(flag=1.0, share=0.3).stage == 1.0
    for _ in range(100):
        assert pilot.step(flag=1.0, share=1.0, v_W=zeros()).stage == 1.0
    for _ in range(10):
        assert [pilot.step(flag=1.0, share=0.3, v_W=zeros()).stage for _ in range(29)] == [1.0] * 29
        assert pilot.step(flag=1.0).stage == 1.0


def test_touch_down_stops_the_rotors_for_good(paper_vehicle: Vehicle) -> None:
    pilot = descending(paper_vehicle)
    stood = pilot.at.p_W
    stages = [pilot.step(flag=1.0, share=0.3, v_W=zeros(), p_W=stood).stage for _ in range(31)]
    assert stages[28:] == [1.0, 2.0, 2.0]
    for flag in (0.0, 1.0):
        decided = pilot.step(flag=flag, share=1.0, v_W=Vec3(0.0, 0.0, -3.0))
        assert (decided.stage, decided.relief) == (2.0, 1.0)
        assert decided.reference.p_W == stood
        assert decided.reference.v_W == zeros()


def test_rotors_that_are_believed_dead_carry_nothing(paper_vehicle: Vehicle) -> None:
    """Thrust enough of sound rotors, that is, and none of those that are believed."""
    pilot = descending(paper_vehicle)
    dead = healthy()._replace(loss=PerRotor(1.0, 1.0, 0.3, 1.0), flagged=PerRotor.all(1.0))
    stages = [pilot.step(told=dead, share=1.0, v_W=zeros()).stage for _ in range(31)]
    assert stages[28:] == [1.0, 2.0, 2.0]


def test_contact_takes_thrust_back_and_holds_the_belief_until_it_is_over(paper_vehicle: Vehicle) -> None:
    pilot = descending(paper_vehicle)
    for _ in range(20):
        decided = pilot.step(flag=1.0, lift=0.5)
    assert 0.8 < decided.relief < 1.0
    assert pilot.recorded.relief == decided.relief
    assert pilot.recorded.lift == pytest.approx(0.5 * paper_vehicle.gravity, rel=1e-4)
    wrong = healthy()._replace(loss=PerRotor.all(0.9), flagged=PerRotor.all(1.0))
    held = pilot.step(told=wrong, lift=0.5).diagnosis
    assert held.loss == PerRotor(0.0, 0.0, 0.3, 0.0)
    assert held.flagged == PerRotor(0.0, 0.0, 1.0, 0.0)
    for _ in range(40):
        decided = pilot.step(flag=1.0)
    assert decided.relief < 0.01, "it was a gust"
    assert pilot.step(told=wrong).diagnosis == wrong
    for _ in range(40):
        assert pilot.step(flag=1.0, lift=-0.5).relief < 0.01, "a loss pulls down"
