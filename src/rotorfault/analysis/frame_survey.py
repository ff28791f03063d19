"""What named frames can lose: control authority and critical thrust-to-weight ratio over sets of failed motors."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterable, Sequence
from itertools import combinations
from pathlib import Path
from typing import NamedTuple

from rotorfault.analysis.controllability import HoverProblem, control_authority, critical_scale, hover_problem
from rotorfault.analysis.flown_frames import flown_row
from rotorfault.base.bounds import positive
from rotorfault.base.files import in_folder, write_atomically
from rotorfault.base.text_table import table_lines, terminal_width
from rotorfault.model.frames import Frame, ReferenceVehicle

MOST_LOST = 2  # motors in the sets that are gone through
HELD, GIVEN_UP = 4, 3  # channels with yaw held, and given up
SAME = 1e-9  # difference of two indices in N, or of two ratios, that is none but for rounding


class FrameCase(NamedTuple):
    """A frame with a set of failed motors."""

    frame: str
    failed: tuple[int, ...]  # numbers of motors
    channels: int  # 4, or 3 with yaw given up
    acai: float  # N
    critical_thrust_to_weight: float  # infinity if no ratio is enough


def failure_sets(frame: Frame, lost: Iterable[int] = (0, 1, MOST_LOST)) -> list[tuple[int, ...]]:
    """All sets of as many motors of a frame.

    Parameters
    ----------
    frame : Frame
    lost : iterable of int
        How many motors a set has.
    """
    numbers = [motor.number for motor in frame.motors]
    return [failed for count in lost for failed in combinations(numbers, count)]


def frame_cases(
    frames: Iterable[Frame],
    sets: Callable[[Frame], Iterable[tuple[int, ...]]] = failure_sets,
    thrust_to_weight: float | None = None,
) -> list[FrameCase]:
    """Index and critical ratio of each frame with each set of failed motors, yaw held and given up.

    Parameters
    ----------
    frames : iterable of Frame
    sets : callable
        Gives the sets of failed motors of a frame.
    thrust_to_weight : float, optional
        Of all frames; that of each frame's reference vehicle if not given. The critical ratio does not depend on it.

    Raises
    ------
    InputError
        If the ratio is no number above 0.
    """
    if thrust_to_weight is not None:
        positive(thrust_to_weight, "thrust_to_weight", "1", most=1000.0)
    found = []
    for frame in frames:
        about = frame.reference
        if thrust_to_weight is not None:
            frame = frame._replace(reference=about._replace(thrust_to_weight=float(thrust_to_weight)))
        sound = hover_problem(frame)
        for failed in sets(frame):
            for channels in (HELD, GIVEN_UP):
                found.append(_case(frame, sound.without(failed).within(channels), failed))
    return found


def _case(frame: Frame, problem: HoverProblem, failed: tuple[int, ...]) -> FrameCase:
    authority = control_authority(problem)
    ratio = critical_scale(problem) * frame.reference.thrust_to_weight
    return FrameCase(frame.name, tuple(failed), authority.channels, authority.acai, ratio)


def write_cases(cases: Iterable[FrameCase], path: Path) -> None:
    """Write cases as JSON: a list of objects with the names of a case; the ratio is null where none is enough.

    Under ``flown`` stands what became of kept flights without the motor, null where there are none.

    Parameters
    ----------
    cases : iterable of FrameCase
    path : Path
        Of the file.

    Raises
    ------
    InputError
        If it cannot be written there.
    """
    rows = []
    for case in cases:
        ratio = case.critical_thrust_to_weight
        row = {**case._asdict(), "critical_thrust_to_weight": ratio if math.isfinite(ratio) else None}
        rows.append({**row, "flown": flown_row(case.frame, case.failed, case.channels == HELD)})
    text = "[\n" + ",\n".join(json.dumps(row) for row in rows) + "\n]\n"
    write_atomically(in_folder(path), lambda temporary: temporary.write_text(text, encoding="utf-8"))


# --------------------------------------------------------------------------------------------------------------- text


def summary_lines(frames: Sequence[Frame], cases: Sequence[FrameCase], lost: int) -> list[str]:
    """A table with a line for each frame: best and worst over the sets of as many failed motors.

    Parameters
    ----------
    frames : sequence of Frame
    cases : sequence of FrameCase
        Of these frames.
    lost : int
        How many motors have failed.
    """
    rows = [["frame", "motors", "ACAI [N], yaw held", "given up", "critical T/W, yaw held", "given up"]]
    for frame in frames:
        own = [case for case in cases if case.frame == frame.name and len(case.failed) == lost]
        cells = [_range([c.acai for c in own if c.channels == channels], ".4f") for channels in (HELD, GIVEN_UP)]
        for channels in (HELD, GIVEN_UP):
            cells.append(_ratios([c.critical_thrust_to_weight for c in own if c.channels == channels]))
        rows.append([frame.name, str(len(frame.motors)), *cells])
    return table_lines(rows, "<>>>>>", rule=True)


def case_lines(cases: Sequence[FrameCase], names: bool = False) -> list[str]:
    """A table of cases, those of a frame with the same numbers in one line.

    Parameters
    ----------
    cases : sequence of FrameCase
        Each set of failed motors with both numbers of channels.
    names : bool
        Whether the frame is named, where there are several.
    """
    found: list[tuple[str, tuple[float, ...], list[str]]] = []
    held = [case for case in cases if case.channels == HELD]
    free = {(case.frame, case.failed): case for case in cases if case.channels == GIVEN_UP}
    for case in held:
        other = free[case.frame, case.failed]
        numbers = (case.acai, other.acai, case.critical_thrust_to_weight, other.critical_thrust_to_weight)
        failed = "+".join(map(str, case.failed)) or "none"
        for frame, known, sets in found:
            if frame == case.frame and all(a == b or abs(a - b) <= SAME for a, b in zip(known, numbers, strict=True)):
                sets.append(failed)
                break
        else:
            found.append((case.frame, numbers, [failed]))
    heading = ["frame"] if names else []
    rows = [[*heading, "ACAI [N], yaw held", "given up", "critical T/W, yaw held", "given up", "failed motors"]]
    for frame, known, sets in found:
        cells = [*(_fixed(x, ".4f") for x in known[:2]), *(_ratio(x) for x in known[2:])]
        rows.append([*([frame] if names else []), *cells, ", ".join(sets)])
    return table_lines(rows, ("<" if names else "") + ">>>><", rule=True, most=terminal_width())


def same_motors(frames: Iterable[Frame]) -> list[list[Frame]]:
    """Frames in groups whose motors are at the same places and turn the same way, under other numbers.

    Parameters
    ----------
    frames : iterable of Frame
    """
    groups: dict[object, list[Frame]] = {}
    for frame in frames:
        motors = sorted((round(motor.x, 6), round(motor.y, 6), motor.clockwise) for motor in frame.motors)
        groups.setdefault((tuple(motors), frame.reference), []).append(frame)
    return list(groups.values())


def reference_line(frame: Frame, thrust_to_weight: float | None = None) -> str:
    """The numbers that a frame is taken with.

    Parameters
    ----------
    frame : Frame
    thrust_to_weight : float, optional
        Instead of the reference vehicle's own.
    """
    about = frame.reference
    ratio = about.thrust_to_weight if thrust_to_weight is None else thrust_to_weight
    each = ratio * about.mass * about.gravity / len(frame.motors)
    return f"With {_numbers(about)} {ratio:.4g} ({each:.4g} N per rotor):"


def note_lines(groups: Sequence[Sequence[Frame]], thrust_to_weight: float | None = None) -> list[str]:
    """What a table of all frames is made with, and which frames it stands for.

    Parameters
    ----------
    groups : sequence of sequence of Frame
        Of `same_motors`.
    thrust_to_weight : float, optional
        Instead of the reference vehicles' own.
    """
    references = dict.fromkeys(group[0].reference for group in groups)
    lines = []
    for about in references:
        of = [group[0].name for group in groups if group[0].reference == about]
        ratio = about.thrust_to_weight if thrust_to_weight is None else thrust_to_weight
        whose = ", ".join(of) if len(of) < len(groups) / 2 else "all others"
        lines.append(f"{_numbers(about)} {ratio:.4g}: {whose}")
    lines.sort(key=lambda line: line.endswith("all others"))
    others = [group for group in groups if len(group) > 1]
    same = [f"  {group[0].name}: {', '.join(frame.name for frame in group[1:])}" for group in others]
    return [*lines, *(["The same motors under other numbers:"] if same else []), *same]


def _numbers(about: ReferenceVehicle) -> str:
    size = f"{about.mass:g} kg, g {about.gravity:g} m/s^2, arm {about.arm:g} m"
    return f"{size}, torque ratio {about.torque_ratio:g} m, thrust to weight"


def _fixed(value: float, form: str) -> str:
    # Rounding makes -0 of small negative numbers, which nobody wants to read.
    text = format(value, form)
    return text.removeprefix("-") if not text.strip("-0.") else text


def _ratio(value: float) -> str:
    return f"{value:.3f}" if math.isfinite(value) else "never"


def _range(values: Sequence[float], form: str) -> str:
    best, worst = _fixed(max(values), form), _fixed(min(values), form)
    return best if best == worst else f"{best} to {worst}"


def _ratios(values: Sequence[float]) -> str:
    best, worst = _ratio(min(values)), _ratio(max(values))
    if best == worst:
        return best
    some = sum(map(math.isfinite, values))
    return f"{best} to {worst}" + (f", {some} of {len(values)}" if some < len(values) else "")
