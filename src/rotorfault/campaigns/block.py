"""Flying one block of a campaign: from its flights to a table with one row for each."""

from __future__ import annotations

from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from rotorfault.campaigns.axes import columns
from rotorfault.campaigns.flight_set import FlightSet, identifiers, seeds, values_of
from rotorfault.campaigns.grades import grades
from rotorfault.campaigns.study import Study
from rotorfault.flight.many import fly_many
from rotorfault.results.score_table import ScoreTable

METRICS = (
    "end_time", "cost", "tilt_max", "command_rate", "saturated_fraction", "outside_layer_fraction",
    "false_alarms", "largest_riccati_residual", "late_position_rms", "late_yaw_rms", "excursion",
    "position_mse.x", "position_mse.y", "position_mse.z", "given_up_fraction.yaw",
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
        ``recovery_time`` [s], ``altitude_lost`` [m], and `METRICS`.

    Raises
    ------
    InputError
        If a value is not allowed.
    """
    values, seed = values_of(study, flights), seeds(study, flights)
    settings = {**columns(values), "seed": seed}
    parts: list[tuple[NDArray[np.intp], ScoreTable]] = []
    for variant in np.unique(flights.variant):
        which = np.flatnonzero(flights.variant == variant)
        scenario = study.scenarios[variant]
        varied = {key: column[which] for key, column in settings.items()}
        # What is hardly meant is said before the first block.
        parts.append((which, fly_many(scenario, varied, threads=threads, warn=False).table))
    order = np.argsort(np.concatenate([which for which, _ in parts]))
    table = ScoreTable({k: v[order] for k, v in ScoreTable.joined([t for _, t in parts]).columns.items()})
    grade = grades(table)
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
    }
    return pa.table({name: _column(values) for name, values in rows.items()})


def _metric(table: ScoreTable, name: str) -> NDArray[Any]:
    """A column of the scores; NaN for controllers that have no such number."""
    return table[name] if name in table else np.full(len(table), np.nan)


def _column(values: NDArray[Any]) -> pa.Array:
    return pa.array(values.tolist() if values.dtype.kind in "UO" else values)
