"""A logged flight flown again: its path as reference, its wind, the faults that were found; both on one page."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from rotorfault.base.csv_text import write_columns
from rotorfault.base.errors import InputError
from rotorfault.flight.flight import Flight
from rotorfault.logs.api import baseline_for, baseline_of, without
from rotorfault.logs.detectors import order_of
from rotorfault.logs.diagnose import diagnosis_of
from rotorfault.logs.log import Log
from rotorfault.logs.page import shown
from rotorfault.logs.read import read_log
from rotorfault.logs.segments import block_means, flight_spans
from rotorfault.logs.verdict import LogDiagnosis
from rotorfault.maths.arrays import Array
from rotorfault.maths.rotation import Quat
from rotorfault.model.vehicle_file import VehicleFile, load_vehicle
from rotorfault.pages.flight_page import write_page

STEP = 0.25  # s between points of the reference: slower than a position loop, so that its noise is not flown
LONGEST = 120.0  # s of a flight that is flown again
SURE = 0.5  # probability from which a fault is flown
USUAL = {"variables of a Crazyflie": "crazyflie-2.1"}
"""The vehicle of a kind of log, where nobody says which; else x500, of four motors."""


class Likeness(NamedTuple):
    """A scenario like a log."""

    found: LogDiagnosis
    settings: dict[str, Any]  # of the scenario hover-fault
    vehicle: VehicleFile
    notes: tuple[str, ...]  # what was taken, a line each


def like(path: str | Path, folder: Path, settings: Mapping[str, Any], baseline: Sequence[Path] = ()) -> Likeness:
    """The scenario of a log: reference, wind, faults.

    Parameters
    ----------
    path : str or Path
        Of the log.
    folder : Path
        Where the table of the reference is written.
    settings : mapping
        What the user sets; ``vehicle`` says which is flown.
    baseline : sequence of Path
        Healthy logs of the same vehicle, or a file of ``rotorfault baseline``: a lasting loss shows against them.

    Raises
    ------
    InputError
        If the log has no position, does not fly, or its motors are not where the vehicle's rotors are.
    """
    log = read_log(path)
    if "position" not in log.series:
        raise InputError(f"{log.source}: has no position, so that there is no path to fly; give a log with one")
    spans = flight_spans(log)
    if not spans:
        raise InputError(f"{log.source}: motors never carry the vehicle: there is no flight in it")
    found = diagnosis_of(log, without(Path(path), baseline_for(log, baseline_of(baseline))))
    name = settings.get("vehicle", USUAL.get(log.kind, "x500"))
    vehicle = load_vehicle(name) if isinstance(name, (str, Path)) else None
    if vehicle is None:
        raise InputError("vehicle: allowed with --like: a name, or a file")
    order = order_of(log, vehicle)
    begin, end = max(spans, key=lambda span: span[1] - span[0])
    end = min(end, begin + LONGEST)
    notes = [f"{end - begin:.1f} s of {log.source}, as vehicle {vehicle.name}; path in reference.csv"]
    first = found.probable
    faults: list[dict[str, Any]] = []
    if first.rotor is not None and first.probability >= SURE:
        onset = begin if first.onset is None else first.onset
        loss = min(max(first.loss or 1.0, 0.01), 1.0)
        end = max(end, min(onset + 3.0, begin + LONGEST))
        rotor = order.index(first.rotor - 1) + 1
        since = round(max(onset - begin, 0.0), 4)
        faults.append({"kind": "step", "rotor": rotor, "time": since, "loss": round(loss, 4)})
        notes.append(f"rotor {rotor} of the vehicle (motor {first.rotor} of the log) loses {loss:.0%} "
                     f"at {max(onset - begin, 0.0):.2f} s")  # fmt: skip
        before = onset
    else:
        before = end
    wind = _wind(log, begin, min(before, end))
    notes.append("the log estimates no wind: still air" if wind is None else
                 f"wind of {np.hypot(*wind):.1f} m/s, as the log estimates it")  # fmt: skip
    start = _reference(log, begin, end, before, folder / "reference.csv")
    made: dict[str, Any] = {
        "vehicle": name,
        "duration": round(end - begin, 3),
        "record_period": 0.01,
        "ground": None,
        "reference": {"kind": "csv", "file": str(folder / "reference.csv")},
        "start.position": [float(x) for x in start],
        "fault": faults,
        "wind": {"kind": "none"} if wind is None else {"kind": "constant", "velocity_W": [*map(float, wind), 0.0]},
    }
    return Likeness(found, {**made, **settings}, vehicle, tuple(notes))


def _wind(log: Log, begin: float, end: float) -> Array | None:
    """Mean of the wind that the log estimates."""
    series = log.series.get("wind")
    if series is None:
        return None
    mean = block_means(series, np.array([begin, max(end, begin + 0.1)]))[0]
    return mean if np.isfinite(mean).all() else None


def _reference(log: Log, begin: float, end: float, fails: float, path: Path) -> Array:
    """Write the path of the log up to a failure, beyond which it is held, and say where it begins.

    After a failure the log shows where the vehicle went, and not where it was meant to be.
    """
    time = np.arange(begin, end + STEP, STEP)
    wanted = np.minimum(time, max(fails - STEP, begin))
    edges = np.column_stack([wanted - STEP, wanted + STEP])
    place = np.array([block_means(log.series["position"], pair)[0] for pair in edges])
    missing = ~np.isfinite(place).all(axis=1)
    place[missing] = log.series["position"].at(wanted)[missing]
    columns = {"t": time - begin, "x": place[:, 0], "y": place[:, 1], "z": place[:, 2]}
    if (attitude := log.series.get("attitude")) is not None:
        q = attitude.at(wanted)
        q = q / np.maximum(np.linalg.norm(q, axis=1, keepdims=True), 1e-9)
        columns["yaw"] = np.unwrap(np.asarray(Quat(*q.T).euler().z))
    write_columns(path, columns)
    start: Array = place[0]
    return start


def write_both(likeness: Likeness, flight: Flight, path: Path) -> Path:
    """The page of a log and of the flight that was flown like it.

    Parameters
    ----------
    likeness : Likeness
    flight : Flight
    path : Path
    """
    log = likeness.found.log
    same = order_of(log, likeness.vehicle) == list(range(log.motors))
    begin = max(flight_spans(log), key=lambda span: span[1] - span[0])[0]
    logged = shown(likeness.found, f"logged: {log.source}", likeness.vehicle if same else None, begin)
    return write_page([logged, flight.shown(f"flown: {likeness.vehicle.name}")], path)
