"""The scores of a batch as a table: one row per flight, the numbers that every flight has everywhere.

Definitions are those of `rotorfault.loop.scoring`. What a flight has no number for is NaN: settling times of a lost
flight, detections of rotors that no fault hits, landings that were not begun. Columns, with dots before the axis,
angle or rotor:

- ``outcome``, ``survived``, ``end_time`` [s];
- ``settle_time`` and ``recovery_time`` [s], ``position_mse`` [m^2], ``position_error_end`` [m],
  ``velocity_end`` [m/s], by axis;
- ``attitude_mse`` [rad^2] by axis of rotation, ``attitude_end`` [rad] as angles for people, ``tilt_max``,
  ``tilt_end``
  [rad];
- ``late_position_rms`` [m] and ``late_yaw_rms`` [rad]: root mean square errors over the last half of the flight (for
  flights that lasted); ``yaw_error_end`` [rad]; ``cost``;
- ``lowest`` [m], the least height; ``excursion`` and ``altitude_lost`` [m], largest distance from the reference and
  largest depth below it, from the first onset of a fault on; ``reference_step`` [m], what the reference asks for;
- ``command_step``, change of a rotor's command from one sampling period to the next, mean over rotors and time, as a
  share of its command in hover, and ``command_rate`` [1/s], the same per second;
- ``saturated_fraction``, ``given_up_fraction`` by what was cut;
- ``onset.R`` and ``detected.R`` [s], when the first fault of rotor R begins and when its flag rose from then on;
  ``loss_true.R``, ``loss_believed.R`` and ``loss_error.R``; ``false_alarms``;
- ``landing.confirmed_time`` and others, where a landing may happen;
- of each signal with a score its ``largest_NAME`` or ``NAME_fraction``.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, final

import numpy as np
from numpy.typing import NDArray

from rotorfault.base import frames
from rotorfault.base.one_line import LONGEST, cut
from rotorfault.engine.batch import Batch, columns
from rotorfault.loop.closed_loop import LoopState, no_reference
from rotorfault.loop.scores import ENDS, INTERRUPTED, SURVIVED, YAW_KEPT, Scores, ScoringParameters
from rotorfault.loop.scoring import Scoring
from rotorfault.maths.arrays import ANGLES, AXES, Array
from rotorfault.maths.records import flatten, unflatten
from rotorfault.model.telemetry import Signal

if TYPE_CHECKING:
    import pandas as pd
    import polars as pl
    import pyarrow as pa

GIVEN_UP = ("tilt", "thrust", "yaw")
FEWEST = 4  # rotors that a table has columns of, so that those of smaller vehicles can be joined with others
LANDING = (
    "fault_time", "confirmed_time", "touch_down_time", "rotors_stopped_time", "speed", "horizontal_speed", "tilt",
    "distance", "yaw_rate",
)  # fmt: skip

Columns = dict[str, NDArray[Any]]


def rotors_of(columns: Iterable[str]) -> list[int]:
    """Numbers of the rotors that numbers of a flight are of, by the names of these."""
    parts = (name.partition(".") for name in columns)
    return sorted(int(number) for group, _, number in parts if group == "onset" and number.isdecimal())


@final
class ScoreTable:
    """Numbers of many flights, for NumPy by column (``table["cost"]``), for pandas, polars and Arrow as a whole.

    ``pandas.DataFrame(table)``, ``polars.DataFrame(table)`` and ``pyarrow.table(table)`` take it as it is.

    Attributes
    ----------
    columns : dict of ndarray, shape (N,)
        By name; see `rotorfault.results.score_table`.
    """

    def __init__(self, columns: Columns) -> None:
        self.columns = columns

    def __len__(self) -> int:
        return len(self.columns["outcome"])

    def __repr__(self) -> str:
        counted = ", ".join(f"{count} {kind}" for kind, count in self.count().items())
        return cut(f"<scores of {len(self)} flights: {counted}; {len(self.columns)} columns>", LONGEST)

    def __getitem__(self, name: str) -> NDArray[Any]:
        return self.columns[name]

    def __contains__(self, name: object) -> bool:
        return name in self.columns

    def __iter__(self) -> Iterator[dict[str, Any]]:
        return frames.rows(self.columns)

    def __arrow_c_stream__(self, requested_schema: object = None) -> object:
        """The table for polars, pyarrow and whatever else speaks the protocol of Arrow."""
        stream: object = self.to_arrow().__arrow_c_stream__(requested_schema)
        return stream

    def to_pandas(self) -> pd.DataFrame:
        """The table as a pandas DataFrame, a row per flight.

        Raises
        ------
        MissingExtraError
            If pandas is not installed.
        """
        return frames.to_pandas(self.columns)

    def to_polars(self) -> pl.DataFrame:
        """The table as a polars DataFrame, a row per flight."""
        return frames.to_polars(self.columns)

    def to_arrow(self) -> pa.Table:
        """The table as a pyarrow Table, a row per flight."""
        return frames.to_arrow(self.columns)

    def row(self, index: int) -> dict[str, Any]:
        """The numbers of one flight."""
        return {name: column[index].item() for name, column in self.columns.items()}

    def count(self) -> dict[str, int]:
        """How many flights ended how, most frequent first."""
        kinds, counts = np.unique(self["outcome"], return_counts=True)
        return {str(kinds[i]): int(counts[i]) for i in np.argsort(-counts)}

    @classmethod
    def joined(cls, tables: Sequence[ScoreTable]) -> ScoreTable:
        """Tables one after the other; NaN in columns that a table has not got."""
        names = list(dict.fromkeys(name for table in tables for name in table.columns))
        return cls(
            {
                name: np.concatenate([t.columns[name] if name in t else np.full(len(t), np.nan) for t in tables])
                for name in names
            }
        )


def score_table(batch: Batch, state: Array) -> ScoreTable:
    """The table of a batch that was flown to its end, or until it was interrupted.

    Parameters
    ----------
    batch : Batch
    state : ndarray, shape (leaves of `LoopState`, N)
        At the end, as a `Recording` has it.
    """
    flown: LoopState = unflatten(batch.state, list(state))
    scores = flown.scores
    numbers = unflatten(batch.parameters, list(columns(batch.parameters, batch.flights)))
    parameters: ScoringParameters = numbers.scoring
    scoring, dt = batch.loop.scoring, np.asarray(numbers.period, dtype=float)
    onsets = batch.loop.onsets(numbers.parts)
    over, steps = np.asarray(scores.over) > 0.0, np.asarray(flown.steps)
    lasted = ~over & (steps >= batch.steps)
    outcome = np.where(over | lasted, _outcomes(batch, scores, parameters), INTERRUPTED)
    survived = np.isin(outcome, SURVIVED)
    end: Array = np.asarray(scores.end, dtype=float)
    end_time: Array = np.where(scores.over > 0.0, end, flown.steps) * dt
    with np.errstate(divide="ignore", invalid="ignore"):
        share = 1.0 / np.where(scores.seen > 0.0, scores.seen, np.nan)
        table: Columns = {"outcome": outcome, "survived": survived, "end_time": end_time}
        settled = [np.where(last >= batch.steps - 1, np.nan, (last + 1.0) * dt) for last in scores.last_outside]
        settled = [np.where(survived & (scores.touched == 0.0), time, np.nan) for time in settled]
        table |= _named("settle_time", (*AXES, "overall"), [*settled, np.maximum.reduce(settled)])
        table |= _named("position_mse", AXES, [x * share for x in scores.position_square])
        table |= _named("attitude_mse", ANGLES, [x * share for x in scores.attitude_square])
        table |= _named("position_error_end", AXES, scores.position_error)
        table |= _named("attitude_end", ANGLES, scores.attitude.euler())
        table["tilt_end"] = np.arccos(np.clip(scores.attitude.z_axis().z, -1.0, 1.0))
        table["yaw_error_end"] = scores.yaw_error
        table |= _named("velocity_end", AXES, scores.velocity)
        late = np.maximum(batch.steps - parameters.half, 1.0)
        table["late_position_rms"] = np.where(lasted, np.sqrt(scores.late_square.sum() / late), np.nan)
        table["late_yaw_rms"] = np.where(lasted, np.sqrt(scores.late_yaw_square / late), np.nan)
        cost = 0.5 * dt * (scores.cost - 0.5 * (scores.cost_first + scores.cost_last))
        table["cost"] = cost if scoring.has_cost else np.full(batch.flights, np.nan)
        table["tilt_max"] = np.arccos(np.clip(scores.cosine_least, -1.0, 1.0))
        table["lowest"] = scores.lowest
        table["reference_step"] = parameters.step
        # The first instant has no change before it.
        rate = scores.variation / (scoring.count_of_rotors * parameters.hover * np.maximum(scores.seen - 1.0, 1.0))
        table["command_step"], table["command_rate"] = rate, rate / dt
        table["saturated_fraction"] = scores.saturated * share
        table |= _named("given_up_fraction", GIVEN_UP, [x * share for x in scores.given_up])
        table |= _detections(scoring, scores, onsets, end_time)
        table["recovery_time"] = _recovery(table, scores, batch.steps, dt)
        struck = np.isfinite(_first_onset(table))
        table["excursion"] = np.where(struck, np.sqrt(scores.away), np.nan)
        table["altitude_lost"] = np.where(struck, scores.drop, np.nan)
        table["false_alarms"] = scores.false_alarms.astype(int)
        if scoring.lands:
            table |= _landing(scores, onsets, end_time)
        for signal, counted in zip(scoring.counted, scores.signals, strict=True):
            largest = signal.quantity.score == "largest"
            table[score_name(signal)] = counted if largest else counted * share
    return ScoreTable({name: np.broadcast_to(column, (batch.flights,)) for name, column in table.items()})


def score_name(signal: Signal) -> str:
    """Name of the column that holds what is counted of a signal."""
    name = signal.name.partition(".")[2] or signal.name
    return f"largest_{name}" if signal.quantity.score == "largest" else f"{name}_fraction"


def _outcomes(batch: Batch, scores: Scores, parameters: ScoringParameters) -> NDArray[Any]:
    """How each flight ended."""
    wanted = unflatten(no_reference(), list(batch.reference.T[: len(flatten(no_reference()))]))
    constant = all(np.ptp(column) == 0.0 for column in (*wanted.p_W, wanted.yaw))
    if constant:
        good = [np.abs(e) <= b for e, b in zip(scores.position_error, parameters.settle_band, strict=True)]
        good.append(np.abs(scores.yaw_error) <= YAW_KEPT)
    else:
        late = batch.steps - parameters.half
        good = [
            np.sqrt(square / late) <= band
            for square, band in zip(scores.late_square, parameters.track_band, strict=True)
        ]
        good.append(np.sqrt(scores.late_yaw_square / late) <= YAW_KEPT)
    flown = np.where(np.logical_and.reduce(good), "settled" if constant else "tracked", "offset")
    flown = np.where(scores.rest > 0.0, "landed", flown)
    return np.where(scores.over > 0.0, np.array(ENDS)[scores.over.astype(int)], flown)


def _detections(scoring: Scoring, scores: Scores, onsets: Sequence[Any], end_time: NDArray[Any]) -> Columns:
    """Onsets and what came of them, by rotor; NaN for faults that begin after the end, and for sound rotors."""
    nothing = np.full(end_time.shape, np.nan)
    table: Columns = {}
    for rotor in range(1, max(FEWEST, scoring.count_of_rotors) + 1):
        hit = rotor in scoring.rotors
        onset = np.asarray(scoring.onset(rotor, tuple(onsets)), dtype=float) if hit else nothing
        begun = onset < end_time
        table[f"onset.{rotor}"] = np.where(begun, onset, np.nan)
        if not hit:
            table |= {f"{name}.{rotor}": nothing for name in ("detected", "loss_true", "loss_believed", "loss_error")}
            continue
        detection = scores.detections[scoring.rotors.index(rotor)]
        table[f"detected.{rotor}"] = np.where(detection.time < 0.0, np.nan, detection.time)
        table[f"loss_true.{rotor}"] = np.where(begun, detection.loss_true, np.nan)
        read = detection.read > 0.5
        table[f"loss_believed.{rotor}"] = np.where(read, detection.loss_believed, np.nan)
        table[f"loss_error.{rotor}"] = np.where(read, detection.loss_error, np.nan)
    return table


def _recovery(table: Columns, scores: Scores, steps: int, dt: NDArray[Any]) -> NDArray[Any]:
    """Time in s from the first onset until the vehicle is back for good; NaN where it never is, or nothing began."""
    first = _first_onset(table)
    back = np.where(scores.last_away >= steps - 1, np.nan, (scores.last_away + 1.0) * dt)
    flew = table["survived"] & (scores.touched == 0.0) & np.isfinite(first)
    return np.where(flew, np.maximum(back - first, 0.0), np.nan)


def _first_onset(table: Columns) -> NDArray[Any]:
    """Time in s of the first onset of any fault; infinite where none began."""
    onsets = np.stack([table[f"onset.{rotor}"] for rotor in rotors_of(table)])
    return np.asarray(np.where(np.isnan(onsets), np.inf, onsets).min(axis=0))


def _landing(scores: Scores, onsets: Sequence[Any], end_time: NDArray[Any]) -> Columns:
    landing: Any = scores.landing
    touched = landing.touched >= 0.0

    def time(value: NDArray[Any]) -> NDArray[Any]:
        return np.where(value < 0.0, np.nan, value)

    first = np.minimum.reduce([np.asarray(onset, dtype=float) + 0.0 * end_time for onset in onsets or [np.inf]])
    values = (
        np.where((landing.begun >= 0.0) & (first < end_time), first, np.nan),
        time(landing.begun),
        time(landing.touched),
        time(landing.stopped),
        *(
            np.where(touched, value, np.nan)
            for value in (
                landing.speed,
                landing.slide,
                np.arccos(np.clip(landing.cosine, -1.0, 1.0)),
                landing.distance,
                landing.yaw_rate,
            )
        ),
    )
    return _named("landing", LANDING, values)


def _named(group: str, names: Sequence[str], values: Iterable[NDArray[Any]]) -> Columns:
    return {f"{group}.{name}": value for name, value in zip(names, values, strict=True)}


def nested(row: Mapping[str, Any]) -> dict[str, Any]:
    """The numbers of one flight as its summary has them: groups as tables, detections and landing by event.

    Parameters
    ----------
    row : mapping
        Of a `ScoreTable`.
    """
    summary: dict[str, Any] = {}
    detection = ("onset", "detected", "loss_true", "loss_believed", "loss_error")
    for name, value in row.items():
        group, _, member = name.partition(".")
        if group in detection or group == "landing":
            continue
        if member:
            summary.setdefault(group, {})[member] = value
        else:
            summary[name] = value
    summary["detections"] = [
        {
            "rotor": rotor,
            "true_time": row[f"onset.{rotor}"],
            "detected_time": row[f"detected.{rotor}"],
            "delay": row[f"detected.{rotor}"] - row[f"onset.{rotor}"],
            "loss_true": row[f"loss_true.{rotor}"],
            "loss_estimated": row[f"loss_believed.{rotor}"],
            "loss_error": row[f"loss_error.{rotor}"],
        }
        for rotor in rotors_of(row)
        if np.isfinite(row[f"onset.{rotor}"])
    ]
    begun = np.isfinite(row.get("landing.confirmed_time", np.nan))
    summary["landing"] = {name: row[f"landing.{name}"] for name in LANDING} if begun else None
    return summary
