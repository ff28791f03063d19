"""What happened in a flight, in words: faults, alarms, isolation, switches, saturation, touch-down, end.

Events are read off the records and the scores that were counted in flight. They need no more than the signals that
every loop has; what a flight did not record gives no events. Pages, animations and exports say the same.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from rotorfault.base.plain_text import one_line
from rotorfault.maths.arrays import Array
from rotorfault.results.derived import STUCK, stuck_at, stuck_text
from rotorfault.results.flight_data import FlightData
from rotorfault.results.flown import faults_of, vehicle_file_of

MERGE = 0.05  # s: what stops for less than that has not stopped
JUMP = 0.02  # of a true loss from one record to the next: a fault that sets in, and no drift
MOST = 12  # events of a kind on one rotor; a burst fault or a chattering limit has hundreds
STEADY = 5  # records before and after a step
WHEN = ("rotor", "time", "start")  # settings of a fault that its event tells by itself
AT_LIMIT = 1e-9  # N
STATES = 8  # values that a signal may take to count as a mode
TURN = 2.0 * np.pi  # rad
SPIN = TURN  # rad/s: a body that makes more than a turn a second spins

Found = TypeVar("Found")


class Event(NamedTuple):
    """Something that happened."""

    time: float  # s
    kind: str  # fault, alarm, false_alarm, cleared, isolated, switch, spin, saturation, given_up, touch_down, end
    text: str
    rotor: int = 0  # number of the rotor, 0 for none
    until: float | None = None  # s, where it lasts


class Span(NamedTuple):
    """Time in which something holds, in s."""

    start: float
    end: float
    broken: bool  # whether it stopped for a moment


def events(data: FlightData) -> list[Event]:
    """All events of a flight in order of time.

    Parameters
    ----------
    data : FlightData

    Returns
    -------
    list of Event
        Of one kind on one rotor no more than 12; the last of them says how many there are.
    """
    time = np.asarray(data["time"].values, dtype=float)
    if not len(time):
        return []
    scores: dict[str, Any] = json.loads(data.attrs.get("scores", "{}"))
    found = [
        *_faults(data, time, scores),
        *_alarms(data, time, scores),
        *_switches(data, time, scores),
        *_spin(data, time),
        *_saturation(data, time),
        *_given_up(data, time),
    ]
    if (kind := str(data.attrs.get("outcome", ""))) != "":
        found.append(Event(float(data.attrs.get("end_time", time[-1])), "end", kind))
    return sorted(found)


def onsets(scores: Mapping[str, Any]) -> dict[int, float]:
    """Time in s at which the first fault of each rotor that has one begins, from the scores of a flight."""
    return {
        int(name.removeprefix("onset.")): float(value)
        for name, value in scores.items()
        if name.startswith("onset.") and value is not None
    }


def isolation_time(data: FlightData, onset: Mapping[int, float]) -> float | None:
    """When the flagged rotors were for the first time those with a fault and no others; None if they never were.

    Parameters
    ----------
    data : FlightData
    onset : mapping of int to float
        Time in s of the first fault of each rotor that has one.
    """
    if not onset or "fault_flag" not in data:
        return None
    time = np.asarray(data["time"].values, dtype=float)
    flags = np.asarray(data["fault_flag"].values) > 0.5
    faulty = np.array([number + 1 in onset for number in range(flags.shape[1])])
    exact = (flags == faulty).all(axis=1) & (time >= max(onset.values()))
    return float(time[np.argmax(exact)]) if exact.any() else None


def _faults(data: FlightData, time: Array, scores: Mapping[str, Any]) -> Iterator[Event]:
    """Each rotor's first fault, as the scenario has it, and what comes after it."""
    first = onsets(scores)
    for rotor, onset in first.items():
        loss = scores.get(f"loss_true.{rotor}")
        yield Event(onset, "fault", _fault_text(rotor, faults_of(data, rotor), loss), rotor)
    if "loss_true" not in data:
        return
    losses = np.asarray(data["loss_true"].values, dtype=float)
    losses = np.where(np.isfinite(stuck_at(data)), 0.0, losses)  # a stuck rotor has no loss
    for k in range(losses.shape[1]):
        onset = first.get(k + 1, np.inf)
        later = [at for at in _steps(losses[:, k]) if time[at] > onset + MERGE]
        for at, more in _first(later):
            text = f"rotor {k + 1}: true loss now {100.0 * losses[at, k]:.3g} %{more}"
            yield Event(float(time[at]), "fault", text, k + 1)


