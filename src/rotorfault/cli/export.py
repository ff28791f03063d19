"""The commands `rotorfault export` and `rotorfault animate`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from rotorfault.base.errors import InputError
from rotorfault.cli.app import app, say

OPTIONS = {"start": "--from"} | {name: f"--{name}" for name in ("speed", "fps", "width", "until")}
"""What the parameters of a film are called here."""


@app.command()
def export(
    flight: Annotated[
        Path,
        typer.Argument(
            metavar="FLIGHT.nc",
            help="A flight file that 'rotorfault fly' wrote, or the word 'vehicle'.",
        ),
    ],
    vehicle: Annotated[
        str | None, typer.Argument(metavar="[NAME|FILE.toml]", help="The vehicle, after the word 'vehicle'.")
    ] = None,
    to: Annotated[
        str | None,
        typer.Option(
            "--to",
            metavar="FORMAT",
            help="csv, parquet, mat, mcap, rrd or ulog, else by the ending of --out; of a vehicle px4 or ardupilot.",
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="File to write; if not given, beside the flight, of a vehicle here."),
    ] = None,
    every: Annotated[int, typer.Option(metavar="N", help="Write one of N records.")] = 1,
    units: Annotated[
        bool, typer.Option("--units/--no-units", help="Units in the names of columns (csv, parquet).")
    ] = True,
) -> None:
    """Write a flight for other tools, or a vehicle as parameters of an autopilot.

    csv and parquet are one table; mat is for MATLAB and Octave; mcap for Foxglove, with a layout; rrd for Rerun, with
    its blueprint; ulog for PX4 Flight Review and PlotJuggler, with PX4's topics in PX4's frames.

    'export vehicle NAME --to px4' writes geometry and thrust as parameters, and says which motor each rotor is.

    Example: rotorfault export results/calm/flight.nc --to mcap
    """
    if str(flight) == "vehicle":
        if every != 1 or not units:
            raise InputError("--every, --no-units: allowed for flights; a vehicle has no records")
        _export_vehicle(vehicle, to, out)
        return
    if vehicle is not None:
        raise InputError(f"'{flight}' '{vehicle}': allowed: one FLIGHT.nc, or: rotorfault export vehicle {vehicle}")

    from rotorfault.flight.flight import load
    from rotorfault.results import exporters

    if to is None and out is None:
        raise InputError(f"--to: is missing; allowed: {', '.join(exporters.FORMATS)}; or give --out with an ending")
    form = str(to) if out is None else exporters.format_of(out, to)
    exporters.writer_of(form)
    step = exporters.whole_every(every, "--every")
    target = exporters.target_of(form, flight, out)
    written = exporters.write(load(flight).records(), target, form, step, units)
    say("\n".join(f"wrote {path}" for path in written))


def _export_vehicle(name: str | None, to: str | None, out: Path | None) -> None:
    """Write a vehicle for an autopilot, and say which motor each rotor is there."""
    from rotorfault.base.files import in_folder, write_atomically
    from rotorfault.cli.vehicle_layout import layout_lines
    from rotorfault.model.importers.vehicles import TARGETS, exported_vehicle
    from rotorfault.model.vehicle_file import load_vehicle

    if name is None or to is None:
        what = "no vehicle came" if name is None else "--to: is missing"
        raise InputError(f"{what}; allowed: rotorfault export vehicle NAME|FILE.toml --to {'|'.join(TARGETS)}")
    file = load_vehicle(name)
    made = exported_vehicle(file, to)
    path = out or Path(f"{file.name}{TARGETS[to]}")
    if out is None and path.name != str(path):
        raise InputError(f"vehicle '{file.name}': its name is no file name; give a file with --out")
    in_folder(path)
    write_atomically(path, lambda temporary: temporary.write_text(made.text, encoding="utf-8"))
    say("\n".join([*layout_lines(file, [str(number) for number in made.numbers], to), ""]))
    for line in made.notes:
        say(line)
    say(f"wrote {path}; compare each motor's place and turn with the vehicle before it flies")


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
    from rotorfault.report.film import Film, require_kind

    target = out or flight.with_suffix(".gif")
    if target.is_dir():
        raise InputError(f"{target}: is a folder; give a file with --out, such as {target / 'flight.gif'}")
    film = Film(speed, fps, width, start, until, names=OPTIONS).checked(require_kind(target))
    say(f"wrote {load(flight).film(target, film)}")
