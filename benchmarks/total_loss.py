"""How many flights survive the total loss of a rotor, or of two opposite ones, by vehicle.

    python benchmarks/total_loss.py [--flights 100] [--only VEHICLE ...] [--json FILE]

Hover at 10 m, wind of 5 m/s with gusts (Dryden, 5 m/s at 6 m), noisy sensors, Luenberger observer; the rotors stop at
1 s, the flight lasts 15 s. Relaxed hover against the same law kept upright, and SMC. Intervals are Clopper and
Pearson's. Air that a built-in vehicle has not got is given here, with its source.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import rotorfault as rf
from rotorfault.base.files import write_durably
from rotorfault.campaigns.sampling.statistics import clopper_pearson


class Case(NamedTuple):
    """A vehicle with its preset and the air that damps its spin."""

    preset: str
    air: dict[str, tuple[float, str, str]]
    opposite: tuple[int, int]


MUELLER, ROTORPY = "Mueller and D'Andrea 2014, of a vehicle of that size", "RotorPy's parameters"
LESS = f"less, for its size, than {MUELLER}"
CASES = {
    "mueller-2014": Case("hummingbird", {}, (1, 2)),
    "hitsz": Case("hummingbird", {}, (1, 2)),
    "hummingbird": Case("hummingbird", {"rotor_drag": (1.19e-4, "kg/rad", ROTORPY)}, (1, 2)),
    "crazyflie-2.1": Case("crazyflie", {"rotor_drag": (1.03e-6, "kg/rad", ROTORPY)}, (1, 2)),
    "paper": Case("quiet", {"damping_yaw": (5e-3, "N m s", f"twice that of {MUELLER}")}, (1, 2)),
    "uzh-2020": Case("hummingbird", {"damping_yaw": (2.75e-3, "N m s", MUELLER)}, (1, 3)),
    "minnie": Case("hummingbird", {"damping_yaw": (1e-3, "N m s", LESS)}, (1, 2)),
    "racer-5inch": Case("hummingbird", {"damping_yaw": (1e-3, "N m s", LESS)}, (1, 4)),
}
LAWS: dict[str, dict[str, Any]] = {
    "roismc, relaxed": {"kind": "roismc", "cascade": {"yaw_lost": "relaxed"}},
    "roismc, upright": {"kind": "roismc", "cascade": {"yaw_lost": "upright"}},
    "smc": {"kind": "smc"},
}


def settings(vehicle: str, dead: tuple[int, ...], law: str) -> dict[str, Any]:
    """Of the flights of a row."""
    case = CASES[vehicle]
    air = {
        f"vehicle.air.{key}": dict(zip(("value", "unit", "source"), it, strict=True)) for key, it in case.air.items()
    }
    # The drag of their files is that of the rotors, and must not act twice.
    once = {"vehicle.linear_drag.value": 0.0} if "rotor_drag" in case.air else {}
    return {
        "vehicle": vehicle,
        **air,
        **once,
        "controller": {"preset": case.preset, **LAWS[law]},
        "duration": 15.0,
        "start.position": [0.0, 0.0, 10.0],
        "reference.position": [0.0, 0.0, 10.0],
        "wind.velocity_W": [5.0, 0.0, 0.0],
        "wind.wind_at_6m": 5.0,
        "wind.altitude": 10.0,
        "fault": [{"kind": "total", "rotor": rotor, "time": 1.0} for rotor in dead],
    }


def row(vehicle: str, dead: tuple[int, ...], law: str, flights: int) -> dict[str, Any]:
    """Survival and altitude lost."""
    table = rf.fly_many("hover-fault", {"seed": np.arange(flights)}, settings=settings(vehicle, dead, law)).table
    survived = np.asarray(table["survived"], dtype=bool)
    low, high = clopper_pearson(int(survived.sum()), flights)
    lost = np.asarray(table["altitude_lost"], dtype=float)[survived]
    return {
        "vehicle": vehicle,
        "rotors_lost": list(dead),
        "controller": law,
        "flights": flights,
        "survived": int(survived.sum()),
        "low": float(low),
        "high": float(high),
        "height_lost_median": float(np.median(lost)) if lost.size else None,
        "height_lost_p95": float(np.quantile(lost, 0.95)) if lost.size else None,
    }


def main() -> None:
    """Fly and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--flights", type=int, default=100)
    parser.add_argument("--only", nargs="+", choices=CASES, default=list(CASES))
    parser.add_argument("--json", type=Path)
    chosen = parser.parse_args()
    rows = []
    print("| vehicle | lost | controller | survived | interval | height lost [m]: median, 95 % |\n|" + " --- |" * 6)
    for vehicle in chosen.only:
        for dead in ((1,), (3,), CASES[vehicle].opposite):
            for law in LAWS:
                one = row(vehicle, dead, law, chosen.flights)
                rows.append(one)
                lost = (one["height_lost_median"], one["height_lost_p95"])
                height = "-" if None in lost else f"{lost[0]:.2f}, {lost[1]:.2f}"
                print(
                    f"| {vehicle} | {', '.join(map(str, dead))} | {law} | {one['survived']} of {one['flights']} "
                    f"| {one['low']:.2f} to {one['high']:.2f} | {height} |",
                    flush=True,
                )
    if chosen.json:
        write_durably(chosen.json, json.dumps(rows, indent=1).encode())


if __name__ == "__main__":
    main()
