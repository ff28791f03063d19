"""What is counted of a landing, of flights whose signals are made up: touching the ground is gentle or a crash."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from made_up_scores import TIME, scored, summarised

STEP = {"kind": "step", "loss": 0.25}
LANDING: dict[str, Any] = {"ground": 0.0, "on_fault": {"kind": "land"}, "fault": [{**STEP, "rotor": 1, "time": 0.2}]}
FORCE = np.where(np.arange(101) >= 5, 10.0, 0.0)
DOWN: dict[str, Any] = {
    "landing_stage": 1.0, "ground_force": FORCE, "position": np.outer(FORCE > 0.0, [0.0, 0.0, -0.002]),
}  # fmt: skip


@pytest.mark.parametrize(
    ("more", "crashed"),
    [
        ({}, False),
        ({"velocity": [0.49, 0.0, -0.99], "attitude": [0.26, 0.0, 0.0]}, False),
        ({"velocity": [0.0, 0.0, -1.01]}, True),
        ({"velocity": [0.0, 0.51, 0.0]}, True),
        ({"attitude": [0.0, 0.27, 0.0]}, True),
        # Contact has braked it by the instant at which it shows.
        ({"velocity": np.outer(FORCE == 0.0, [0.0, 0.0, -3.0])}, True),
        # Pressed into the ground by more than its legs are long.
        ({"position": np.outer(FORCE > 0.0, [0.0, 0.0, -0.2])}, True),
        # A touch that cannot be felt is none: 0.1 N of 17.
        ({"velocity": [2.0, 0.0, 0.0], "ground_force": 0.01 * FORCE}, False),
        # Nobody knows of one that is no number.
        ({"velocity": [2.0, 0.0, 0.0], "ground_force": np.where(FORCE > 0.0, np.nan, 0.0)}, True),
    ],
)
@pytest.mark.parametrize("stage", [0.0, 1.0])
def test_a_touch_is_gentle_or_a_crash(more: dict[str, Any], crashed: bool, stage: float) -> None:
    """At 0.5 s the ground is touched, in a landing or not; the limits are on speed down, sideways, tilt and depth."""
    row = scored(tables=LANDING, **{**DOWN, "landing_stage": stage, **more})
    assert (row["outcome"] == "ground") is crashed, row["outcome"]
    if crashed:
        assert row["end_time"] == pytest.approx(0.5)


def test_a_landing_is_over_after_half_a_second_at_rest() -> None:
    """Confirmed at 0.3 s, touched at 0.5 s with the speed of the instant before, rotors stopped at 0.8 s."""
    stage = np.select([TIME < 0.3 - 1e-9, TIME < 0.8 - 1e-9], [0.0, 1.0], 2.0)
    drift = np.stack([0.3 + 0.5 * TIME, 0.0 * TIME, np.where(FORCE > 0.0, -0.002, 0.1)], axis=1)
    drift[6:, 0] = 7.0  # what happens on the ground counts no more
    speed = np.outer(FORCE == 0.0, [0.3, 0.4, -0.6])
    summary = summarised(
        tables=LANDING, landing_stage=stage, ground_force=FORCE, position=drift, velocity=speed,
        attitude=np.outer(FORCE == 0.0, [0.1, 0.0, 0.0]),
    )  # fmt: skip
    assert summary["outcome"] == "landed"
    assert summary["end_time"] == pytest.approx(0.8 + 0.5)
    assert summary["landing"] == pytest.approx(
        {
            "fault_time": 0.2, "confirmed_time": 0.3, "touch_down_time": 0.5, "rotors_stopped_time": 0.8,
            "speed": 0.6, "horizontal_speed": 0.5, "tilt": 0.1, "distance": 0.5 * 0.3, "yaw_rate": 0.0,
        }
    )  # fmt: skip
    assert math.isnan(summary["settle_time"]["overall"])


def test_without_a_landing_there_are_no_numbers_of_one() -> None:
    assert summarised(tables=LANDING)["landing"] is None
    assert summarised()["landing"] is None
    begun = summarised(tables=LANDING, landing_stage=np.where(TIME < 0.3 - 1e-9, 0.0, 1.0), position=[0.0, 0.0, 5.0])
    assert begun["landing"]["confirmed_time"] == pytest.approx(0.3)
    assert math.isnan(begun["landing"]["touch_down_time"])
