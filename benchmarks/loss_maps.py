"""The map of partial losses with yaw given up, before and after: kept upright, and spinning about an axis of its own.

    python benchmarks/loss_maps.py [--flights 100] [--only VEHICLE ...] [--out DIR]

The study `partial-loss-map` with two variants of ROISMC, on vehicles with a damping of yaw (that of
`total-loss`). Prints in how many cells inside the limit "yaw given up" at least 95 % of flights survive, and in how
many they succeed as well, and draws the share that survives in each cell, `DIR/survival.png`. What has been flown is
not flown again.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib import rc_context
from numpy.typing import NDArray

import rotorfault as rf
from rotorfault.campaigns.load import load_study
from rotorfault.campaigns.report.axis_drawing import SUCCESS_COLOURS, colours
from rotorfault.campaigns.report.maps import Maps, VariantMap
from rotorfault.campaigns.study import Study, study_from
from rotorfault.report.style import STYLE, VERMILION, new_figure

Array = NDArray[np.float64]
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


class Panel(NamedTuple):
    """What is drawn of one vehicle under one law."""

    vehicle: str
    law: str
    loss: Array
    wind: Array  # m/s
    share: Array  # of flights that survive: loss, wind
    inside: NDArray[np.bool_]  # the limit "yaw given up"


def panel(vehicle: str, maps: Maps, variant: VariantMap, survived: Array) -> Panel:
    """The map of survival of one law."""
    assert variant.possible is not None
    loss, wind = (view.positions for view in maps.views)
    share = survived[variant.cell]
    return Panel(vehicle, variant.label, loss, wind, share, variant.possible.without_yaw == 1.0)


def draw(panels: list[Panel], file: Path) -> None:
    """A row for each vehicle, a column for each law."""
    rows = len(panels) // len(LAWS)
    with rc_context(STYLE):
        figure = new_figure(1.6 + 3.9 * rows)
        grid = figure.subplots(rows, len(LAWS), sharex=True, sharey=True, squeeze=False)
        for one, axes in zip(panels, grid.flat, strict=True):
            drawn = axes.pcolormesh(
                one.loss,
                one.wind,
                100.0 * one.share.T,
                cmap=colours("survival", SUCCESS_COLOURS),
                vmin=0.0,
                vmax=100.0,
            )
            last = [one.loss[row].max(initial=0.0) for row in one.inside.T]
            limit = np.array(last) + 0.5 * np.diff(one.loss).min()
            (line,) = axes.plot(limit, one.wind, "--", color=VERMILION, linewidth=1.5)
            axes.set_title(f"{one.vehicle}, {one.law}")
            axes.grid(visible=False)
        for axes in grid[:, 0]:
            axes.set_ylabel("wind speed (m/s)")
        for axes in grid[-1]:
            axes.set_xlabel("loss of a rotor (\N{EN DASH})")
        figure.colorbar(drawn, ax=grid, label="flights that survive (%)", aspect=40.0)
        figure.legend([line], ["limit of hover, yaw given up"], loc="outside upper center")
        file.parent.mkdir(parents=True, exist_ok=True)
        figure.savefig(file)


def main() -> None:
    """Fly, draw and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--flights", type=int, default=100, help="of each law in each cell")
    first = ["paper", "hummingbird", "crazyflie-2.1", "x500"]
    parser.add_argument("--only", nargs="+", choices=cases(), default=first, metavar="VEHICLE")
    parser.add_argument("--out", type=Path, default=Path("results/loss-maps"))
    chosen = parser.parse_args()
    panels: list[Panel] = []
    for vehicle in chosen.only:
        done = rf.campaign(study(vehicle, chosen.flights), chosen.out / vehicle)
        table, maps = done.table().to_pandas(), done.maps()
        done.report()
        for variant in maps.variants:
            mine = table[table["variant"] == variant.label]
            cells = np.arange(variant.cell.max() + 1)
            one = panel(vehicle, maps, variant, mine.groupby("cell")["survived"].mean().reindex(cells).to_numpy())
            panels.append(one)
            good, within = int(np.count_nonzero(one.inside & (one.share >= SURE))), int(one.inside.sum())
            held = int(np.count_nonzero(one.inside & (variant.success_rate >= SURE)))
            print(
                f"{vehicle:<14} {variant.label:<13} {good} of {within} cells inside the limit "
                f"({100.0 * good / max(within, 1):.1f} %), {held} in place; largest loss inside "
                f"{np.max(one.loss[one.inside.any(axis=1)], initial=0.0):.3g}",
                flush=True,
            )
    draw(panels, chosen.out / "survival.png")
    print(f"drew {chosen.out / 'survival.png'}")


if __name__ == "__main__":
    main()
