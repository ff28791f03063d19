"""One record for all flight logs: what a diagnosis needs, in our axes and units, whoever wrote it.

Body x forward, y left, z up; world z up; SI units and radians. Commands are shares of a motor's greatest thrust. Each
quantity keeps the times at which it was logged, for logs have them at different rates.
"""

from __future__ import annotations

import bisect
from collections.abc import Mapping
from typing import NamedTuple, final

import numpy as np
from numpy.typing import NDArray

from rotorfault.maths.arrays import Array
from rotorfault.model.frames import FRAMES, place_of

DAY = 86400.0  # s: no log pauses for longer
WRAP, NEAR_WRAP = 2.0**32 * 1e-6, 5.0  # s after which a counter of us begins again, and how near a step back is to it


class Series(NamedTuple):
    """A quantity over time."""

    time: Array  # (n,) s, increasing
    values: Array  # (n, width)

    @property
    def rate(self) -> float:
        """Records per second, by the median of the steps; 0 where there are fewer than two."""
        if len(self.time) < 2:
            return 0.0
        step = float(np.median(np.diff(self.time)))
        return 1.0 / step if step > 0.0 else 0.0

    def at(self, time: Array) -> Array:
        """Values at other times, between records by straight lines, beyond the ends as there.

        Parameters
        ----------
        time : (m,) ndarray, s
        """
        return np.column_stack([np.interp(time, self.time, column) for column in self.values.T])


class Layout(NamedTuple):
    """Where the motors are, by their numbers in the log."""

    places: Array  # (N, 2) forward and left of the centre, in longest arms
    yaw: Array  # (N,) +1 where drag turns the body to the left (a clockwise propeller), else -1
    source: str  # who says so, in words
    assumed: bool = False  # whether the log does not say it

    @property
    def names(self) -> list[str]:
        """Where each motor is in words, such as "front right"."""
        return [place_of(float(x), float(y)) for x, y in self.places]


def named_layout(frame: str, source: str, assumed: bool = False) -> Layout:
    """The layout of a named frame.

    Parameters
    ----------
    frame : str
        Of `rotorfault.model.frames.FRAMES`.
    source : str
        Who says that it is this one.
    assumed : bool
        Whether the log does not say it.
    """
    motors = FRAMES[frame].motors
    places = np.array([(motor.x, motor.y) for motor in motors])
    return Layout(places, np.array([motor.yaw_sign for motor in motors]), source, assumed)


class Note(NamedTuple):
    """Something that the log says in words, or an alarm of the flight software's own."""

    time: float  # s
    text: str
    alarm: bool = False  # whether it is the software's own verdict on a motor
    motor: int | None = None  # 1, 2, ... where it names one
    stopped: bool = False  # whether it is what was sent to the motor: none of its thrust is left


class Damage(NamedTuple):
    """What of a log could not be read."""

    lost: int = 0  # bytes, or rows of a table
    reason: str = ""  # in words; empty where nothing was lost


