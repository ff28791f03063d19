"""Presets `spin` of a search against those that ship, on flights that no search and no table has seen.

    python benchmarks/spin_presets.py FOLDER [--laws LAW ...] [--flights 200] [--first-seed 1000] [--json FILE]

`FOLDER/LAW.toml` holds the preset `spin` that `rotorfault tune LAW --name spin --out FOLDER/LAW.toml` found. Flights
are those of `opponents.py`: the one that was searched (`hummingbird` without rotor 1 in 5 m/s of wind), one in more
wind than was searched (without 3 in 9 m/s), and another vehicle (`mueller-2014` without 1 in 9 m/s). Seeds begin at
1000: searches draw theirs from 90,000 on, tables from 0 on.

The new preset is kept if more of all these flights end within 2 m, by Tango's interval of the difference; if that
interval has 0 in it, if its late error is less in the median, by the bootstrapped interval; else the old one stays.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from opponents import compared, flight, flown

from rotorfault.base.files import write_durably

LAWS = ("roismc", "smc", "indi", "ndi_primary_axis", "lqr_relaxed_hover", "uniform_passive")
# Vehicle, rotor lost, mean wind in m/s.
FLOWN = (("hummingbird", 1, 5.0), ("hummingbird", 3, 9.0), ("mueller-2014", 1, 9.0))


def flights(law: str, preset: str, seeds: NDArray[Any]) -> list[dict[str, NDArray[Any]]]:
    """Numbers of each flight, by what is flown."""
    found = []
    for vehicle, rotor, wind in FLOWN:
        chosen = flight(vehicle, "one", law) | {"wind.velocity_W": [wind, 0.0, 0.0]}
        chosen["controller"] = {"kind": law, "preset": preset}
        chosen["fault"] = [{"kind": "total", "rotor": rotor, "time": 1.0}]
        found.append(flown(chosen, seeds))
    return found


def counts(one: dict[str, NDArray[Any]]) -> str:
    """Survived, within 2 m, height lost and late error, in a cell of a table."""
    up = one["survived"]
    lost, late = (np.median(one[key][up]) if up.any() else np.nan for key in ("altitude_lost", "late_position_rms"))
    return f"{up.sum()}, {one['near'].sum()}; {lost:.2f}, {late:.2f}"


def better(differences: dict[str, list[float]]) -> bool:
    """Whether the new preset is kept."""
    _, low, high = differences["near"]
    if low > 0.0 or high < 0.0:
        return low > 0.0
    return "late_position_rms" in differences and differences["late_position_rms"][2] < 0.0


def main() -> None:
    """Fly and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--laws", nargs="+", choices=LAWS, default=list(LAWS))
    parser.add_argument("--flights", type=int, default=200)
    parser.add_argument("--first-seed", type=int, default=1000)
    parser.add_argument("--json", type=Path)
    asked = parser.parse_args()
    seeds = np.arange(asked.first_seed, asked.first_seed + asked.flights)
    names = " | ".join(f"`{vehicle}` without {rotor}, {wind:g} m/s" for vehicle, rotor, wind in FLOWN)
    print(f"of {asked.flights}: up, within 2 m; height lost and late error in the median [m]\n")
    print(f"| law | preset | {names} | within 2 m, new less old | late error, new less old [m] | kept |")
    print("|" + " --- |" * (5 + len(FLOWN)))
    rows = []
    for law in asked.laws:
        old, new = (flights(law, preset, seeds) for preset in ("spin", f"{asked.folder / law}.toml:spin"))
        whole = ({key: np.concatenate([one[key] for one in each]) for key in each[0]} for each in (new, old))
        differences = compared(*whole)
        kept = better(differences)
        gaps = ["{:+.2f} ({:+.2f}, {:+.2f})".format(*differences[key]) if key in differences else ""
                for key in ("near", "late_position_rms")]  # fmt: skip
        print(f"| `{law}` | old | {' | '.join(map(counts, old))} |  |  | {'' if kept else 'yes'} |")
        print(
            f"| | new | {' | '.join(map(counts, new))} | {' | '.join(gaps)} | {'yes' if kept else ''} |", flush=True
        )
        both = {"old": list(map(counts, old)), "new": list(map(counts, new))}
        rows.append({"law": law, **both, "differences": differences, "kept": "new" if kept else "old"})
    if asked.json:
        write_durably(asked.json, json.dumps(rows, indent=1).encode())


if __name__ == "__main__":
    main()
