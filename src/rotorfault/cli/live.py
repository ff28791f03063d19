"""`rotorfault fly --live`: a flight is looked at while it is computed, at real time or another speed.

On a terminal the view is drawn anew some times a second; elsewhere, as in a pipe, a line is printed each second, and
one for whatever happens.
"""

from __future__ import annotations

import contextlib
import time as system_time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from types import TracebackType
from typing import Protocol, final

import numpy as np
from rich.console import Console
from rich.live import Live
from rich.text import Text

from rotorfault.base.errors import InputError
from rotorfault.cli.app import say
from rotorfault.cli.cockpit import ASCII, PRETTY, Flown, Instant, lines, one_liner
from rotorfault.maths.arrays import Array
from rotorfault.results.derived import believed_stuck_at, stuck_at, stuck_text
from rotorfault.results.flight_data import FlightData

RATE = 12.0  # views a second
LINE = 1.0  # s between two lines
TOLD = 20  # lines that are kept
STAGES = ("flying as the scenario wants", "landing begins", "rotors stopped")
STYLES = {"FLAGGED": "bold yellow", "FALSE ALARM": "bold red", "false alarm": "bold red"}
SLOWEST, FASTEST = 0.01, 1000.0
LOSS = 0.02  # a true loss that changes by more from one record to the next is a fault


def checked_speed(speed: float) -> float:
    """A speed, if it is allowed.

    Raises
    ------
    InputError
        If it is not.
    """
    if not SLOWEST <= speed <= FASTEST:
        raise InputError(f"--live-speed: got {speed:g}; allowed: {SLOWEST:g} to {FASTEST:g} times real time")
    return speed


class Screen(Protocol):
    """Where a flight is shown."""

    rate: float  # looks a second

    def show(self, flown: Flown, now: Instant, said: Sequence[str]) -> None:
        """Show an instant, and what was told last."""

    def tell(self, text: str) -> None:
        """Something has happened."""

    def close(self) -> None:
        """The flight is over."""


@final
class Panel:
    """A view on a terminal that is drawn anew in place."""

    rate = RATE

    def __init__(self, console: Console) -> None:
        self._console = console
        self._signs = ASCII if console.options.ascii_only else PRETTY
        # Drawn by us alone; the last view stays.
        self._live = Live(console=console, auto_refresh=False, vertical_overflow="crop")
        self._open = False

    def show(self, flown: Flown, now: Instant, said: Sequence[str]) -> None:
        """See `Screen`."""
        if not self._open:
            self._live.start()
            self._open = True
        size = self._console.size
        shown = lines(flown, now, said, size.width, size.height, self._signs)
        text = Text("\n".join(shown), no_wrap=True, overflow="crop")
        for words, style in STYLES.items():
            text.highlight_words([words], style)
        self._live.update(text, refresh=True)

    def tell(self, text: str) -> None:
        """It will be in the next view."""

    def close(self) -> None:
        """See `Screen`."""
        if self._open:
            self._live.stop()
            self._open = False


@final
class Lines:
    """A line a second, and one for whatever happens."""

    rate = 1.0 / LINE

    def show(self, flown: Flown, now: Instant, said: Sequence[str]) -> None:
        """See `Screen`."""
        say(one_liner(now))

    def tell(self, text: str) -> None:
        """See `Screen`."""
        say(text)

    def close(self) -> None:
        """See `Screen`."""


def screen() -> Screen:
    """What there is: a terminal, or a place for lines."""
    console = Console()
    return Panel(console) if console.is_terminal and not console.is_dumb_terminal else Lines()


