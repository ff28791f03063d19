"""The page of a diagnosed log: the flight page, with what the log says in place of a truth that nobody knows.

Evidence of each rotor against its threshold, the belief that follows from it, and the residual of motion have plots;
causes stand in the table below. Times count from the first record.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from rotorfault.base.files import output_folder
from rotorfault.logs.detectors import order_of
from rotorfault.logs.diagnose import SUDDEN
from rotorfault.logs.scan import Scan
from rotorfault.logs.sentences import percent, rotor_words
from rotorfault.logs.verdict import LogDiagnosis, likely
from rotorfault.maths.arrays import ANGLES, AXES, Array
from rotorfault.maths.geometry import Vec3
from rotorfault.maths.rotation import Quat
from rotorfault.model.vehicle_file import VehicleFile, load_vehicle
from rotorfault.pages.flight_page import Shown, write_page
from rotorfault.pages.verdict import Fact
from rotorfault.results.events import Event
from rotorfault.results.flight_data import FlightData, Variable

STEP, MOST = 0.02, 12_000  # s between records of the page, and records of it
NAMES = {
    "position": ("position", "m", "axis"),
    "velocity": ("velocity", "m/s", "axis"),
    "attitude": ("quaternion", "1", "component"),
    "rates": ("body_rates", "rad/s", "axis"),
    "specific_force": ("specific_force", "m/s^2", "axis"),
    "rpm": ("estimator.speed_of_motors", "1/min", "rotor"),
    "battery": ("estimator.battery", "V", "reading"),
}


def page_name(found: LogDiagnosis) -> str:
    """File of a log's page.

    Parameters
    ----------
    found : LogDiagnosis
    """
    stem = "".join(c if c.isalnum() or c in "-_." else "-" for c in Path(found.log.source.removesuffix(".gz")).stem)[
        :80
    ]
    return f"{stem or 'log'}.html"


def write_diagnosis(found: LogDiagnosis, folder: Path, name: str = "", vehicle: str | Path | None = None) -> Path:
    """Write the page of a diagnosis.

    Parameters
    ----------
    found : LogDiagnosis
    folder : Path
    name : str, optional
        Of the file, else by the log's.
    vehicle : str or Path, optional
        To be drawn, where its rotors are counted as the log's motors.
    """
    file = None if vehicle is None else load_vehicle(vehicle)
    if file is not None and order_of(found.log, file) != list(range(found.log.motors)):
        file = None
    return write_page([shown(found, file=file)], output_folder(folder) / (name or page_name(found)))


def shown(found: LogDiagnosis, label: str = "", file: VehicleFile | None = None, begin: float | None = None) -> Shown:
    """A diagnosed log as a flight of the page.

    Parameters
    ----------
    found : LogDiagnosis
    label : str, optional
    file : VehicleFile, optional
        To be drawn.
    begin : float, optional, s
        Of the log's clock, that is 0 on the page; else its first record.
    """
    zero = found.log.start if begin is None else begin
    data = data_of(found, file, begin)
    rows = [
        (f"{percent(one.probability)} {one.cause}" + (f", rotor {one.rotor}" if one.rotor else ""), one.evidence)
        for one in found.causes
        if one.probability >= 0.005
    ]
    rows += [("its own message", said) for said in found.own]
    rows += [("vibration", said) for said in found.vibration]
    rows += [("cannot tell", said) for said in found.limits]
    rows += [("read", said) for said in found.log.remarks]
    if found.log.damage.reason:
        rows.append(("lost in reading", found.log.damage.reason))
    return Shown(label or found.verdict, data, rows, facts=_facts(found), happened=_events(found, zero))


def _facts(found: LogDiagnosis) -> list[Fact]:
    first = found.probable
    look = "good" if first.cause == "healthy" else "bad" if first.rotor is not None else "fair"
    what = "no rotor" if first.cause == "healthy" else first.cause
    what = rotor_words(found.log, first.rotor) if first.rotor is not None else what
    if "cannot tell" in found.verdict:
        what, look = "cannot tell", "fair"
    facts = [Fact(what, f"{likely(first.probability)}, {percent(first.probability)}", found.verdict, look)]
    if first.rotor is not None and first.loss is not None:
        ends = first.interval
        how = "as the log shows it" if ends is None else f"{ends[0]:.0%} to {ends[1]:.0%}, 9 times of 10"
        facts.append(Fact(f"{first.loss:.0%}", "of its thrust lost", how, look))
    if first.rotor is not None and first.onset is not None:
        into = f"{first.onset - found.log.start:.2f} s"
        facts.append(Fact(into, "onset, into the log", f"{first.onset:.2f} s by its clock"))
        if found.alarm is not None:
            delay = max(found.alarm - first.onset, 0.0)
            facts.append(Fact(f"{1000 * delay:.0f} ms", "until it is certain", "from the onset to the alarm"))
    return facts


def _events(found: LogDiagnosis, zero: float) -> list[Event]:
    log, events = found.log, list[Event]()
    for note in log.notes:
        if note.alarm:
            events.append(Event(note.time - zero, "switch", f"its own: {note.text}", 0))
    first = found.probable
    over = next((scan.over for scan in found.scans if scan.over is not None), None)
    if over is not None and first.onset is not None:
        events.append(Event(over[0] - zero, "end", f"{over[1]}: the evidence ends", 0))
    if first.rotor is not None and first.onset is not None:
        text = f"{rotor_words(log, first.rotor)} begins to lose thrust"
        events.append(Event(first.onset - zero, "fault", text, first.rotor))
        if found.alarm is not None:
            text = f"the evidence against rotor {first.rotor} is an alarm"
            events.append(Event(found.alarm - zero, "alarm", text, first.rotor))
    events.append(Event(log.start + log.duration - zero, "end", "the log ends"))
    return sorted(events)


def data_of(found: LogDiagnosis, file: VehicleFile | None = None, zero: float | None = None) -> FlightData:
    """A log and its diagnosis as records at even times.

    Parameters
    ----------
    found : LogDiagnosis
    file : VehicleFile, optional
        Of the vehicle, to be drawn.
    zero : float, optional, s
        Of the log's clock, where the records begin; else the first record.
    """
    log = found.log
    whole = zero is None  # beside a flight of ours both are told apart by their numbers
    zero = log.start if zero is None else zero
    length = max(log.start + log.duration - zero, STEP)
    step = max(STEP, length / MOST)
    time = np.arange(0.0, length + 0.5 * step, step)
    clock = time + zero
    variables: dict[str, Variable] = {}
    for quantity, (signal, unit, dim) in NAMES.items():
        series = log.series.get(quantity)
        if series is None:
            continue
        values = series.at(clock)
        if quantity == "battery":
            values = values[:, :1]
        if quantity == "attitude":
            values = values / np.maximum(np.linalg.norm(values, axis=1, keepdims=True), 1e-9)
            euler = Quat(*values.T).euler()
            about = {"units": "rad", "long_name": "roll, pitch, yaw of the log"}
            variables["attitude"] = Variable(("time", "angle"), np.column_stack([*_columns(euler)]), about)
        dims = ("time", dim) if quantity != "battery" else ("time",)
        about = {"units": unit, "long_name": f"{quantity.replace('_', ' ')} of the log"}
        variables[signal] = Variable(dims, values if len(dims) == 2 else values[:, 0], about)
    if (command := log.series.get("command")) is not None:
        about = {"units": "1", "long_name": "share of the greatest thrust that each motor was asked for"}
        variables["diagnosis.command_of_motors"] = Variable(("time", "rotor"), command.at(clock), about)
    if log.motors:
        variables |= _evidence(found.scans, clock, log.motors)
    coordinates: dict[str, Any] = {
        "time": np.asarray(time),
        "axis": np.array(AXES),
        "angle": np.array(ANGLES),
        "component": np.array(["w", "x", "y", "z"]),
        "rotor": np.arange(1, max(log.motors, 1) + 1),
        "against": np.array([*(f"rotor {k + 1}" for k in range(log.motors)), "an alarm"]),
        "channel": np.array(["roll", "pitch", "yaw", "thrust"]),
    }
    said = {"time": {"units": "s", "long_name": "time since the first record"}}
    name = "" if file is None else file.name
    attributes: dict[str, Any] = {"scenario": log.source, "vehicle": name}
    if whole:
        attributes["logged"] = 1
    if file is not None:
        attributes["configuration"] = json.dumps({"vehicle": file.model_dump(mode="json")})
    return FlightData(
        variables, {name: Variable((name,), values, said.get(name, {})) for name, values in coordinates.items()},
        attributes,
    )  # fmt: skip


def _columns(euler: Vec3) -> tuple[Array, Array, Array]:
    return np.asarray(euler.x), np.asarray(euler.y), np.asarray(euler.z)


def _evidence(scans: tuple[Scan, ...], clock: Array, motors: int) -> dict[str, Variable]:
    """Evidence against its threshold, belief and residual over time; 0 and NaN where nothing was tested."""
    evidence, belief = np.zeros((len(clock), motors)), np.zeros((len(clock), motors))
    residual = np.full((len(clock), 4), np.nan)
    if not scans:
        return {}
    for scan in scans:
        at = np.searchsorted(scan.time, clock, side="right") - 1
        inside = (at >= 0) & (clock <= scan.time[-1] + 0.5)
        rows = at[inside]
        evidence[inside] = scan.evidence[rows]
        # Each block may be the onset, as the prior has it; all other rotors and no fault stand against it.
        logs = scan.evidence[rows] + np.log(SUDDEN / motors / max(len(scan.time), 1))
        most = np.maximum(logs.max(axis=1, keepdims=True), 0.0)
        odds = np.exp(logs - most)
        belief[inside] = odds / (np.exp(-most) + odds.sum(axis=1, keepdims=True))
        residual[inside] = scan.residual[rows]
        if scan.over is not None:  # a crash would look like the loss of any rotor
            gone = inside & (clock > scan.over[0])
            evidence[gone], belief[gone], residual[gone] = np.nan, np.nan, np.nan
    alarm = np.full((len(clock), 1), scans[0].threshold)
    about = {"units": "1", "long_name": "logarithm of likelihood that a rotor lost thrust over that of none did"}
    found = {"diagnosis.evidence_against_rotors": Variable(("time", "against"), np.hstack([evidence, alarm]), about)}
    about = {"units": "1", "long_name": "probability of a sudden loss of each rotor, by its evidence alone"}
    found["diagnosis.belief"] = Variable(("time", "rotor"), belief, about)
    about = {"units": "1", "long_name": "what commands do not explain of the motion, in units of command"}
    shown = np.where(np.isfinite(residual), residual, 0.0)
    size = max(6.0 * float(np.median(np.abs(shown))), float(np.quantile(np.abs(shown), 0.97)), 1e-3)
    clipped = np.clip(np.where(np.isfinite(residual), residual, np.nan), -4.0 * size, 4.0 * size)
    found["diagnosis.residual"] = Variable(("time", "channel"), clipped, about)
    return found
