"""Speed of flights: one alone, and batches on one core and on all, through the public functions.

The flight is the paper's set point with everything in the loop: rigid body on a quaternion by RK4 at 1 ms, rotor lag
and limits, drag and wind, two rotor faults, Luenberger diagnosis with its decision, effectiveness allocation, ROISMC
with one exact Newton-Kleinman step of its Riccati equation at each sampling instant, and all scores. In a batch mass,
inertia, wind, faults and start differ from flight to flight, and none is the same as another. What is timed is the
whole engine call: from parameters to scores. Only steps of flights that still fly are counted.
"""

from __future__ import annotations

import json
import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from typing import Any

import numpy as np

from rotorfault.base.progress import Say
from rotorfault.engine import load_engine
from rotorfault.engine.batch import Batch, no_watch
from rotorfault.flight.assembly import assemble_group
from rotorfault.flight.fly import fly
from rotorfault.flight.many import fly_many
from rotorfault.flight.sweep import checked_columns, groups_of
from rotorfault.scenario.library import load_scenario
from rotorfault.scenario.scenario import Scenario

SIZES = (100, 1_000, 10_000)
SCALES = (1_000, 10_000, 100_000)  # of the batches whose time and memory are compared; quick: without the last
PERIOD = 1e-3  # s, of sampling and integration
FRAMES = {4: "x500", 6: "du-ppnnpn", 8: "x8"}
"""A vehicle of each number of rotors."""


def scenario(duration: float, **settings: Any) -> Scenario:
    """The flight that is measured."""
    overrides = {"controller.kind": "roismc", "plant": "rigid_body", "duration": duration} | settings
    return load_scenario("paper-set-point", overrides)


def different(count: int, seed: int = 1) -> dict[str, Any]:
    """What differs between the flights of a batch: near enough to the paper's for nearly all to fly to their end."""
    draw = np.random.default_rng(seed)
    return {
        "mismatch.mass": draw.uniform(0.95, 1.05, count),
        "mismatch.inertia.0": draw.uniform(0.95, 1.05, count),
        "wind.velocity_W.0": draw.uniform(-4.0, 4.0, count),
        "wind.velocity_W.1": draw.uniform(-4.0, 4.0, count),
        "fault.0.loss": draw.uniform(0.1, 0.3, count),
        "fault.0.time": draw.uniform(0.5, 1.8, count),
        "fault.1.loss": draw.uniform(0.1, 0.35, count),
        "start.position.0": draw.uniform(0.0, 0.2, count),
        "seed": np.arange(count),
    }


def batch_of(count: int, duration: float, **settings: Any) -> Batch:
    """A batch of different flights that records nothing."""
    one = scenario(duration, **settings)
    return assemble_group(groups_of(one, checked_columns(one, different(count)))[0])._replace(every=0)


def timed(batch: Batch, threads: int, repeats: int, clock: Callable[[], float] = time.perf_counter) -> float:
    """Flight-steps per second, the median of several calls.

    Parameters
    ----------
    batch : Batch
    threads, repeats : int
    clock : callable
        Gives seconds; that of one thread's own time is blind to what else runs on the machine.
    """
    run = load_engine("simd")
    run(batch._replace(reference=batch.reference[:10]), no_watch)  # compiled, and warm
    speeds = []
    for _ in range(repeats):
        start = clock()
        done = run(batch, no_watch, threads)
        speeds.append(done.flown / (clock() - start))
    return statistics.median(speeds)


def speed(steps_per_s: float, cores: int) -> dict[str, float]:
    """The usual figures of a speed."""
    return {
        "steps_per_s": steps_per_s,
        "steps_per_s_per_core": steps_per_s / cores,
        "simulated_s_per_s_per_core": steps_per_s / cores * PERIOD,
    }


def measure_batches(cores: int, quick: bool, say: Say) -> dict[str, Any]:
    """Batches of `SIZES`, some 20 million steps a call (quick: 5): on one core by its own time, and on all."""
    speeds: dict[str, Any] = {}
    repeats, steps = (3, 5e6) if quick else (7, 2e7)
    for size in SIZES:
        duration = float(np.clip(round(steps / size * PERIOD, 1), 0.2, 20.0))
        say(f"batch of {size:,}: {duration:g} s each")
        batch = batch_of(size, duration)
        one = speed(timed(batch, 1, repeats, time.thread_time), 1)
        speeds[str(size)] = one | {"flight_seconds": duration}
        if cores > 1:
            together = timed(batch, cores, repeats)
            speeds[str(size)]["all_cores"] = speed(together, cores) | {
                "cores": cores,
                "over_one_core": together / one["steps_per_s"],
            }
    return speeds


