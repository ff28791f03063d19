"""What do PX4's failure modes give a hexarotor that loses a rotor, beside allocation with the believed effectiveness?

    python benchmarks/failure_modes.py [--flights 100] [--seed 1] [--loads 1 1.35] [--out failure_modes.json]

Hover 5 m above ground in wind and gusts, with noisy sensors; after 1 s (to 1.3 s) one rotor loses all of its thrust.
The diagnosis finds out (Luenberger observer), nobody is told. Every rotor of every vehicle is lost in so many
flights, each with a direction of the wind, gusts and noise of its own, the same for all allocators:

    sequential, ignore            PX4's desaturation, CA_FAILURE_MODE 0
    sequential, stop_opposite     1: the failed rotor is taken out, its opposite stopped
    sequential, reverse_opposite  2: the failed rotor is taken out, its opposite reversed, to -0.4 thrust_max at most
    effectiveness                 the rotors that are left, in strict order tilt, thrust, yaw
    effectiveness, reversible     the same where every rotor may be reversed down to -0.4 thrust_max

Told are the flights lost, with the exact (Clopper and Pearson) 95 % interval; of those that are not, the median and
the worst height lost, and of yaw the median error and rate (both root mean square over the last half). A load is a
factor on the mass, believed as well.
"""

from __future__ import annotations

import argparse
import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import rotorfault as rf
from rotorfault.base.files import write_atomically
from rotorfault.base.progress import Bar
from rotorfault.base.text_table import table_lines
from rotorfault.campaigns.sampling.statistics import clopper_pearson
from rotorfault.maths.arrays import Array

VEHICLES = ("du-pnpnpn", "du-ppnnpn", "f550")
ROTORS = 6
WIND, GUSTS = 5.0, 6.0  # m/s: mean, and at 6 m for the gusts
REVERSE = 0.4  # of the largest thrust, PX4's CA_REV_THR_FRAC
LAST_HALF = 5.0  # s


class Contender(NamedTuple):
    """An allocation that is compared."""

    name: str
    allocation: dict[str, Any]
    reversible: bool


CONTENDERS = (
    *(
        Contender(f"sequential, {mode}", {"kind": "sequential", "failure_mode": mode}, mode == "reverse_opposite")
        for mode in ("ignore", "stop_opposite", "reverse_opposite")
    ),
    Contender("effectiveness", {"kind": "effectiveness"}, False),
    Contender("effectiveness, reversible", {"kind": "effectiveness"}, True),
)


def scenario_of(vehicle: str, contender: Contender, load: float, law: tuple[str, str]) -> rf.Scenario:
    """Hover of a vehicle with a load, in wind."""
    numbers = rf.load_vehicle(vehicle).vehicle
    settings: dict[str, Any] = {
        "vehicle": vehicle,
        "vehicle.mass.value": load * float(numbers.mass),
        "controller": {"kind": law[0], "preset": law[1]},
        "allocation": contender.allocation,
        "wind.wind_at_6m": GUSTS,
        "fault.0.loss": 1.0,
    }
    if contender.reversible:
        settings["vehicle.thrust_min.value"] = -REVERSE * float(numbers.thrust_max)
    return rf.load_scenario("hover-fault", settings)


def flown(scenario: rf.Scenario, rotor: int, flights: int, seed: int) -> dict[str, Array]:
    """Numbers of flights that lose a rotor."""
    rng = np.random.default_rng((seed, rotor))
    to = rng.uniform(0.0, 2.0 * math.pi, flights)
    vary = {
        "wind.velocity_W.0": WIND * np.cos(to),
        "wind.velocity_W.1": WIND * np.sin(to),
        "fault.0.time": rng.uniform(1.0, 1.3, flights),
        "fault.0.rotor": np.full(flights, rotor),
        "seed": seed * 100_000 + rotor * 1_000 + np.arange(flights),
    }
    found = rf.fly_many(scenario, vary, record=["body_rates"], record_period=0.05, warn=False)
    late = found.signals[found.times >= LAST_HALF][:, found.names.index("body_rates.z")]
    table = found.table
    return {
        "survived": np.asarray(table["survived"], dtype=bool),
        "altitude_lost": np.asarray(table["altitude_lost"]),
        "yaw_error": np.asarray(table["late_yaw_rms"]),
        "yaw_rate": np.sqrt(np.mean(late**2, axis=0)),
        "found": np.asarray(table[f"detected.{rotor}"] - table[f"onset.{rotor}"]),
    }


