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

from rotorfault.logs.baseline import Baseline, hover_command, trim_of
from rotorfault.logs.detectors import Said, said_by_all
from rotorfault.logs.dynamics import Residual, Response, block_length, residual_of
from rotorfault.logs.log import Log, when
from rotorfault.logs.scan import Scan, scan
from rotorfault.logs.segments import Hover, flight_spans, hover_of
from rotorfault.logs.sentences import own_words, sudden_evidence, trim_evidence, verdict_of
from rotorfault.logs.trim import PRIOR, Evidence, Trim, directions_of, spread_of, weigh
from rotorfault.logs.verdict import Cause, LogDiagnosis

# How often a flight that is looked at has a rotor that suddenly loses thrust, and a lasting push that begins in it.
# Of what is met at all, half is taken to begin in flight, since nothing is known of it.
SUDDEN = 0.5 * PRIOR["rotor loss"]
PUSHED = 0.5 * (PRIOR["wind"] + PRIOR["centre of mass shifted"])
TAKE_OFF = 1.5  # s in which the ground is near
PUSHES = {"wind": 0.6, "centre of mass shifted": 0.3, "drag": 0.1}  # what a push from outside is


class Sudden(NamedTuple):
    """What came in flight, by probability."""

    scan: Scan
    residual: Residual
    none: float
    rotors: tuple[float, ...]
    push: float


def diagnosis_of(log: Log, baseline: Baseline | None = None, vehicle: str | Path | None = None) -> LogDiagnosis:
    """What a log says of its rotors.

    Parameters
    ----------
    log : Log
    baseline : Baseline, optional
        Of healthy flights of the same vehicle.
    vehicle : str or Path, optional
        Name or file, for the registered sources of diagnosis.
    """
    limits = list(_limits_of_rates(log))
    spans = flight_spans(log)
    if log.layout is None or not spans:
        return _nothing(log, limits, bool(log.motors))
    hover = hover_of(log, spans)
    response = None if baseline is None else baseline.response
    sudden = _sudden(log, spans, hover, response)
    first = max(sudden, key=lambda one: 1.0 - one.none, default=None)
    before = hover
    if first is not None and first.none < 0.5 and first.scan.onset is not None:
        keep = hover.time + 1.0 < first.scan.onset
        before = Hover(*(part[keep] for part in hover))
    trim = trim_of(before)
    evidence = None if trim is None else _steady(log, trim, baseline)
    causes = _ranked(log, first, evidence, trim, baseline)
    limits += _limits_of_hover(trim, evidence, baseline)
    said: list[Said] = []
    if vehicle is not None:
        span = max(spans, key=lambda one: one[1] - one[0])
        said = said_by_all(log, (span[0] + TAKE_OFF, span[1]), before, vehicle)
    return LogDiagnosis(
        log, causes, verdict_of(log, causes, evidence), tuple(limits), tuple(one.scan for one in sudden), evidence,
        own_words(log), tuple(said),
    )  # fmt: skip


def _sudden(log: Log, spans: Sequence[tuple[float, float]], hover: Hover, known: Response | None) -> list[Sudden]:
    """Each flight tested for what begins in it."""
    mean = hover_command(log, spans, hover)
    found: list[Sudden] = []
    for begin, end in spans:
        residual = residual_of(log, begin + TAKE_OFF, end, mean, known)
        if residual is None:
            continue
        one = scan(residual)
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


def _steady(log: Log, trim: Trim, baseline: Baseline | None) -> Evidence:
    """The trim of hover against the baseline's."""
    layout = log.layout
    assert layout is not None
    trims = [] if baseline is None else baseline.trims
    sagged: float | None = None
    voltages = [one.voltage for one in trims if math.isfinite(one.voltage)]
    if voltages and math.isfinite(trim.voltage) and trim.voltage > 0.0:
        sagged = max(float(np.mean(voltages)) / trim.voltage - 1.0, 0.0)
    return weigh(layout, trim, spread_of(layout, trims), directions_of(layout)[1], sagged)


def _ranked(
    log: Log, sudden: Sudden | None, evidence: Evidence | None, trim: Trim | None, baseline: Baseline | None
) -> tuple[Cause, ...]:
    """All causes, the most probable first."""
    found: list[Cause] = []
    none = 1.0 if sudden is None else sudden.none
    if sudden is not None and sudden.scan.onset is not None and none < 0.999:
        onset = sudden.scan.onset
        for k, probability in enumerate(sudden.rotors):
            said = sudden_evidence(log, sudden.scan, k)
            loss = sudden.scan.loss if k == sudden.scan.rotor else None
            found.append(Cause("rotor loss", k + 1, loss, onset, probability, said))
        for name, share in PUSHES.items():
            said = f"a lasting push from outside since {when(log, onset)}"
            found.append(Cause(name, None, None, onset, sudden.push * share, said))
    if evidence is None:
        seen = "nothing else began in flight" if sudden is not None else "nothing in the log speaks for a fault"
        healthy = PRIOR["healthy"] + PRIOR["rotor loss"]
        found.append(Cause("healthy", None, None, None, none * healthy, seen))
        others = [name for name in PRIOR if name not in ("healthy", "rotor loss")]
        share = (1.0 - healthy) / len(others)
        found += [
            Cause(name, None, None, None, none * share, "without hover nothing is known of it") for name in others
        ]
    else:
        for (name, rotor), probability in evidence.causes.items():
            said = trim_evidence(name, rotor, evidence, trim, baseline is not None and bool(baseline.trims))
            loss = None if rotor is None else float(evidence.loss[rotor])
            interval = (
                None if rotor is None else (float(evidence.interval[rotor][0]), float(evidence.interval[rotor][1]))
            )
            number = None if rotor is None else rotor + 1
            found.append(Cause(name, number, loss, None, none * probability, said, interval))
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
        limits.append("no body rates: a sudden loss is not looked for; log the gyro at 50 Hz or more")
        return limits
    length = block_length(log)
    slow = "commands" if command.rate < 0.5 * rates.rate else "rates"
    if length is None:
        limits.append(f"{slow} are logged too slowly ({min(command.rate, rates.rate):.1f} Hz) to see a sudden loss; "
                      "log both at 20 Hz or more")  # fmt: skip
    elif length > 0.06:
        limits.append(f"{slow} are logged at {min(command.rate, rates.rate):.0f} Hz: an onset is told to about "
                      f"{length:.1f} s; log both at 50 Hz for 0.05 s")  # fmt: skip
    return limits


def _limits_of_hover(trim: Trim | None, evidence: Evidence | None, baseline: Baseline | None) -> list[str]:
    if trim is None or evidence is None:
        return ["no steady hover (3 s, slow and level): a loss that was there from the beginning is not looked for; "
                "hover for ten seconds"]  # fmt: skip
    hidden = f"of less than {evidence.largest_hidden:.0%} of one rotor may pass for healthy"
    if baseline is None or not baseline.trims:
        return [f"no baseline: motors of a healthy vehicle may differ by 10 %, so a lasting loss {hidden}; "
                "give healthy flights with --baseline"]  # fmt: skip
    return [f"a lasting loss {hidden}: healthy flights of this vehicle vary by as much"]


def _nothing(log: Log, limits: list[str], motors: bool) -> LogDiagnosis:
    """The diagnosis of a log that does not fly, or has no commands."""
    why = "motors never carry the vehicle: there is no flight in it" if motors else "it has no commands of motors"
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
