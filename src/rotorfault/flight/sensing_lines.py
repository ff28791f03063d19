"""What sensors do not read of a flight: ground out of reach, and the velocity of a flight that begins in motion."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from rotorfault.autopilot.estimation import ESTIMATOR
from rotorfault.flight.reference_rows import heights_of
from rotorfault.model.block import Context
from rotorfault.plant import SENSORS
from rotorfault.plant.ground import GROUND
from rotorfault.plant.instruments import LOWEST, RangeFinder
from rotorfault.plant.sensor_sets import SensorSet
from rotorfault.reference import REFERENCE
from rotorfault.scenario.scenario import Scenario

MOST_OFF = 3.0  # standard deviations by which a first velocity may be off
SHARE = 0.05  # of the flight out of reach that is told: a landing, or a short way through, is bridged


def sensing_lines(scenario: Scenario) -> Iterator[str]:
    """A line for each thing that sensors do not read and the estimator believes to know, with what would mend it.

    Parameters
    ----------
    scenario : Scenario
    """
    sensors = scenario[SENSORS].make()
    if not isinstance(sensors, SensorSet):
        return
    yield from _first_velocity(scenario, sensors)
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


def _first_velocity(scenario: Scenario, sensors: SensorSet) -> Iterator[str]:
    """A line where a flight begins in motion and nothing tells the filter so."""
    estimator = scenario[ESTIMATOR]
    known = getattr(estimator.make().settings, "start_speed", None)
    speed = math.hypot(*scenario.start.velocity)
    measured = any(getattr(one, "velocity", False) for one in sensors.made.values())
    if known is None or measured or speed <= MOST_OFF * known:
        return
    yield (
        f"estimator {estimator.kind}: sensors {scenario[SENSORS].kind} measure no velocity, so the first is taken "
        f"to be 0 to within {known:g} m/s (standard deviation), but the flight starts at {speed:.3g} m/s; "
        f"try --set estimator.kind={estimator.kind} --set estimator.start_speed={float(f'{speed:.1g}'):g}"
    )


def _ground(scenario: Scenario) -> float:
    """Height in m of the centre of mass of the vehicle that stands; sensors count from there."""
    part = scenario.maybe(GROUND)
    if part is None:
        return 0.0
    ground = part.make()
    context = Context(scenario.mismatch.applied(scenario.vehicle), scenario.period)
    return float(ground.height(ground.parameters(context)))
