"""Accuracy beside speed: how far off a flight ends for which integration step, and what that step costs.

The flight is ten seconds of closed loop along the path that `peer_scripts` fly too, sines on all axes with up to 1.6
m/s^2 that keep the vehicle tilted by up to 10 degrees to the end. It is flown by the paper's quadrotor, as a rigid
body in a constant wind of 3.6 m/s, with the controller ROISMC ``tuned`` and the Luenberger diagnosis. It starts
tilted and turning, so that attitude moves fast at first. Once more it is flown with losses of 25 % and 35 % on two
rotors from 1.8 s on, a sampling instant of every period. The observer's poles are 60 and 80 rad/s for all periods:
the faster one times the longest period, 10 ms, stays below 1, and the controller is the same throughout.

Its truth is `rotorfault.engine.taylor`: the same sampling instants, and motion between them exact to rounding. What
is measured is the error of the integrator, not what a longer sampling period does to control.

A yardstick says whether an error matters: how far off the same flight is with the standard noise of the
sensors (root mean square over flights), or with one percent more mass, whichever is more. An error does not matter
below a thousandth of the smallest such yardstick of all sampling periods, without faults and with them: at the end
of the flight, where most simulators are compared, or throughout, which the moments after a fault decide.
"""

from __future__ import annotations

import math
import statistics
import time
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from rotorfault.base.progress import Say
from rotorfault.engine import load_engine
from rotorfault.engine.batch import Batch, Recording, no_watch
from rotorfault.engine.taylor import fly_taylor
from rotorfault.flight.assembly import assemble
from rotorfault.flight.beginning import initial_state, start_of
from rotorfault.maths.arrays import Array
from rotorfault.maths.records import leaf_names
from rotorfault.scenario.scenario import Scenario, scenario_from

DURATION = 10.0  # s
PERIOD = 0.01  # s, the sampling period of the second curve
STEPS = (0.01, 0.005, 0.002, 0.001, 0.0005)  # s, of the first curve
HELD_STEPS = (0.01, 0.005, 0.0025, 0.002, 0.001, 0.0005)  # s, of the second
TOLERANCES = (1e-14, 1e-16)  # of the truth; the second is used
FINEST = 64  # Runge-Kutta steps per period that the truth is compared with
SHARE = 1e-3  # of the yardstick: what does not matter
ROUNDING = 1e-14  # m: errors below it say nothing about the order
SAMPLED, HELD = "sampled at each step", "sampled every 10 ms"
FLIGHTS: dict[str, list[dict[str, Any]]] = {
    "sound": [],
    "faulty": [
        {"kind": "step", "rotor": 1, "time": 1.8, "loss": 0.25},
        {"kind": "step", "rotor": 3, "time": 1.8, "loss": 0.35},
    ],
}
_POSITION = (0, 1, 2)  # rows of the true position: the first signal of every loop


class Effort(NamedTuple):
    """How much to measure."""

    batch: int  # flights that are timed together
    repeats: int
    seconds: float  # of each repeat, at least, unless a flight is shorter
    noisy: int  # flights with sensor noise
    steps: tuple[float, ...]  # s
    held_steps: tuple[float, ...]  # s


FULL = Effort(10_000, 5, 1.0, 256, STEPS, HELD_STEPS)
QUICK = Effort(1_000, 3, 0.1, 32, STEPS[:2], HELD_STEPS[:3])


class Off(NamedTuple):
    """Distance of two flights in m."""

    end: float  # at the end
    largest: float  # at any sampling instant


