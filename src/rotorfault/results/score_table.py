"""The scores of a batch as a table: one row per flight, columns named as in the summary of a single flight.

Definitions are those of `rotorfault.results.metrics`. Beside them: ``lowest`` [m], the least height, ``lowest_after_loss``
[m], the same from the first true loss on; ``velocity_end`` [m/s]; ``late_position_rms`` [m] and ``late_yaw_rms``
[rad], root mean square errors over the last half of the flight (for flights that lasted); ``onset.R`` and
``detected.R`` [s], when rotor R first truly lost thrust and when its flag rose from then on. What a flight has no
number for is NaN.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

from rotorfault.engine.batch import Array, Batch, columns
from rotorfault.loop.scoring import FAR, KINDS, Scores, ScoringParameters
from rotorfault.maths.records import unflatten
from rotorfault.results.metrics import SURVIVED

AXES = ("x", "y", "z")
ANGLES = ("roll", "pitch", "yaw")
GIVEN_UP = ("tilt", "thrust", "yaw")
ROTORS = ("1", "2", "3", "4")


@final
class ScoreTable:
    """Numbers of many flights.

    Attributes
    ----------
    columns : dict of ndarray, shape (N,)
    """

    def __init__(self, columns: dict[str, NDArray[Any]]) -> None:
        self.columns = columns

    def __len__(self) -> int:
        return len(self.columns["outcome"])

    def __getitem__(self, name: str) -> NDArray[Any]:
        return self.columns[name]

    def row(self, index: int) -> dict[str, Any]:
        """The numbers of one flight."""
        return {name: column[index].item() for name, column in self.columns.items()}

    def count(self) -> dict[str, int]:
        """How many flights ended how, most frequent first."""
        kinds, counts = np.unique(self["outcome"], return_counts=True)
        return {str(kinds[i]): int(counts[i]) for i in np.argsort(-counts)}

    @classmethod
    def joined(cls, tables: Sequence[ScoreTable]) -> ScoreTable:
        """Tables one after the other."""
        return cls({name: np.concatenate([t.columns[name] for t in tables]) for name in tables[0].columns})


def score_table(batch: Batch, state: Array) -> ScoreTable:
    """The table of a batch that was flown to its end.

    Parameters
    ----------
    batch : Batch
    state : ndarray, shape (leaves of `LoopState`, N)
        At the end, as a `Recording` has it.
    """
    scores: Scores = unflatten(batch.state, list(state)).scores
    parameters: ScoringParameters = unflatten(
        batch.parameters.scoring, list(columns(batch.parameters.scoring, batch.flights))
    )
    dt = np.broadcast_to(np.asarray(batch.parameters.period, dtype=float), (batch.flights,))
    outcome = _outcomes(batch, scores, parameters)
    survived = np.isin(outcome, SURVIVED)
    with np.errstate(divide="ignore", invalid="ignore"):
        share = 1.0 / np.where(scores.seen > 0.0, scores.seen, np.nan)
        table: dict[str, NDArray[Any]] = {
            "outcome": outcome,
            "survived": survived,
            "end_time": np.where(scores.over > 0.0, scores.end, batch.steps) * dt,
        }
        settled = [np.where(last >= batch.steps - 1, np.nan, (last + 1.0) * dt) for last in scores.last_outside]
        settled = [np.where(survived & (scores.touched == 0.0), time, np.nan) for time in settled]
        table |= _named("settle_time", (*AXES, "overall"), [*settled, np.maximum.reduce(settled)])
        table |= _named("position_mse", AXES, [x * share for x in scores.position_square])
        table |= _named("attitude_mse", ANGLES, [x * share for x in scores.attitude_square])
        table |= _named("position_error_end", AXES, list(scores.position_error))
        table |= _named("attitude_end", ANGLES, list(scores.attitude))
        table |= _named("velocity_end", AXES, list(scores.velocity))
        late = np.maximum(batch.steps - parameters.half, 1.0)
        lasted = scores.over == 0.0
        table["late_position_rms"] = np.where(lasted, np.sqrt(sum(scores.late_square) / late), np.nan)
        table["late_yaw_rms"] = np.where(lasted, np.sqrt(scores.late_yaw_square / late), np.nan)
        table["cost"] = 0.5 * dt * (scores.cost - 0.5 * (scores.cost_first + scores.cost_last))
        table["tilt_max"] = np.arccos(np.clip(scores.cosine_least, -1.0, 1.0))
        table |= _named("attitude_max", ANGLES, list(scores.attitude_most))
        table["lowest"] = scores.lowest
        table["lowest_after_loss"] = np.where(scores.lowest_after < FAR, scores.lowest_after, np.nan)
        table["control_total_variation"] = scores.variation
        table["saturated_fraction"] = scores.saturated * share
        table["outside_layer_fraction"] = scores.outside_layer * share
        table |= _named("given_up_fraction", GIVEN_UP, [x * share for x in scores.given_up])
        table |= _named("onset", ROTORS, [np.where(x < 0.0, np.nan, x * dt) for x in scores.onset])
        table |= _named("detected", ROTORS, [np.where(x < 0.0, np.nan, x * dt) for x in scores.detected])
        table["false_alarms"] = scores.false_alarms.astype(int)
        table["largest_riccati_residual"] = scores.riccati_residual
        table["riccati_guarded_fraction"] = scores.riccati_guarded * share
    return ScoreTable(table)


def _outcomes(batch: Batch, scores: Scores, parameters: ScoringParameters) -> NDArray[Any]:
    """How each flight ended."""
    constant = bool((np.ptp(batch.reference[:, :3], axis=0) == 0.0).all())
    if constant:
        good = [np.abs(e) <= b for e, b in zip(scores.position_error, parameters.settle_band, strict=True)]
    else:
        late = batch.steps - parameters.half
        good = [
            np.sqrt(square / late) <= band
            for square, band in zip(scores.late_square, parameters.track_band, strict=True)
        ]
    flown = np.where(np.logical_and.reduce(good), "settled" if constant else "tracked", "offset")
    flown = np.where(scores.rest > 0.0, "landed", flown)
    return np.where(scores.over > 0.0, np.array(KINDS)[scores.over.astype(int)], flown)


def _named(group: str, names: Sequence[str], values: Sequence[NDArray[Any]]) -> dict[str, NDArray[Any]]:
    return {f"{group}.{name}": value for name, value in zip(names, values, strict=True)}
