"""A study small enough for tests, and what a process does that flies it."""

from __future__ import annotations

from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from rotorfault.base.executors import InProcess
from rotorfault.campaigns import rounds, run
from rotorfault.campaigns.study import study_from

TINY: dict[str, Any] = {
    "name": "tiny",
    "scenario": "hover-fault",
    "settings": {
        "duration": 1.0,
        "period": 0.004,
        "step": 0.004,
        "fault.0.time": 0.2,
        "diagnosis.poles": [60.0, 80.0],
    },
    "axis": [
        {"name": "loss", "values": [0.1, 0.5, 0.9]},
        {"name": "wind_speed", "start": 0.0, "stop": 8.0, "count": 3},
    ],
    "draw": [
        {"name": "wind_direction", "uniform": [-3.0, 3.0]},
        {"name": "mass", "normal": [1.0, 0.03]},
        {"name": "rotor", "choice": [1, 2]},
    ],
    "variant": [
        {"label": "roismc", "settings": {"controller.kind": "roismc"}},
        {"label": "smc", "settings": {"controller.kind": "smc"}},
    ],
    "refine": {"initial": 4, "block": 4, "most": 12, "width": 0.4},
}


def fly_in_small_blocks(said: Connection, folder: Path) -> None:
    """Fly it in blocks of ten, or what is missing of it, and say when the folder is open and when it is complete."""
    rounds.FLIGHTS_IN_BLOCK = 10
    study = study_from(TINY, "test")
    with run.open_store(study, folder, folder.exists()) as store:
        said.send("open")
        run.fly(study, store, InProcess())
    said.send("complete")
