"""The commands `rotorfault export` and `rotorfault animate`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from rotorfault.base.errors import InputError, choices
from rotorfault.cli.app import app, say


@app.command()
def export(
    flight: Annotated[Path, typer.Argument(metavar="FLIGHT.nc", help="A flight file that 'rotorfault fly' wrote.")],
    to: Annotated[
        str | None,
        typer.Option(
            "--to",
            metavar="FORMAT",
            help="csv, parquet, mat (MATLAB), mcap (Foxglove), rrd (Rerun) or ulog "
            "(PX4); told by the ending of --out if not given.",
        ),
    ] = None,
    out: Annotated[
        Path | None, typer.Option(metavar="FILE", help="File to write; beside the flight if not given.")
    ] = None,
    every: Annotated[int, typer.Option(metavar="N", help="Write one of N records.")] = 1,
    units: Annotated[bool, typer.Option("--units/--no-units", help="Units in names or descriptions.")] = True,
    layout: Annotated[
        bool, typer.Option("--layout", help="With mcap: write a layout for Foxglove beside the file.")
    ] = False,
) -> None:
    """Write a flight for other tools: tables, MATLAB, Foxglove, Rerun, PX4's log.

    Example: rotorfault export results/calm/flight.nc --to mcap --every 10 --layout
    """
    from rotorfault.base.files import write_atomically
    from rotorfault.flight.flight import load
    from rotorfault.results.export import FORMATS, format_of, foxglove_layout, target_of
    from rotorfault.results.export import export as write

    if to is None and out is None:
        raise InputError(f"no format was given; give --to ({choices(FORMATS)}), or --out with its ending")
    form = format_of(out) if to is None and out is not None else to or ""
    if layout and form != "mcap":
        raise InputError(f"--layout is for the format mcap; got --to {form}")
    target = target_of(form, flight, out)
    records = load(flight).records()
    say(f"wrote {write(records, target, form, every, units)}")
    if layout:
        beside = target.with_suffix(".layout.json")
        write_atomically(beside, lambda path: path.write_text(foxglove_layout(records), encoding="utf-8"))
        say(f"wrote {beside}; in Foxglove: Layouts, Import from file")


@app.command()
def animate(
    flight: Annotated[Path, typer.Argument(metavar="FLIGHT.nc", help="A flight file that 'rotorfault fly' wrote.")],
    out: Annotated[
        Path | None,
        typer.Option(
            "--out", "-o", metavar="FILE", help="Film to write, .gif or .mp4; a .gif beside the flight if not given."
        ),
    ] = None,
    speed: Annotated[float, typer.Option(metavar="X", help="Of the flight; 1 is real time.")] = 1.0,
    fps: Annotated[float, typer.Option(metavar="N", help="Pictures a second; up to 50 in a GIF.")] = 30.0,
    width: Annotated[int, typer.Option(metavar="PIXELS", help="Of a picture; its height is 9/16 of it.")] = 960,
    start: Annotated[float | None, typer.Option("--from", metavar="T", help="Begin here, s.")] = None,
    until: Annotated[float | None, typer.Option(metavar="T", help="End here, s.")] = None,
) -> None:
    """Write a flight as a film: the scene, the vehicle close up, thrusts and losses, what happens in words.

    Example: rotorfault animate results/calm/flight.nc -o calm.mp4 --speed 0.5 --until 4
    """
    from rotorfault.flight.flight import load

    target = out or flight.with_suffix(".gif")
    if target.is_dir():
        raise InputError(f"{target}: is a folder; give a file with --out, such as {target / 'flight.gif'}")
    written = load(flight).animate(target, speed=speed, fps=fps, width=width, start=start, until=until)
    say(f"wrote {written}")
