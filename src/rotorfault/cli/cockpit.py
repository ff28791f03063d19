"""What a terminal shows of a flight at an instant: attitude, errors, rotors, alarms, in letters.

Lines are made for the width and height that there are: what does not fit is left out, the least important first.
"""

from __future__ import annotations

from collections.abc import Sequence
from textwrap import wrap
from typing import NamedTuple

import numpy as np

from rotorfault.base.angles import wrapped
from rotorfault.base.plain_text import one_line
from rotorfault.maths.arrays import Array
from rotorfault.results.derived import stuck_text

COLUMNS, ROWS = 25, 7  # of the horizon
FIELD = 40.0  # degrees of pitch from its lowest to its highest row
NARROW = 62  # columns below which there is no room for the horizon beside the numbers


class Signs(NamedTuple):
    """Letters that bars and the horizon are made of."""

    full: str
    empty: str
    mark: str
    ground: str
    level: str
    nose: str
    degree: str


PRETTY = Signs("█", "░", "┃", "▒", "─", "◆", "°")
ASCII = Signs("#", ".", "|", ":", "-", "+", " deg")


class Instant(NamedTuple):
    """What is shown."""

    time: float  # s
    position: Array  # (3,), m
    wanted: Array  # (3,), m
    attitude: Array  # (3,), rad: roll, pitch, yaw
    speed: float  # m/s
    command: Array  # (rotors,), N
    thrust: Array  # (rotors,), N
    loss: Array  # (rotors,), true
    believed: Array  # (rotors,)
    flagged: Array  # (rotors,), 0 or 1
    stuck: Array  # (rotors,), N: what a rotor gives that is stuck; NaN for others
    stuck_believed: Array  # (rotors,), the same as believed


class Flown(NamedTuple):
    """What does not change during a flight."""

    title: str
    duration: float  # s
    thrust_max: float  # N
    speed: float  # 1 for real time


def lines(
    flown: Flown, now: Instant, said: Sequence[str], width: int, height: int, signs: Signs = PRETTY
) -> list[str]:
    """The view of an instant.

    Parameters
    ----------
    flown : Flown
    now : Instant
    said : sequence of str
        What happened so far, in words.
    width, height : int
        Columns and lines of the terminal.
    signs : Signs
    """
    share = now.time / flown.duration if flown.duration > 0.0 else 1.0
    clock = f"t {now.time:.2f} of {flown.duration:g} s, {flown.speed:g} x real time"
    head = [
        _cut(one_line(flown.title), width),
        f"{bar(share, max(width - len(clock) - 1, 0), signs)} {clock}".strip(),
    ]
    rotors = _rotors(flown, now, width, signs)
    numbers = [_fitting(forms, width) for forms in _numbers(now, signs)]
    picture = horizon(float(now.attitude[0]), float(now.attitude[1]), signs)
    words = [line for text in said for line in wrap(one_line(text), max(width, 1), subsequent_indent="  ")]
    # From all there is to what matters most.
    whole = [forms[0] for forms in _numbers(now, signs)]
    beside = [f"{p}   {n}" for p, n in zip(picture, [*whole, *[""] * ROWS], strict=False)]
    view = beside if width >= NARROW else numbers
    if len(head) + len(view) + len(rotors) + 2 > height - 1:
        view = numbers
    room = height - 1 - len(head) - len(view) - len(rotors)
    if room < 1:
        head, room = head[1:], room + 1
    if room < 1:
        view = view[:2]
        room = height - 1 - len(head) - len(view) - len(rotors)
    last = words[-max(min(room, 5), 0) :] if room > 0 else []
    found = [*head, *view, *rotors, *last]
    return [_cut(line, width) for line in found[: max(height - 1, 1)]]


def _cut(text: str, width: int) -> str:
    """A text in so many columns; where words are lost, dots say so."""
    return text if len(text) <= width else f"{text[: max(width - 2, 0)].rstrip()}.."[:width]


def _fitting(forms: Sequence[str], width: int) -> str:
    """The first form of a line that fits, else the shortest."""
    return next((form for form in forms if len(form) <= width), forms[-1])


def bar(share: float, length: int, signs: Signs, mark: float | None = None) -> str:
    """A bar of letters.

    Parameters
    ----------
    share : float
        From 0 to 1; what lies beyond is cut.
    length : int
        In letters.
    signs : Signs
    mark : float, optional
        Where a mark stands in it, from 0 to 1.
    """
    if length < 1:
        return ""
    filled = round(_limited(share) * length)
    letters = [signs.full] * filled + [signs.empty] * (length - filled)
    if mark is not None:
        letters[min(int(_limited(mark) * length), length - 1)] = signs.mark
    return "".join(letters)


def _limited(share: float) -> float:
    return min(max(share, 0.0), 1.0) if share == share else 0.0


