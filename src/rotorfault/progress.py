"""Progress of long computations, on the terminal's error stream, once they have taken two seconds."""

from __future__ import annotations

import sys
import time
from types import TracebackType

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

PATIENCE = 2.0  # s before anything is shown


class Bar:
    """A progress bar that appears only when it is needed, and only on a terminal.

    Parameters
    ----------
    title : str
    total : float
        In `unit`.
    unit : str
    """

    def __init__(self, title: str, total: float, unit: str) -> None:
        self._progress: Progress | None = None
        self._task = None
        self._start = time.monotonic()
        self.title, self.total, self.unit = title, total, unit

    def __enter__(self) -> Bar:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None
    ) -> None:
        if self._progress is not None:
            self._progress.stop()

    def update(self, done: float) -> None:
        """Show how much is done, in `unit`."""
        if self._progress is None:
            if time.monotonic() - self._start < PATIENCE or not sys.stderr.isatty():
                return
            self._progress = Progress(
                TextColumn("{task.description}"),
                BarColumn(),
                TextColumn(f"{{task.completed:.4g}} of {{task.total:.4g}} {self.unit}"),
                TimeRemainingColumn(),
                console=Console(stderr=True),
                transient=True,
            )
            self._progress.start()
            self._task = self._progress.add_task(self.title, total=self.total)  # type: ignore[assignment]
        self._progress.update(self._task, completed=done)  # type: ignore[arg-type]


class Busy:
    """A line that says what is going on, for as long as it does; only on a terminal.

    Parameters
    ----------
    what : str
    """

    def __init__(self, what: str) -> None:
        self._what, self._console = what, Console(stderr=True)

    def __enter__(self) -> Busy:
        if sys.stderr.isatty():
            self._console.print(f"{self._what} ...", end="\r", style="dim", highlight=False)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None
    ) -> None:
        if sys.stderr.isatty():
            self._console.print(" " * (len(self._what) + 4), end="\r")
