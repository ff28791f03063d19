"""How gently a vehicle comes down that spins, because a rotor of it is lost altogether, or two opposite ones.

    python benchmarks/spin_landing.py [--flights 200] [--only VEHICLE ...] [--json FILE]

Hover at 10 m (`crazyflie-2.1` at 20 m: it falls up to 9 m before it is caught), wind of 5 m/s with gusts (Dryden,
5 m/s at 6 m), noisy sensors, Luenberger observer, ROISMC; the rotors stop at 1 s, and the vehicle lands by
`on_fault = "land"` at its default rate. Counted are flights that touch the ground at less than 1.5 m/s downwards,
with the interval of Clopper and Pearson. A touch-down that is gentle by the rules of `ground` (1 m/s down, 0.5 m/s
sideways, 15 degrees) ends as `landed`; a body that spins leans by more than that on some vehicles.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

import numpy as np
from total_loss import CASES, settings

import rotorfault as rf
from rotorfault.base.files import write_durably
from rotorfault.campaigns.sampling.statistics import clopper_pearson

VEHICLES = ("mueller-2014", "hummingbird", "hitsz", "uzh-2020", "crazyflie-2.1")
HIGHEST = {"crazyflie-2.1": 20.0}
HEIGHT = 10.0  # m
FASTEST = 1.5  # m/s, downwards


def row(vehicle: str, dead: tuple[int, ...], flights: int) -> dict[str, Any]:
    """Touch-downs of a vehicle without some rotors."""
    height = HIGHEST.get(vehicle, HEIGHT)
    chosen = settings(vehicle, dead, "roismc, relaxed") | {
        "start.position": [0.0, 0.0, height],
        "reference.position": [0.0, 0.0, height],
        "wind.altitude": height,
        "ground": 0.0,
        "on_fault": "land",
        "duration": 15.0 + 2.2 * height,
    }
    table = rf.fly_many("hover-fault", {"seed": np.arange(flights)}, settings=chosen).table
    down, across, tilt, spin = (
        np.asarray(table[f"landing.{key}"], dtype=float) for key in ("speed", "horizontal_speed", "tilt", "yaw_rate")
    )
    soft = int((down < FASTEST).sum())  # one that never touched has none, which is not below
    low, high = clopper_pearson(soft, flights)

    def median(x: np.ndarray[Any, Any]) -> float:
        return float(np.nanmedian(x))

    return {
        "vehicle": vehicle,
        "rotors_lost": list(dead),
        "flights": flights,
        "soft": soft,
        "low": float(low),
        "high": float(high),
        "landed": int((np.asarray(table["outcome"]) == "landed").sum()),
        "speed_median": median(down),
        "speed_p95": float(np.nanquantile(down, 0.95)),
        "horizontal_speed_median": median(across),
        "tilt_median": median(tilt),
        "yaw_rate_median": median(np.abs(spin)),
    }


def main() -> None:
    """Fly and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--flights", type=int, default=200)
    parser.add_argument("--only", nargs="+", choices=VEHICLES, default=list(VEHICLES))
    parser.add_argument("--json", type=Path)
    chosen = parser.parse_args()
    rows = []
    print(
        "| vehicle | lost | below 1.5 m/s | interval | down [m/s]: median, 95 % | sideways | tilt | yaw rate "
        "| `landed` |\n|" + " --- |" * 9
    )
    for vehicle in chosen.only:
        for dead in ((1,), (3,), CASES[vehicle].opposite):
            one = row(vehicle, dead, chosen.flights)
            rows.append(one)
            print(
                f"| `{vehicle}` | {', '.join(map(str, dead))} | {one['soft']} of {one['flights']} "
                f"| {one['low']:.3f} to {one['high']:.3f} | {one['speed_median']:.2f}, {one['speed_p95']:.2f} "
                f"| {one['horizontal_speed_median']:.2f} m/s | {np.degrees(one['tilt_median']):.0f} deg "
                f"| {one['yaw_rate_median']:.0f} rad/s | {one['landed']} |",
                flush=True,
            )
    if chosen.json:
        write_durably(chosen.json, json.dumps(rows, indent=1).encode())


if __name__ == "__main__":
    main()
