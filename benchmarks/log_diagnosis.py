"""Which rotor, on logs that others flew: `ROTORFAULT_DATA=FOLDER python benchmarks/log_diagnosis.py`.

Prints, of the logs in the folder: a Crazyflie with a propeller cut ever shorter, against its own normal flights (each
normal one against the others); simulated failures of PX4 and ArduPilot, with the delay from their onset; false alarms
over all healthy flight at hand, and in healthy flights of rotorfault itself; and the same files by other programs:
ArduPilot's own message in the log, and flightdx 0.1.0 where `--flightdx PYTHON` names a Python that has it.
"""

from __future__ import annotations

import argparse
import gzip
import json
import os
import re
import subprocess
import sys
import tempfile
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.stats import chi2

import rotorfault as rf
from rotorfault.logs.baseline import learned
from rotorfault.logs.diagnose import diagnosis_of
from rotorfault.logs.log import Log, Series
from rotorfault.logs.prediction import validated
from rotorfault.logs.read import read_log
from rotorfault.logs.recorded import log_of
from rotorfault.logs.segments import flight_spans
from rotorfault.logs.verdict import LogDiagnosis

PEER = """
import json, sys
from flightdx.engine.report_builder import analyze_log
path = sys.argv[1]
if path.endswith(".ulg"):
    from flightdx.parsers import ulog
    parse = next(getattr(ulog, name) for name in dir(ulog) if name.startswith("parse"))
else:
    from flightdx.parsers.dataflash import parse_dataflash as parse
found = analyze_log(parse(path)).incidents
print(json.dumps([(one.type, one.severity, one.t_start) for one in found]))
"""


class Failure(NamedTuple):
    """A log with a failure that is known."""

    name: str
    motor: int
    onset: float  # s of the log's clock
    known: str  # how


FAILURES = (
    Failure("rflymad/TestCase_3_1000000002.ulg", 1, 35.365, "label at 10 Hz"),
    Failure("rflymad/TestCase_3_2000000002.ulg", 1, 54.416, "label at 10 Hz"),
    Failure("ardupilot_sitl/quadx_m2.bin", 2, 73.38, "RCOU leaves the mixer between 73.28 and 73.38"),
)
SAMPLES = ("sample", "sample_logging_tagged_and_default_params", "sample_px4_events")


def unpacked(data: Path, name: str, folder: Path) -> Path:
    """A packed log as a file."""
    out = folder / Path(name).name
    if not out.exists():
        out.write_bytes(gzip.decompress((data / f"{name}.gz").read_bytes()))
    return out


def until(log: Log, time: float) -> Log:
    """A log up to a time."""
    cut = {k: Series(s.time[s.time < time], s.values[s.time < time]) for k, s in log.series.items()}
    return Log(log.source, log.kind, log.layout, cut, log.parameters)


def crazyflie(data: Path) -> list[tuple[Log, LogDiagnosis]]:
    """The curve of evidence against damage; the normal flights with their diagnoses."""
    logs = {path.stem: read_log(path) for path in sorted((data / "crazypad").glob("*.npz"))}
    normal = {name: log for name, log in logs.items() if name.startswith("normal")}
    print("\nCrazyflie 2.1, unit E8: motor 3 by what is left of its propeller (47 mm new)")
    print(f"{'log':44} {'sigma of 3':>10} {'loss':>6} {'P(3)':>6} {'healthy':>8}  verdict")

    def length(name: str) -> float:
        if name.startswith("normal"):
            return 48.0
        match = re.search(r"_([\d.]+)mm__E8", name)
        value = float(match[1]) if match else 47.5
        return value if value > 10.0 else 47.0 - value  # of one blade alone the cut is named

    healthy = []
    for name in sorted(logs, key=lambda one: (-length(one), one)):
        others = [log for one, log in normal.items() if one != name]
        found = diagnosis_of(logs[name], learned(others, [""] * len(others)))
        p = {(one.cause, one.rotor): one for one in found.causes}
        third = p["rotor loss", 3]
        blamed = "healthy" if found.rotor is None else f"rotor {found.rotor}"
        sigma = 0.0 if found.trim is None else found.trim.sigmas[2]
        said = name.removeprefix("cut_propeller_").removesuffix("__E8")
        print(f"{said[:44]:44} {sigma:10.1f} {third.loss:6.0%} {third.probability:6.2f} "
              f"{p['healthy', None].probability:8.2f}  {blamed}")  # fmt: skip
        if name in normal:
            healthy.append((logs[name], found))
    return healthy


