"""Does diagnosis cost flights that survive without it? Healthy vehicles with a wrong model, and stuck rotors.

    python benchmarks/worse_than_none.py [--flights 100] [--duration 60] [--only healthy|stuck]
        [--detector luenberger]

``healthy``: no fault; true moments of inertia (each of its own, as far as a body can have them) 0.8 to 1.2 and rotor
bandwidth 0.7 to 1.4 times the believed, noisy sensors, gusts of 8 m/s at 6 m, 4 m squares and waypoints. Every flight
twice, with the same numbers, gusts and noise: with a detector (the Luenberger observer unless another is named) and
with diagnosis off. Per vehicle and controller: alarms per flight hour (all of them false) with the 95 % interval of a
Poisson count, and how many flights are lost with, without, and with alone.

``stuck``: rotor 2 sticks in hover at a share of its hover thrust, in gusts of 5 m/s, 5 s long; which rotors are
flagged, when, and how many flights are lost.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from typing import Any

import numpy as np
from scipy.stats import chi2

import rotorfault as rf
from rotorfault.maths.arrays import Array
from rotorfault.model.mixer import hover_thrust
from rotorfault.model.vehicle_file import load_vehicle
from rotorfault.scenario.scenario import scenario_from

VEHICLES = {"hummingbird": "gentle", "crazyflie-2.1": "gentle", "paper": "tuned"}  # with the preset that flies it
LAWS = ("roismc", "smc")
SIDE = 4.0  # m
SQUARE = {
    "kind": "square",
    "amplitude": [SIDE / 2, SIDE / 2, 0.5],
    "period": [8.0, 11.0, 14.0],
    "time_constant": [0.5, 0.5, 0.5],
}
CORNERS = [[0, 0, 0], [SIDE, 0, 0], [SIDE, SIDE, 1], [0, SIDE, 0], [0, 0, 1], [3, 1, 0]]
SHARES = (0.0, 0.2, 0.4, 0.6, 0.8, 0.9, 1.0, 1.1, 1.2, 1.35, 1.5, 1.75, np.inf)  # of hover thrust; inf: full thrust


def waypoints(duration: float) -> dict[str, Any]:
    """Corners of a room, one every 3 s, over and over."""
    count = int(duration / 3.0) + 1
    return {
        "kind": "waypoints",
        "points": [{"time": 3.0 * k, "position": CORNERS[k % len(CORNERS)]} for k in range(count)],
    }


def both(
    tables: Mapping[str, Any], vary: Mapping[str, Any], detector: str
) -> tuple[dict[str, Array], dict[str, Array]]:
    """Scores of the same flights with diagnosis and without."""
    with_it, without = (
        rf.fly_many(scenario_from({"period": 0.001, "sensors": "noisy", **tables, "diagnosis": kind}, "script"), vary)
        for kind in (detector, "off")
    )
    return with_it.table, without.table


def lost(with_it: Mapping[str, Array], without: Mapping[str, Array]) -> tuple[int, int, int]:
    """How many flights are lost with diagnosis, without, and with it alone."""
    one, other = (~np.asarray(table["survived"], dtype=bool) for table in (with_it, without))
    return int(one.sum()), int(other.sum()), int((one & ~other).sum())


def interval(count: int, hours: float) -> str:
    """95 % interval of a rate per hour."""
    low = chi2.ppf(0.025, 2 * count) / 2 if count else 0.0
    return f"{low / hours:.1f} to {chi2.ppf(0.975, 2 * count + 2) / 2 / hours:.1f}"


def row(*cells: object) -> None:
    """Print a line of a table."""
    print("  ".join(f"{cell!s:>14s}" for cell in cells), flush=True)


def bodies(vary: dict[str, Array], vehicle: str) -> dict[str, Array]:
    """The same factors, none beyond what a body can have: no moment is above the sum of the other two."""
    J = np.array(list(load_vehicle(vehicle).vehicle.inertia))
    moments = np.stack(list(vary.values())) * J[:, None]
    moments = np.minimum(moments, 0.999 * (moments.sum(axis=0) - moments))
    return dict(zip(vary, moments / J[:, None], strict=True))


def healthy(flights: int, duration: float, detector: str) -> None:
    """Print a row for each vehicle, controller and path."""
    row("vehicle", "law", "path", "alarms/h", "95 %", "lost with", "without", "only with")
    for vehicle, preset in VEHICLES.items():
        for law in LAWS:
            for name, path in (("square", SQUARE), ("waypoints", waypoints(duration))):
                rng = np.random.default_rng(len(name))
                vary = {f"mismatch.inertia.{axis}": rng.uniform(0.8, 1.2, flights) for axis in range(3)}
                vary = bodies(vary, vehicle)
                vary |= {"mismatch.rotor_bandwidth": rng.uniform(0.7, 1.4, flights), "seed": np.arange(flights)}
                tables = {
                    "name": "healthy",
                    "vehicle": vehicle,
                    "duration": duration,
                    "controller": {"kind": law, "preset": preset},
                    "reference": path,
                    "wind": {"kind": "dryden", "wind_at_6m": 8.0},
                    "mismatch": {"inertia": [1.0, 1.0, 1.0], "rotor_bandwidth": 1.0},
                    "start": {"position": [SIDE / 2, SIDE / 2, 0.5] if name == "square" else CORNERS[0]},
                }
                one, other = both(tables, vary, detector)
                alarms, hours = int(one["false_alarms"].sum()), float(one["end_time"].sum()) / 3600.0
                row(vehicle, law, name, f"{alarms / hours:.1f}", interval(alarms, hours), *lost(one, other))


def stuck(flights: int, detector: str) -> None:
    """Print a row for each vehicle, controller and share of hover thrust."""
    row("vehicle", "law", "thrust", "found", "delay [ms]", "others flagged", "lost with", "without", "only with")
    for vehicle, preset in VEHICLES.items():
        numbers = load_vehicle(vehicle).vehicle
        for law in LAWS:
            for share in SHARES:
                thrust = float(np.minimum(share * hover_thrust(numbers).r2, numbers.thrust_max))
                tables = {
                    "name": "stuck",
                    "vehicle": vehicle,
                    "duration": 5.0,
                    "controller": {"kind": law, "preset": preset},
                    "reference": {"kind": "set_point", "position": [0.0, 0.0, 0.0]},
                    "wind": {"kind": "dryden", "wind_at_6m": 5.0},
                    "fault": [{"kind": "stuck", "rotor": 2, "time": 1.0, "thrust": thrust}],
                }
                vary = {"seed": np.arange(flights), "fault.0.time": np.linspace(1.0, 1.3, flights)}
                one, other = both(tables, vary, detector)
                delay = one["detected.2"] - one["onset.2"]
                found = np.isfinite(delay) & (delay >= 0.0)
                median = f"{1e3 * np.median(delay[found]):.0f}" if found.any() else "-"
                others = int((one["false_alarms"] > 0).sum())
                row(vehicle, law, f"{share:g}", f"{100 * found.mean():.0f} %", median, others, *lost(one, other))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--flights", type=int, default=100, help="of each row")
    parser.add_argument("--duration", type=float, default=60.0, help="of healthy flights [s]")
    parser.add_argument("--detector", default="luenberger", help="beside no diagnosis")
    parser.add_argument("--only", choices=("healthy", "stuck"))
    chosen = parser.parse_args()
    if chosen.only != "stuck":
        healthy(chosen.flights, chosen.duration, chosen.detector)
    if chosen.only != "healthy":
        stuck(chosen.flights, chosen.detector)


if __name__ == "__main__":
    main()
