"""The flights that gains are searched on.

Where nothing else is given they are neighbours of the paper's cases, never the cases themselves: true mass, inertia,
drag, rotor lag and initial state differ by up to 10 % (25 % for the lag), unknown to the autopilot, and the faults
set in at another time. Case 1 is trained on both plants; case 3 with shorter periods, to see more switches in less
time. Of scenarios of a user's own neighbours are taken in the same way, each with noise of its own.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from rotorfault.base.foreign import is_place
from rotorfault.flight.fly import prepare
from rotorfault.plant import FAULT
from rotorfault.reference import REFERENCE
from rotorfault.scenario.neighbours import neighbour
from rotorfault.scenario.scenario import Scenario
from rotorfault.tuning.objectives import onset_of

FIRST_SEED = 90_000  # neighbours that tests and reports use start at 0
RECORD = 0.01  # s between two records: what objectives read changes no faster
LAG = (0.75, 1.25)  # factors of the rotors' bandwidth: gains must not rest on a lag that is known exactly
NEIGHBOURS = 7  # of a scenario of a user's own
# Of the time of its first fault: a search must not count on the fault at the one instant.
ONSET = (0.5, 1.5)
LATEST = 0.8  # of the flight: the rest shows what becomes of it

# Scenario, overrides, number of neighbours; one batch each.
GROUPS: tuple[tuple[str, dict[str, Any], int], ...] = (
    ("paper-set-point", {"duration": 6.0}, 7),
    ("paper-set-point", {"duration": 6.0, "plant": "rigid_body"}, 7),
    ("paper-sinusoid", {"duration": 10.0}, 4),
    ("paper-square", {"duration": 22.0, "reference.period": [16.0, 18.0, 20.0], "reference.yaw_period": 17.0}, 4),
)


def training_groups(
    controller: str,
    overrides: Mapping[str, Any],
    neighbours: int | None = None,
    scenarios: Sequence[str | Path | Mapping[str, Any] | Scenario] = (),
    *,
    allow_code: bool = False,
) -> list[list[Scenario]]:
    """Training flights in groups that fly in one batch each.

    Parameters
    ----------
    controller : str
    overrides : mapping
        Dotted keys and values for all flights, such as another vehicle.
    neighbours : int, optional
        At most so many in each group of the paper's, as many as the presets were found with if not given; so many of
        each scenario of a user's own, 7 if not given.
    scenarios : sequence of str, Path, mapping or Scenario
        What is flown in place of the paper's cases.
    allow_code : bool
        Whether code that these scenarios name may run; code that `controller` and `overrides` name may.

    Raises
    ------
    InputError
        If a scenario cannot be flown so.
    """
    draw = np.random.Generator(np.random.Philox(np.random.SeedSequence([FIRST_SEED])))
    plain: dict[str, Any] = {} if is_place(controller) else {"controller.preset": "none"}

    def base(scenario: Any, own: Mapping[str, Any]) -> Scenario:
        return prepare(scenario, controller, {**plain, **own, **overrides}, allow_code=allow_code)

    def lagging(one: Scenario) -> Scenario:
        mismatch = one.mismatch.model_copy(update={"rotor_bandwidth": float(draw.uniform(*LAG))})
        return one.model_copy(update={"mismatch": mismatch})

    if scenarios:
        count = NEIGHBOURS if neighbours is None else neighbours
        return [
            [lagging(_neighbour(_recorded(base(one, {})), FIRST_SEED + i)) for i in range(count)] for one in scenarios
        ]
    groups = []
    for name, own, most in GROUPS:
        one = base(name, {"record_period": RECORD, **own})
        count = most if neighbours is None else min(most, neighbours)
        groups.append([lagging(neighbour(one, seed=FIRST_SEED + i)) for i in range(count)])
    return groups


def _recorded(scenario: Scenario) -> Scenario:
    """The same scenario with records as far apart as a search needs."""
    every = max(1, math.floor(RECORD / scenario.period + 1e-9))
    return scenario.model_copy(update={"record_period": every * scenario.period})


def _neighbour(scenario: Scenario, seed: int) -> Scenario:
    """A neighbour of a scenario of a user's own, with its own noise, and its fault at another time."""
    times = [part.settings.time for part in scenario.all(FAULT) if "time" in type(part.settings).model_fields]
    early, late = (share * min(times, default=onset_of(scenario)) for share in ONSET)
    late = min(late, LATEST * scenario.duration)
    moved = (min(early, late), late) if math.isfinite(late) and times else (0.0, 0.0)
    found = neighbour(scenario, seed, onset=moved).model_copy(update={"seed": seed})
    begin = scenario[REFERENCE].make().table(np.zeros(1)).p_W[0]
    if np.allclose(scenario.start.position, begin):
        # It begins where it is to be, and so do its neighbours: else a hover were a search for a small step.
        start = found.start.model_copy(update={"position": scenario.start.position})
        found = found.model_copy(update={"start": start})
    return found