@final
class View:
    """Shows the records of a flight at their pace; what `rotorfault.fly` takes as `follow`.

    Parameters
    ----------
    shown_on : Screen
    speed : float
        1 for real time. A computation that is slower is waited for.
    clock, sleep : callable
        Seconds that have passed; waits for some.
    """

    def __init__(
        self,
        shown_on: Screen,
        speed: float,
        clock: Callable[[], float] = system_time.monotonic,
        sleep: Callable[[float], None] = system_time.sleep,
    ) -> None:
        self._screen, self._speed, self._clock, self._sleep = shown_on, speed, clock, sleep
        self._start: float | None = None  # time on the clock of the flight's beginning
        self._next = -np.inf  # time on the clock from which there is to be a view again
        self._before: Array | None = None  # losses, flags and stage of the record before
        self._coming: deque[tuple[float, str]] = deque()  # what happens in records that are not yet shown
        self._told: deque[str] = deque(maxlen=TOLD)
        self._quiet: dict[int, float] = {}  # until when nothing more is said of the loss of a rotor, s
        self._flown = Flown("", 0.0, 1.0, speed)
        self._last: FlightData | None = None
        self._closed = False

    def __enter__(self) -> View:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None
    ) -> None:
        with contextlib.suppress(BrokenPipeError):
            if kind is None and self._last is not None and not self._closed:
                self._show(self._last, len(self._last["time"].values) - 1)
            self._screen.close()

    def __call__(self, data: FlightData) -> None:
        """Show some records, and come back when the last of them has been seen; at once where nobody looks."""
        if self._closed:
            return
        try:
            self._follow(data)
        except BrokenPipeError:
            self._closed = True  # as of `| head`: the flight flies on

    def _follow(self, data: FlightData) -> None:
        time, about = np.asarray(data["time"].values), data.attrs
        self._flown = Flown(str(about["title"]), float(about["duration"]), float(about["thrust_max"]), self._speed)
        self._coming.extend(self._happened(data))
        self._last, now = data, self._clock()
        # A computation that is late is not made up for: the flight goes on from here.
        beginning = now - float(time[0]) / self._speed
        self._start = beginning if self._start is None else max(self._start, beginning)
        while True:
            reached = (now - self._start) * self._speed
            at = min(max(int(np.searchsorted(time, reached + 1e-9, side="right")) - 1, 0), len(time) - 1)
            while self._coming and self._coming[0][0] <= time[at]:
                self._told.append(self._coming.popleft()[1])
                self._screen.tell(self._told[-1])
            if now >= self._next - 1e-9:
                self._show(data, at)
                self._next = now + 1.0 / self._screen.rate
            if reached >= time[-1]:
                break
            coming = min(float(time[-1]), self._coming[0][0] if self._coming else np.inf)
            self._sleep(max(min(self._next, self._start + coming / self._speed) - now, 1e-3))
            now = self._clock()

    def _show(self, data: FlightData, at: int) -> None:
        self._screen.show(self._flown, _instant(data, at), list(self._told))

    def _happened(self, data: FlightData) -> Iterator[tuple[float, str]]:
        """Faults, alarms and stages of a landing in some records, in words."""
        time = np.asarray(data["time"].values)
        held = stuck_at(data)
        loss = np.where(np.isfinite(held), 2.0, np.nan_to_num(np.asarray(data["loss_true"].values, dtype=float)))
        flag = np.asarray(data["fault_flag"].values) > 0.5
        stage = np.asarray(data["landing_stage"].values if "landing_stage" in data else np.zeros(len(time)))
        table = np.hstack([loss, flag, stage[:, None]])
        before = np.zeros(table.shape[1]) if self._before is None else self._before
        self._before, rotors = table[-1], loss.shape[1]
        change = np.diff(table, axis=0, prepend=before[None])
        for at, column in np.argwhere(np.abs(change) > LOSS):
            when, k = float(time[at]), int(column)
            rotor = k % rotors
            if k < rotors:
                if when < self._quiet.get(rotor, 0.0):  # a loss may come as a ramp
                    continue
                self._quiet[rotor] = when + LINE
                words = f"rotor {rotor + 1}: true loss now {100.0 * loss[at, rotor]:.3g} %"
                if np.isfinite(held[at, rotor]):
                    words = f"rotor {rotor + 1} is {stuck_text(held[at, rotor])}"
            elif k < 2 * rotors:
                wrong = "false alarm: " if flag[at, rotor] and loss[at, rotor] <= 0.0 else ""
                words = f"{wrong}rotor {rotor + 1} {'flagged' if flag[at, rotor] else 'cleared'}"
            else:
                words = STAGES[min(int(stage[at]), len(STAGES) - 1)]
            yield when, f"{when:.2f} s  {words}"


def _instant(data: FlightData, at: int) -> Instant:
    def value(name: str) -> Array:
        values: Array = np.nan_to_num(np.asarray(data[name].values[at], dtype=float))
        return values

    return Instant(
        time=float(data["time"].values[at]),
        position=value("position"),
        wanted=value("position_reference"),
        attitude=value("attitude"),
        speed=float(np.linalg.norm(value("velocity"))),
        command=value("thrust_command"),
        thrust=value("thrust"),
        loss=value("loss_true"),
        believed=value("loss_believed"),
        flagged=value("fault_flag"),
        stuck=stuck_at(data)[at],
        stuck_believed=believed_stuck_at(data)[at],
    )
