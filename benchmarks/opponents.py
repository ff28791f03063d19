"""The same flights by every controller: a rotor lost, two opposite ones, a partial loss, and sound rotors that track.

    python benchmarks/opponents.py [--flights 100] [--first-seed 0] [--only VEHICLE ...] [--cases CASE ...]
                                   [--laws LAW ...] [--json FILE]

Hover at 10 m, or a circle of 2 m at a rad/s (`tracking`), in wind of 5 m/s with gusts (Dryden, 5 m/s at 6 m) and with
noisy sensors; rotors stop, or lose 40 %, at 1 s; 15 s. Controllers that are told of faults have the Luenberger
observer in the loop; those that are not fly without a diagnosis. Every controller has the preset that the same search
found for it with the same budget, on `hummingbird`: `hummingbird` for flights that hold yaw, `spin` for total losses,
where it has one. Nothing was searched on another vehicle: `mueller-2014` and `hitsz` show what gains are worth there.

Seeds are the same for all, so each is compared with ROISMC pair by pair: Tango's interval of the differences of
survival and of being within 2 m, and the median differences of height lost and of the tracking error with intervals
of a bootstrap. Operations are those of a step of the whole quiet loop (`benchmarks/operations.py`), on a quadrotor.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from operations import loaded, operations
from total_loss import CASES, settings

import rotorfault as rf
from rotorfault.autopilot.presets import presets
from rotorfault.base.files import write_durably
from rotorfault.campaigns.sampling.paired import paired_difference
from rotorfault.campaigns.sampling.statistics import clopper_pearson

Array = NDArray[Any]
OURS = "roismc"
UNTOLD = ("pid_cascade", "geometric_adaptive", "uniform_passive")
KINDS = (OURS, "smc", "indi", "ndi_primary_axis", "lqr_relaxed_hover", "pid_cascade", "geometric", *UNTOLD[1:])
VEHICLES = ("hummingbird", "mueller-2014", "hitsz")
FLIGHTS = {
    "one": "One rotor lost",
    "opposite": "Two opposite rotors lost",
    "partial": "A rotor loses 40 %",
    "tracking": "Sound rotors, tracking",
}
NEAR = 2.0  # m
DRAWS = 2000  # of the bootstrap
CIRCLE = {
    "kind": "sinusoid", "amplitude": [2.0, 2.0, 0.5], "frequency": [1.0, 1.0, 1.0], "phase": [0.0, 1.5708, 0.0],
    "offset": [0.0, 0.0, 10.0],
}  # fmt: skip


def flight(vehicle: str, case: str, kind: str) -> dict[str, Any]:
    """Settings of the flights of a row."""
    dead = {"one": (1,), "opposite": CASES[vehicle].opposite}.get(case, ())
    chosen = settings(vehicle, dead, "smc")
    spins = bool(dead) and "spin" in presets(kind)
    known = "spin" if spins else "hummingbird" if "hummingbird" in presets(kind) else "none"
    chosen["controller"] = {"kind": kind, "preset": known}
    if case == "partial":
        chosen["fault"] = [{"kind": "step", "rotor": 1, "time": 1.0, "loss": 0.4}]
    if case == "tracking":
        chosen.pop("reference.position")
        chosen |= {"reference": CIRCLE, "start.position": [0.0, 2.0, 10.0]}
    if kind in UNTOLD:
        chosen["diagnosis"] = "off"
    return chosen


def flown(chosen: dict[str, Any], seeds: Array) -> dict[str, Array]:
    """Numbers of each flight of these settings."""
    table = rf.fly_many("hover-fault", {"seed": seeds}, settings=chosen).table
    end = sum(np.asarray(table[f"position_error_end.{axis}"], dtype=float) ** 2 for axis in "xyz")
    survived = np.asarray(table["survived"], dtype=bool)
    return {
        "survived": survived,
        "near": survived & (np.sqrt(end) < NEAR),
        **{key: np.asarray(table[key], dtype=float) for key in ("altitude_lost", "late_position_rms", "cost")},
    }


def compared(one: dict[str, Array], ours: dict[str, Array]) -> dict[str, list[float]]:
    """A controller less ours, pair by pair, each difference with its interval."""
    found: dict[str, list[float]] = {}
    for key in ("survived", "near"):
        a, b = one[key], ours[key]
        found[key] = [float(x) for x in paired_difference(int((a & ~b).sum()), int((b & ~a).sum()), len(a))]
    both = one["survived"] & ours["survived"]
    for key in ("altitude_lost", "late_position_rms"):
        gap = (one[key] - ours[key])[both]
        gap = gap[np.isfinite(gap)]
        if len(gap) > 1:
            draws = np.random.Generator(np.random.Philox(1)).integers(len(gap), size=(DRAWS, len(gap)))
            low, high = np.quantile(np.median(gap[draws], axis=1), (0.025, 0.975))
            found[key] = [float(np.median(gap)), float(low), float(high)]
    return found


def row(vehicle: str, case: str, kind: str, numbers: dict[str, Array], ours: dict[str, Array]) -> dict[str, Any]:
    """A row of the table."""
    survived, count = numbers["survived"], len(numbers["survived"])
    low, high = clopper_pearson(int(survived.sum()), count)

    def of_survivors(key: str, q: float) -> float | None:
        values = numbers[key][survived]
        values = values[np.isfinite(values)]
        return float(np.quantile(values, q)) if len(values) else None

    return {
        "vehicle": vehicle,
        "case": case,
        "controller": kind,
        "preset": flight(vehicle, case, kind)["controller"]["preset"],
        "told": kind not in UNTOLD,
        "flights": count,
        "survived": int(survived.sum()),
        "low": float(low),
        "high": float(high),
        "within_2m": int(numbers["near"].sum()),
        "height_lost_median": of_survivors("altitude_lost", 0.5),
        "height_lost_p95": of_survivors("altitude_lost", 0.95),
        "late_position_rms_median": of_survivors("late_position_rms", 0.5),
        "cost_median": of_survivors("cost", 0.5),
        "against_ours": compared(numbers, ours),
    }


def line(one: dict[str, Any]) -> str:
    """A row as Markdown."""

    def number(key: str, digits: int = 2) -> str:
        return "-" if one[key] is None else f"{one[key]:.{digits}f}"

    def gap(key: str) -> str:
        known = one["controller"] != OURS and key in one["against_ours"]
        return "{:+.2f} ({:+.2f}, {:+.2f})".format(*one["against_ours"][key]) if known else ""

    tracks = one["case"] == "tracking"
    lost = f"{number('height_lost_median')}, {number('height_lost_p95')}" if one["survived"] else "-"
    cells = [
        f"`{one['vehicle']}`",
        f"`{one['controller']}`",
        str(one["survived"]),
        str(one["within_2m"]),
        "" if tracks else lost,
        number("late_position_rms_median"),
        number("cost_median", 1),
        gap("survived"),
        gap("near"),
        "" if tracks else gap("altitude_lost"),
        gap("late_position_rms"),
    ]
    return f"| {' | '.join(cells)} |"


def main() -> None:
    """Fly and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--flights", type=int, default=100)
    parser.add_argument("--first-seed", type=int, default=0)
    parser.add_argument("--only", nargs="+", choices=VEHICLES, default=list(VEHICLES))
    parser.add_argument("--cases", nargs="+", choices=FLIGHTS, default=list(FLIGHTS))
    parser.add_argument("--laws", nargs="+", choices=KINDS, default=list(KINDS), help="beside ROISMC")
    parser.add_argument("--json", type=Path)
    asked = parser.parse_args()
    counts = {kind: operations(loaded("hover-fault", {"controller.kind": kind}), False).total() for kind in KINDS}
    print("operations of a step: " + ", ".join(f"{kind} {count:,d}" for kind, count in counts.items()))
    seeds, rows = np.arange(asked.first_seed, asked.first_seed + asked.flights), []
    for case in asked.cases:
        print(
            f"\n## {FLIGHTS[case]}\n\n| vehicle | controller | survived of {asked.flights} | within 2 m "
            "| height lost [m]: median, 95 % | late error [m] | cost J | survival less ROISMC's | within 2 m less "
            "ROISMC's | height lost less ROISMC's [m] | error less ROISMC's [m] |\n|" + " --- |" * 11
        )
        for vehicle in asked.only:
            ours = flown(flight(vehicle, case, OURS), seeds)
            for kind in (OURS, *(kind for kind in KINDS[1:] if kind in asked.laws)):
                numbers = ours if kind == OURS else flown(flight(vehicle, case, kind), seeds)
                rows.append(row(vehicle, case, kind, numbers, ours))
                print(line(rows[-1]), flush=True)
    if asked.json:
        write_durably(asked.json, json.dumps(rows, indent=1).encode())


if __name__ == "__main__":
    main()
