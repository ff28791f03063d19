"""`rotorfault.diagnose`: logs in, ranked causes out."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rotorfault.base.bounds import require
from rotorfault.base.errors import InputError
from rotorfault.base.files import in_folder, write_atomically
from rotorfault.logs.baseline import Baseline, digest_of, is_baseline, learned, read_baseline
from rotorfault.logs.detectors import detector_of
from rotorfault.logs.diagnose import diagnosis_of
from rotorfault.logs.log import Log
from rotorfault.logs.page import page_name, write_diagnosis
from rotorfault.logs.read import read_log
from rotorfault.logs.verdict import LogDiagnosis
from rotorfault.model.vehicle_file import load_vehicle

Paths = str | Path | Sequence[str | Path]


def paths_of(value: object, key: str) -> list[Path]:
    """One path or several as a list.

    Parameters
    ----------
    value : object
        As somebody gave it.
    key : str
        What it is, for the message.

    Raises
    ------
    InputError
        If it is neither.
    """
    if isinstance(value, (str, Path)):
        return [Path(value)]
    if (
        isinstance(value, Sequence)
        and not isinstance(value, bytes)
        and all(isinstance(v, (str, Path)) for v in value)
    ):
        return [Path(v) for v in value]
    raise InputError(f"{key}: got {type(value).__name__}; allowed: a path, or a list of paths")


def baseline_of(paths: Sequence[Path]) -> Baseline | None:
    """The baseline of some healthy logs, or the one that a file holds; None where there are no paths.

    Parameters
    ----------
    paths : sequence of Path
        Logs, or one file that ``rotorfault baseline`` wrote.

    Raises
    ------
    InputError
        If they cannot be read, or do not fit together.
    """
    if not paths:
        return None
    files = [path for path in paths if is_baseline(path)]
    if files:
        if len(paths) > 1:
            raise InputError(f"{files[0]}: is a baseline; give it alone, or logs alone")
        return read_baseline(files[0])
    logs = [read_log(path) for path in paths]
    return learned(logs, [digest_of(path / "flight.nc" if path.is_dir() else path) for path in paths])


def diagnose(
    logs: Paths,
    vehicle: str | Path | None = None,
    baseline: Paths | Baseline = (),
    out: str | Path | None = None,
    detectors: str | Path | Sequence[str | Path] = (),
) -> LogDiagnosis | list[LogDiagnosis]:
    """Say which rotor, if any, a flight log shows to have lost thrust, since when, and how surely.

    Parameters
    ----------
    logs : str, Path or sequence of them
        PX4 ULog, ArduPilot dataflash, Betaflight's decoded blackbox, ``flight.nc``, or a table with documented
        columns.
    vehicle : str or Path, optional
        Name or file of the vehicle; the registered sources of diagnosis are then run over the log too.
    baseline : str, Path, sequence of them, or Baseline, optional
        Logs of healthy flights of the same vehicle, or a file that ``rotorfault baseline`` wrote.
    out : str or Path, optional
        Folder for pages with time lines, one for each log.
    detectors : str or sequence of str, optional
        Sources of diagnosis of your own, ``FILE.py:CLASS``, run besides the registered ones; takes `vehicle`.

    Returns
    -------
    LogDiagnosis or list of LogDiagnosis
        One for one path, a list for a list.

    Raises
    ------
    InputError
        If a file cannot be read, or is no flight log.

    Examples
    --------
    >>> import rotorfault as rf
    >>> found = rf.diagnose("flight.ulg", baseline=["monday.ulg", "tuesday.ulg"])  # doctest: +SKIP
    >>> print(found.verdict)  # doctest: +SKIP
    """
    paths = paths_of(logs, "logs")
    if not paths:
        raise InputError("logs: got none; allowed: a path, or a list of paths")
    if vehicle is not None:
        require(vehicle, (str, Path), "vehicle", "the name of a vehicle, or a file")
    known = baseline if isinstance(baseline, Baseline) else baseline_of(paths_of(baseline, "baseline"))
    own = [str(path) for path in paths_of(detectors, "detectors")]
    found = [diagnosed(path, known, vehicle, own) for path in paths]
    if out is not None:
        write_pages(found, Path(out), vehicle)
    return found[0] if isinstance(logs, (str, Path)) else found


def diagnosed(
    path: Path, baseline: Baseline | None, vehicle: str | Path | None = None, detectors: Sequence[str] = ()
) -> LogDiagnosis:
    """The diagnosis of one log.

    Parameters
    ----------
    path : Path
    baseline : Baseline or None
    vehicle : str, Path or None
        Name or file of the vehicle.
    detectors : sequence of str
        Sources of diagnosis of one's own.

    Raises
    ------
    InputError
        If it cannot be read, the baseline is of another vehicle, or there is no such source, or no vehicle for it.
    """
    if detectors and vehicle is None:
        raise InputError("a detector needs to know what flew: say it with --vehicle (vehicle= from Python)")
    if vehicle is not None:
        load_vehicle(vehicle)  # before anything is read, and also where the log has no flight to run it on
    for place in detectors:
        detector_of(place)
    log = read_log(path)
    others = without(path, baseline_for(log, baseline))
    found = diagnosis_of(log, others, vehicle, detectors)
    if baseline is not None and others is not baseline:
        said = "is itself in the baseline and is compared with the others there"
        said = said if others is not None else "is itself the baseline, and nothing else is in it: give other flights"
        found.limits = (*found.limits, f"the log {said}")
    return found


def without(path: Path, baseline: Baseline | None) -> Baseline | None:
    """A baseline without a log that is to be compared with it; None where nothing is left.

    Parameters
    ----------
    path : Path
        Of the log.
    baseline : Baseline or None
    """
    if baseline is None:
        return None
    digest = digest_of(path / "flight.nc" if path.is_dir() else path)
    kept = tuple(one for one in baseline.flights if one.sha256 != digest)
    if len(kept) == len(baseline.flights):
        return baseline
    return baseline._replace(flights=kept) if kept else None


def baseline_for(log: Log, baseline: Baseline | None) -> Baseline | None:
    """A baseline, if it can be one of a log's vehicle.

    Parameters
    ----------
    log : Log
    baseline : Baseline or None

    Raises
    ------
    InputError
        If its vehicle has not as many motors.
    """
    if baseline is not None and log.layout is not None and len(log.layout.places) != len(baseline.layout.places):
        raise InputError(
            f"{log.source}: has {len(log.layout.places)} motors, its baseline {len(baseline.layout.places)}; give a "
            "baseline of the same vehicle"
        )
    return baseline


def write_pages(found: Sequence[LogDiagnosis], folder: Path, vehicle: str | Path | None = None) -> list[Path]:
    """Write a page for each diagnosis.

    Parameters
    ----------
    found : sequence of LogDiagnosis
    folder : Path
        Made where there is none.
    vehicle : str or Path, optional
        To be drawn.
    """
    names: set[str] = set()
    written = []
    for number, one in enumerate(found, start=1):
        name = page_name(one)
        name = f"{number}-{name}" if name in names else name
        names.add(name)
        written.append(write_diagnosis(one, folder, name, vehicle))
    return written


def write_json(found: Sequence[LogDiagnosis], path: Path) -> Path:
    """Write diagnoses as JSON: of one log its object, of several a list in ``logs``.

    Parameters
    ----------
    found : sequence of LogDiagnosis
    path : Path

    Raises
    ------
    InputError
        If the folder does not exist.
    """
    tables: Any = found[0].json() if len(found) == 1 else {"logs": [one.json() for one in found]}
    text = json.dumps(tables, indent=1, allow_nan=False)
    write_atomically(in_folder(path), lambda temporary: temporary.write_text(text + "\n", encoding="utf-8"))
    return path
