"""Following a flight while it is computed: somebody is handed its records, a piece at a time.

Engines fly in chunks of steps and look up between two of them. There, what has been recorded is handed over, and the
flight waits until it has been looked at: so a view at real time follows a computation that is faster. The piece that
was computed last is held back until the next one is there, for only the end of a flight says up to which record it
lasted.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from typing import Any, final

import numpy as np

from rotorfault.base import interrupts
from rotorfault.maths.arrays import Array
from rotorfault.model.telemetry import Layout
from rotorfault.results.flight_data import FlightData, flight_data

Follow = Callable[[FlightData], None]
"""Takes the next records of a flight. KeyboardInterrupt in it ends the flight, and nothing computed is lost."""


@final
class Following:
    """Hands over the records of one flight.

    Parameters
    ----------
    follow : callable
    layout : Layout
        Of the rows that are recorded.
    step : float
        Between two records, in s.
    about : dict
        Attributes of the flight, handed over with its records.
    """

    def __init__(self, follow: Follow, layout: Layout, step: float, about: dict[str, Any]) -> None:
        self._follow, self._layout, self._step, self._about = follow, layout, step, about
        self._new: list[Array] = []  # signals of runs of records
        self._held: list[Array] = []
        self._shown = 0  # records

    def look(self, step: int, signals: Array) -> None:
        """See records as they are made; see `rotorfault.engine.batch.Look`."""
        self._new.append(signals[:, :, 0])

    def watch(self, done: int) -> bool:
        """Hand over what was held back, and hold back what is new; see `rotorfault.engine.batch.Watch`."""
        interrupts.check()
        ready, self._held, self._new = self._held, self._new, []
        self._hand_over(ready)
        return False

    def end(self, records: int) -> None:
        """Hand over the rest of the flight, which has so many records; Ctrl-C ends the looking alone."""
        with contextlib.suppress(KeyboardInterrupt):
            if not interrupts.came():
                self._hand_over([*self._held, *self._new], records)

    def _hand_over(self, pieces: list[Array], records: int | None = None) -> None:
        """Up to the end of the flight, where that is known."""
        signals = np.concatenate(pieces) if pieces else np.empty((0, len(self._layout)))
        signals = signals if records is None else signals[: max(records - self._shown, 0)]
        if len(signals):
            times: Array = np.arange(self._shown, self._shown + len(signals), dtype=np.float64) * self._step
            self._shown += len(signals)
            self._follow(flight_data(self._layout, signals, times, self._about))
