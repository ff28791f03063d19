"""Flying one block of a campaign: from its flights to a table with one row for each."""

from __future__ import annotations

from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from rotorfault.campaigns.grades import grades
from rotorfault.campaigns.sampling.axes import columns
from rotorfault.campaigns.sampling.plan import Flights, drawn, identifier, seeds
from rotorfault.campaigns.study import Study
from rotorfault.flight.many import fly_many
from rotorfault.loop.scores import SURVIVED as IN_ONE_PIECE
from rotorfault.reference import REFERENCE
from rotorfault.results.score_table import ScoreTable

RECOVERED = 0.25  # m: within it a vehicle counts as back where it should be

METRICS = (
    "end_time", "cost", "tilt_max", "control_total_variation", "saturated_fraction", "outside_layer_fraction",
    "false_alarms", "largest_riccati_residual", "late_position_rms", "late_yaw_rms", "lowest_after_loss",
    "position_mse.x", "position_mse.y", "position_mse.z", "given_up_fraction.yaw",
)  # fmt: skip
"""Columns of `ScoreTable` that are kept; dots become underscores."""


def vary(study: Study, flights: Flights) -> dict[str, NDArray[Any]]:
    """Values of axes and draws of each flight, by name."""
    return {**study.cell_values(flights.cell), **drawn(study, flights)}


def fly_block(study: Study, flights: Flights, threads: int | None = None) -> pa.Table:
    """Fly a block.

    Parameters
    ----------
    study : Study
    flights : Flights
    threads : int, optional
        One per processor if not given.

    Returns
    -------
    pyarrow.Table
        One row per flight in order: ``flight`` (within the block), ``id`` (within the campaign, see
        `rotorfault.campaigns.sampling.plan.identifier`), ``variant``, ``cell``, ``number``, axes and draws by name, ``seed``,
        ``grade``, ``survived``, ``outcome``, ``recovery_time`` [s], ``altitude_lost`` [m], and `METRICS`.

    Raises
    ------
    InputError
        If a value is not allowed.
    """
    names = vary(study, flights)
    parts: list[tuple[NDArray[np.intp], ScoreTable]] = []
    heights = np.empty(flights.size)
    for variant in np.unique(flights.variant):
        which = np.flatnonzero(flights.variant == variant)
        mine = flights.part(which)
        scenario = study.scenario_of(int(variant))
        given: dict[str, Any] = dict(columns(vary(study, mine)))
        given["seed"] = seeds(study, mine)
        parts.append((which, fly_many(scenario, given, within=RECOVERED, threads=threads).table))
        heights[which] = scenario[REFERENCE].make().table(np.zeros(1)).p_W[0, 2]
    order = np.argsort(np.concatenate([which for which, _ in parts]))
    table = ScoreTable({k: v[order] for k, v in ScoreTable.joined([t for _, t in parts]).columns.items()})
    found: dict[str, Any] = {
        "flight": np.arange(flights.size, dtype=np.int64),
        "id": identifier(study, flights),
        "variant": np.array([study.variant[v].label for v in flights.variant]),
        "cell": flights.cell,
        "number": flights.number,
        **names,
        "seed": seeds(study, flights),
        "grade": (graded := grades(table)),
        "survived": np.isin(graded, study.survived),
        "outcome": table["outcome"],
        "recovery_time": recovery_times(table),
        "altitude_lost": altitudes_lost(table, heights),
    }
    for name in METRICS:
        found[name.replace(".", "_")] = table[name]
    return pa.table({name: _column(values) for name, values in found.items()})


def recovery_times(table: ScoreTable) -> NDArray[np.float64]:
    """Time in s from the first true loss until the error stays within `RECOVERED`; NaN where it never does."""
    onsets = np.stack([table[f"onset.{rotor}"] for rotor in "1234"])
    first = np.where(np.isnan(onsets), np.inf, onsets).min(axis=0)
    settled = table["settle_time.overall"]
    in_one_piece = np.isin(table["outcome"], IN_ONE_PIECE)
    with np.errstate(invalid="ignore"):
        return np.where(in_one_piece & np.isfinite(first), np.maximum(settled - first, 0.0), np.nan)


def altitudes_lost(table: ScoreTable, height: NDArray[np.float64]) -> NDArray[np.float64]:
    """By how much in m a flight fell below a height, where it began, after the first true loss; NaN without one."""
    return np.asarray(np.maximum(height - table["lowest_after_loss"], 0.0))


def _column(values: NDArray[Any]) -> pa.Array:
    return pa.array(values.tolist() if values.dtype.kind in "UO" else values)