def _steps(loss: Array) -> list[int]:
    """Records at which a loss goes from one steady value to another."""
    change = np.abs(np.diff(loss))
    found = np.flatnonzero(change > JUMP)
    return [
        int(at) + 1
        for at in found
        if (change[max(at - STEADY, 0) : at] < 1e-9).all() and (change[at + 1 : at + 1 + STEADY] < 1e-9).all()
    ]


def _fault_text(rotor: int, faults: list[dict[str, Any]], loss: float | None) -> str:
    """A plain loss says how much; of other faults the kind and its settings tell more."""
    share = " thrust" if loss is None else f" {100.0 * loss:.3g} % of its thrust"
    if all(fault.get("kind") == "step" for fault in faults):
        return f"rotor {rotor} loses{share}"
    if len(faults) == 1 and faults[0].get("kind") == STUCK and isinstance(faults[0].get("thrust"), (int, float)):
        return f"rotor {rotor} is {stuck_text(faults[0]['thrust'])}"
    return f"fault of rotor {rotor} begins: " + "; ".join(map(_settings_text, faults))


def _settings_text(fault: Mapping[str, Any]) -> str:
    numbers = [
        f"{name} {value:.4g}"
        for name, value in fault.items()
        if isinstance(value, (int, float)) and not isinstance(value, bool) and name not in WHEN
    ]
    return one_line(" ".join([str(fault.get("kind", "")), ", ".join(numbers)]).strip())


def _alarms(data: FlightData, time: Array, scores: Mapping[str, Any]) -> Iterator[Event]:
    """Flags raised and cleared, and when they named the rotors with a fault and no others."""
    if "fault_flag" not in data:
        return
    flags = np.asarray(data["fault_flag"].values) > 0.5
    onset = onsets(scores)
    for k in range(flags.shape[1]):
        rotor = k + 1
        begins = onset.get(rotor, np.inf)
        raised = list(np.flatnonzero(np.diff(flags[:, k].astype(int), prepend=0) > 0))
        cleared = list(np.flatnonzero(np.diff(flags[:, k].astype(int), prepend=0) < 0))
        right = [at for at in raised if time[at] >= begins]
        for number, (at, more) in enumerate(_first(right)):
            late = f", {1e3 * (time[at] - begins):.0f} ms after its fault" if number == 0 else " again"
            yield Event(float(time[at]), "alarm", f"rotor {rotor} flagged{late}{more}", rotor)
        for at, more in _first([at for at in raised if time[at] < begins]):
            yield Event(float(time[at]), "false_alarm", f"false alarm: rotor {rotor} flagged{more}", rotor)
        for at, more in _first(cleared):
            yield Event(float(time[at]), "cleared", f"rotor {rotor} cleared{more}", rotor)
    if (isolated := isolation_time(data, onset)) is not None:
        yield Event(isolated, "isolated", f"isolated: {_rotors(list(onset))} and no other")


def _rotors(numbers: list[int]) -> str:
    *rest, last = map(str, sorted(numbers))
    return f"rotors {', '.join(rest)} and {last}" if rest else f"rotor {last}"


def _switches(data: FlightData, time: Array, scores: Mapping[str, Any]) -> Iterator[Event]:
    """What the response to a fault did: a landing, and modes that parts record."""
    words = {
        "confirmed_time": ("switch", "landing begins"),
        "touch_down_time": ("touch_down", "touch-down"),
        "rotors_stopped_time": ("switch", "rotors stopped"),
    }
    for name, (kind, text) in words.items():
        if (at := scores.get(f"landing.{name}")) is not None:
            speed = scores.get("landing.speed")
            down = f" at {speed:.2g} m/s" if kind == "touch_down" and speed is not None else ""
            yield Event(float(at), kind, text + down)
    for name, variable in data.variables.items():
        if name.rpartition(".")[2] not in ("mode", "stage") or variable.dims != ("time",):
            continue
        values = np.asarray(variable.values, dtype=float)
        if len(np.unique(values[np.isfinite(values)])) > STATES:
            continue
        for at, more in _first(list(np.flatnonzero(np.diff(values) != 0.0) + 1)):
            yield Event(float(time[at]), "switch", f"{name}: {values[at - 1]:g} to {values[at]:g}{more}")


