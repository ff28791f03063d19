"""The presets for slow rotors hold on the Crazyflie (15.5 rad/s): case 1, both faults, neighbours, both plants."""

from __future__ import annotations

import pytest

import rotorfault as rf
from rotorfault.scenario.library import load_scenario
from rotorfault.scenario.neighbours import neighbour


@pytest.mark.parametrize("plant", ["paper_model", "rigid_body"])
@pytest.mark.parametrize("law", ["roismc", "smc"])
def test_gentle_flies_case_one_with_both_faults(law: str, plant: str) -> None:
    changes = {"vehicle": "crazyflie-2.1", "plant": plant, "duration": 8.0}
    scenario = load_scenario("paper-set-point", {**changes, "controller.kind": law, "controller.preset": "gentle"})
    summary = rf.fly(scenario).summary()
    assert summary["outcome"] == "settled"
    assert summary["settle_time"]["overall"] < 2.0
    assert [one["rotor"] for one in summary["detections"] if one["delay"] is not None] == [1, 3]
    for seed in (500, 501, 502, 503):
        assert rf.fly(neighbour(scenario, seed=seed)).summary()["survived"], seed
