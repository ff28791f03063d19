"""The command `rotorfault export`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from rotorfault.cli.app import app, say


@app.command()
def export(
    flight: Annotated[Path, typer.Argument(metavar="FLIGHT.nc", help="A flight file that 'rotorfault fly' wrote.")],
    to: Annotated[
        str | None,
        typer.Option(
            "--to",
            metavar="FORMAT",
            help="csv, parquet, mat, mcap, rrd or ulog; else by the ending of --out.",
        ),
    ] = None,
    out: Annotated[
        Path | None, typer.Option(metavar="FILE", help="File to write; beside the flight if not given.")
    ] = None,
    every: Annotated[int, typer.Option(metavar="N", help="Write one of N records.")] = 1,
    units: Annotated[
        bool, typer.Option("--units/--no-units", help="Units in the names of columns (csv, parquet).")
    ] = True,
) -> None:
    """Write a flight for other tools.

    csv and parquet are one table; mat is for MATLAB and Octave; mcap for Foxglove, with a layout; rrd for Rerun, with
    its blueprint; ulog for PX4 Flight Review and PlotJuggler, with PX4's topics in PX4's frames.

    Example: rotorfault export results/calm/flight.nc --to mcap
    """
    from rotorfault.base.errors import InputError
    from rotorfault.flight.flight import load
    from rotorfault.results import exporters

    if to is None and out is None:
        raise InputError(f"--to: is missing; allowed: {', '.join(exporters.FORMATS)}; or give --out with an ending")
    form = exporters.form_of(out) if to is None and out is not None else str(to)
    exporters.writer_of(form)
    written = exporters.write(load(flight).records(), exporters.target_of(form, flight, out), form, every, units)
    say("\n".join(f"wrote {path}" for path in written))
