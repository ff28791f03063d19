"""Another preset in place of the one that a checked scenario's settings started from."""

from __future__ import annotations

import pytest

from rotorfault.autopilot.control import CONTROLLER
from rotorfault.flight.assembly import overridden
from rotorfault.scenario.library import load_scenario
from rotorfault.scenario.scenario import Scenario


def hover(**controller: object) -> Scenario:
    return load_scenario("hover-fault", {f"controller.{key}": value for key, value in controller.items()})


@pytest.mark.parametrize("kind", ["roismc", "smc"])
@pytest.mark.parametrize("preset", ["paper", "gentle", "none"])
def test_a_checked_scenario_takes_another_preset_as_a_file_does(kind: str, preset: str) -> None:
    tuned, asked = hover(kind=kind), hover(kind=kind, preset=preset)
    assert tuned[CONTROLLER].settings != asked[CONTROLLER].settings
    assert overridden(tuned, {"controller.preset": preset}, "test") == asked
    assert overridden(asked, {"controller.preset": "tuned"}, "test") == tuned


def test_settings_that_are_of_no_preset_stay() -> None:
    own = {"controller.cascade.filter_bandwidth": 12.5, "controller.preset": "gentle"}
    assert overridden(hover(), own, "test") == load_scenario("hover-fault", own)
    first = overridden(hover(), {"controller.cascade.filter_bandwidth": 12.5}, "test")
    assert overridden(first, {"controller.preset": "gentle"}, "test") == load_scenario("hover-fault", own)
