"""What the scripts that measure other simulators share: timing, the shape of a result, and writing it.

The scripts run in an environment that has one peer and no rotorfault, so they import nothing of this package; the
interpreter finds this file beside them.
"""

from __future__ import annotations

import argparse
import json
import math
import statistics
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

DURATION = 10.0  # s, of the manoeuvre of which the accuracy is judged
SIZES = (1, 100, 1_000, 10_000)  # vehicles in a batch
START = time.perf_counter()


class Effort(NamedTuple):
    """How long to measure."""

    repeats: int
    seconds: float  # of each repeat, at least


FULL, QUICK = Effort(5, 1.0), Effort(3, 0.3)


class Task(NamedTuple):
    """What the command line asks for."""

    json: Path
    effort: Effort
    cores: int

    @property
    def whole(self) -> bool:
        """Measure everything; with several cores only the large batch is measured again."""
        return self.cores == 1


class Speed(NamedTuple):
    """Vehicle-steps in a second of wall time, and in a second of processor time.

    The two agree on a core (or cores) that nothing else uses; the second hardly changes when something does.
    """

    per_s: float
    per_cpu_s: float


def task() -> Task:
    """The command line: --json FILE, --quick, --cores N."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--json", type=Path, required=True)
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--cores", type=int, default=1)
    options = parser.parse_args()
    return Task(options.json, QUICK if options.quick else FULL, options.cores)


def rate(advance: Callable[[], object], steps: int, effort: Effort) -> Speed:
    """Speed of something: the median of several repeats, without the first call.

    Parameters
    ----------
    advance : callable
        Advances all vehicles and returns when it is done. Its first call may compile.
    steps : int
        Vehicle-steps of one call.
    effort : Effort
    """
    advance()
    start = time.perf_counter()
    advance()
    calls = max(1, math.ceil(effort.seconds / (time.perf_counter() - start)))
    wall, processor = [], []
    for _ in range(effort.repeats):
        start, used = time.perf_counter(), time.process_time()
        done = 0
        # A call can be faster than the trial one was: count on until the time is full.
        while done < calls or time.perf_counter() - start < effort.seconds:
            advance()
            done += 1
        wall.append(steps * done / (time.perf_counter() - start))
        processor.append(steps * done / (time.process_time() - used))
    return Speed(statistics.median(wall), statistics.median(processor))


def batch_entry(speed: Speed, step: float, cores: int) -> dict[str, float]:
    """What is reported of one size of batch; `step` in s."""
    per_core = speed.per_s / cores
    return {
        "steps_per_s": speed.per_s,
        "steps_per_s_per_core": per_core,
        "steps_per_cpu_s": speed.per_cpu_s,
        "simulated_s_per_s_per_core": per_core * step,
    }


def setting_entry(
    setting: str,
    integrator: str,
    dtype: str,
    step: float,
    control_period: float,
    batch: dict[int, Speed],
    cores: int,
) -> dict[str, Any]:
    """What is reported of one setting of a peer.

    Parameters
    ----------
    setting : str
        One sentence.
    integrator, dtype : str
    step, control_period : float
        s.
    batch : dict
        Speed by the number of vehicles; the largest number is the headline.
    cores : int
        That the process could use.
    """
    entries = {str(size): batch_entry(value, step, cores) for size, value in batch.items()}
    largest = entries[str(max(batch))]
    return {
        "setting": setting,
        "integrator": integrator,
        "dtype": dtype,
        "step": step,
        "control_period": control_period,
        "batch": entries,
        "steps_per_s_per_core": largest["steps_per_s_per_core"],
        "steps_per_cpu_s": largest["steps_per_cpu_s"],
        "best_steps_per_s_per_core": max(entry["steps_per_s_per_core"] for entry in entries.values()),
        "simulated_s_per_s_per_core": largest["simulated_s_per_s_per_core"],
    }


def accuracy_entry(integrator: str, step: float, error: float, speed: Speed) -> dict[str, Any]:
    """What is reported of one step (s): the error (m) at the end of the manoeuvre, and the cost on one core."""
    return {
        "integrator": integrator,
        "step": step,
        "error_m": error,
        "simulated_s_per_s_per_core": speed.per_s * step,
        "simulated_s_per_cpu_s": speed.per_cpu_s * step,
    }


def headline(setting: dict[str, Any]) -> Speed:
    """Speed of a setting's largest batch on one core."""
    return Speed(setting["steps_per_s_per_core"], setting["steps_per_cpu_s"])


def reference(t: float) -> tuple[list[float], list[float], list[float]]:
    """The smooth path of the manoeuvre: position in m, velocity in m/s, acceleration in m/s² at time t in s.

    It starts at the origin at rest (every coordinate is a product of sines that vanish there with their slope).
    """
    position, velocity, acceleration = [], [], []
    for size, omega in ((0.5, 1.2), (0.4, 0.9), (0.2, 0.7)):
        position.append(size * math.sin(omega * t) ** 2)
        velocity.append(size * omega * math.sin(2.0 * omega * t))
        acceleration.append(2.0 * size * omega**2 * math.cos(2.0 * omega * t))
    return position, velocity, acceleration


def distance(a: Sequence[float], b: Sequence[float]) -> float:
    """Distance of two points in m."""
    return math.dist([float(x) for x in a], [float(x) for x in b])


def must(true: bool, what: str) -> None:
    """Stop with one line if a peer does not do what a measurement of it takes for granted."""
    if not true:
        raise SystemExit(f"not measured: {what}")


def write(path: Path, result: dict[str, Any]) -> None:
    """Write the result; a number that is not finite is an error, not a result.

    With it goes the share of the wall time in which the process ran: on one core, well below 1 means that something
    else ran there too, and that the speeds are too low.
    """
    result = {**result, "cpu_share": time.process_time() / (time.perf_counter() - START)}
    path.write_text(json.dumps(result, indent=1, allow_nan=False), encoding="utf-8")
