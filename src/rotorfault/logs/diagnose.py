"""Which rotor, in a flight log: sudden losses by the residual of motion, lasting ones by the trim of hover.

Both tests give probabilities, and these are put together: what came suddenly in this flight, and else what was there
from its beginning. No number here is fitted to a log; noise, gains and imbalance are measured in it or in a baseline.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from rotorfault.logs.baseline import Baseline, hover_command
from rotorfault.logs.detectors import Said, said_by_all
from rotorfault.logs.dynamics import Residual, Response, block_length, fallen, residual_of
from rotorfault.logs.forced import short_of
from rotorfault.logs.log import Log, Note, when
from rotorfault.logs.resting import resting_residual
from rotorfault.logs.scan import FIRST, Scan, scan
from rotorfault.logs.segments import Hover, flight_spans, hover_of
from rotorfault.logs.sentences import (
    own_words,
    seconded,
    shaking_words,
    sudden_evidence,
    trim_evidence,
    verdict_of,
)
from rotorfault.logs.steady import Steady, steady_of
from rotorfault.logs.trim import PRIOR
from rotorfault.logs.verdict import Cause, LogDiagnosis
from rotorfault.logs.vibration import shaking_of
from rotorfault.logs.witness import heard

# How often a flight that is looked at has a rotor that suddenly loses thrust, and a lasting push that begins in it.
# Of what is met at all, half is taken to begin in flight, since nothing is known of it.
SUDDEN = 0.5 * PRIOR["rotor loss"]
PUSHED = 0.5 * (PRIOR["wind"] + PRIOR["centre of mass shifted"])
TAKE_OFF = 1.5  # s in which the ground is near
IN_FLIGHT = 0.5  # s: a log that begins so shortly before its flight begins in the air
BLIND, NEAR = 0.3, 0.5  # s without records, and how shortly before an onset, in which it may have begun
SENT = 0.99  # that a motor gave no thrust, if the log says twice that it was sent none
SLOWLY = "what begins in a flight is looked for in steady hover alone, and told to about a second"
PUSHES = {"wind": 0.6, "centre of mass shifted": 0.3, "drag": 0.1}  # what a push from outside is


class Sudden(NamedTuple):
    """What came in flight, by probability."""

    scan: Scan
    residual: Residual
    none: float
    rotors: tuple[float, ...]
    push: float


def diagnosis_of(
    log: Log,
    baseline: Baseline | None = None,
    vehicle: str | Path | None = None,
    detectors: Sequence[str] = (),
) -> LogDiagnosis:
    """What a log says of its rotors.

    Parameters
    ----------
    log : Log
    baseline : Baseline, optional
        Of healthy flights of the same vehicle.
    vehicle : str or Path, optional
        Name or file, for the registered sources of diagnosis.
    detectors : sequence of str
        Sources of one's own, ``FILE.py:CLASS``, that are run besides where there is a vehicle.
    """
    limits = list(_limits_of_rates(log))
    spans = flight_spans(log)
    if log.layout is None or not spans:
        return _nothing(log, limits, bool(log.motors))
    limits += _limits_of_begin(log, spans)
    hover = hover_of(log, spans)
    response = None if baseline is None else baseline.response
    sudden = _sudden(log, spans, hover, response)
    first = max(sudden, key=lambda one: 1.0 - one.none, default=None)
    before = hover
    if first is not None and first.none < 0.5 and first.scan.onset is not None:
        keep = hover.time + 1.0 < first.scan.onset
        before = Hover(*(part[keep] for part in hover))
        limits += _limits_of_onset(log, first.scan.onset)
        if first.scan.over is not None:
            time, why = first.scan.over
            limits.append(f"at {when(log, time)}, {why}: the flight is over, and what follows is not weighed")
    flown = [(begin + TAKE_OFF, end) for begin, end in spans]
    said = [] if vehicle is None else said_by_all(log, flown, before, vehicle, detectors)
    first, counts = _with_witness(first, said, flown)
    steady = steady_of(log, before, spans, baseline)
    evidence = None if steady is None else steady.evidence
    causes = _ranked(log, first, steady, baseline)
    stopped = next((note for note in log.notes if note.stopped and _inside(note.time, spans)), None)
    if stopped is not None and not (causes[0].rotor == stopped.motor and causes[0].onset is not None):
        causes = _with_stopped(log, causes, stopped)
    if "otherwise" in log.series and baseline is None:
        causes = _either(causes, diagnosis_of(_otherwise(log)).causes)
    limits += _limits_of_hover(steady, baseline)
    causes = (seconded(causes[0], said, counts), *causes[1:])
    verdict = verdict_of(log, causes, evidence, None if steady is None else steady.trim)
    shaking, why = shaking_of(log, spans)
    limits += [why] if why else []
    shakes = [] if shaking is None else shaking_words(log, shaking, baseline)
    verdict += f"; {shakes[0]}" if shakes and causes[0].cause == "healthy" and "times as much" in shakes[0] else ""
    scans = tuple(one.scan for one in sudden)
    return LogDiagnosis(
        log, causes, verdict, tuple(limits), scans, evidence, own_words(log), tuple(said), tuple(shakes)
    )  # fmt: skip


def _sudden(log: Log, spans: Sequence[tuple[float, float]], hover: Hover, known: Response | None) -> list[Sudden]:
    """Each flight tested for what begins in it."""
    mean = hover_command(log, spans, hover)
    found: list[Sudden] = []
    for begin, end in spans:
        residual = residual_of(log, begin + TAKE_OFF, end, mean, known)
        if residual is None and block_length(log) is None:
            residual = resting_residual(log, begin, end, mean)
        if residual is None:
            continue
        one = scan(residual)
        if one.onset is not None:
            one = one._replace(over=fallen(log, one.onset, end + 1.0, mean))
        blocks, motors = max(int(np.isfinite(one.residual[:, 0]).sum()), 1), len(one.scores)
        if one.onset is None:
            found.append(Sudden(one, residual, 1.0, (0.0,) * motors, 0.0))
            continue
        logs = np.array(
            [math.log(1.0 - SUDDEN - PUSHED)]
            + [math.log(SUDDEN / motors / blocks) + score for score in one.scores]
            + [math.log(PUSHED / blocks) + one.free]
        )
        weights = np.exp(logs - logs.max())
        weights /= weights.sum()
        found.append(Sudden(one, residual, float(weights[0]), tuple(weights[1:-1].tolist()), float(weights[-1])))
    return found


def _with_witness(
    first: Sudden | None, said: Sequence[Said], flown: Sequence[tuple[float, float]]
) -> tuple[Sudden | None, float | None]:
    """What came in flight, with what other sources say of it; and how often as likely that makes its rotor."""
    if first is None or first.scan.onset is None or first.scan.rotor is None:
        return first, None
    onset = first.scan.onset
    begin = next((begin for begin, end in flown if begin <= onset <= end + 1.0), flown[0][0])
    told = heard(said, begin, onset, len(first.rotors))
    if told is None:
        return first, None
    weights = np.array([first.none, *(first.rotors * told.rotors), first.push])
    weights /= weights.sum()
    joined = first._replace(none=float(weights[0]), rotors=tuple(weights[1:-1].tolist()), push=float(weights[-1]))
    return joined, float(told.rotors[int(np.argmax(joined.rotors))])


def _inside(time: float, spans: Sequence[tuple[float, float]]) -> bool:
    """Whether a time is in a flight, or where one ends: a vehicle without a motor soon flies no more."""
    return any(begin <= time <= end + 1.0 for begin, end in spans)


def _with_stopped(log: Log, causes: Sequence[Cause], note: Note) -> tuple[Cause, ...]:
    """Causes with a motor that was sent nothing while the others ran."""
    said = f"{note.text}, from {when(log, note.time)}"
    same = ("rotor loss", note.motor)
    rest = [one._replace(probability=one.probability * (1.0 - SENT)) for one in causes]
    more = sum(one.probability for one in rest if (one.cause, one.rotor) == same)
    others = [one for one in rest if (one.cause, one.rotor) != same]
    return (Cause(*same, 1.0, note.time, SENT + more, said), *others)


def _ranked(log: Log, sudden: Sudden | None, steady: Steady | None, baseline: Baseline | None) -> tuple[Cause, ...]:
    """All causes, the most probable first."""
    found: list[Cause] = []
    none = 1.0 if sudden is None else sudden.none
    if sudden is not None and sudden.scan.onset is not None and none < 0.999:
        onset = sudden.scan.onset
        for k, probability in enumerate(sudden.rotors):
            said = sudden_evidence(log, sudden.scan, k)
            loss, ends = (sudden.scan.loss, sudden.scan.interval) if k == sudden.scan.rotor else (None, None)
            if loss is not None and (sent := short_of(log, onset, k)) is not None:
                loss, ends = sent
            found.append(Cause("rotor loss", k + 1, loss, onset, probability, said, ends))
        for name, share in PUSHES.items():
            said = f"a lasting push from outside since {when(log, onset)}"
            found.append(Cause(name, None, None, onset, sudden.push * share, said))
    if steady is None:
        seen = "nothing else began in flight" if sudden is not None else "nothing in the log speaks for a fault"
        healthy = PRIOR["healthy"] + PRIOR["rotor loss"]
        found.append(Cause("healthy", None, None, None, none * healthy, seen))
        others = [name for name in PRIOR if name not in ("healthy", "rotor loss")]
        share = (1.0 - healthy) / len(others)
        found += [
            Cause(name, None, None, None, none * share, "without hover nothing is known of it") for name in others
        ]
    else:
        evidence, since = steady.evidence, steady.since
        for (name, rotor), probability in evidence.causes.items():
            said = trim_evidence(name, rotor, evidence, steady.trim, steady.against)
            loss = None if rotor is None else float(evidence.loss[rotor])
            interval = (
                None if rotor is None else (float(evidence.interval[rotor][0]), float(evidence.interval[rotor][1]))
            )
            number = None if rotor is None else rotor + 1
            began = None if name == "healthy" else since
            found.append(Cause(name, number, loss, began, none * probability, said, interval))
    changed = _changed_parameters(log, baseline)
    if changed:
        found = [one._replace(probability=one.probability * 0.97) for one in found]
        found.append(Cause("parameters", None, None, None, 0.03, f"other than in the baseline: {changed}"))
    return tuple(sorted(_merged(found), key=lambda one: -one.probability))


def _merged(causes: list[Cause]) -> list[Cause]:
    """Of each cause and rotor one entry: that with more probability keeps its words."""
    kept: dict[tuple[str, int | None], Cause] = {}
    for one in causes:
        key = (one.cause, one.rotor)
        other = kept.get(key)
        if other is None:
            kept[key] = one
        else:
            more = one if one.probability > other.probability else other
            kept[key] = more._replace(probability=one.probability + other.probability)
    return list(kept.values())


def _otherwise(log: Log) -> Log:
    """The same log with its commands in the other unit that they may have."""
    series = {**log.series, "command": log.series["otherwise"]}
    del series["otherwise"]
    return Log(log.source, log.kind, log.layout, series, log.parameters, log.notes)


def _either(causes: Sequence[Cause], others: Sequence[Cause]) -> tuple[Cause, ...]:
    """Causes with the losses of two readings of a log; which rotor it is does not hang on the unit of commands."""
    by_other = {(one.cause, one.rotor): one for one in others}
    found = []
    for one in causes:
        known = [each for each in (one, by_other.get((one.cause, one.rotor))) if each is not None]
        ends = [end for each in known if each.loss is not None for end in (each.interval or (each.loss, each.loss))]
        found.append(one._replace(interval=(min(ends), max(ends))) if ends else one)
    return tuple(found)


CONTROL = ("MC_", "MPC_THR", "ATC_", "PSC_", "MOT_", "CA_", "THR_MDL", "PWM_", "SERVO")


def _changed_parameters(log: Log, baseline: Baseline | None) -> str:
    """Parameters of control that the baseline has otherwise, in words."""
    if baseline is None or not log.parameters:
        return ""
    known = [one.parameters for one in baseline.flights if one.parameters]
    if not known:
        return ""
    names = [
        name
        for name, value in log.parameters.items()
        if name.startswith(CONTROL)
        and not name.startswith("MOT_THST_HOVER")
        and any(name in one for one in known)
        and not any(math.isclose(one.get(name, math.nan), value, rel_tol=1e-5) for one in known)
    ]
    more = f" and {len(names) - 5} more" if len(names) > 5 else ""
    return ", ".join(names[:5]) + more


def _limits_of_rates(log: Log) -> list[str]:
    """What the log's rates do not let it tell."""
    limits: list[str] = []
    command, rates = log.series.get("command"), log.series.get("rates")
    if log.layout is None and log.why:
        limits.append(log.why)
        return limits
    if log.layout is None or command is None:
        limits.append(
            "no commands of motors: log actuator_motors or set-points (PX4), RATE and RCOU (ArduPilot), motor_1, ..."
        )
        return limits
    if log.layout.assumed:
        limits.append(
            f"the places of motors are assumed ({log.layout.source}): compare the numbers with your vehicle"
        )
    if rates is None:
        limits.append(f"no body rates: {SLOWLY}; log the gyro at 50 Hz or more")
        return limits
    length = block_length(log)
    slow = "commands" if command.rate < 0.5 * rates.rate else "rates"
    if length is None:
        limits.append(f"{slow} are logged too slowly ({min(command.rate, rates.rate):.1f} Hz) to see how the body "
                      f"turns: {SLOWLY}; log both at 20 Hz or more")  # fmt: skip
    elif length > 0.06:
        limits.append(f"{slow} are logged at {min(command.rate, rates.rate):.0f} Hz: an onset is told to about "
                      f"{length:.1f} s; log both at 50 Hz for 0.05 s")  # fmt: skip
    return limits


