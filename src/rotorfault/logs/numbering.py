"""Whether the motors of a table are where they are said to be: a body turns the way its motors push.

A table holds the commands of motors, and where these are is often assumed. What the commands ask for about an axis
and how the body then turns are correlated if the places are right; with other places they are not, or negatively.
So places that are assumed and contradicted give way to a named frame that fits; where none fits, or where the user
named the frame, the log says that it cannot tell which motor is which.
"""

from __future__ import annotations

import numpy as np

from rotorfault.logs.commands import directions
from rotorfault.logs.dynamics import answers, chance
from rotorfault.logs.log import Layout, Log, named_layout
from rotorfault.logs.segments import flight_spans
from rotorfault.maths.arrays import Array
from rotorfault.model.frames import FRAMES

CUT = 1.5  # standard deviations that count at most: a rotor that fails must not decide where it is
SIGMAS = 5.0  # of a correlation by chance: seen where there is none once in three million axes
NAMES = ("roll", "pitch", "yaw")


def numbered(log: Log) -> Log:
    """A log whose motors turn the body as it turned, or that has no places of motors.

    Parameters
    ----------
    log : Log
        Of a table, whose commands are those of motors.
    """
    spans = flight_spans(log) if log.layout is not None else []
    if log.layout is None or not spans or "rates" not in log.series or "command" not in log.series:
        return log
    span = max(spans, key=lambda one: one[1] - one[0])
    now = _correlations(log, span, log.layout)
    sure = SIGMAS * chance(log, *span)
    if now is None or (now[:2].min() >= sure and now[2] > -sure):
        return log
    best: tuple[float, Layout] | None = None
    for layout in _others(log.layout):
        found = _correlations(log, span, layout)
        fits = found is not None and found[:2].min() > sure and found[2] > -sure
        if found is not None and fits and (best is None or found.sum() > best[0]):
            best = float(found.sum()), layout
    against = [name for name, r in zip(NAMES, now, strict=True) if r < -sure]
    if best is None and not against:
        return log  # gusts or rest: nothing tells
    if best is not None and best[0] - now.sum() < sure:
        return log  # no better than what is said
    if log.layout.assumed and best is not None:
        remarks = tuple(one for one in log.remarks if "motor places are assumed" not in one)
        said = f"motor places are those of {best[1].source}, by how the body turns, and not {log.layout.source}"
        return _with(log, best[1], (*remarks, said), "")
    how = f"about {' and '.join(against)} the other way" if against else "otherwise"
    like = "" if best is None else f", as motors of {best[1].source} would turn it"
    why = (
        f"the body turns {how} than its motors push ({log.layout.source}){like}: which motor is which cannot be "
        "told; write a line '# motors = FRAME' above the table with a name that 'rotorfault frames' lists"
    )
    return _with(log, None, log.remarks, why)


def _with(log: Log, layout: Layout | None, remarks: tuple[str, ...], why: str) -> Log:
    return Log(log.source, log.kind, layout, log.series, log.parameters, log.notes, log.damage, remarks, why)


def _others(layout: Layout) -> list[Layout]:
    """The same places with propellers the other way round, and all named frames of so many motors."""
    count = len(layout.places)
    turned = layout._replace(yaw=-layout.yaw, source=f"{layout.source}, with propellers the other way round")
    named = [named_layout(name, name, assumed=True) for name, one in FRAMES.items() if len(one.motors) == count]
    return [turned, *named]


def _correlations(log: Log, span: tuple[float, float], layout: Layout) -> Array | None:
    """Of what is asked for and how the body turns, about each axis, with the lag that fits best."""
    fits = answers(log, *span, directions(layout), CUT)
    if fits is None:
        return None
    best: Array = fits[int(np.argmax(np.abs(fits[:, 1, :2]).sum(axis=1))), 1]
    return best
