"""The map of partial losses with yaw given up, before and after: kept upright, and spinning about an axis of its own.

    python benchmarks/loss_maps.py [--flights 100] [--only VEHICLE ...] [--out DIR]

The study `partial-loss-map` with two variants of ROISMC, on vehicles with a damping of yaw (that of
`total-loss`). Prints in how many cells inside the limit "yaw given up" at least 95 % of flights survive.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import numpy as np

import rotorfault as rf
from rotorfault.campaigns.load import load_study
from rotorfault.campaigns.study import Study, study_from

SURE = 0.95
LAWS = {"kept upright": "upright", "spinning": "relaxed"}


def cases() -> dict[str, dict[str, Any]]:
    """Settings of each vehicle: those of its first case in the study of total losses, less its faults."""
    (lost,) = (part for part in load_study("total-loss").axis if part.name == "lost")
    return {
        str(case.settings["vehicle"]): {key: value for key, value in case.settings.items() if key != "fault"}
        for case in reversed(lost.case)
    }


def study(vehicle: str, flights: int) -> Study:
    """The study of one vehicle."""
    tables = load_study("partial-loss-map").as_tables()
    tables["name"] = f"loss-map-{vehicle}"
    tables["settings"] = cases()[vehicle]
    tables["variant"] = [
        {"label": label, "settings": {"controller.kind": "roismc", "controller.cascade.yaw_lost": axis}}
        for label, axis in LAWS.items()
    ]
    tables["refine"] = {"initial": flights, "block": flights, "most": flights}
    return study_from(tables, "loss_maps.py")


def main() -> None:
    """Fly, draw and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--flights", type=int, default=100, help="of each law in each cell")
    parser.add_argument("--only", nargs="+", default=["paper", "hummingbird", "crazyflie-2.1", "x500"])
    parser.add_argument("--out", type=Path, default=Path("results/loss-maps"))
    chosen = parser.parse_args()
    for vehicle in chosen.only:
        done = rf.campaign(study(vehicle, chosen.flights), chosen.out / vehicle)
        table, maps = done.table().to_pandas(), done.maps()
        done.report()
        for variant in maps.variants:
            mine = table[table["variant"] == variant.label]
            rate = mine.groupby("cell")["survived"].mean()
            share = rate.reindex(variant.cell.ravel()).to_numpy().reshape(variant.cell.shape)
            assert variant.possible is not None
            inside = variant.possible.without_yaw == 1.0
            good = int(np.count_nonzero(inside & (share >= SURE)))
            print(
                f"{vehicle:<14} {variant.label:<13} {good} of {int(inside.sum())} cells inside the limit "
                f"({100.0 * good / max(int(inside.sum()), 1):.1f} %); largest loss inside "
                f"{np.max(maps.views[0].positions[inside.any(axis=1)], initial=0.0):.3g}",
                flush=True,
            )


if __name__ == "__main__":
    main()