def measure(quick: bool = False, say: Say = lambda _: None) -> dict[str, Any]:
    """Measure error and cost of each step.

    Parameters
    ----------
    quick : bool
        Fewer steps, and 1,000 flights at a time instead of 10,000: half a minute instead of four.
    say : callable
        Takes what is being done, line by line.

    Returns
    -------
    dict
        In m and s. ``truth``: by how much those of the longest period differ between two tolerances, and from Runge-
        Kutta at 1/64 of it. ``yardsticks``: by flight and sampling period. ``limit_m``, ``largest_limit_m``: below
        them an error at the end, or anywhere, does not matter. ``curves`` by name: ``points``; ``order``, the slope
        of the errors by flight, None for fewer than two above rounding; ``cheapest_step``, fine enough at the end,
        and ``cheapest_step_throughout``, None if there is none. A point has what those of the peers have, for the
        sound flight, and the errors of all ``flights``. ``cpu_share``: the least of processor time over wall time;
        well below 1, something else ran on the core, and speeds by wall time are too low.

    Raises
    ------
    InputError
        If heyoka or llvmlite is not installed.
    """
    effort = QUICK if quick else FULL
    truths = _Truths(say)
    truth = _truth_error(truths)
    yardsticks = _yardsticks(effort, say)
    limit, largest = (
        SHARE * min(max(y[f"{prefix}noise_m"], y[f"{prefix}mass_m"]) for y in yardsticks)
        for prefix in ("", "largest_")
    )
    pairs = {SAMPLED: [(h, h) for h in effort.steps], HELD: [(PERIOD, h) for h in effort.held_steps]}
    every = [pair for name in pairs for pair in pairs[name]]
    points = {pair: _point(*pair, truths, effort, say) for pair in dict.fromkeys(every)}
    return {
        "batch": effort.batch,
        "duration": DURATION,
        "share": SHARE,
        "truth": truth,
        "yardsticks": yardsticks,
        "limit_m": limit,
        "largest_limit_m": largest,
        "cpu_share": min(p["simulated_s_per_s_per_core"] / p["simulated_s_per_cpu_s"] for p in points.values()),
        "curves": {name: _curve([points[pair] for pair in pairs[name]], limit, largest) for name in pairs},
    }


def manoeuvre(period: float, step: float, flight: str = "sound", **tables: Any) -> Scenario:
    """The flight that is measured.

    Parameters
    ----------
    period, step : float
        Sampling period and integration step, s.
    flight : str
        ``sound``, or ``faulty``.
    **tables
        Of the scenario, in place of those of the flight.
    """
    defaults = {
        "name": "accuracy",
        "vehicle": "paper",
        "plant": "rigid_body",
        "duration": DURATION,
        "period": period,
        "step": step,
        "start": {"attitude": [0.2, -0.3, 0.4], "body_rates": [0.5, 1.0, -0.5]},
        # A sin^2(w t) = A/2 - A/2 cos(2 w t) for A = (0.5, 0.4, 0.2) m and w = (1.2, 0.9, 0.7) rad/s.
        "reference": {
            "kind": "sinusoid",
            "amplitude": [-0.25, -0.2, -0.1],
            "frequency": [2.4, 1.8, 1.4],
            "phase": [0.5 * math.pi] * 3,
            "offset": [0.25, 0.2, 0.1],
        },
        "wind": "constant",
        "fault": FLIGHTS[flight],
        "controller": {"kind": "roismc", "preset": "tuned"},
        "diagnosis": {"kind": "luenberger", "poles": [60.0, 80.0]},
    }
    return scenario_from(defaults | tables, "accuracy")


def positions(batch: Batch, recording: Recording) -> Array:
    """Positions at all sampling instants and at the end, shape (steps + 1, 3, N), in m."""
    names = leaf_names(batch.state)
    rows = [names.index(f"plant.body.p_W.{axis}") for axis in "xyz"]
    columns = list(_POSITION) if batch.wanted is None else [batch.wanted.index(row) for row in _POSITION]
    return np.concatenate([recording.signals[:, columns], recording.state[None, rows]])


class _Truths:
    """Flights that others are compared with, each flown once."""

    def __init__(self, say: Say) -> None:
        self._say, self._paths = say, dict[tuple[float, str, float], Array]()

    def get(self, period: float, flight: str, tolerance: float = TOLERANCES[-1]) -> Array:
        key = (period, flight, tolerance)
        if key not in self._paths:
            self._say(f"truth of the {flight} flight, sampled every {1e3 * period:g} ms")
            batch = assemble(manoeuvre(period, period, flight))
            self._paths[key] = positions(batch, fly_taylor(batch, no_watch, tolerance))
        return self._paths[key]


def _fly(scenario: Scenario, flights: int = 1) -> Array:
    """Positions of the compiled engine; of several flights, which differ in their random numbers."""
    batch = assemble(scenario)._replace(wanted=_POSITION)
    if flights > 1:
        seeds = tuple((scenario.seed, i) for i in range(flights))
        state = initial_state(batch.loop, start_of(scenario), batch.reference, seeds, batch.parameters)
        batch = batch._replace(state=state, flights=flights, seeds=seeds)
    return positions(batch, load_engine("simd")(batch, no_watch, 1))


def _off(path: Array, truth: Array) -> Off:
    """Distance of paths of N flights from one, root mean square over the N."""
    distance = np.sqrt(np.mean(np.sum(np.square(path - truth), axis=1), axis=1))
    return Off(float(distance[-1]), float(distance.max()))


