"""What a vehicle is like while it is healthy, learned from its own logs and kept in a file with its provenance."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from rotorfault._version import __version__
from rotorfault.base.errors import InputError
from rotorfault.base.files import in_folder, read_plain, write_atomically
from rotorfault.logs.dynamics import Response, residual_of
from rotorfault.logs.log import Layout, Log
from rotorfault.logs.segments import Hover, flight_spans, hover_of
from rotorfault.logs.trim import Trim
from rotorfault.logs.vibration import Shaking, shaking_of
from rotorfault.maths.arrays import Array

FORMAT = "rotorfault baseline 1"
FEWEST = 3  # blocks of hover that make a trim
MOST = 16 << 20  # bytes of a baseline's file


class Flown(NamedTuple):
    """One log of a baseline."""

    log: str
    sha256: str
    kind: str
    trim: Trim | None
    response: Response | None
    parameters: Mapping[str, float]
    shaking: Shaking | None = None


class Baseline(NamedTuple):
    """Healthy flights of one vehicle."""

    layout: Layout
    flights: tuple[Flown, ...]

    @property
    def trims(self) -> list[Trim]:
        """Of the flights that hover."""
        return [one.trim for one in self.flights if one.trim is not None]

    @property
    def response(self) -> Response | None:
        """Gains and lag of all flights together, weighed by how well each knows them."""
        known = [one.response for one in self.flights if one.response is not None]
        if not known:
            return None
        weights = np.array([one.error**-2 for one in known])
        logs = np.array([np.log(one.gain) for one in known])
        total = weights.sum(axis=0)
        gain: Array = np.exp((weights * logs).sum(axis=0) / total)
        # Flights of one vehicle share errors of the method: more of them do not make a gain exact.
        error = np.maximum(np.sqrt(len(known) / total) / math.sqrt(min(len(known), 4)), 0.1)
        lag = float(np.median([one.lag for one in known]))
        hover = float(np.mean([one.hover for one in known]))
        return Response(gain, error, lag, any(one.lag_known for one in known), hover)


def trim_of(hover: Hover) -> Trim | None:
    """The trim of some blocks of hover; None where there are too few.

    Parameters
    ----------
    hover : Hover
    """
    count = len(hover.time)
    if count < FEWEST:
        return None
    logs = np.log(np.maximum(hover.command, 1e-3))
    with np.errstate(all="ignore"):
        voltage = float(np.nanmean(hover.voltage)) if np.isfinite(hover.voltage).any() else math.nan
        tilt = np.nanmean(hover.tilt, axis=0) if np.isfinite(hover.tilt).any() else np.full(2, np.nan)
    return Trim(logs.mean(axis=0), logs.std(axis=0, ddof=1) / math.sqrt(count), count, voltage, tilt)


def learned(logs: Sequence[Log], digests: Sequence[str]) -> Baseline:
    """The baseline of healthy logs.

    Parameters
    ----------
    logs : sequence of Log
        Of one vehicle.
    digests : sequence of str
        SHA-256 of each file.

    Raises
    ------
    InputError
        If there are none, or they are of different vehicles, or no log flies.
    """
    flights: list[Flown] = []
    layout: Layout | None = None
    for log, digest in zip(logs, digests, strict=True):
        if log.layout is None or not log.motors:
            raise InputError(f"{log.source}: has no commands of motors; a baseline is learned from them")
        if layout is None:
            layout = log.layout
        elif len(layout.places) != len(log.layout.places) or not np.allclose(
            layout.places, log.layout.places, atol=0.02
        ):
            raise InputError(
                f"{log.source}: its motors are not where those of {logs[0].source} are; give one vehicle"
            )
        spans = flight_spans(log)
        hover = hover_of(log, spans)
        trim = trim_of(hover)
        response = None
        if spans:
            mean = hover_command(log, spans, hover)
            longest = max(spans, key=lambda span: span[1] - span[0])
            residual = residual_of(log, longest[0] + 1.5, longest[1], mean)
            response = None if residual is None else residual.response
        shaking, _ = shaking_of(log, spans)
        flights.append(Flown(log.source, digest, log.kind, trim, response, log.parameters, shaking))
    if layout is None or not any(one.trim or one.response for one in flights):
        raise InputError("no log of the baseline flies; give logs of healthy flights, best with some hover")
    return Baseline(layout, tuple(flights))


def hover_command(log: Log, spans: Sequence[tuple[float, float]], hover: Hover) -> float:
    """Mean command in hover; where the log has none, the median in flight.

    Parameters
    ----------
    log : Log
    spans : sequence of (float, float), s
        Of flight.
    hover : Hover
    """
    if len(hover.time) >= FEWEST:
        return float(hover.command.mean())
    command = log.series["command"]
    inside = np.zeros(len(command.time), dtype=bool)
    for begin, end in spans:
        inside |= (command.time >= begin) & (command.time <= end)
    return max(float(np.median(command.values[inside].mean(axis=1))), 0.02)


def digest_of(path: Path) -> str:
    """SHA-256 of a file, read in pieces.

    Parameters
    ----------
    path : Path
    """
    found = hashlib.sha256()
    with path.open("rb") as file:
        while piece := file.read(1 << 20):
            found.update(piece)
    return found.hexdigest()


def write_baseline(baseline: Baseline, path: Path, extra: Mapping[str, Any] | None = None) -> Path:
    """Write a baseline as JSON, whole or not at all.

    Parameters
    ----------
    baseline : Baseline
    path : Path
    extra : mapping, optional
        What else is to stand there, such as estimates.
    """
    layout = baseline.layout
    tables = {
        "format": FORMAT,
        "written": datetime.now(UTC).isoformat(timespec="seconds"),
        "written_by": f"rotorfault {__version__}",
        "layout": {"places": layout.places.tolist(), "yaw": layout.yaw.tolist(), "source": layout.source},
        "flights": [
            {
                "log": one.log,
                "sha256": one.sha256,
                "kind": one.kind,
                "trim": None if one.trim is None else _plain(one.trim._asdict()),
                "response": None if one.response is None else _plain(one.response._asdict()),
                "shaking": None if one.shaking is None else _plain(one.shaking._asdict()),
                "parameters": _plain(dict(one.parameters)),
            }
            for one in baseline.flights
        ],
        **dict(extra or {}),
    }
    text = json.dumps(tables, indent=1, allow_nan=False)
    write_atomically(in_folder(path), lambda temporary: temporary.write_text(text + "\n", encoding="utf-8"))
    return path


def _plain(fields: Mapping[str, Any]) -> dict[str, Any]:
    """Numbers as JSON has them; what is not finite is null."""

    def one(value: Any) -> Any:
        if isinstance(value, np.ndarray):
            return [one(v) for v in value.tolist()]
        if isinstance(value, float):
            return value if math.isfinite(value) else None
        return value

    return {key: one(value) for key, value in fields.items()}


def is_baseline(path: Path) -> bool:
    """Whether a file is a baseline, by how it begins.

    Parameters
    ----------
    path : Path
    """
    if path.suffix.lower() != ".json":
        return False
    try:
        with path.open("rb") as file:
            return FORMAT[:19].encode() in file.read(200)
    except OSError:
        return False


def read_baseline(path: Path) -> Baseline:
    """Read a baseline that `write_baseline` wrote.

    Parameters
    ----------
    path : Path

    Raises
    ------
    InputError
        If it is none.
    """
    try:
        if path.stat().st_size > MOST:
            raise ValueError("too large")
        tables = json.loads(read_plain(path))
        layout = tables["layout"]
        made = Layout(
            np.array(layout["places"], dtype=float), np.array(layout["yaw"], dtype=float), str(layout["source"])
        )
        if made.places.ndim != 2 or made.places.shape[1] != 2 or made.yaw.shape != (len(made.places),):
            raise ValueError("layout")
        flights = tuple(_flown(one, len(made.places)) for one in tables["flights"])
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from None
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        raise InputError(f"{path}: is no baseline; make one with rotorfault baseline LOG ... --out FILE") from None
    return Baseline(made, flights)


def _flown(tables: Mapping[str, Any], count: int) -> Flown:
    trim, response = tables["trim"], tables["response"]

    def numbers(value: Any, shape: tuple[int, ...]) -> Array:
        found = np.array([math.nan if v is None else float(v) for v in value])
        if found.shape != shape:
            raise ValueError("shape")
        return found

    return Flown(
        str(tables["log"]),
        str(tables["sha256"]),
        str(tables["kind"]),
        None if trim is None else Trim(
            numbers(trim["log_command"], (count,)), numbers(trim["error"], (count,)), int(trim["blocks"]),
            math.nan if trim["voltage"] is None else float(trim["voltage"]), numbers(trim["tilt"], (2,)),
        ),
        None if response is None else Response(
            numbers(response["gain"], (3,)), numbers(response["error"], (3,)), float(response["lag"]),
            bool(response["lag_known"]), float(response["hover"]),
        ),
        {str(k): float(v) for k, v in tables["parameters"].items() if v is not None},
        None if (shaking := tables.get("shaking")) is None else Shaking(
            str(shaking["of"]), numbers(shaking["size"], (count,)), int(shaking["blocks"])
        ),
    )  # fmt: skip
