"""What about the wind of a flight is hardly meant: stronger than any storm, or a gust front that comes too late."""

from __future__ import annotations

import math
from collections.abc import Iterator

from rotorfault.plant import WIND
from rotorfault.plant.wind_in_space import InSpace, shear_factor, space_numbers
from rotorfault.scenario.scenario import Scenario

STORM = 70.0  # m/s: from here on the Saffir-Simpson scale has its highest category
HEIGHT = 10.0  # m, at which weather services give winds


def wind_lines(scenario: Scenario) -> Iterator[str]:
    """A line for each thing.

    Parameters
    ----------
    scenario : Scenario
    """
    settings = getattr(scenario[WIND].make(), "settings", None)
    if not isinstance(settings, InSpace):
        return
    level = math.hypot(*settings.velocity_W)
    strengths = {"velocity_W": level, "wind_at_6m": getattr(settings, "wind_at_6m", 0.0)}
    if settings.front is not None:
        strengths["front.velocity_W"] = math.hypot(*settings.front.velocity_W)
    for key, strength in strengths.items():
        if strength > STORM:
            yield (
                f"wind.{key}: {strength:.4g} m/s, but hurricanes of the highest category begin at {STORM:g} m/s; "
                "check its unit (1 m/s = 3.6 km/h = 1.94 knots)"
            )
    front, shear = settings.front, settings.shear
    if front is not None:
        begins = front.arrival - front.length / front.speed
        if begins >= scenario.duration:
            yield (
                f"wind.front begins at the origin at {begins:.4g} s, after the end of the flight at "
                f"{scenario.duration:g} s; wind.front.arrival is when it is strongest there"
            )
        elif front.shape == "pulse" and front.arrival + front.length / front.speed <= 0.0:
            yield f"wind.front has passed the origin before the flight: arrival is {front.arrival:g} s"
    if shear is not None and level <= STORM:
        z = HEIGHT + shear.ground
        above = level * float(shear_factor(z, shear.law, space_numbers(settings).shear))
        if above > STORM:
            yield (
                f"wind.shear: {level:.4g} m/s at reference_height {shear.reference_height:g} m are {above:.4g} "
                f"m/s at {HEIGHT:g} m, more than the strongest hurricanes have; check wind.shear.reference_height"
            )
        start = scenario.start.position[2] - shear.ground
        if start < 0.0:
            yield (
                f"wind.shear counts heights from wind.shear.ground = {shear.ground:g} m, and the flight starts "
                f"{-start:.4g} m below it, where no wind blows"
            )
