"""What a diagnosis of a log says: ranked causes with evidence and probability, and what it cannot tell."""

from __future__ import annotations

import math
from typing import Any, NamedTuple, final

from rotorfault.base.text_table import table_lines, terminal_width
from rotorfault.logs.detectors import Said
from rotorfault.logs.log import Log, when
from rotorfault.logs.scan import Scan
from rotorfault.logs.trim import Evidence

SHOWN = 0.005  # probability below which a cause is not listed in text


class Cause(NamedTuple):
    """One explanation."""

    cause: str  # healthy, rotor loss, wind, centre of mass shifted, added weight, battery sag, drag, parameters
    rotor: int | None  # number of the motor in the log's own order
    loss: float | None  # share of its thrust, where a rotor lost some
    onset: float | None  # s of the log's clock; None if it was so from the beginning, or does not apply
    probability: float
    evidence: str
    interval: tuple[float, float] | None = None  # of the loss, 90 %


@final
class LogDiagnosis:
    """What a log says of the rotors.

    Parameters
    ----------
    log : Log
    causes : tuple of Cause
        By probability.
    verdict : str
        In a sentence.
    limits : tuple of str
        What the log cannot tell, and what would let it.
    scans : tuple of Scan
        One for each flight that could be tested for sudden losses.
    trim : Evidence or None
        Of steady hover.
    own : tuple of str
        What the flight software itself said of motors.
    detectors : tuple of Said
        What the registered sources of diagnosis say, where the vehicle is known.
    vibration : tuple of str
        How much each rotor shakes the body, where the log can tell.
    """

    __slots__ = ("causes", "detectors", "limits", "log", "own", "scans", "trim", "verdict", "vibration")

    def __init__(
        self,
        log: Log,
        causes: tuple[Cause, ...],
        verdict: str,
        limits: tuple[str, ...],
        scans: tuple[Scan, ...] = (),
        trim: Evidence | None = None,
        own: tuple[str, ...] = (),
        detectors: tuple[Said, ...] = (),
        vibration: tuple[str, ...] = (),
    ) -> None:
        self.log, self.causes, self.verdict, self.limits = log, causes, verdict, limits
        self.scans, self.trim, self.own, self.detectors = scans, trim, own, detectors
        self.vibration = vibration

    @property
    def probable(self) -> Cause:
        """The most probable cause."""
        return self.causes[0]

    @property
    def rotor(self) -> int | None:
        """Number of the motor that is blamed; None where none is."""
        return self.probable.rotor

    @property
    def alarm(self) -> float | None:
        """When a sudden loss was certain, in s of the log's clock; None where there was none."""
        if self.rotor is None or self.probable.onset is None:
            return None
        return next((scan.alarm for scan in self.scans if scan.onset == self.probable.onset), None)

    def __repr__(self) -> str:
        return f"<diagnosis of {self.log.source}: {self.verdict}>"

    def json(self) -> dict[str, Any]:
        """As plain tables for JSON."""
        return {
            "log": self.log.source,
            "format": self.log.kind,
            "causes": [
                {
                    "cause": one.cause,
                    "rotor": one.rotor,
                    "loss": _rounded(one.loss),
                    "onset": _rounded(one.onset, 4),
                    "probability": _rounded(one.probability, 6),
                    "evidence": one.evidence,
                    "interval": None if one.interval is None else [_rounded(end) for end in one.interval],
                }
                for one in self.causes
            ],
            "verdict": self.verdict,
            "limits": list(self.limits),
            "read": {"lost": self.log.damage.lost, "reason": self.log.damage.reason},
            "alarm": _rounded(self.alarm, 4),
            "over": _rounded(next((scan.over[0] for scan in self.scans if scan.over is not None), None), 4),
            "start": _rounded(self.log.start, 4),
            "duration": _rounded(self.log.duration, 4),
            "own_messages": list(self.own),
            "vibration": list(self.vibration),
            "detectors": [
                {
                    "detector": one.detector,
                    "flags": [
                        {"rotor": rotor, "time": _rounded(time), "loss": _rounded(loss)}
                        for rotor, time, loss in one.flags
                    ],
                    "note": one.note,
                }
                for one in self.detectors
            ],
        }

    def __str__(self) -> str:
        lines = [f"{self.log.source}: {self.log.kind}, {self.log.duration:.1f} s", "", self.verdict, ""]
        rows = [
            [f"{one.probability:.0%}" if one.probability >= 0.01 else "< 1%", _named(one), one.evidence]
            for one in self.causes
            if one.probability >= SHOWN
        ]
        table = [["", "cause", "evidence"], *rows]
        lines += table_lines(table, "><<", indent=2, rule=True, most=terminal_width())
        for title, items in (
            ("its own messages", self.own),
            ("vibration", self.vibration),
            (
                "registered sources of diagnosis (of the same records, so that all count as one witness)",
                tuple(_said(one, self.log, self.probable) for one in self.detectors),
            ),
             ("cannot tell", self.limits), ("read", self._read()),
        ):  # fmt: skip
            if items:
                lines += ["", f"{title}:", *(f"  - {item}" for item in items)]
        return "\n".join(lines)

    def _read(self) -> tuple[str, ...]:
        damage = self.log.damage
        lost = (f"lost: {damage.reason}",) if damage.reason else ()
        return (*self.log.remarks, *lost)


def _said(one: Said, log: Log, first: Cause) -> str:
    """What a source says, in a line, and whether the verdict says the same."""
    if one.note and not one.flags:
        return f"{one.detector}: {one.note}"
    if not one.flags:
        return f"{one.detector} flags nobody" + ("" if first.rotor is None else ", other than the verdict")
    flag = one.first(first.onset)
    if flag is None:
        return f"{one.detector} flags nobody from the onset on, other than the verdict"
    rotor, time, loss = flag
    late = f", {time - first.onset:.2f} s after the onset" if first.onset is not None and time >= first.onset else ""
    believed = f", and believes that {100.0 * loss:.0f} % is lost" if loss > 0.0 else ""
    text = f"{one.detector} flags rotor {rotor} from {when(log, time)}{late}{believed}"
    others = {True: "before", False: "later"}
    for before, word in others.items():
        more = [str(number) for number, at, _ in one.flags if number != rotor and (at < time) == before]
        text += f"; {word} rotor{'s' if len(more) > 1 else ''} {', '.join(more)}" if more else ""
    return text + ("" if rotor == first.rotor else "; the verdict does not")


def _named(cause: Cause) -> str:
    """A cause in words."""
    if cause.rotor is None:
        return cause.cause
    loss = "" if cause.loss is None else f" lost {cause.loss:.0%}"
    return f"rotor {cause.rotor}{loss}"


def likely(probability: float) -> str:
    """A probability in words."""
    if probability >= 0.95:
        return "very likely"
    if probability >= 0.75:
        return "likely"
    return "more likely than not" if probability >= 0.5 else "possible"


def _rounded(value: float | None, digits: int = 4) -> float | None:
    return None if value is None or not math.isfinite(value) else round(float(value), digits)
