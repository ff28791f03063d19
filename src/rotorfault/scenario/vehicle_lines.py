"""What about the vehicles of a scenario is hardly meant: the one that is believed, and the true one."""

from __future__ import annotations

from rotorfault.model.vehicle_check import vehicle_warnings
from rotorfault.scenario.scenario import Scenario


def vehicle_lines(scenario: Scenario) -> list[str]:
    """A line for each thing that `rotorfault.model.vehicle_check` has to say; empty if there is none.

    Parameters
    ----------
    scenario : Scenario
    """
    believed = scenario.vehicle.vehicle
    lines = vehicle_warnings(believed)
    # With the same numbers the true vehicle has the same lines; with others, those that came with the mismatch.
    more = [line for line in vehicle_warnings(scenario.mismatch.applied(scenario.vehicle)) if line not in lines]
    about = f"vehicle '{scenario.vehicle.name}'"
    return [f"{about}: {line}" for line in lines] + [f"{about} with its mismatch: {line}" for line in more]
