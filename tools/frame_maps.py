"""Fly what frames of six and eight rotors can lose, and keep the numbers that `rotorfault frames` shows.

    python tools/frame_maps.py                     all maps, their pages and pictures, signatures, and the kept file
    python tools/frame_maps.py maps y6 x8          maps of some vehicles alone; nothing is kept
    python tools/frame_maps.py signatures x8       losses from which the diagnosis is right, by flights

Maps are campaigns of the study `frame-loss-map` at a thrust-to-weight ratio of 2.5: every rotor, losses up to all of
it, ROISMC and SMC, with the diagnosis in the loop. Interrupted, they are resumed. Flights at a total loss that are no
success are flown again, to say why.
"""

from __future__ import annotations

import argparse
import json
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

import rotorfault as rf
from rotorfault._version import __version__
from rotorfault.analysis.controllability import control_authority, hover_problem
from rotorfault.base.files import write_atomically
from rotorfault.campaigns.axes import columns
from rotorfault.campaigns.grades import grades
from rotorfault.campaigns.sampling.statistics import clopper_pearson

ROOT = Path(__file__).parents[1]
KEPT = ROOT / "src" / "rotorfault" / "analysis" / "flown_frames.json"
RESULTS = ROOT / "results" / "frame-maps"
FRAMES = {"du-pnpnpn": "du-pnpnpn", "du-ppnnpn": "du-ppnnpn", "y6": "y6b", "octa-x": "octa-x", "x8": "octaquad-x"}
"""Vehicles, and the frames whose motors theirs are, under the same numbers."""
RATIO = 2.5  # thrust to weight
LATE = 0.1  # s from the onset: within it a flat frame with a dead rotor tilts by a few degrees
SIGNATURE_LOSSES = (0.1, 0.11, 0.12, 0.13, 0.15, 0.18, 0.22, 0.27, 0.33, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0)
TRIES = 100


def thrust_max(vehicle: str) -> float:
    """Largest thrust of a rotor in N that gives the ratio."""
    v = rf.load_vehicle(vehicle).vehicle
    return float(f"{RATIO * v.mass * v.gravity / v.rotors:.6g}")


def settings_of(vehicle: str) -> dict[str, Any]:
    """Of a vehicle with the ratio."""
    return {"vehicle.thrust_max.value": thrust_max(vehicle)}


def fly_map(vehicle: str) -> rf.Campaign:
    """The map of one vehicle; one that is complete is taken as it is."""
    folder = RESULTS / vehicle
    if (folder / "flights.parquet").is_file():
        return rf.Campaign(folder)
    there, own = (folder / "study.json").is_file(), settings_of(vehicle)
    return rf.campaign("frame-loss-map", folder, resume=there, vehicle=vehicle, settings=own, say=print)


def rows_of(vehicle: str, done: rf.Campaign) -> list[dict[str, Any]]:
    """Cells of a map as rows: what was flown, the prediction, and why flights at a total loss were no success."""
    table, sound = done.table().to_arrow(), hover_problem(rf.load_vehicle(vehicle).vehicle)
    factor = RATIO * sound.needed[0] / sound.high.sum()
    rows = []
    for variant in [one.label for one in done.study.variant]:
        for cell in range(done.study.cells):
            values = {name: float(v[0]) for name, v in done.study.cell_values(np.array([cell])).items()}
            mine = table.filter(pc.and_(pc.equal(table["variant"], variant), pc.equal(table["cell"], cell)))
            rotor, loss, count = int(values["rotor"]), values["loss"], len(mine)
            share = np.where(np.arange(1, len(sound.high) + 1) == rotor, 1.0 - loss, 1.0)
            problem = sound._replace(low=sound.low * factor * share, high=sound.high * factor * share)
            good = int(pc.sum(mine["success"]).as_py())
            held = int(pc.sum(pc.equal(mine["grade"], "held")).as_py())
            row = {
                "vehicle": vehicle, "frame": FRAMES[vehicle], "controller": variant, "rotor": rotor, "loss": loss,
                "flights": count, "held": _share(held, count), "survived": _share(good, count),
                "acai": [round(control_authority(problem.within(k)).acai, 4) for k in (4, 3)],
            }  # fmt: skip
            if good < count:
                row["why_not"] = why_not(done, variant, mine.filter(pc.invert(mine["success"])))
            rows.append(row)
    return rows


def _share(good: int, count: int) -> list[float]:
    """Number of flights, and the exact interval of their share."""
    lower, upper = clopper_pearson(good, count)
    return [good, round(float(lower), 4), round(float(upper), 4)]


