"""What about the vehicles of a scenario is hardly meant: the one that is believed, and the true one."""

from __future__ import annotations

import warnings

from rotorfault.base.errors import VehicleWarning
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


def warn_of_vehicle(scenario: Scenario, stacklevel: int = 2) -> None:
    """Warn (`VehicleWarning`) of each of `vehicle_lines`.

    Parameters
    ----------
    scenario : Scenario
    stacklevel : int
        Of the function that calls this one, whose caller the warning is for: 2.
    """
    for line in vehicle_lines(scenario):
        warnings.warn(line, VehicleWarning, stacklevel=stacklevel + 1)
