"""Search the preset `midsize` of a law anew: gains for a class of rotors, not for one vehicle.

    python tools/class_presets.py roismc --out results/midsize-roismc.toml

Laws ask for angular accelerations, so inertia, arms and number of rotors are not in their gains: what limits them is
the rotors' bandwidth, and the least acceleration that a vehicle of the class can give. The flights of the search are
therefore of four vehicles unlike each other (a weak quadrotor, two hexarotors, a coaxial octorotor; rotors of 33 to
53 rad/s), and `tests/flight/test_presets_of_vehicles.py` flies others with what it finds.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import rotorfault as rf
from rotorfault.scenario.library import load_scenario
from rotorfault.scenario.scenario import Scenario

VEHICLES = ("x500", "f550", "du-ppnnpn", "x8")
BANDWIDTH = 40.0  # rad/s: of most rotors of 8 to 12 inches, and in the middle of those searched with
# A loss that the weakest, of 1.7 times its weight in thrust, can bear with yaw held, with a reserve against wind.
FAULT = [{"kind": "step", "rotor": 1, "time": 1.8, "loss": 0.3}]
NAME = "midsize"


def flights() -> list[Scenario]:
    """A step of 2 m out of 45 degrees of tilt in wind, and a noisy hover; both with a fault, of each vehicle."""
    common: dict[str, Any] = {"plant": "rigid_body", "duration": 6.0, "fault": FAULT}
    names = ("paper-set-point", "hover-fault")
    return [load_scenario(name, {**common, "vehicle": vehicle}) for vehicle in VEHICLES for name in names]


def main() -> None:
    """Search, and write the preset."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("law", choices=("roismc", "smc"))
    parser.add_argument("--generations", type=int, default=55)
    parser.add_argument("--neighbours", type=int, default=3, help="training flights of each vehicle and scenario")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--out", type=Path, required=True)
    asked = parser.parse_args()
    found = rf.tune(
        asked.law, flights(), objective="quiet", generations=asked.generations, neighbours=asked.neighbours,
        seed=asked.seed,
    )  # fmt: skip
    made_for = {"vehicle": ", ".join(VEHICLES), "rotor_bandwidth": BANDWIDTH}
    print(found._replace(record={**found.record, **made_for}).save(asked.out, NAME))


if __name__ == "__main__":
    main()
