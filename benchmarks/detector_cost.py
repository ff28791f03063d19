"""What a loop with a detector costs: time to compile it, and steps per second and core in a batch.

    python benchmarks/detector_cost.py [--flights 10000] [--steps 200] [--detectors off multiple_model ...]

Hover of a Crazyflie with its own sensors, an inertial unit at 1 kHz, and the filter `eskf` in the loop. The first
flight of a process compiles the loop, where none is kept (``ROTORFAULT_CACHE=``); steps are those of
a long batch beyond a short one. Times are processor times of the whole process, all threads, so that other work on
the machine counts for little.
"""

from __future__ import annotations

import argparse
import os
from typing import Any

import numpy as np

import rotorfault as rf
from rotorfault.scenario.scenario import scenario_from

DETECTORS = ("off", "luenberger", "effectiveness_kalman", "glr", "multiple_model")


def spent(detector: str, flights: int, steps: int) -> float:
    """Processor time in s of so many flights."""
    tables: dict[str, Any] = {
        "name": "cost", "vehicle": "crazyflie-2.1", "period": 0.001, "duration": steps * 0.001,
        "sensors": "crazyflie", "estimator": "eskf", "diagnosis": detector,
        "controller": {"kind": "roismc", "preset": "gentle"},
        "reference": {"kind": "set_point", "position": [0.0, 0.0, 0.0]},
        "wind": {"kind": "dryden", "wind_at_6m": 8.0},
        "fault": [{"kind": "step", "rotor": 2, "time": 0.5 * steps * 0.001, "loss": 0.3}],
    }  # fmt: skip
    begun = sum(os.times()[:4])  # with those of children, for whoever compiles in one
    rf.fly_many(scenario_from(tables, "script"), {"seed": np.arange(flights)}, warn=False)
    return sum(os.times()[:4]) - begun


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--flights", type=int, default=10_000)
    parser.add_argument("--steps", type=int, default=200, help="sampling periods of each flight")
    parser.add_argument("--detectors", nargs="+", default=list(DETECTORS), choices=DETECTORS)
    chosen = parser.parse_args()
    print(f"{'detector':>22s}{'first flight [s]':>20s}{'steps/s and core':>20s}")
    for detector in chosen.detectors:
        first = spent(detector, 8, 8)
        few = spent(detector, chosen.flights, 8)
        many = spent(detector, chosen.flights, chosen.steps)
        rate = chosen.flights * (chosen.steps - 8) / (many - few)
        print(f"{detector:>22s}{first:>20.1f}{rate:>20,.0f}", flush=True)


if __name__ == "__main__":
    main()
