"""Several flights side by side: `compare`, and the `Comparison` that it gives back."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, final

import numpy as np
from rich.console import Console
from rich.table import Table
from rich.text import Text

from rotorfault.base.html import html_note, html_table
from rotorfault.base.one_line import LONGEST, cut
from rotorfault.base.plain_text import one_line
from rotorfault.base.text_table import terminal_width
from rotorfault.flight.flight import Flight
from rotorfault.flight.given import Given, labelled
from rotorfault.results.score_table import ScoreTable
from rotorfault.results.text import UNTIL_LOST, comparison

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@final
class Comparison:
    """Several flights side by side; prints as a table.

    Attributes
    ----------
    flights : dict of str to Flight
        By the label that tells each from the others.
    """

    def __init__(self, flights: dict[str, Flight]) -> None:
        self.flights = flights

    def __len__(self) -> int:
        return len(self.flights)

    def __repr__(self) -> str:
        told = ", ".join(f"{cut(label)} ({flight.outcome.kind})" for label, flight in self.flights.items())
        return cut(f"<comparison of {len(self)} flights: {told}>", LONGEST)

    def __str__(self) -> str:
        file = io.StringIO()
        Console(file=file, width=terminal_width(), color_system=None).print(self)
        return file.getvalue().rstrip("\n")

    def __rich__(self) -> Table:
        """The table for terminals, in which long texts are folded."""
        header, *lines = self.rows()
        # As `Text`, for rich would take what stands in brackets in a name for markup.
        table = Table(title=Text(one_line(self.title)))
        for text in header:
            table.add_column(Text(one_line(text)), overflow="fold")
        for line in lines:
            table.add_row(*(Text(one_line(text)) for text in line))
        table.caption = self._note or None
        return table

    def _repr_html_(self) -> str:
        """The table for notebooks."""
        header, *lines = self.rows()
        return html_table(lines, header, self.title) + (html_note(self._note) if self._note else "")

    @property
    def title(self) -> str:
        """Scenarios of the flights."""
        return ", ".join(dict.fromkeys(flight.scenario_name for flight in self.flights.values()))

    @property
    def _note(self) -> str:
        if all(flight.outcome.survived for flight in self.flights.values()):
            return ""
        return f"{UNTIL_LOST} of a flight that was lost: over the time before, not to be compared"

    def rows(self) -> list[list[str]]:
        """The table as texts: a header with the labels, then a row per quantity."""
        return comparison({label: flight.summary() for label, flight in self.flights.items()})

    @property
    def table(self) -> ScoreTable:
        """All numbers, a row per flight; its first columns are ``flight``, the label, and ``scenario``.

        Other columns are those of `Flights.table`, NaN where a flight has no such number.
        """
        flights = self.flights
        names = dict.fromkeys(name for flight in flights.values() for name in flight.scores)
        columns = {name: [flight.scores.get(name) for flight in flights.values()] for name in names}
        about = {
            "flight": np.array(list(flights)),
            "scenario": np.array([flight.scenario_name for flight in flights.values()]),
        }
        return ScoreTable(about | {name: _column(values) for name, values in columns.items()})

    def plot(self) -> dict[str, Figure]:
        """Figures with all flights together, as matplotlib figures by name: position, attitude, rotor_speeds, ..."""
        # matplotlib takes a second to load, which a table need not spend.
        from rotorfault.report import figures

        return figures.draw({label: flight.data for label, flight in self.flights.items()})

    def save_plots(self, folder: str | Path) -> list[Path]:
        """Write the figures of `plot` into a folder; their paths.

        Parameters
        ----------
        folder : str or Path

        Raises
        ------
        InputError
            If the folder cannot be written.
        """
        from rotorfault.report import figures

        return figures.save(self.plot(), Path(folder))

    def view(self, path: str | Path) -> Path:
        """Write a page that replays the flights, one file that opens offline; its path.

        Parameters
        ----------
        path : str or Path

        Raises
        ------
        InputError
            If there are more than six flights, one has no records, or the folder does not exist.
        """
        from rotorfault.flight.view import view

        return view(self.flights, out=path)


def compare(*flights: Given | Sequence[Given] | Mapping[str, Given]) -> Comparison:
    """Put flights side by side, as the command ``rotorfault compare`` does.

    Parameters
    ----------
    *flights : Flight, str or Path; or one list or mapping of them
        Flights, or paths of flight files; two or more. The keys of a mapping are their labels. Others are called by
        their controller, with folder or scenario, and at last a number, where that does not tell them apart.

    Returns
    -------
    Comparison
        Prints as a table; ``.table`` has its numbers, ``.plot()`` its figures.

    Raises
    ------
    InputError
        If they are no flights, fewer than two, or a file cannot be read.
    """
    return Comparison(labelled("compare", flights, 2))


def _column(values: list[Any]) -> Any:
    """A column of numbers with NaN where there is none, or of texts."""
    known = [value for value in values if value is not None]
    if known and all(isinstance(value, (str, bool)) for value in known) and len(known) == len(values):
        return np.array(values)
    return np.array([np.nan if value is None else value for value in values])
