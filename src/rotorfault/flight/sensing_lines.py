"""What sensors that look at the ground do not read of a flight: flow and range have a nearest and a farthest."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from rotorfault.flight.reference_rows import heights_of
from rotorfault.model.block import Context
from rotorfault.plant import SENSORS
from rotorfault.plant.ground import GROUND
from rotorfault.plant.instruments import LOWEST, RangeFinder
from rotorfault.plant.sensor_sets import SensorSet
from rotorfault.reference import REFERENCE
from rotorfault.scenario.scenario import Scenario

SHARE = 0.05  # of the flight out of reach that is told: a landing, or a short way through, is bridged


def sensing_lines(scenario: Scenario) -> Iterator[str]:
    """A line where start or reference lie where the ground is not read, with what would mend it.

    Parameters
    ----------
    scenario : Scenario
    """
    sensors = scenario[SENSORS].make()
    if not isinstance(sensors, SensorSet):
        return
    finder = next((one for one in sensors.made.values() if isinstance(one, RangeFinder)), None)
    if finder is None:
        return
    farthest, ground = float(finder.settings.farthest), _ground(scenario)
    heights = heights_of(scenario) - ground
    x, y, z = scenario.start.position
    begin = z - ground
    outside = float(np.mean((heights < LOWEST) | (heights > farthest)))
    # Who stands at the start takes off from there; without ground it hangs there.
    starts = begin <= farthest and (begin >= LOWEST or scenario.maybe(GROUND) is not None)
    if starts and outside <= SHARE:
        return
    told = [] if starts else [f"the flight starts {begin:.4g} m above it"]
    if outside > SHARE:
        low, high = float(heights.min()), float(heights.max())
        span = f"{low:.4g} m" if high - low < 1e-3 else f"{low:.4g} to {high:.4g} m"
        told.append(f"the reference is {span} above it, for {100.0 * outside:.3g} % of the flight out of reach")
    held = scenario[REFERENCE].kind == "set_point"
    # A quarter of its reach, in round numbers: 1 m for 4 m.
    good = ground + float(f"{max(farthest / 4.0, 2.0 * LOWEST):.1g}")
    mend = f"--set start.position=[{x:g},{y:g},{good:g}]"
    if held:
        a, b, _ = scenario[REFERENCE].make().settings.position
        mend += f" --set reference.position=[{a:g},{b:g},{good:g}]"
    else:
        mend += " and a reference about there, or ground = HEIGHT that far below both"
    yield (
        f"sensors {scenario[SENSORS].kind}: flow and range read the ground (at {ground:g} m) from {LOWEST:g} to "
        f"{farthest:g} m, but {' and '.join(told)}; there height and way are guessed from the accelerometer and "
        f"drift by metres; try {mend}"
    )


def _ground(scenario: Scenario) -> float:
    """Height in m of the centre of mass of the vehicle that stands; sensors count from there."""
    part = scenario.maybe(GROUND)
    if part is None:
        return 0.0
    ground = part.make()
    context = Context(scenario.mismatch.applied(scenario.vehicle), scenario.period)
    return float(ground.height(ground.parameters(context)))
