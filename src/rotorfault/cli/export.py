"""The command `rotorfault export`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from rotorfault.cli.app import app, say


@app.command()
def export(
    flight: Annotated[Path, typer.Argument(metavar="FLIGHT.nc", help="A flight file that 'rotorfault fly' wrote.")],
    to: Annotated[str, typer.Option("--to", metavar="FORMAT", help="Format: csv.")],
    out: Annotated[
        Path | None, typer.Option(metavar="FILE", help="File to write; beside the flight if not given.")
    ] = None,
    every: Annotated[int, typer.Option(metavar="N", help="Write one of N records.")] = 1,
    units: Annotated[bool, typer.Option("--units/--no-units", help="Units in the names of columns.")] = True,
) -> None:
    """Write a flight for other tools: one table, a row per record and a column per component.

    Example: rotorfault export results/calm/flight.nc --to csv --every 10
    """
    from rotorfault.flight.flight import load
    from rotorfault.results import dataset
    from rotorfault.results.export import target_of, writer

    write = writer(to)
    data = dataset.as_flight_data(load(flight).data)
    say(f"wrote {write(data, target_of(to, flight, out), every, units)}")
