"""A flagged rotor that does not follow its command is believed stuck; one that lost a share is not."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from gates import needs_simd

import rotorfault as rf
from rotorfault.autopilot.diagnosis import fault_free
from rotorfault.autopilot.diagnosis.following import following_parameters
from rotorfault.autopilot.diagnosis.model_settings import ModelSettings
from rotorfault.model.block import Context
from rotorfault.model.mixer import hover_thrust
from rotorfault.model.sensor_model import SensorModel, SensorNoise
from rotorfault.model.vehicle_file import load_vehicle
from rotorfault.scenario.scenario import scenario_from

VEHICLE = load_vehicle("hummingbird").vehicle
HOVER = float(hover_thrust(VEHICLE).r2)


def flown(kind: str, fault: dict[str, Any]) -> Any:
    tables = {
        "name": "stuck", "vehicle": "hummingbird", "duration": 1.0, "period": 0.001, "sensors": "noisy",
        "controller": {"kind": "roismc", "preset": "gentle"}, "diagnosis": kind,
        "reference": {"kind": "set_point", "position": [0.0, 0.0, 0.0]},
        "wind": {"kind": "dryden", "wind_at_6m": 5.0},
        "fault": [{"rotor": 2, "time": 0.5, **fault}],
    }  # fmt: skip
    return rf.fly(scenario_from(tables, "test"), engine="simd").data


@needs_simd
@pytest.mark.parametrize("kind", ["multiple_model", "effectiveness_kalman"])
def test_a_rotor_that_stands_still_is_believed_stuck(kind: str) -> None:
    data = flown(kind, {"kind": "stuck", "thrust": 0.4 * HOVER})
    probability, given = data["diagnosis.stuck"].values, data["diagnosis.stuck_thrust"].values
    sure = probability[:, 1] > 0.99
    assert sure[500:].mean() > 0.1
    assert not (probability[:, [0, 2, 3]] > 0.99).any()
    believed = given[given[:, 1] > 0.0, 1][-50:]
    assert abs(np.median(believed) - 0.4 * HOVER) < 0.2 * HOVER


@needs_simd
@pytest.mark.parametrize("loss", [0.3, 0.6])
def test_a_rotor_that_lost_a_share_is_not(loss: float) -> None:
    data = flown("multiple_model", {"kind": "step", "loss": loss})
    assert data["fault_flag"].values[600:, 1].all()
    assert (data["diagnosis.stuck_thrust"].values > 0.0).mean() < 0.01


def test_noise_makes_it_late() -> None:
    def late(noise: float) -> float:
        context = Context(VEHICLE, 0.001, SensorModel(rates=SensorNoise(noise)))
        model = fault_free.model_parameters(ModelSettings(), context)
        return float(following_parameters(context, model, 0.25).lateness)

    # The root of the noise: R is its square, of which the fourth root counts.
    assert late(0.08) == pytest.approx(2.0 * late(0.02))
