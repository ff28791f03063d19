"""Progress of long computations, on the terminal's error stream, once they have taken two seconds."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from types import TracebackType
from typing import TYPE_CHECKING

from rotorfault.base import interrupts
from rotorfault.base.plain_text import one_line

if TYPE_CHECKING:
    from rich.progress import Progress, TaskID

PATIENCE = 2.0  # s before anything is shown

Say = Callable[[str], None]
"""Takes a line that says what is being done."""


_outermost: Bar | None = None
"""The bar that may be shown: a long computation may be part of a longer one, which has a bar already."""


class Bar:
    """A progress bar that appears only when it is needed, only on a terminal, and not within another.

    Parameters
    ----------
    title : str
    total : float
        In `unit`.
    unit : str
    """

    def __init__(self, title: str, total: float, unit: str) -> None:
        self._progress: Progress | None = None
        self._task: TaskID | None = None
        self._start = time.monotonic()
        self.title, self.total, self.unit = one_line(title), total, unit

    def __enter__(self) -> Bar:
        global _outermost
        _outermost = _outermost or self
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None
    ) -> None:
        global _outermost
        if _outermost is self:
            _outermost = None
        if self._progress is not None:
            self._progress.stop()

    def update(self, done: float, note: str = "") -> None:
        """Show how much is done, in `unit`, how fast, and a note.

        Raises
        ------
        KeyboardInterrupt
            If Ctrl-C came and was dropped somewhere: all long computations come by here.
        """
        interrupts.check()
        elapsed = time.monotonic() - self._start
        if self._progress is None or self._task is None:
            if elapsed < PATIENCE or _outermost is not self or not sys.stderr.isatty():
                return
            self._progress = _progress(self.unit)
            self._progress.start()
            self._task = self._progress.add_task(self.title, total=self.total, rate="", note="")
        rate = f"{done / max(elapsed, 1e-3):,.4g} {self.unit}/s"
        self._progress.update(self._task, completed=done, rate=rate, note=note)


def _progress(unit: str) -> Progress:
    # rich is loaded for a bar that is shown; most computations are done before.
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    return Progress(
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        TextColumn(f"{{task.completed:.4g}} of {{task.total:.4g}} {unit}", markup=False),
        TextColumn("{task.fields[rate]}", markup=False),
        TimeRemainingColumn(),
        TextColumn("{task.fields[note]}", markup=False),
        console=Console(stderr=True),
        transient=True,
    )


class Busy:
    """A line that says what is going on, for as long as it does; only on a terminal without a bar.

    Parameters
    ----------
    what : str
    """

    def __init__(self, what: str) -> None:
        self._line = f"{what} ..."

    def __enter__(self) -> Busy:
        self._show(self._line)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None
    ) -> None:
        self._show(" " * len(self._line))

    @staticmethod
    def _show(line: str) -> None:
        if sys.stderr.isatty() and _outermost is None:
            print(line, end="\r", file=sys.stderr, flush=True)