def measure_frames(quick: bool, say: Say) -> dict[str, Any]:
    """Batches of 10,000 of vehicles with four, six and eight rotors, on one core, by its own time.

    All hover with one fault, with the preset `midsize`. What more rotors cost is the difference: a step has more of
    them, and beyond four the diagnosis by signatures and the allocation by active sets.
    """
    speeds: dict[str, Any] = {}
    size, repeats, steps = 10_000, 3 if quick else 5, 5e6 if quick else 2e7
    for rotors, vehicle in FRAMES.items():
        duration = round(steps / size * PERIOD, 2)
        say(f"batch of {size:,} with {rotors} rotors: {duration:g} s each")
        settings = {"vehicle": vehicle, "controller.preset": "midsize", "duration": duration, "sensors": "ideal"}
        # One fault, from rest where it is to be; the inertia of some is as large about yaw as it can be.
        left = ("fault.1", "start", "mismatch.inertia")
        varied = {key: column for key, column in different(size).items() if not key.startswith(left)}
        varied |= {"fault.0.time": np.full(len(varied["seed"]), 0.1 * duration)}
        one = load_scenario("hover-fault", settings)
        batch = assemble_group(groups_of(one, checked_columns(one, varied))[0])._replace(every=0)
        value = timed(batch, 1, repeats, time.thread_time)
        speeds[str(rotors)] = speed(value, 1) | {"vehicle": vehicle, "flight_seconds": duration}
    for part in speeds.values():
        part["cost_factor"] = speeds["4"]["steps_per_s"] / part["steps_per_s"]
    return speeds


def measure_noise(quick: bool, say: Say) -> dict[str, Any]:
    """What sensor noise (12 numbers a step) and gusts (3) cost, as a factor on the time of a batch of 1,000."""
    say("sensor noise and gusts")
    repeats, duration = (3, 1.0) if quick else (7, 4.0)
    # A threshold that noise does not reach, so that the same flights fly to their end.
    calm = {"diagnosis.decision.threshold": 0.4}
    cases: dict[str, dict[str, Any]] = {
        "without": {},
        "noise": {"sensors.kind": "noisy"},
        "gusts": {"wind.kind": "dryden"},
        "noise_and_gusts": {"sensors.kind": "noisy", "wind.kind": "dryden"},
    }
    speeds = {
        name: timed(batch_of(1_000, duration, **calm, **case), 1, repeats, time.thread_time)
        for name, case in cases.items()
    }
    return {
        name: {"steps_per_s_per_core": value, "cost_factor": speeds["without"] / value}
        for name, value in speeds.items()
    }


def measure_single(quick: bool, say: Say) -> dict[str, Any]:
    """One flight of 20 s through `rotorfault.fly`: with all its records as arrays, once the loop is compiled."""
    say("one flight of 20 s")
    flown = scenario(20.0)
    fly(flown)
    times = []
    for _ in range(3 if quick else 9):
        start = time.perf_counter()
        fly(flown)
        times.append(time.perf_counter() - start)
    seconds = statistics.median(times)
    return {"seconds": seconds, "steps_per_s": flown.steps / seconds, "simulated_s_per_s": flown.duration / seconds}


def measure_scaling(quick: bool, say: Say) -> dict[str, Any]:
    """Time per flight and peak memory of `rotorfault.fly_many` for flights of 0.1 s in batches of `SCALES`.

    Each in a process of its own; its memory is all that the process ever held, Python and libraries included.
    """
    costs: dict[str, Any] = {}
    for size in SCALES[:-1] if quick else SCALES:
        say(f"{size:,} flights through fly_many")
        done = subprocess.run(
            [sys.executable, "-c", f"from rotorfault.bench.flights import alone; alone({size})"],
            capture_output=True, text=True, check=True,
        )  # fmt: skip
        costs[str(size)] = json.loads(done.stdout)
    return costs


def alone(size: int) -> None:
    """Fly a batch and print what that took, as JSON.

    Parameters
    ----------
    size : int
        Flights in the batch.
    """
    flown = scenario(0.1)
    fly_many(flown, different(64))
    columns = different(size)
    start = time.perf_counter()
    fly_many(flown, columns)
    seconds = time.perf_counter() - start
    print(json.dumps({"us_per_flight": 1e6 * seconds / size, "peak_memory_MB": _peak_memory()}))


def _peak_memory() -> float | None:
    """In MB; None on Windows, which has no such count."""
    try:
        import resource
    except ImportError:
        return None
    # In kilobytes, but on macOS in bytes.
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * (1.0 if sys.platform == "darwin" else 1024.0) / 1e6
