"""What does it cost to act on a wrong diagnosis? Made-up beliefs beside none, on the same flights.

    python benchmarks/wrong_belief.py [--flights 200] [--vehicles hummingbird ...]

Hover in gusts of 8 m/s with sensor noise. A rotor loses a share at 1 s, or none does; from 50 ms later on a belief is
made up that lasts to the end, or for 0.5 s, after which a detector would have taken it back: the right rotor, the
right rotor with half or one and a half times its loss, the opposite rotor, a neighbour, a neighbour stuck at one and
a half times hover. Per row: flights lost with the belief, without any, with it alone; and the exact one-sided 95 %
bound of the share that is lost by the belief alone (Clopper and Pearson).
"""

from __future__ import annotations

import argparse
from typing import Any

import numpy as np
from scipy.stats import beta

import rotorfault as rf
from rotorfault.maths.arrays import Array
from rotorfault.scenario.scenario import scenario_from

VEHICLES = {"hummingbird": "gentle", "crazyflie-2.1": "gentle", "x500": "midsize"}  # with the preset that flies it
LOSSES = (0.0, 0.15, 0.3, 0.5)
ONSET, LATE, BRIEF = 1.0, 0.05, 0.5  # s
Belief = dict[str, Any]


def beliefs(loss: float) -> dict[str, Belief]:
    """What is believed, by name; rotor 2 is at fault."""
    size = loss if loss > 0.0 else 0.3
    right = {} if loss == 0.0 else {"right": {"rotor": 2, "loss": loss}, "half": {"rotor": 2, "loss": 0.5 * loss},
                                   "half more": {"rotor": 2, "loss": min(1.5 * loss, 1.0)}}  # fmt: skip
    return right | {
        "opposite": {"rotor": 1, "loss": size},
        "neighbour": {"rotor": 3, "loss": size},
        "neighbour dead": {"rotor": 3, "loss": 1.0},
        "stuck high": {"rotor": 3, "stuck": 1.5},
    }


def survived(vehicle: str, loss: float, diagnosis: Any, seeds: Array) -> Array:
    """Whether each flight is."""
    tables: dict[str, Any] = {
        "name": "wrong-belief", "vehicle": vehicle, "duration": 5.0, "period": 0.001, "sensors": "noisy",
        "controller": {"kind": "roismc", "preset": VEHICLES[vehicle]},
        "reference": {"kind": "set_point", "position": [0.0, 0.0, 0.0]},
        "wind": {"kind": "dryden", "wind_at_6m": 8.0},
        "diagnosis": diagnosis,
    }  # fmt: skip
    if loss > 0.0:
        tables["fault"] = [{"kind": "step", "rotor": 2, "time": ONSET, "loss": loss}]
    flights = rf.fly_many(scenario_from(tables, "script"), {"seed": seeds}, warn=False)
    return np.asarray(flights.table["survived"], dtype=bool)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--flights", type=int, default=200, help="of each row")
    parser.add_argument("--vehicles", nargs="+", default=list(VEHICLES), choices=list(VEHICLES))
    chosen = parser.parse_args()
    seeds = np.arange(chosen.flights)
    cells = ("vehicle", "loss", "belief", "for", "lost with", "without", "with alone", "at most")
    print("  ".join(f"{cell:>14s}" for cell in cells))
    for vehicle in chosen.vehicles:
        for loss in LOSSES:
            without = survived(vehicle, loss, "off", seeds)
            for name, belief in beliefs(loss).items():
                for lasts, end in (("0.5 s", ONSET + LATE + BRIEF), ("ever", 1e6)):
                    made_up = {"kind": "injected", "time": ONSET + LATE, "end": end, **belief}
                    with_it = survived(vehicle, loss, made_up, seeds)
                    alone = int((without & ~with_it).sum())
                    bound = beta.ppf(0.95, alone + 1, len(seeds) - alone) if alone < len(seeds) else 1.0
                    lost = (~with_it).sum(), (~without).sum()
                    row = (vehicle, f"{loss:g}", name, lasts, *lost, alone, f"{100 * bound:.1f} %")
                    print("  ".join(f"{cell!s:>14s}" for cell in row), flush=True)


if __name__ == "__main__":
    main()
