"""Several flights side by side: a table, and figures with all of them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from rich.console import Console
from rich.table import Table
from rich.text import Text

from rotorfault.base.plain_text import one_line
from rotorfault.flight.flight import Flight, load
from rotorfault.report import figures
from rotorfault.results.text import UNTIL_LOST, comparison


def labelled(paths: Sequence[Path]) -> dict[str, Flight]:
    """Flights by a label that tells them apart: the controller, with the folder where that is not enough."""
    loaded = [load(path) for path in paths]
    labels = [flight.label for flight in loaded]
    if len(set(labels)) < len(labels):
        labels = [f"{label} ({path.resolve().parent.name})" for label, path in zip(labels, paths, strict=True)]
    if len(set(labels)) < len(labels):
        labels = [f"{label} {number}" for number, label in enumerate(labels, start=1)]
    return dict(zip(labels, loaded, strict=True))


def print_table(flights: dict[str, Flight]) -> None:
    """Print the numbers of all flights, a column each."""
    header, *lines = comparison({label: flight.summary() for label, flight in flights.items()})
    names = dict.fromkeys(str(f.data.attrs["scenario"]) for f in flights.values())
    # As `Text`, for rich would take what stands in brackets in a name for markup.
    table = Table(title=Text(one_line(", ".join(names))))
    for text in header:
        table.add_column(Text(one_line(text)), overflow="fold")
    for line in lines:
        table.add_row(*(Text(one_line(text)) for text in line))
    if any(not flight.outcome.survived for flight in flights.values()):
        table.caption = f"{UNTIL_LOST} of a flight that was lost: over the time before, not to be compared"
    Console().print(table)


def draw(flights: dict[str, Flight], folder: Path) -> list[Path]:
    """Draw all flights together into a folder."""
    return figures.save(figures.draw({label: flight.data for label, flight in flights.items()}), folder)