def _limits_of_begin(log: Log, spans: Sequence[tuple[float, float]]) -> list[str]:
    """What a log that begins in the air does not show."""
    if spans[0][0] - log.start > IN_FLIGHT:
        return []
    return [f"the log begins in flight: what set in before it, or in its first {TAKE_OFF + FIRST:g} s, passes for "
            "how the vehicle is; log from arming on"]  # fmt: skip


def _limits_of_onset(log: Log, onset: float) -> list[str]:
    """Whether records are missing where something begins."""
    gaps: list[tuple[float, float]] = []
    for name in ("rates", "command"):
        if (series := log.series.get(name)) is None:
            continue
        ends = np.searchsorted(series.time, [onset - NEAR, onset + 2.0 / max(series.rate, 1.0)])
        near = series.time[max(int(ends[0]) - 1, 0) : int(ends[1]) + 1]
        steps = np.diff(near)
        if len(steps) and steps.max() > max(BLIND, 3.0 / max(series.rate, 1.0)):
            at = int(np.argmax(steps))
            gaps.append((float(near[at]), float(near[at + 1])))
    if not gaps:
        return []
    begin, end = min(gaps)[0], max(gap[1] for gap in gaps)
    return [f"nothing is logged from {begin:.2f} to {end:.2f} s: what is seen after it may have begun in it"]