def told(numbers: dict[str, Array]) -> dict[str, float | None]:
    """Counts, the interval, and quantiles of flights that are not lost; None where all are."""
    alive = numbers["survived"].astype(bool)
    lost, count = int((~alive).sum()), len(alive)
    low, high = (float(end) for end in clopper_pearson(lost, count))

    def of_alive(name: str, what: Callable[[Array], Any], unit: float = 1.0) -> float | None:
        return unit * float(what(numbers[name][alive])) if alive.any() else None

    return {
        "flights": count,
        "lost": lost,
        "lost from": low,
        "lost to": high,
        "found after [ms]": 1e3 * float(np.nanmedian(numbers["found"])),
        "height lost [m]": of_alive("altitude_lost", np.median),
        "worst height lost [m]": of_alive("altitude_lost", np.max),
        "yaw error [deg]": of_alive("yaw_error", np.median, math.degrees(1.0)),
        "yaw rate [rad/s]": of_alive("yaw_rate", np.median),
    }


def study(chosen: argparse.Namespace) -> dict[str, Any]:
    """All flights, per rotor and in all."""
    rows: list[dict[str, Any]] = []
    law = (chosen.controller, chosen.preset)
    total = len(chosen.loads) * len(chosen.vehicles) * len(CONTENDERS) * ROTORS * chosen.flights
    with Bar("failure modes", total, "flights") as bar:
        done = 0
        for load in chosen.loads:
            for vehicle in chosen.vehicles:
                for contender in CONTENDERS:
                    scenario = scenario_of(vehicle, contender, load, law)
                    each = []
                    for rotor in range(1, ROTORS + 1):
                        each.append(flown(scenario, rotor, chosen.flights, chosen.seed))
                        done += chosen.flights
                        bar.update(done, f"{vehicle}: {contender.name}")
                    numbers = rf.load_vehicle(vehicle).vehicle
                    ratio = ROTORS * numbers.thrust_max * numbers.rotor_gain / (load * numbers.mass * numbers.gravity)
                    whole = {name: np.concatenate([one[name] for one in each]) for name in each[0]}
                    rows.append(
                        {
                            "vehicle": vehicle,
                            "load": load,
                            "thrust to weight": float(ratio),
                            "allocation": contender.name,
                            **told(whole),
                            "by rotor": [told(one) for one in each],
                        }
                    )
    return {
        "seed": chosen.seed,
        "flights of each rotor": chosen.flights,
        "controller": " ".join(law),
        "wind [m/s]": WIND,
        "gusts at 6 m [m/s]": GUSTS,
        "rows": rows,
    }


def number(value: float | None, digits: int) -> str:
    return "-" if value is None else f"{value:.{digits}f}"


def lines(rows: list[dict[str, Any]]) -> list[str]:
    """The table in words."""
    head = [
        "vehicle",
        "T/W",
        "allocation",
        "lost",
        "95 %",
        "height lost, worst [m]",
        "yaw error [deg]",
        "rate [rad/s]",
    ]
    head.append("lost of rotor 1 to 6")
    cells = [
        [
            row["vehicle"],
            f"{row['thrust to weight']:.2f}",
            row["allocation"],
            f"{row['lost']} of {row['flights']}",
            f"{100 * row['lost from']:.1f} to {100 * row['lost to']:.1f} %",
            f"{number(row['height lost [m]'], 2)}, {number(row['worst height lost [m]'], 2)}",
            number(row["yaw error [deg]"], 0),
            number(row["yaw rate [rad/s]"], 2),
            " ".join(str(one["lost"]) for one in row["by rotor"]),
        ]
        for row in rows
    ]
    return table_lines([head, *cells], "<><>>>>>>", rule=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--flights", type=int, default=100, help="of each rotor of each row")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--loads", type=float, nargs="+", default=[1.0, 1.35], help="factors on the mass")
    parser.add_argument("--vehicles", nargs="+", default=list(VEHICLES), choices=VEHICLES, help="hexarotors")
    parser.add_argument("--controller", default="roismc")
    parser.add_argument("--preset", default="quiet")
    parser.add_argument("--out", type=Path, help="JSON file")
    chosen = parser.parse_args()
    found = study(chosen)
    print("\n".join(lines(found["rows"])))
    if chosen.out:
        text = json.dumps(found, indent=1) + "\n"
        write_atomically(chosen.out, lambda path: path.write_text(text, encoding="utf-8"))


if __name__ == "__main__":
    main()
