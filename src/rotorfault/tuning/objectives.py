"""What a flight is worth to a search of gains: the smaller the better, in seconds or what is taken for one.

- constant reference: time to settle within 2 % of the step (`INTERRUPTED` of the onset plus the time from then on,
  where the fault interrupts), plus `EXCURSION_FREE` and `LEFT_WEIGHT` for what the fault does to the error; for a
  hover, which asks for no step, within 2 cm;
- moving reference: root mean square position error, weighted by `TRACKING_WEIGHT`, or as a share of its span;
- plus `COST_WEIGHT` log10(1 + J) with the paper's cost J, 1 for every false alarm or missed rotor, the tilt beyond
  `TILT_FREE`, and `EFFORT_WEIGHT` log10(1 + mean square of the demanded angular acceleration);
- `LOST` for a flight that is lost.

The weights are our choice; nobody prescribes them. The `tuned` presets were found with them, so that they must not
change without a new search for every controller. Beside each stands what it trades. What the ratio of two laws owes
to that choice is shown by `rotorfault.studies.paper.ranges`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np

from rotorfault.base.errors import InputError, unknown
from rotorfault.loop.scores import RATTLING, SETTLED, bands
from rotorfault.maths.arrays import Array
from rotorfault.model.block import Context
from rotorfault.plant import FAULT
from rotorfault.results.flight_data import FlightData
from rotorfault.scenario.scenario import Scenario

# Five times what a tuned set-point flight comes to: survival comes before speed, yet one lost neighbour among many
# does not hide what the others are worth.
LOST = 10.0
# Of the time of the fault, for a flight that had not settled by then: more would ask for settling before the fault at
# any price, less would reward those that wait for it.
INTERRUPTED = 0.6
# Of the settling band, up to which an excursion after the fault costs nothing: a search has no reason to make it
# smaller, and keeps the rest of the band in reserve.
EXCURSION_FREE = 0.7
# Per band of error at the end: leads the search on among flights that do not settle, which are all alike otherwise.
LEFT_WEIGHT = 0.3
# Per metre: a centimetre behind the sinusoid, which all laws follow closely, counts as a tenth of a second; half a
# metre behind the square wave, which nobody can follow through its jumps, as one second.
TRACKING_WEIGHT = {"paper-sinusoid": 10.0, "paper-square": 2.0}
# Per decade of J: speed that costs ten times as much must save 0.3 s. A quarter of what a tuned flight comes to.
COST_WEIGHT = 0.3
TILT_FREE = 1.1  # rad; the largest demand that a search may allow, see `cascade.tilt_max` in the search space
# Per decade of (rad/s^2)^2: settles between flights that are alike in all else, in favour of the quieter one.
EFFORT_WEIGHT = 0.04
# Of the change of commands in a sampling period, as a share of hover thrust: up to three quarters of what `fly` calls
# rattling (`rotorfault.loop.scores.RATTLING`) are free, so that a flight noisier than those searched on stays below.
QUIET_FREE = 0.75 * RATTLING
QUIET_WEIGHT = 10.0  # s per percent beyond: more than anything else comes to, so that it is a limit
LOST_QUIET = 120.0  # s: more than commands that change by 13 %; no flight is worth losing for being quiet
# Per span of a reference that moves, where `TRACKING_WEIGHT` has none: a tenth of the span behind it counts as 1 s.
TRACKING_SHARE = 10.0
MISSED = 0.05  # loss from which on a rotor that no flag names at the end is missed; the diagnosis finds 0.1
# What pages say of them: value, unit, reason. The comments above say the same in more words.
WEIGHTS: tuple[tuple[str, float, str, str], ...] = (
    ("a lost flight", LOST, "s", "five times a tuned set-point flight: survival first, yet one of many hides none"),
    ("a lost flight (`quiet`)", LOST_QUIET, "s",
     "more than commands that change by 13 %: no flight is worth losing for being quiet"),
    ("time of a fault that interrupts the approach", INTERRUPTED, "1",
     "1 would ask for settling before the fault at any price, 0 would reward who waits for it"),
    ("excursion after the fault that is free", EXCURSION_FREE, "bands",
     "no reason to make it smaller still; the rest of the band is a reserve"),
    ("error left at the end", LEFT_WEIGHT, "s per band", "leads on among flights that do not settle, else all alike"),
    ("tracking error, sinusoid", TRACKING_WEIGHT["paper-sinusoid"], "s/m",
     "all laws follow closely: a centimetre counts as a tenth of a second"),
    ("tracking error, square wave", TRACKING_WEIGHT["paper-square"], "s/m",
     "nobody follows the jumps: half a metre counts as one second"),
    ("tracking error of any other reference that moves, as a share of its span", TRACKING_SHARE, "s",
     "a tenth of the span counts as one second"),
    ("cost, on log10(1 + J)", COST_WEIGHT, "s per decade",
     "ten times the cost must save 0.3 s; a quarter of what a tuned flight comes to"),
    ("rotor flagged wrongly, or missed", 1.0, "s", "as bad as settling a second later"),
    ("tilt beyond 1.1 rad", 1.0, "s/rad", "the largest tilt that may be demanded: more is a flight near its limit"),
    ("change of commands beyond 1.5 % of hover thrust in a sampling period (`quiet` alone)", QUIET_WEIGHT, "s per %",
     "three quarters of what counts as rattling are free; a percent too much costs more than slow settling"),
    ("effort, on log10(1 + mean square angular acceleration)", EFFORT_WEIGHT, "s per decade",
     "settles between flights alike in all else, for the quieter one"),
)  # fmt: skip
# Signals that objectives read, as far as a controller has them.
NEEDED = (
    "position", "position_reference", "fault_flag", "loss_true", "torque_demand", "controller.virtual_attitude",
    "controller.virtual_position",
)  # fmt: skip


class Objective(NamedTuple):
    """What a search is for."""

    says: str  # in a line, for people
    worth: Callable[[Scenario, FlightData, Mapping[str, Any]], float]  # of a flight, smaller is better


def onset_of(scenario: Scenario) -> float:
    """Time in s at which the first fault begins; infinite without one."""
    # When a fault begins depends on no vehicle; the true one is not worth its making for each flight of a search.
    context = Context(scenario.vehicle.vehicle, scenario.period)
    faults = [part.make() for part in scenario.all(FAULT)]
    return min((float(fault.onset(fault.parameters(context))) for fault in faults), default=math.inf)


def balanced(
    scenario: Scenario, data: FlightData, scores: Mapping[str, Any], cost_weight: float = COST_WEIGHT
) -> float:
    """What one flight is worth.

    Parameters
    ----------
    scenario : Scenario
        That was flown.
    data : FlightData
        Its records.
    scores : mapping
        Its row of a score table.
    cost_weight : float
        Of log10(1 + J).
    """
    if not scores["survived"]:
        return LOST
    times, onset = data["time"].values, onset_of(scenario)
    k = int(np.searchsorted(times, onset - 1e-9))
    # What the cascade asks of the attitude; other controllers ask for a torque.
    known = "controller.virtual_attitude" in data
    virtual = data["controller.virtual_attitude" if known else "torque_demand"].values
    virtual = virtual if known else virtual / np.array([*scenario.vehicle.vehicle.inertia])
    return float(
        _following(scenario, data, times, onset, k)
        + _mistakes(data["fault_flag"].values, data["loss_true"].values, k)
        + (cost_weight * math.log10(1.0 + scores["cost"]) if "controller.virtual_position" in data else 0.0)
        + max(0.0, float(scores["tilt_max"]) - TILT_FREE)
        + EFFORT_WEIGHT * math.log10(1.0 + float(np.mean(virtual**2)))
    )


def _following(scenario: Scenario, data: FlightData, times: Array, onset: float, k: int) -> float:
    """What the position error is worth in s; record k is the first with a fault."""
    wanted = data["position_reference"].values
    error = data["position"].values - wanted
    span = float(np.ptp(wanted, axis=0).max())
    if span == 0.0:
        return _settling(error, bands(wanted, data["position"].values[0], SETTLED), times, onset, k)
    weight = TRACKING_WEIGHT.get(scenario.name, TRACKING_SHARE / span)
    return weight * float(np.sqrt(np.mean(error**2)))


def _mistakes(flags: Array, loss: Array, k: int) -> float:
    """Rotors that a flag misses at the end or names wrongly, and false alarms before and after record k."""
    sound = loss.max(axis=0) == 0.0
    wrong = np.abs(flags[-1] - (loss[-1] > MISSED)).sum() + flags[:k].max(axis=0, initial=0.0).sum()
    return float(wrong + flags[k:, sound].max(axis=0, initial=0.0).sum())


def without_cost(scenario: Scenario, data: FlightData, scores: Mapping[str, Any]) -> float:
    """`balanced` with no weight on the cost J."""
    return balanced(scenario, data, scores, cost_weight=0.0)


def quiet(scenario: Scenario, data: FlightData, scores: Mapping[str, Any]) -> float:
    """`balanced`, and no commands that rattle; for vehicles with real sensors."""
    if not scores["survived"]:
        return LOST_QUIET
    rattles = 100.0 * max(0.0, float(scores["command_step"]) - QUIET_FREE)
    return balanced(scenario, data, scores) + QUIET_WEIGHT * rattles


def cost_alone(scenario: Scenario, data: FlightData, scores: Mapping[str, Any]) -> float:
    """log10 J: a search for the cost alone, in which a case of small J counts as much as one of large J.

    Raises
    ------
    InputError
        If the controller has no cost.
    """
    if "controller.virtual_position" not in data:
        raise InputError(
            "objective 'cost' needs a controller that records virtual_position, of which the cost J is made; "
            "allowed for this one: balanced, quiet, without-cost"
        )
    # The floor keeps the logarithm of a flight without error and input a number.
    return math.log10(max(float(scores["cost"]), 1e-6)) if scores["survived"] else LOST


OBJECTIVES: dict[str, Objective] = {
    "balanced": Objective(
        "time to settle and tracking error, with the cost J a quarter: the preset `tuned`", balanced
    ),
    "quiet": Objective("as balanced, and against commands that rattle: the presets of real vehicles", quiet),
    "cost": Objective("the cost J alone", cost_alone),
    "without-cost": Objective("as balanced, with no weight on J", without_cost),
}


def objective_of(name: str) -> Objective:
    """An objective by its name.

    Raises
    ------
    InputError
        If there is none of this name.
    """
    if name not in OBJECTIVES:
        raise InputError(unknown("objective", name, list(OBJECTIVES)))
    return OBJECTIVES[name]


def _settling(error: Array, band: Array, times: Array, onset: float, k: int) -> float:
    """Worth in s of an error after a step; record k is the first with the fault."""
    excess = np.max(np.abs(error) / band, axis=1)
    every = float(times[1] - times[0])
    before, after = np.flatnonzero(excess[:k] > 1.0), np.flatnonzero(excess[k:] > 1.0)
    first = (before[-1] + 1) * every if len(before) else 0.0
    late = (after[-1] + 1) * every if len(after) else 0.0
    left = LEFT_WEIGHT * float(excess[-1])
    if first < onset - every:
        return float(first + late + max(0.0, float(excess[k:].max(initial=0.0)) - EXCURSION_FREE) + left)
    return float(INTERRUPTED * onset + late + left)