def turning(data: FlightData) -> Array:
    """How fast the body turns in rad/s, shape (records,); empty where that was not recorded.

    Parameters
    ----------
    data : FlightData
    """
    if "body_rates" not in data:
        return np.empty(0)
    rate: Array = np.linalg.norm(np.asarray(data["body_rates"].values, dtype=float), axis=1)
    return np.nan_to_num(rate)


def spins(data: FlightData) -> bool:
    """Whether the body makes a whole turn at more than one a second, about whatever axis.

    Parameters
    ----------
    data : FlightData
    """
    return any(True for _ in _spin(data, np.asarray(data["time"].values, dtype=float)))


def _spin(data: FlightData, time: Array) -> Iterator[Event]:
    """When the body begins to turn faster than once a second, and how fast it turns then at most."""
    rate = turning(data)
    found = []
    for span in _spans(time, rate > SPIN) if rate.size else []:
        within = rate[(time >= span.start - 1e-9) & (time <= span.end + 1e-9)]
        if within.mean() * (span.end - span.start) >= TURN:  # a swerve is no spin
            found.append((span, float(within.max()) / TURN))
    for (span, most), more in _first(found):
        text = f"spins for {_seconds(span.end - span.start)}, up to {most:.2g} turns a second{more}"
        yield Event(span.start, "spin", text)


def _saturation(data: FlightData, time: Array) -> Iterator[Event]:
    """Rotors at a limit of their commands."""
    if "thrust_command" not in data or "thrust_max" not in data.attrs:
        return
    command = np.asarray(data["thrust_command"].values, dtype=float)
    ends = (
        ("upper", _limits(data, "thrust_max", command.shape[1]), 1.0),
        ("lower", _limits(data, "thrust_min", command.shape[1]), -1.0),
    )
    for k in range(command.shape[1]):
        for side, limits, sign in ends:
            spans = _spans(time, sign * (command[:, k] - limits[k]) >= -AT_LIMIT)
            for span, more in _first(spans):
                text = f"command of rotor {k + 1} at its {side} limit {_span_text(span)}{more}"
                yield Event(span.start, "saturation", text, k + 1, span.end)


def _limits(data: FlightData, name: str, rotors: int) -> list[float]:
    """A limit of the commands of each rotor in N."""
    file = vehicle_file_of(data)
    if file is not None and len(file.rotor) == rotors and len(set(own := file.of_rotors(name))) > 1:
        return list(own)
    return [float(data.attrs.get(name, 0.0))] * rotors


def _given_up(data: FlightData, time: Array) -> Iterator[Event]:
    """What allocation could not give."""
    if "given_up" not in data:
        return
    cut = np.asarray(data["given_up"].values) > 0.5
    for k, what in enumerate(("tilt", "thrust", "yaw")):
        for span, more in _first(_spans(time, cut[:, k])):
            text = f"{what} {'cut' if what == 'thrust' else 'torque cut'} {_span_text(span)}{more}"
            yield Event(span.start, "given_up", text, 0, span.end)


def _span_text(span: Span) -> str:
    length = _seconds(span.end - span.start)
    return f"on and off for {length}" if span.broken else f"for {length}"


def _seconds(length: float) -> str:
    return f"{1e3 * length:.0f} ms" if length < 1.0 else f"{length:.3g} s"


def _spans(time: Array, where: NDArray[np.bool_]) -> list[Span]:
    """Times from and until which something holds, with short breaks."""
    edges = np.diff(where.astype(int), prepend=0, append=0)
    starts, stops = np.flatnonzero(edges > 0), np.flatnonzero(edges < 0)
    step = float(time[1] - time[0]) if len(time) > 1 else 0.0
    spans: list[Span] = []
    for start, stop in zip(starts, stops, strict=True):
        begin, end = float(time[start]), float(time[stop - 1]) + step
        if spans and begin - spans[-1].end < MERGE:
            spans[-1] = Span(spans[-1].start, end, True)
        else:
            spans.append(Span(begin, end, False))
    return spans


def _first(found: list[Found]) -> Iterator[tuple[Found, str]]:
    """The first so many of a kind, and what is to be said of those left out."""
    for number, one in enumerate(found[:MOST], start=1):
        left = len(found) - MOST
        yield one, f" (and {left} times more)" if number == MOST and left > 0 else ""
