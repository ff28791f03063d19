"""Studies and tables of a campaign whose counts are known."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pyarrow as pa

from rotorfault.campaigns.study import Study, study_from

LOSS = {"name": "loss", "values": [0.0, 0.2, 0.4, 0.6, 0.8]}
WIND = {"name": "wind_speed", "values": [0.0, 4.0, 8.0]}
VARIANTS = [{"label": "one"}, {"label": "two"}]
TWO_FAULTS = {"fault": [{"kind": "step", "rotor": r, "time": 1.0, "loss": 0.3} for r in (1, 3)]}
FIRST = 8

Share = Callable[[str, tuple[int, ...]], float]
Flown = Callable[[str, int], int]


def study_of(axis: list[dict[str, Any]], **tables: Any) -> Study:
    refine = {"initial": FIRST, "block": FIRST, "most": 3 * FIRST, "width": 0.2}
    defaults = {"name": "made-up", "scenario": "hover-fault", "variant": VARIANTS, "refine": refine}
    return study_from({**defaults, "axis": axis, **tables}, "test")


def table_of(study: Study, share: Share, flown: Flown = lambda label, cell: FIRST) -> pa.Table:
    """A table in which the first flights of a cell are successful, rounded to the share, and the others are lost."""
    rows = []
    for k, variant in enumerate(study.variant):
        for cell in range(study.cells):
            place = tuple(int(i) for i in np.unravel_index(cell, study.shape))
            count = flown(variant.label, cell)
            successes = round(share(variant.label, place) * count)
            for number in range(count):
                success = number < successes
                rows.append(
                    {
                        "variant": variant.label,
                        "cell": cell,
                        "number": number,
                        "id": (number * study.cells + cell) * len(study.variant) + k,
                        "success": success,
                        "grade": ("held", "degraded")[number % 2] if success else "lost",
                        "recovery_time": 0.1 * (number + 1) if success else np.nan,
                        "altitude_lost": 0.01 * (number + 1) if success else 5.0,
                    }
                )
    return pa.Table.from_pylist(rows)


def falling(label: str, place: tuple[int, ...]) -> float:
    """A success rate that falls along the first axis, later for the first variant."""
    return float(np.clip(1.5 - 0.5 * place[0] + (0.25 if label == "one" else 0.0), 0.0, 1.0))


SPACE = [LOSS, WIND, {"name": "rotor", "values": [1.0, 3.0]}]
ODD = [{"name": "detection_delay", "values": [0.0, 0.005, 0.05, 1.0]}, {"name": "rotor", "values": [1.0, 2.0]}]
STUDIES = {
    "plane": study_of([LOSS, WIND]),
    "line": study_of([LOSS]),
    "names": study_of([{"name": "preset", "values": ["paper", "tuned"]}], variant=[{"label": "only"}]),
    "space": study_of(SPACE),
    "odd": study_of(ODD, variant=[{"label": f"a rather long name of variant {k}"} for k in range(4)],
                    settings={"diagnosis.kind": "delayed"}),
}  # fmt: skip
