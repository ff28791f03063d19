"""A belief that was not found in the motion is acted on while the motion bears it out."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from gates import needs_simd

import rotorfault as rf
from rotorfault.autopilot.diagnosis.borne_out import acted_on, nothing_claimed
from rotorfault.autopilot.prediction import Expectation, predict
from rotorfault.maths.geometry import PerRotor, Vec3, zeros
from rotorfault.model.mixer import hover_thrust
from rotorfault.model.signals import Diagnosis, Motion, Stuck
from rotorfault.model.vehicle import rotor_speeds
from rotorfault.model.vehicle_file import load_vehicle
from rotorfault.scenario.scenario import scenario_from

VEHICLE = load_vehicle("crazyflie-2.1").vehicle
NONE = PerRotor.all(0.0)
UP = Vec3(0.0, 0.0, 1.0)
DT = 0.001


def told(**values: PerRotor) -> Diagnosis:
    loss = values.get("loss", NONE)
    stuck = Stuck(values["rotor"], values["thrust"]) if "rotor" in values else None
    flagged = loss.map(lambda x: float(x > 0.0)) if stuck is None else values["rotor"]
    return Diagnosis(loss, flagged, loss, NONE, stuck=stuck)


def doubted(true: PerRotor, belief: Diagnosis, steps: int, offset: Vec3 | None = None, seed: int = 0) -> list[bool]:
    """Whether a belief is doubted, step by step, of a body that turns as its true losses have it, from hover."""
    rng = np.random.default_rng(seed)
    memory, thrust = nothing_claimed(), hover_thrust(VEHICLE)
    omega = read = zeros()
    found = []
    healthy, quiet = told(), 400
    for k in range(quiet + steps):
        loss = true if k >= quiet else NONE
        speed = rotor_speeds(VEHICLE, thrust)
        now = Motion(zeros(), read, UP)
        e = Expectation(now, now, thrust, thrust, 0.0, speed, NONE, zeros(), DT)
        turned = predict(e, loss, VEHICLE).delta_omega_B + (zeros() if offset is None else offset * DT)
        omega = omega + turned
        after = omega + Vec3(*rng.normal(0.0, 0.005, 3))
        e = e._replace(now=Motion(zeros(), after, UP))
        read = after
        memory, diagnosis = acted_on(memory, belief if k >= quiet else healthy, e, VEHICLE)
        if k >= quiet:
            found.append(bool(memory.doubted))
            assert (sum(diagnosis.flagged) == 0.0) == bool(memory.doubted)
    return found


RIGHT = PerRotor(0.0, 0.4, 0.0, 0.0)


@pytest.mark.parametrize("share", [0.5, 1.0, 1.5])
def test_the_right_rotor_is_believed_whatever_the_size(share: float) -> None:
    assert not any(doubted(RIGHT, told(loss=RIGHT * share), 200))


@pytest.mark.parametrize(
    "belief",
    [
        told(loss=PerRotor(0.4, 0.0, 0.0, 0.0)),
        told(loss=PerRotor(0.0, 0.0, 0.4, 0.0)),
        told(loss=PerRotor(0.0, 0.0, 1.0, 0.0)),
        told(rotor=PerRotor(0.0, 0.0, 1.0, 0.0), thrust=PerRotor(0.0, 0.0, 1.5 * hover_thrust(VEHICLE).r1, 0.0)),
    ],
)
@pytest.mark.parametrize("true", [NONE, RIGHT])
def test_another_rotor_is_not_believed_for_long(belief: Diagnosis, true: PerRotor) -> None:
    assert all(doubted(true, belief, 200)[20:])


def test_what_always_turns_the_vehicle_is_no_evidence() -> None:
    """A shifted centre of mass that turns it as much as the loss does."""
    offset = Vec3(40.0, -40.0, 0.0)
    assert not any(doubted(RIGHT, told(loss=RIGHT), 200, offset))
    assert all(doubted(NONE, told(loss=RIGHT), 200, offset)[40:])


def test_noise_alone_does_not_move_it_to_and_fro() -> None:
    """A loss too small to be seen at once: it is acted on or not, and changes seldom."""
    small = PerRotor(0.0, 0.01, 0.0, 0.0)
    for seed in range(5):
        found = np.array(doubted(small, told(loss=small), 400, seed=seed))
        assert np.abs(np.diff(found.astype(int))).sum() <= 2


def flown(engine: str, **made_up: Any) -> np.ndarray:
    tables = {
        "name": "told", "vehicle": "hummingbird", "duration": 0.3, "period": 0.001, "sensors": "noisy",
        "controller": {"kind": "roismc", "preset": "gentle"},
        "reference": {"kind": "set_point", "position": [0.0, 0.0, 0.0]},
        "fault": [{"kind": "step", "rotor": 3, "time": 0.08, "loss": 0.25}],
        "diagnosis": {"kind": "injected", "loss": 0.25, "time": 0.1, "end": 0.2, **made_up},
    }  # fmt: skip
    believed: np.ndarray = rf.fly(scenario_from(tables, "test"), engine=engine).data["loss_believed"].values
    return believed


@pytest.mark.parametrize("engine", ["python", pytest.param("simd", marks=needs_simd)])
def test_in_flight_a_right_belief_is_acted_on_while_it_lasts_and_a_wrong_one_is_not(engine: str) -> None:
    right = flown(engine, rotor=3)
    assert right[105].tolist() == right[195].tolist() == [0.0, 0.0, 0.25, 0.0]
    assert not right[:99].any()
    assert not right[202:].any()
    wrong = flown(engine, rotor=1)
    assert not wrong[120:].any()


@needs_simd
def test_a_neighbour_that_is_believed_stuck_high_loses_no_crazyflie() -> None:
    """A rotor at half of its thrust, and the wrong one believed stuck: all were lost before."""
    tables = {
        "name": "told", "vehicle": "crazyflie-2.1", "duration": 3.0, "period": 0.001, "sensors": "noisy",
        "controller": {"kind": "roismc", "preset": "gentle"},
        "reference": {"kind": "set_point", "position": [0.0, 0.0, 0.0]},
        "wind": {"kind": "dryden", "wind_at_6m": 8.0},
        "fault": [{"kind": "step", "rotor": 2, "time": 1.0, "loss": 0.5}],
        "diagnosis": {"kind": "injected", "rotor": 3, "stuck": 1.5, "time": 1.05, "end": 1.55},
    }  # fmt: skip
    table = rf.fly_many(scenario_from(tables, "test"), {"seed": range(8)}, warn=False).table
    assert np.asarray(table["survived"], dtype=bool).all()