def horizon(roll: float, pitch: float, signs: Signs) -> list[str]:
    """An artificial horizon: what a pilot sees, ground where it is below.

    Parameters
    ----------
    roll, pitch : float
        In rad; a positive roll leans to the right, a positive pitch lowers the nose.
    signs : Signs
    """
    rows = []
    step = np.radians(FIELD) / ROWS
    for row in range(ROWS):
        up = (ROWS // 2 - row) * step
        letters = []
        for column in range(COLUMNS):
            right = (column - COLUMNS // 2) * 0.5 * step  # letters are twice as high as wide
            above = np.cos(roll) * (up - pitch) - np.sin(roll) * right
            letters.append(" " if above > 0.25 * step else signs.ground if above < -0.25 * step else signs.level)
        if row == ROWS // 2:
            letters[COLUMNS // 2 - 3 : COLUMNS // 2 + 4] = [*signs.level * 2, " ", signs.nose, " ", *signs.level * 2]
        rows.append(f"|{''.join(letters)}|")
    return rows


def _numbers(now: Instant, signs: Signs) -> list[tuple[str, ...]]:
    """Lines of numbers, each in forms for wide and for narrow terminals."""
    roll, pitch, yaw = _degrees(now)
    x, y, z = now.position
    a, b, c = now.position - now.wanted
    degree = signs.degree
    off = float(np.linalg.norm(now.position - now.wanted))
    return [
        (f"position error {off:8.3f} m", f"error {off:.3g} m"),
        (
            f"attitude  roll {roll:+6.1f}{degree}  pitch {pitch:+6.1f}{degree}  yaw {yaw:+6.1f}{degree}",
            f"roll {roll:+.0f} pitch {pitch:+.0f} yaw {yaw:+.0f} deg",
            f"{roll:+.0f} {pitch:+.0f} {yaw:+.0f} deg",
        ),
        (f"errors     x {a:+8.3f}   y {b:+8.3f}   z {c:+8.3f} m", f"off by {a:+.3g} {b:+.3g} {c:+.3g} m"),
        (f"position   x {x:+8.3f}   y {y:+8.3f}   z {z:+8.3f} m", f"at {x:+.3g} {y:+.3g} {z:+.3g} m"),
        (f"speed        {now.speed:8.3f} m/s", f"speed {now.speed:.3g} m/s"),
    ]


def _degrees(now: Instant) -> Array:
    """Roll, pitch and yaw in degrees, each within half a turn."""
    angles: Array = np.degrees([wrapped(float(angle)) for angle in now.attitude])
    return angles


def _rotors(flown: Flown, now: Instant, width: int, signs: Signs) -> list[str]:
    """A line for each rotor: thrust as a bar, the command as a mark in it, losses."""
    wide = width >= NARROW
    said = []
    for k in range(len(now.thrust)):
        held = bool(np.isfinite(now.stuck[k]))
        true = f"true: {stuck_text(now.stuck[k])}" if held else f"true loss {100.0 * now.loss[k]:3.0f} %"
        words = f" {true}" if wide else ""
        if now.flagged[k] > 0.5:
            flag = "FLAGGED" if held or now.loss[k] > 0.0 else "FALSE ALARM"
            believed = _believed(now, k)
            words = f" {flag}, believed {believed},{words}" if wide else f" {flag} {believed}"
        said.append(words)
    head, room = "rotor {:<2}", max(41 if wide else 18, *map(len, said)) + 16
    found = []
    for k, (thrust, words) in enumerate(zip(now.thrust, said, strict=True)):
        share, command = thrust / flown.thrust_max, now.command[k] / flown.thrust_max
        drawn = bar(share, min(width - room, 40) if wide else width - room, signs, command)
        found.append(f"{head.format(k + 1)} {drawn} {100.0 * share:4.0f} %{words}")
    return found


def _believed(now: Instant, k: int) -> str:
    """What a flagged rotor is believed to have lost, or to be stuck at."""
    held = float(now.stuck_believed[k])
    return stuck_text(held) if np.isfinite(held) else f"{100.0 * now.believed[k]:3.0f} %"


def one_liner(now: Instant) -> str:
    """An instant in a line, where there is no terminal."""
    roll, pitch, yaw = _degrees(now)
    flags = [f"rotor {k + 1} {_believed(now, k).strip()}" for k in range(len(now.flagged)) if now.flagged[k] > 0.5]
    x, y, z = now.position
    error = float(np.linalg.norm(now.position - now.wanted))
    return (
        f"t {now.time:8.2f} s  position {x:.3f} {y:.3f} {z:.3f} m  error {error:.3f} m  "
        f"roll {roll:.1f} pitch {pitch:.1f} yaw {yaw:.1f} deg  flagged: {', '.join(flags) or 'none'}"
    )