def failures(data: Path, folder: Path) -> None:
    """Motor named, onset, delay to the alarm."""
    print("\nSimulated failures: the motor named, onset against the true one, delay from it to the alarm")
    for one in FAILURES:
        path = unpacked(data, one.name, folder)
        found = diagnosis_of(read_log(path))
        own = "; ".join(found.own) or "says nothing"
        onset = found.probable.onset or float("nan")
        delay = float("nan") if found.alarm is None else found.alarm - one.onset
        print(f"{path.name}: motor {one.motor} fails at {one.onset:.2f} s ({one.known}); named: rotor {found.rotor} "
              f"(P {found.probable.probability:.3f}), onset {onset - one.onset:+.2f} s, alarm {delay:+.2f} s; "
              f"its own software: {own}")  # fmt: skip
    print("\nGenerations of PX4's topics")
    for name in SAMPLES:
        path = unpacked(data, f"px4_ulog/{name}.ulg", folder)
        log = read_log(path)
        print(f"{path.name}: {log.kind}, {log.duration:.0f} s, lost {log.damage.lost} bytes; "
              f"{diagnosis_of(log).verdict}")  # fmt: skip


def real_healthy(data: Path, folder: Path) -> Iterator[Log]:
    """Healthy flight with body rates: all of NanoBench, and what is before a failure."""
    for path in sorted((data / "nanobench").glob("*.csv.gz")):
        yield read_log(unpacked(data, f"nanobench/{path.name.removesuffix('.gz')}", folder))
    for one in FAILURES:
        yield until(read_log(unpacked(data, one.name, folder)), one.onset - 0.5)
    yield read_log(unpacked(data, "px4_ulog/sample_px4_events.ulg", folder))


def simulated_healthy(count: int) -> Iterator[Log]:
    """Healthy flights of rotorfault in gusts, with noisy sensors, two minutes each."""
    for seed in range(count):
        vehicle, preset = (("x500", "midsize"), ("hummingbird", "tuned"))[seed % 2]
        settings = {"vehicle": vehicle, "controller.preset": preset, "fault": [], "duration": 120.0,
                    "record_period": 0.01, "wind.kind": "dryden", "wind.wind_at_6m": float(3 * (seed % 4)),
                    "sensors.kind": "noisy"}  # fmt: skip
        yield log_of(rf.fly("hover-fault", settings=settings, seed=seed).records(), f"{vehicle} {seed}")


def losses(count: int) -> None:
    """Flights of rotorfault in gusts of 6 m/s in which a rotor loses thrust after 20 s: how often it is named."""
    print("\nrotorfault's own flights in gusts (6 m/s), a rotor loses thrust at 20 s")
    for loss in (0.15, 0.2, 0.3, 0.5):
        right, wrong, delays = 0, 0, []
        for seed in range(count):
            vehicle, preset = (("x500", "midsize"), ("hummingbird", "tuned"))[seed % 2]
            rotor = seed % 4 + 1
            settings = {"vehicle": vehicle, "controller.preset": preset, "duration": 40.0, "record_period": 0.01,
                        "fault": [{"kind": "step", "rotor": rotor, "time": 20.0, "loss": loss}],
                        "wind.kind": "dryden", "wind.wind_at_6m": 6.0, "sensors.kind": "noisy"}  # fmt: skip
            found = diagnosis_of(log_of(rf.fly("hover-fault", settings=settings, seed=seed).records(), vehicle))
            right += found.rotor == rotor
            wrong += found.rotor not in (None, rotor)
            if found.rotor == rotor and found.alarm is not None:
                delays.append(found.alarm - 20.0)
        middle = f", median delay {np.median(delays):.2f} s" if delays else ""
        print(f"loss of {loss:.0%}: right rotor named in {right} of {count}, a wrong one in {wrong}{middle}")


