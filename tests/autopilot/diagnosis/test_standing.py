"""A rotor that stands still by its speed: found within periods that follow; no loss, no broken sensor is blamed."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from gates import needs_simd

import rotorfault as rf
from rotorfault.model.mixer import hover_thrust
from rotorfault.model.vehicle_file import load_vehicle
from rotorfault.scenario.scenario import Scenario, scenario_from

VEHICLE = load_vehicle("hummingbird").vehicle
HOVER = float(hover_thrust(VEHICLE).r2)
DETECTORS = ("luenberger", "effectiveness_kalman", "glr", "multiple_model")
ONSET, PERIOD = 0.5, 0.001
# The reading is 2 ms late and comes every 2 ms; then its level holds for `persistence`.
LATEST = 0.002 + 0.002 + 0.008
SQUARE = {"kind": "square", "amplitude": [2.0, 2.0, 0.5], "period": [4.0, 5.0, 6.0], "time_constant": [0.4] * 3}


def tables(kind: str, faults: list[dict[str, Any]], speeds: bool = True, **other: Any) -> Scenario:
    made = {
        "name": "standing", "vehicle": "hummingbird", "duration": 0.8, "period": PERIOD, "estimator": "eskf",
        "sensors": {"kind": "mocap", "rotor_speeds": {"on": speeds}}, "diagnosis": kind,
        "controller": {"kind": "roismc", "preset": "gentle"},
        "reference": {"kind": "set_point", "position": [0.0, 0.0, 0.0]},
        "wind": {"kind": "dryden", "wind_at_6m": 5.0}, "fault": faults, **other,
    }  # fmt: skip
    return scenario_from(made, "test")


def stuck(share: float) -> dict[str, Any]:
    return {"kind": "stuck", "rotor": 2, "time": ONSET, "thrust": share * HOVER}


@needs_simd
@pytest.mark.parametrize("share", [0.4, 1.75])
@pytest.mark.parametrize("kind", DETECTORS)
def test_low_or_high_it_is_named_within_two_readings_and_its_persistence(kind: str, share: float) -> None:
    # In flight 7 the observer takes gusts for faults of two others, with speeds or without.
    table = rf.fly_many(tables(kind, [stuck(share)]), {"seed": np.arange(7)}, warn=False).table
    delay = table["detected.2"] - table["onset.2"]
    assert (delay <= LATEST + 1e-6).all()
    assert (table["false_alarms"] == 0).all()


@needs_simd
@pytest.mark.parametrize("kind", DETECTORS)
def test_it_is_believed_to_give_the_thrust_of_its_speed(kind: str) -> None:
    data = rf.fly(tables(kind, [stuck(1.4)]), engine="simd").data
    given = data["diagnosis.stuck_thrust"].values
    assert given[-1, 1] == pytest.approx(1.4 * HOVER, rel=0.02)
    assert (given[:, [0, 2, 3]] == 0.0).all()


@needs_simd
@pytest.mark.parametrize("loss", [0.3, 1.0])
@pytest.mark.parametrize("kind", DETECTORS)
def test_a_loss_is_not_blamed_on_a_speed(kind: str, loss: float) -> None:
    """A rotor without blades turns as commanded: it is flagged by the motion, as lost, and not as stuck."""
    fault = {"kind": "step", "rotor": 2, "time": ONSET, "loss": loss}
    data = rf.fly(tables(kind, [fault]), engine="simd").data
    assert data["fault_flag"].values[-1, 1] == 1.0
    assert (data["diagnosis.stuck_thrust"].values == 0.0).all()
    assert data["loss_believed"].values[-1, 1] == pytest.approx(loss, abs=0.12)


@needs_simd
@pytest.mark.parametrize("kind", DETECTORS)
def test_a_silent_sensor_leaves_the_numbers_without_speeds(kind: str) -> None:
    silent = {"kind": "sensor_dropout", "sensor": "rotor_speeds", "start": 0.0, "end": 9.0}
    loss = {"kind": "step", "rotor": 2, "time": ONSET, "loss": 0.4}
    one = rf.fly(tables(kind, [silent, loss]), engine="simd").data
    other = rf.fly(tables(kind, [loss], speeds=False), engine="simd").data
    for name in ("fault_flag", "loss_estimated", "loss_believed", "thrust_command"):
        np.testing.assert_allclose(one[name].values, other[name].values, rtol=1e-6, atol=1e-9)


@needs_simd
def test_a_frozen_speed_is_nobodys_fault() -> None:
    """In hard turns, where rotors do what a frozen speed says that they do not."""
    frozen = {"kind": "sensor_freeze", "sensor": "rotor_speeds", "start": 0.3, "end": 2.0}
    scenario = tables("multiple_model", [frozen], reference=SQUARE, duration=2.0)
    table = rf.fly_many(scenario, {"seed": np.arange(10)}, warn=False).table
    assert (table["false_alarms"] == 0).all()
    assert table["survived"].all()


@needs_simd
@pytest.mark.parametrize("kind", DETECTORS)
def test_engines_agree(kind: str) -> None:
    scenario = tables(kind, [{**stuck(1.3), "time": 0.05}], duration=0.1)
    found = {engine: rf.fly(scenario, engine=engine).data for engine in ("python", "simd")}
    for name in ("fault_flag", "loss_estimated", "diagnosis.stuck_thrust", "thrust_command"):
        np.testing.assert_allclose(found["python"][name].values, found["simd"][name].values, rtol=1e-7, atol=1e-9)
    assert found["simd"]["fault_flag"].values[-1, 1] == 1.0
