"""The program of the command line, and what its commands share."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rotorfault._version import __version__

if TYPE_CHECKING:
    from rotorfault.flight.flight import Flight

app = typer.Typer(
    name="rotorfault",
    help="Design, prove and fly multirotor control that survives rotor faults and wind.",
    epilog="Start with:  rotorfault fly paper-set-point    then:  rotorfault list",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
)

AllowCode = Annotated[
    bool,
    typer.Option("--allow-code", help="Let code run that the file names (kind = 'FILE.py:NAME', function = ...)."),
]
Assignments = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY=VALUE", help="Override a key, e.g. fault.0.loss=0.4; may be repeated."),
]


def _version(wanted: bool) -> None:
    if wanted:
        typer.echo(__version__)
        raise typer.Exit


@app.callback()
def _root(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version and exit.")
    ] = False,
) -> None:
    pass


def finish(flight: Flight, folder: Path, figures: bool) -> None:
    """Print the numbers of a flight and write its files.

    Parameters
    ----------
    flight : Flight
    folder : Path
        For its files.
    figures : bool
        Whether figures are drawn.
    """
    typer.echo(str(flight.summary()))
    written = flight.write(folder, with_figures=figures)
    typer.echo(f"\nwrote {', '.join(path.name for path in written)} to {folder}")
    if flight.outcome.kind == "interrupted":
        raise typer.Exit(130)