def _limits_of_hover(steady: Steady | None, baseline: Baseline | None) -> list[str]:
    if steady is None:
        return ["no steady hover (3 s, slow and level): a loss that was there from the beginning is not looked for; "
                "hover for ten seconds"]  # fmt: skip
    least = steady.evidence.largest_hidden
    hidden = (
        f"a lasting loss of less than {least:.0%} of one rotor" if least < 1.0 else "any lasting loss of one rotor"
    )
    if baseline is None or not baseline.trims:
        return [f"no baseline: motors of a healthy vehicle may differ by 10 %, so {hidden} may pass for healthy; "
                "give healthy flights with --baseline"]  # fmt: skip
    return [f"{hidden} may pass for healthy: healthy flights of this vehicle vary by as much"]


def _nothing(log: Log, limits: list[str], motors: bool) -> LogDiagnosis:
    """The diagnosis of a log that does not fly, or has no commands."""
    why = "motors never carry the vehicle: there is no flight in it" if motors else "it has no commands of motors"
    if log.layout is None:
        why, motors = log.why or "where its motors are is not known", False
    causes = [Cause(name, None, None, None, share, why) for name, share in PRIOR.items() if name != "rotor loss"]
    motors_known = 0 if log.layout is None else len(log.layout.places)
    causes += [
        Cause("rotor loss", k + 1, None, None, PRIOR["rotor loss"] / motors_known, why) for k in range(motors_known)
    ]
    if not motors_known:
        causes.append(Cause("rotor loss", None, None, None, PRIOR["rotor loss"], why))
    ranked = tuple(sorted(causes, key=lambda one: -one.probability))
    if motors:
        limits.append("no flight: nothing can be said of rotors that do not carry; give a log with a flight of 10 s")
    return LogDiagnosis(log, ranked, f"the log cannot tell: {why}", tuple(limits), own=own_words(log))
