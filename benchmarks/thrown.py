"""Thrown without a rotor: who comes back from any attitude and up to 10 rad/s about each axis.

    python benchmarks/thrown.py [--flights 100] [--height 10] [--seed 5] [--only LABEL ...]

Vehicles, their air and presets are those of the study `total-loss`, the law is ROISMC. The rotors are gone from the
first instant; mean wind of 5 m/s with gusts of Dryden's spectrum (5 m/s at 6 m), noisy sensors, 11 s. Each once
with the Luenberger observer, which starts with it and knows nothing, and once told at once, as by an autopilot that
flew when the rotor was lost. Survived, and height lost in the median of those that survived. Beside it the height
that no law could do without (`rotorfault.analysis.least_height`): what 95 % of the throws stay below, and from upside
down at rest.
"""

from __future__ import annotations

import argparse
from typing import Any

import numpy as np
from loss_claims import cases

import rotorfault as rf
from rotorfault.analysis.least_height import least_height
from rotorfault.analysis.vehicle_settings import vehicle_with

LABELS = ("mueller-2014: 1", "hummingbird: 3", "uzh-2020: 1", "hitsz: 1", "x500: 1", "mueller-2014: 1 and 2")
DIAGNOSES: dict[str, dict[str, Any]] = {
    "own observer": {"kind": "luenberger"},
    "told at once": {"kind": "delayed", "delay": 0.0},
}
SEED = 5
FASTEST = 10.0  # rad/s


def thrown(count: int, seed: int = SEED) -> dict[str, Any]:
    """Seeds, attitudes (any alike) and rates of the flights."""
    draw = np.random.default_rng(seed)
    angles = (
        draw.uniform(-np.pi, np.pi, count),
        np.arcsin(draw.uniform(-1.0, 1.0, count)),
        draw.uniform(-np.pi, np.pi, count),
    )
    varied: dict[str, Any] = {"seed": np.arange(count) + 1000 * ((seed - SEED) % 1_000_000)}
    varied |= {f"start.attitude.{axis}": angles[axis] for axis in range(3)}
    return varied | {f"start.body_rates.{axis}": draw.uniform(-FASTEST, FASTEST, count) for axis in range(3)}


def settings(chosen: dict[str, Any], diagnosis: dict[str, Any], height: float) -> dict[str, Any]:
    """Of the flights of a row."""
    return {
        **chosen,
        "fault": [{**fault, "time": 0.0} for fault in chosen["fault"]],
        "duration": 11.0,
        "start.position": [0.0, 0.0, height],
        "reference.position": [0.0, 0.0, height],
        "wind.velocity_W": [5.0, 0.0, 0.0],
        "wind.wind_at_6m": 5.0,
        "wind.altitude": height,
        "diagnosis": diagnosis,
    }


def physics(chosen: dict[str, Any], varied: dict[str, Any]) -> str:
    """What no law could do without: 95 % quantile of the throws, and upside down at rest."""
    own = {key: it for key, it in chosen.items() if key.startswith("vehicle.")}
    vehicle = vehicle_with(chosen["vehicle"], own)
    dead = {fault["rotor"] for fault in chosen["fault"]}
    tilt = np.arccos(np.cos(varied["start.attitude.0"]) * np.cos(varied["start.attitude.1"]))
    least = least_height(vehicle, dead, tilt, [varied[f"start.body_rates.{axis}"] for axis in range(3)])
    return f"{np.quantile(least, 0.95):.2f}, {float(least_height(vehicle, dead)):.2f} m"


def main() -> None:
    """Fly and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--flights", type=int, default=100)
    parser.add_argument("--height", type=float, default=10.0, help="m")
    parser.add_argument("--seed", type=int, default=SEED, help="of the throws and their gusts")
    known = cases()
    parser.add_argument("--only", nargs="+", choices=known, default=list(LABELS), metavar="LABEL")
    chosen = parser.parse_args()
    print(f"| lost | {' | '.join(DIAGNOSES)} | no law below |\n|" + " --- |" * (2 + len(DIAGNOSES)))
    for label in chosen.only:
        cells = []
        for diagnosis in DIAGNOSES.values():
            flown = settings(known[label], diagnosis, chosen.height)
            table = rf.fly_many("hover-fault", thrown(chosen.flights, chosen.seed), settings=flown).table
            survived = np.asarray(table["survived"], dtype=bool)
            lost = np.asarray(table["altitude_lost"], dtype=float)[survived]
            height = f"{np.median(lost):.2f} m" if lost.size else "-"
            cells.append(f"{int(survived.sum())} of {chosen.flights}; {height}")
        cells.append(physics(known[label], thrown(chosen.flights, chosen.seed)))
        print(f"| `{label}` | {' | '.join(cells)} |", flush=True)


if __name__ == "__main__":
    main()