def _yardsticks(effort: Effort, say: Say) -> list[dict[str, Any]]:
    """What noise and a wrong mass do, at each sampling period."""
    yardsticks = []
    for flight in FLIGHTS:
        for period in effort.steps:
            say(f"noise and mass in the {flight} flight, sampled every {1e3 * period:g} ms")
            path = _fly(manoeuvre(period, period, flight))
            noise = _off(_fly(manoeuvre(period, period, flight, sensors="noisy"), effort.noisy), path)
            mass = _off(_fly(manoeuvre(period, period, flight, mismatch={"mass": 1.01})), path)
            yardsticks.append(
                {
                    "flight": flight,
                    "control_period": period,
                    "noise_m": noise.end,
                    "mass_m": mass.end,
                    "largest_noise_m": noise.largest,
                    "largest_mass_m": mass.largest,
                }
            )
    return yardsticks


def _point(period: float, step: float, truths: _Truths, effort: Effort, say: Say) -> dict[str, Any]:
    flights = {}
    for flight in FLIGHTS:
        error = _off(_fly(manoeuvre(period, step, flight)), truths.get(period, flight))
        flights[flight] = {"error_m": error.end, "largest_error_m": error.largest}
    say(f"step {1e3 * step:g} ms, sampled every {1e3 * period:g} ms: {effort.batch} flights on one core")
    wall, processor = _speed(assemble(manoeuvre(period, step)), effort)
    return {
        "integrator": "RK4",
        "step": step,
        "control_period": period,
        "error_m": flights["sound"]["error_m"],
        "simulated_s_per_s_per_core": wall,
        "simulated_s_per_cpu_s": processor,
        "flights": flights,
    }


def _speed(one: Batch, effort: Effort) -> tuple[float, float]:
    """Simulated seconds in a second of wall time and in one of processor time, on one thread.

    All flights of the batch are the same one: straight code takes the same time for any numbers.
    """
    whole = one._replace(flights=effort.batch, seeds=((0, 0),) * effort.batch, every=0)
    run, periods = load_engine("simd"), 100

    def timed(periods: int) -> tuple[float, float]:
        batch = whole._replace(reference=whole.reference[:periods])
        start, used = time.perf_counter(), time.process_time()
        run(batch, no_watch, 1)
        return time.perf_counter() - start, time.process_time() - used

    while timed(periods)[0] < effort.seconds and periods < whole.steps:
        periods = min(2 * periods, whole.steps)
    simulated = effort.batch * periods * float(one.parameters.period)
    times = [timed(periods) for _ in range(effort.repeats)]
    wall, processor = (simulated / statistics.median(column) for column in zip(*times, strict=True))
    return wall, processor


def _curve(points: list[dict[str, Any]], limit: float, largest: float) -> dict[str, Any]:
    return {
        "points": points,
        "order": {flight: _order(points, flight) for flight in FLIGHTS},
        "cheapest_step": _cheapest(points, {"error_m": limit}),
        "cheapest_step_throughout": _cheapest(points, {"error_m": limit, "largest_error_m": largest}),
    }


def _cheapest(points: Sequence[dict[str, Any]], limits: dict[str, float]) -> float | None:
    """Step of least cost whose errors stay below their limits in every flight.

    It is the longest one: that a longer step costs less needs no measurement, and none can deny it by a disturbance.
    """
    fine = [
        point["step"]
        for point in points
        if all(flight[key] < limit for flight in point["flights"].values() for key, limit in limits.items())
    ]
    return max(fine, default=None)


def _order(points: Sequence[dict[str, Any]], flight: str) -> float | None:
    """Slope of the logarithms."""
    pairs = [(point["step"], point["flights"][flight]["error_m"]) for point in points]
    pairs = [pair for pair in pairs if pair[1] > ROUNDING]
    if len(pairs) < 2:
        return None
    steps, errors = np.log(np.array(pairs)).T
    return float(np.polyfit(steps, errors, 1)[0])


def _truth_error(truths: _Truths) -> dict[str, Any]:
    """How far the truth itself is to be trusted, in the flights of the longest period: there series are longest."""
    errors: dict[str, Any] = {"tolerances": list(TOLERANCES), "rk4_step": PERIOD / FINEST, "flights": {}}
    for flight in FLIGHTS:
        truth, coarser = (truths.get(PERIOD, flight, tolerance) for tolerance in reversed(TOLERANCES))
        finest = _fly(manoeuvre(PERIOD, PERIOD / FINEST, flight))
        errors["flights"][flight] = {
            "tolerance_m": _off(coarser, truth).largest,
            "rk4_m": _off(finest, truth).end,
            "largest_rk4_m": _off(finest, truth).largest,
        }
    return errors