@final
class Log:
    """A flight log.

    Parameters
    ----------
    source : str
        Name of the file.
    kind : str
        Format in words.
    layout : Layout or None
        None where not even the number of motors is known.
    series : mapping of str to Series
        ``command`` (share of greatest thrust per motor), ``rates`` (rad/s), ``attitude`` (quaternion body to world,
        scalar first), ``velocity`` (m/s), ``position`` (m), ``specific_force`` (m/s^2), ``battery`` (V, A), ``rpm``,
        ``current`` (A per motor), ``landed`` (1 on the ground); what the log lacks is left out. Also ``output``: what
        was sent to the motors, where `command` was rebuilt from set-points; and ``otherwise``: what `command` is as
        well, where the log does not say its unit.
    parameters : mapping of str to float
        Of the flight software.
    notes : tuple of Note
    damage : Damage
    remarks : tuple of str
        What was assumed in reading, in words.
    why : str
        Why there is no layout, in words; empty where there is one, or nothing is known of it.

    Notes
    -----
    Times are those of the log's own clock, in s.
    """

    __slots__ = ("damage", "kind", "layout", "notes", "parameters", "remarks", "series", "source", "why")

    def __init__(
        self,
        source: str,
        kind: str,
        layout: Layout | None,
        series: Mapping[str, Series],
        parameters: Mapping[str, float] | None = None,
        notes: tuple[Note, ...] = (),
        damage: Damage | None = None,
        remarks: tuple[str, ...] = (),
        why: str = "",
    ) -> None:
        self.source, self.kind, self.layout, self.why = source, kind, layout, why
        self.series: dict[str, Series] = {}
        astray: dict[str, int] = {}
        for name, raw in series.items():
            one, left_out = cleaned(raw)
            if len(one.time) > 1:
                self.series[name] = one
                astray |= {name: left_out} if left_out else {}
        if astray:
            said = ", ".join(f"{count} of {name}" for name, count in astray.items())
            remarks = (*remarks, f"records whose time goes back or jumps by more than a day are left out: {said}")
        self.parameters = dict(parameters or {})
        self.notes, self.damage, self.remarks = notes, damage or Damage(), remarks

    def __repr__(self) -> str:
        rates = {name: round(one.rate, 1) for name, one in self.series.items()}
        return f"<log {self.source}: {self.kind}, {self.duration:.1f} s, {rates}>"

    @property
    def motors(self) -> int:
        """How many motors are commanded."""
        command = self.series.get("command")
        return 0 if command is None else command.values.shape[1]

    @property
    def start(self) -> float:
        """Time of the first record in s."""
        return float(min((one.time[0] for one in self.series.values()), default=0.0))

    @property
    def duration(self) -> float:
        """From the first record to the last, in s."""
        ends = [(one.time[0], one.time[-1]) for one in self.series.values()]
        return float(max(b for _, b in ends) - min(a for a, _ in ends)) if ends else 0.0


def cleaned(series: Series) -> tuple[Series, int]:
    """A series with finite values at increasing times alone, and how many records were left out for their times.

    Parameters
    ----------
    series : Series

    Notes
    -----
    A clock that jumps once must not take the rest of the log along: of all ways to leave out records until times
    increase, the one that leaves out the fewest is taken.
    """
    time = np.asarray(series.time, dtype=float)
    values = np.asarray(series.values, dtype=float).reshape(len(time), -1)
    good = np.isfinite(time) & np.isfinite(values).all(axis=1) & (np.abs(values) < 1e9).all(axis=1)
    time, values = time[good], values[good]
    twice = np.concatenate([np.diff(time) == 0.0, [False]]) if len(time) else np.zeros(0, dtype=bool)
    time, values = time[~twice], values[~twice]  # the same record again is no jump
    wrapped = np.abs(np.diff(time) + WRAP) < NEAR_WRAP
    if wrapped.any():  # a counter of 32 bits that began again
        time = time + WRAP * np.concatenate([[0.0], np.cumsum(wrapped)])
    whole = len(time)
    if (np.diff(time) < 0.0).any():
        kept = _increasing(time)
        time, values = time[kept], values[kept]
    breaks = np.flatnonzero(np.diff(time) > DAY)
    if len(breaks):
        edges = np.concatenate([[0], breaks + 1, [len(time)]])
        k = int(np.argmax(np.diff(edges)))
        time, values = time[edges[k] : edges[k + 1]], values[edges[k] : edges[k + 1]]
    return Series(time, values), whole - len(time)


def _increasing(time: Array) -> NDArray[np.intp]:
    """Indices of a longest part of the times that increases."""
    ends: list[float] = []  # least last time of an increasing part of each length
    last: list[int] = []  # and its index
    before = np.full(len(time), -1)
    for k, one in enumerate(time.tolist()):
        at = bisect.bisect_left(ends, one)
        if at == len(ends):
            ends.append(one)
            last.append(k)
        else:
            ends[at], last[at] = one, k
        before[k] = last[at - 1] if at else -1
    kept = []
    k = last[-1]
    while k >= 0:
        kept.append(k)
        k = int(before[k])
    return np.array(kept[::-1])


def when(log: Log, time: float) -> str:
    """A time of the log's clock, and where in the log it is.

    Parameters
    ----------
    log : Log
    time : float, s
    """
    into = f", {time - log.start:.2f} s into the log" if log.start > 0.5 else ""
    return f"t = {time:.2f} s{into}"