def why_not(done: rf.Campaign, variant: str, failed: pa.Table) -> dict[str, int]:
    """Flights that were no success, by what the diagnosis had made of the fault."""
    study = done.study
    number = [one.label for one in study.variant].index(variant)
    names = [part.name for part in (*study.axis, *study.draw)]
    varied = columns({name: failed[name].to_numpy(zero_copy_only=False) for name in names})
    varied = {**varied, "seed": failed["seed"].to_numpy(zero_copy_only=False)}
    flown = rf.fly_many(study.scenarios[number], varied, warn=False).table
    grade = grades(flown)
    reasons: Counter[str] = Counter()
    for i, rotor in enumerate(failed["rotor"].to_pylist()):
        row = flown.row(i)
        delay = row[f"detected.{int(rotor)}"] - row[f"onset.{int(rotor)}"]
        found = "not found" if not np.isfinite(delay) else "found late" if delay > LATE else "found"
        wrong = " and sound rotors blamed" if row["false_alarms"] else ""
        reasons[f"{found}{wrong}, {grade[i]}"] += 1
    return dict(reasons)


def signature_rows(vehicle: str) -> list[dict[str, Any]]:
    """How often the diagnosis names the rotor and no other, by loss, in a noisy hover with light gusts."""
    v = rf.load_vehicle(vehicle).vehicle
    draw = np.random.default_rng(1)
    count = TRIES * len(SIGNATURE_LOSSES)
    rotor = np.tile(np.arange(1, v.rotors + 1), -(-TRIES // v.rotors))[:TRIES]
    varied = {
        "fault.0.rotor": np.tile(rotor, len(SIGNATURE_LOSSES)),
        "fault.0.loss": np.repeat(SIGNATURE_LOSSES, TRIES),
        "fault.0.time": draw.uniform(0.5, 1.0, count),
        "seed": np.arange(count),
    }
    common = {"vehicle": vehicle, **settings_of(vehicle), "duration": 3.0, "controller.preset": "midsize"}
    flown = rf.fly_many("hover-fault", varied, settings=common, warn=False).table
    found = np.array([np.isfinite(flown[f"detected.{r}"][i]) for i, r in enumerate(varied["fault.0.rotor"])])
    right = (found & (flown["false_alarms"] == 0)).reshape(-1, TRIES).sum(axis=1)
    wrong = (flown["false_alarms"] > 0).reshape(-1, TRIES).sum(axis=1)
    told = rf.told_apart(v._replace(thrust_max=thrust_max(vehicle)))
    return [
        {"vehicle": vehicle, "loss": loss, "flights": TRIES, "right": int(yes), "others_blamed": int(no),
         "predicted_least_loss": round(max(one.least_loss for one in told.singles), 4)}
        for loss, yes, no in zip(SIGNATURE_LOSSES, right, wrong, strict=True)
    ]  # fmt: skip


def keep(cells: list[dict[str, Any]], signatures: list[dict[str, Any]]) -> None:
    """Write the file that comes with the package."""
    about = {
        "version": __version__, "command": "python tools/frame_maps.py", "study": "frame-loss-map", "seed": 0,
        "thrust_to_weight": RATIO, "preset": "midsize", "diagnosis": "luenberger",
        "flights": sum(row["flights"] for row in cells),
    }  # fmt: skip
    lists = {"cells": cells, "signatures": signatures}
    parts = [f'"about": {json.dumps(about)}']
    parts += [f'"{name}": [\n' + ",\n".join(map(json.dumps, rows)) + "\n]" for name, rows in lists.items()]
    text = "{\n" + ",\n".join(parts) + "\n}\n"
    write_atomically(KEPT, lambda temporary: temporary.write_text(text, encoding="utf-8"))
    print(f"wrote {KEPT}")


def main() -> None:
    """Fly what is asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", nargs="?", choices=("all", "maps", "signatures"), default="all")
    parser.add_argument("vehicles", nargs="*", help=", ".join(FRAMES))
    asked = parser.parse_args()
    vehicles = asked.vehicles or list(FRAMES)
    cells = [row for one in vehicles if asked.what != "signatures" for row in rows_of(one, fly_map(one))]
    signatures = [row for one in vehicles if asked.what != "maps" for row in signature_rows(one)]
    for row in (*cells, *signatures):
        print(json.dumps(row))
    if asked.what == "all" and not asked.vehicles:
        keep(cells, signatures)
    for one in vehicles if asked.what != "signatures" else ():
        print(fly_map(one).report()[0])


if __name__ == "__main__":
    main()
