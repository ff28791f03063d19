"""Flying one block of a campaign: from its flights to a table with one row for each."""

from __future__ import annotations

from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from rotorfault.campaigns.flight_set import FlightSet, alike, columns_of, identifiers, seeds, values_of
from rotorfault.campaigns.grading import judged
from rotorfault.campaigns.study import Study
from rotorfault.flight.many import fly_many
from rotorfault.results.score_table import ScoreTable

METRICS = (
    "end_time", "cost", "tilt_max", "command_rate", "saturated_fraction", "outside_layer_fraction",
    "false_alarms", "largest_riccati_residual", "late_position_rms", "late_yaw_rms", "excursion",
    "position_mse.x", "position_mse.y", "position_mse.z", "given_up_fraction.yaw",
    "position_error_end.x", "position_error_end.y", "position_error_end.z",
)  # fmt: skip
"""Columns of `ScoreTable` that are kept; dots become underscores."""


def fly_block(study: Study, flights: FlightSet, threads: int | None = None) -> pa.Table:
    """Fly a block.

    Parameters
    ----------
    study : Study
    flights : FlightSet
    threads : int, optional
        One per processor if not given.

    Returns
    -------
    pyarrow.Table
        One row per flight in order: ``flight`` (within the block), ``id`` (within the campaign, see
        `rotorfault.campaigns.flight_set.identifiers`), ``variant``, ``cell``, ``number``, axes and draws by name,
        ``seed``, ``grade``, ``success`` (of the grade, by the study), ``survived`` (of the outcome), ``outcome``,
        ``recovery_time`` [s], ``altitude_lost`` [m], `METRICS`, and what its
        grading adds (`rotorfault.campaigns.detections`).

    Raises
    ------
    InputError
        If a value is not allowed.
    """
    values, seed = values_of(study, flights), seeds(study, flights)
    parts: list[tuple[NDArray[np.intp], ScoreTable]] = []
    for which, variant, cases in alike(study, flights):
        here = {name: column[which] for name, column in values.items()}
        varied = {**columns_of(study, here, cases), "seed": seed[which]}
        # What is hardly meant is said before the first block.
        parts.append((which, fly_many(study.scenario_of(variant, cases), varied, threads=threads, warn=False).table))
    order = np.argsort(np.concatenate([which for which, _ in parts]))
    table = ScoreTable({k: v[order] for k, v in ScoreTable.joined([t for _, t in parts]).columns.items()})
    grade, found = judged(study.grading, table)
    rows: dict[str, NDArray[Any]] = {
        "flight": np.arange(flights.size, dtype=np.int64),
        "id": identifiers(study, flights),
        "variant": np.array([study.variant[v].label for v in flights.variant]),
        "cell": flights.cell,
        "number": flights.number,
        **values,
        "seed": seed,
        "grade": grade,
        "success": np.isin(grade, study.success),
        "survived": table["survived"],
        "outcome": table["outcome"],
        "recovery_time": table["recovery_time"],
        "altitude_lost": table["altitude_lost"],
        **{name.replace(".", "_"): _metric(table, name) for name in METRICS},
        **found,
    }
    return pa.table({name: _column(values) for name, values in rows.items()})


def _metric(table: ScoreTable, name: str) -> NDArray[Any]:
    """A column of the scores; NaN for controllers that have no such number."""
    return table[name] if name in table else np.full(len(table), np.nan)


def _column(values: NDArray[Any]) -> pa.Array:
    return pa.array(values.tolist() if values.dtype.kind in "UO" else values)
