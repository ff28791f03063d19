"""What the constants of log diagnosis rest on: `ROTORFAULT_DATA=FOLDER python benchmarks/log_constants.py`.

Prints by how much the trim of healthy flights of one vehicle varies, direction by direction, with 90 % intervals,
beside what is taken before any flight is known; and what becomes of the verdicts on all logs at hand, from others and
from flights of rotorfault, if each constant were half or twice what it is. A verdict that hangs on the value of a
constant shows there.
"""

from __future__ import annotations

import argparse
import os
import re
import sys
import tempfile
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from log_diagnosis import FAILURES, unpacked
from log_held_out import COMMON, ONSET, flown, thinned
from scipy.stats import chi2

from rotorfault.logs.baseline import learned
from rotorfault.logs.diagnose import diagnosis_of
from rotorfault.logs.log import Log
from rotorfault.logs.read import read_log
from rotorfault.logs.trim import BETWEEN_FLIGHTS, directions_of

OF_TRIM = ("BETWEEN_FLIGHTS", "WORTH", "SHIFT", "WIND", "WEIGHT", "SAG")
OF_MOTION = ("UNEVEN", "LEAD", "LEAST_GAIN_ERROR", "LASTING", "REFERENCE", "SUDDEN", "PUSHED")
VEHICLES = {"x500": "midsize", "f550": "midsize", "racer-5inch": "midsize"}


@contextmanager
def scaled(name: str, factor: float) -> Iterator[None]:
    """A constant of log diagnosis, wherever it is used, times a factor."""
    before: list[tuple[Any, Any]] = []
    for module in [one for key, one in sys.modules.items() if key.startswith("rotorfault.logs.")]:
        if name in vars(module):
            value = vars(module)[name]
            before.append((module, value))
            many = isinstance(value, Mapping)
            setattr(module, name, {k: factor * v for k, v in value.items()} if many else factor * value)
    try:
        yield
    finally:
        for module, value in before:
            setattr(module, name, value)


def crazyflie(data: Path) -> dict[str, Log]:
    """All logs of the Crazyflie with a propeller cut."""
    return {path.stem: read_log(path) for path in sorted((data / "crazypad").glob("*.npz"))}


def trims(logs: Mapping[str, Log]) -> None:
    """How much healthy flights vary."""
    normal = [log for name, log in logs.items() if name.startswith("normal")]
    baseline = learned(normal, [""] * len(normal))
    basis, names = directions_of(baseline.layout)
    along = np.array([basis @ trim.log_command for trim in baseline.trims]) / np.sqrt(len(names))
    count = len(along)
    print(
        f"Trim of {count} healthy flights of one vehicle: standard deviation, 90 % interval; taken before any flight"
    )
    for name, spread in zip(names, along.std(axis=0, ddof=1), strict=True):
        low, high = (spread * np.sqrt((count - 1) / chi2.ppf(q, count - 1)) for q in (0.95, 0.05))
        print(f"  {name:8} {spread:.4f} ({low:.4f} to {high:.4f}); {BETWEEN_FLIGHTS[name]:.4f}")


def of_trim(logs: Mapping[str, Log]) -> str:
    """Verdicts on the Crazyflie: normal flights blamed, cut propellers named, wrong rotors."""
    normal = {name: log for name, log in logs.items() if name.startswith("normal")}
    blamed = named = wrong = cut = middle = between = 0
    whole = learned(list(normal.values()), [""] * len(normal))
    for name, log in logs.items():
        if name in normal:
            others = [one for key, one in normal.items() if key != name]
            blamed += diagnosis_of(log, learned(others, [""] * len(others))).rotor is not None
            continue
        found = diagnosis_of(log, whole)
        match = re.search(r"_([\d.]+)mm__E8", name)
        length = float(match[1]) if match else 47.5
        length = length if length > 10.0 else 47.0 - length
        wrong += found.rotor not in (None, 3)
        if length <= 43.0:
            cut, named = cut + 1, named + (found.rotor == 3)
        else:
            middle, between = middle + 1, between + (found.rotor == 3)
    return (f"blamed {blamed} of {len(normal)} normal; named {named} of {cut} at 43 mm or less, {between} of "
            f"{middle} above; wrong rotor {wrong}")  # fmt: skip


def of_motion(failures: Mapping[int, tuple[Log, int]], own: list[tuple[Log, int | None]]) -> str:
    """Verdicts on sudden losses: of others' simulations, and of flights of rotorfault."""
    right = sum(diagnosis_of(log).rotor == motor for log, motor in failures.values())
    hit = blamed = wrong = lost = healthy = 0
    for log, rotor in own:
        found = diagnosis_of(log)
        healthy, blamed = healthy + (rotor is None), blamed + (rotor is None and found.rotor is not None)
        lost, hit = lost + (rotor is not None), hit + (rotor is not None and found.rotor == rotor)
        wrong += rotor is not None and found.rotor not in (None, rotor)
    return (f"{right} of {len(failures)} simulated failures of others; {hit} of {lost} losses named, wrong rotor "
            f"{wrong}; blamed {blamed} of {healthy} healthy")  # fmt: skip


def own_flights() -> list[tuple[Log, int | None]]:
    """Losses of 20 and 40 % and healthy flights, in gusts, logged at 50 Hz."""
    found: list[tuple[Log, int | None]] = []
    for k, (vehicle, preset) in enumerate(VEHICLES.items()):
        base = COMMON | {"vehicle": vehicle, "controller.preset": preset, "wind.wind_at_6m": 6.0}
        for n, loss in enumerate((0.2, 0.4)):
            fault = {"kind": "step", "rotor": n + 1, "time": ONSET, "loss": loss}
            log = flown(base | {"fault": [fault], "duration": 24.0}, 90000 + 10 * k + n)
            found.append((thinned(log, 4), n + 1))
        found.append((thinned(flown(base | {"fault": [], "duration": 60.0}, 90005 + 10 * k), 4), None))
    return found


def main() -> int:
    """Print all of it."""
    argparse.ArgumentParser(description=__doc__).parse_args()
    folder = os.environ.get("ROTORFAULT_DATA", "")
    if not folder:
        print("ROTORFAULT_DATA names no folder with flight logs: nothing to measure")
        return 0
    warnings.simplefilter("ignore")
    data = Path(folder)
    logs = crazyflie(data)
    trims(logs)
    print(f"\nLasting losses, as it is: {of_trim(logs)}", flush=True)
    for name in OF_TRIM:
        for factor in (0.5, 2.0):
            with scaled(name, factor):
                print(f"  {name} x {factor:g}: {of_trim(logs)}", flush=True)
    with tempfile.TemporaryDirectory() as scratch:
        failures = {
            k: (read_log(unpacked(data, one.name, Path(scratch))), one.motor) for k, one in enumerate(FAILURES)
        }
    own = own_flights()
    print(f"\nSudden losses, as it is: {of_motion(failures, own)}", flush=True)
    for name in OF_MOTION:
        for factor in (0.5, 2.0):
            with scaled(name, factor):
                print(f"  {name} x {factor:g}: {of_motion(failures, own)}", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