def alarms(title: str, logs: Iterator[Log]) -> None:
    """Alarms of the test of sudden losses per hour, with the exact interval of a Poisson count."""
    hours, count, blamed, number = 0.0, 0, 0, 0
    for log in logs:
        found = diagnosis_of(log)
        hours += sum(end - begin for begin, end in flight_spans(log)) / 3600.0
        count += sum(scan.alarm is not None for scan in found.scans)
        blamed += found.rotor is not None
        number += 1
    low = 0.0 if not count else chi2.ppf(0.025, 2 * count) / 2.0 / hours
    high = chi2.ppf(0.975 if count else 0.95, 2 * count + 2) / 2.0 / hours
    print(f"{title}: {number} flights, {hours:.2f} h, {count} alarms, {blamed} blamed on a rotor; "
          f"{count / hours:.2g} alarms per hour (95 %: {low:.2g} to {high:.2g})")  # fmt: skip


def peers(data: Path, folder: Path, python: str | None) -> None:
    """Other programs on the same files."""
    print("\nBeside others: what each says of the same file, s after the true onset")
    names = [one.name for one in FAILURES] + [f"px4_ulog/{name}.ulg" for name in SAMPLES]
    onsets = {one.name: one.onset for one in FAILURES}
    for name in names:
        path, onset = unpacked(data, name, folder), onsets.get(name)
        found = diagnosis_of(read_log(path))
        own = [
            f"motor {note.motor} after {note.time - (onset or 0.0):.2f} s" for note in found.log.notes if note.alarm
        ]
        mine = "nobody" if found.rotor is None else f"rotor {found.rotor} after {found.alarm - (onset or 0.0):.2f} s"
        print(f"{path.name}: rotorfault {mine}; flight software {', '.join(own) or 'nothing'}; "
              f"flightdx {_flightdx(python, path, onset)}")  # fmt: skip


def _flightdx(python: str | None, path: Path, onset: float | None) -> str:
    if python is None:
        return "not here (--flightdx)"
    done = subprocess.run([python, "-c", PEER, str(path)], capture_output=True, text=True, check=False, timeout=300)
    if done.returncode:
        return f"fails: {done.stderr.strip().splitlines()[-1][:80]}"
    found = json.loads(done.stdout.strip().splitlines()[-1])
    critical = [f"{kind} ({how}) after {time - (onset or 0.0):.2f} s" for kind, how, time in found]
    return ", ".join(critical[:4]) or "nothing"


def main() -> int:
    """Print all of it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--flightdx", metavar="PYTHON", help="a Python that has flightdx")
    parser.add_argument("--peers", action="store_true", help="only what other programs say of the same files")
    parser.add_argument("--simulated", type=int, default=60, help="healthy flights of two minutes that are flown")
    chosen = parser.parse_args()
    folder = os.environ.get("ROTORFAULT_DATA", "")
    if not folder:
        print("ROTORFAULT_DATA names no folder with flight logs: nothing to measure")
        return 0
    warnings.simplefilter("ignore")
    data = Path(folder)
    with tempfile.TemporaryDirectory() as name:
        scratch = Path(name)
        if chosen.peers:
            peers(data, scratch, chosen.flightdx)
            return 0
        normal = crazyflie(data)
        failures(data, scratch)
        print("\nFalse alarms")
        flown = sum(end - begin for log, _ in normal for begin, end in flight_spans(log)) / 60.0
        wrong = sum(found.rotor is not None for _, found in normal)
        print(
            f"Crazyflie E8, each normal flight against the others: {len(normal)} logs, {flown:.1f} min, "
            f"{wrong} blamed"
        )
        alarms("others' flights with body rates", real_healthy(data, scratch))
        alarms("rotorfault's own healthy flights", simulated_healthy(chosen.simulated))
        losses(max(chosen.simulated // 5, 2))
        peers(data, scratch, chosen.flightdx)
        print("\nPredictions on NanoBench: root mean square of errors")
        file = rf.load_vehicle("crazyflie-2.1")
        for path in sorted((data / "nanobench").glob("*.csv.gz")):
            log = read_log(unpacked(data, f"nanobench/{path.name.removesuffix('.gz')}", scratch))
            print(log.source)
            for row in validated(log, file).table():
                print("  " + "  ".join(f"{cell:>26}" for cell in row))
    print(f"\nnumpy {np.__version__}, rotorfault {rf.__version__}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
