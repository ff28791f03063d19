"""The words of a diagnosis: evidence of each cause, and the verdict."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from rotorfault.logs.baseline import Baseline
from rotorfault.logs.detectors import Said
from rotorfault.logs.dynamics import G, block_length
from rotorfault.logs.forced import short_of
from rotorfault.logs.log import Log, when
from rotorfault.logs.scan import Scan
from rotorfault.logs.trim import Evidence, Trim
from rotorfault.logs.verdict import Cause, likely
from rotorfault.logs.vibration import Shaking, more_than

# 1/s, drag over mass: mean of its logarithm and standard deviation, of the built-in vehicles (0.12 to 0.45).
DRAG = (math.log(0.23), 0.45)
NARROW = 0.2  # width of a loss's interval up to which "about" says it
LEANS = math.radians(1.0)  # below which a lean may be an error of the attitude
NAMED = {"healthy": "a sound vehicle", "centre of mass shifted": "a shifted centre of mass"}
SIDES = ("front", "front left", "left", "rear left", "rear", "rear right", "right", "front right")


def wind_words(trim: Trim | None) -> str:
    """The wind that a vehicle leans against in hover, by what vehicles have of drag; empty where nobody knows.

    Parameters
    ----------
    trim : Trim or None
    """
    if trim is None or not np.isfinite(trim.tilt).all():
        return ""
    forward, left = trim.tilt
    lean = math.asin(min(math.hypot(forward, left), 1.0))
    if lean < LEANS:
        return f", though it leans by {math.degrees(lean):.1f} deg only,"
    side = SIDES[round(math.atan2(left, forward) / (math.pi / 4.0)) % 8]
    speeds = [G * math.tan(lean) / math.exp(DRAG[0] + k * 1.645 * DRAG[1]) for k in (1.0, 0.0, -1.0)]
    return f" of {speeds[1]:.0f} m/s ({speeds[0]:.0f} to {speeds[2]:.0f}) from the {side}"


def rotor_words(log: Log, rotor: int) -> str:
    """A rotor with its place.

    Parameters
    ----------
    log : Log
    rotor : int
        Its number, from 1.
    """
    place = "" if log.layout is None else f" ({log.layout.names[rotor - 1]})"
    return f"rotor {rotor}{place}"


def sudden_evidence(log: Log, scan: Scan, rotor: int) -> str:
    """What a test of motion says of a rotor.

    Parameters
    ----------
    log : Log
    scan : Scan
    rotor : int
        Its index.
    """
    odds = f"evidence {scan.scores[rotor]:.1f} of {scan.threshold:.1f} that are an alarm, in logarithms of likelihood"
    if rotor != scan.rotor or scan.onset is None:
        return odds
    resting = block_length(log) is None
    how = "in hover it is asked for more" if resting else "the body turned as if it pulled less"
    said = [f"{how} from {when(log, scan.onset)}", odds]
    if scan.alarm is not None:
        said.append(f"certain {max(scan.alarm - scan.onset, 0.0):.2f} s later")
    if (sent := short_of(log, scan.onset, rotor)) is not None:
        said.append(
            f"it was sent {1.0 - sent[0]:.0%} of what was asked for: its output was forced or limited, so that the "
            "loss is that of the output"
        )
    return "; ".join(said)


def trim_evidence(name: str, rotor: int | None, evidence: Evidence, trim: Trim | None, against: str) -> str:
    """What hover says of a cause.

    Parameters
    ----------
    name : str
        Of the cause.
    rotor : int or None
        Index, where it is a rotor.
    evidence : Evidence
    trim : Trim or None
    against : str
        What it is compared with, in words.
    """
    if rotor is not None:
        others = np.delete(evidence.deviation, rotor)
        return (
            f"in hover it is asked for {evidence.deviation[rotor]:+.0%} ({evidence.sigmas[rotor]:+.1f} sigma of "
            f"{against}), the others for {others.min():+.0%} to {others.max():+.0%}"
        )
    if name == "healthy":
        most = int(np.argmax(np.abs(evidence.sigmas)))
        return f"furthest off {against} is motor {most + 1}, by {abs(evidence.sigmas[most]):.1f} sigma"
    share = evidence.explained.get(name)
    said = "" if share is None else f"would explain {share:.0%} of the change of trim"
    if name == "battery sag" and trim is not None and np.isfinite(trim.voltage):
        said += f"; {trim.voltage:.2f} V in hover"
    if name == "wind":
        tilt = None if trim is None or not np.isfinite(trim.tilt).all() else trim.tilt
        size = None if tilt is None else np.degrees(np.hypot(*tilt))
        said += "; attitude is not logged" if size is None else f"; leans by {size:.1f} deg in hover"
        said += f", as in wind{speed}" if (speed := wind_words(trim)).startswith(" of") else ""
    return said


def seconded(cause: Cause, said: Sequence[Said], counts: float | None) -> Cause:
    """A cause with how many of the registered sources of diagnosis say the same, and what that counts.

    Parameters
    ----------
    cause : Cause
        The most probable.
    said : sequence of Said
    counts : float or None
        How often as likely they make its rotor; None where nothing began that they could speak for.
    """
    ran = [one for one in said if not one.note]
    if not ran:
        return cause
    if cause.rotor is None or cause.onset is None:
        quiet = sum(not one.flags for one in ran)
        return cause._replace(evidence=f"{cause.evidence}; {quiet} of {len(ran)} registered sources flag nobody")
    same = sum((flag := one.first(cause.onset)) is not None and flag[0] == cause.rotor for one in ran)
    said_so = f"{same} of {len(ran)} registered sources flag it first"
    if counts is not None:
        said_so += f", which makes it {counts:.2g} times as likely"
    return cause._replace(evidence=f"{cause.evidence}; {said_so}")


def shaking_words(log: Log, now: Shaking, baseline: Baseline | None) -> list[str]:
    """How much each rotor shakes the body: those that do so more than in healthy flights, else the sizes alone.

    Parameters
    ----------
    log : Log
    now : Shaking
    baseline : Baseline or None
    """
    before = [] if baseline is None else [one.shaking for one in baseline.flights if one.shaking is not None]
    more = more_than(now, before)
    unit = "m/s^2" if now.of == "specific force" else "rad/s"
    sizes = ", ".join(f"{k + 1}: {size:.2g}" for k, size in enumerate(now.size))
    all_of = f"{now.of} once per turn, in {unit}, of motor {sizes} ({now.blocks} blocks of 2 s)"
    if more:
        said = [f"{rotor_words(log, k + 1)} shakes {times:.1f} times as much as in healthy flights: look at its "
                "propeller" for k, times in sorted(more, key=lambda one: -one[1])]  # fmt: skip
        return [*said, all_of]
    same = [one for one in before if one.of == now.of]
    return [all_of, "as in healthy flights" if same else "no healthy flight to compare it with: give --baseline"]


def own_words(log: Log) -> tuple[str, ...]:
    """What the flight software itself said of motors.

    Parameters
    ----------
    log : Log
    """
    said = [f"{when(log, note.time)}: {note.text}" for note in log.notes if note.alarm]
    return tuple(said[:10])


def verdict_of(log: Log, causes: Sequence[Cause], evidence: Evidence | None, trim: Trim | None = None) -> str:
    """The diagnosis in a sentence.

    Parameters
    ----------
    log : Log
    causes : sequence of Cause
        By probability.
    evidence : Evidence or None
        Of hover.
    trim : Trim or None
        The trim that it is of.
    """
    first = causes[0]
    how = f"({likely(first.probability)}, {percent(first.probability)})"
    if first.cause == "healthy":
        said = f"no rotor is at fault {how}"
        second = next((one for one in causes[1:] if one.rotor is not None), None)
        if second is not None and second.probability >= 0.02:
            said += f"; {rotor_words(log, second.rotor or 1)} cannot be excluded ({percent(second.probability)})"
        return said
    if first.rotor is None:
        word = (
            f"{first.cause} rather than a rotor"
            if first.onset is None
            else f"{first.cause} since {when(log, first.onset)}"
        )
        return f"{word} {how}{_rest(log, causes, None, None)}"
    may = "" if first.probability >= 0.75 else " may have"
    lost = f"lost {share_words(first)} of its thrust" if first.loss is not None else "lost thrust"
    since = f"from {when(log, first.onset)}" if first.onset is not None else "from the beginning of the log"
    return f"{rotor_words(log, first.rotor)}{may} {lost} {since} {how}{_rest(log, causes, evidence, trim)}"


def share_words(cause: Cause) -> str:
    """How much of its thrust a rotor lost: with its interval where that is wide.

    Parameters
    ----------
    cause : Cause
    """
    loss, ends = 100.0 * (cause.loss or 0.0), cause.interval
    if ends is None or ends[1] - ends[0] <= NARROW:
        return f"about {loss:.0f} %"
    low, high = 100.0 * ends[0], 100.0 * ends[1]
    if high > 97.0:
        return f"{low:.0f} % or more, likely {loss:.0f} %,"
    return f"{low:.0f} to {high:.0f} %, likely {loss:.0f} %,"


def _rest(log: Log, causes: Sequence[Cause], evidence: Evidence | None, trim: Trim | None) -> str:
    """What else would explain a part of it, and what cannot be excluded."""
    said = ""
    if evidence is not None and "in hover" in causes[0].evidence:
        for name in ("wind", "centre of mass shifted"):
            share = evidence.explained.get(name, 0.0)
            if share >= 0.1:
                word = f"wind{wind_words(trim)}" if name == "wind" else "a shifted centre of mass"
                said += f"; {word} would explain {100.0 * share:.0f} % of it"
    doubts = [one for one in causes[1:] if one.probability >= 0.05][:2]
    for one in doubts:
        name = rotor_words(log, one.rotor) if one.rotor is not None else one.cause
        name = NAMED.get(name, name)
        said += f"; {name} cannot be excluded ({percent(one.probability)})"
    return said


def percent(probability: float) -> str:
    """A probability in words that do not say that anything is sure.

    Parameters
    ----------
    probability : float
    """
    return "> 99 %" if probability > 0.99 else f"{100.0 * probability:.0f} %"
