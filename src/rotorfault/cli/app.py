"""The program of the command line, and what its commands share."""

from __future__ import annotations

import contextlib
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rotorfault._version import __version__
from rotorfault.base.plain_text import printable

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


STOPPED: list[str] = []
"""What a command has said of the Ctrl-C that ended it; `main` says it where no command did."""


def say(text: str, err: bool = False) -> None:
    """Print a text, with all that a terminal would obey written out: names in it may come from anywhere.

    Parameters
    ----------
    text : str
        Of one line or several.
    err : bool
        Whether on the error stream.
    """
    typer.echo(printable(text, keep="\n\t"), err=err)


def stopped(line: str) -> typer.Exit:
    """The exception with which a command ends after Ctrl-C, when it has said what becomes of its work."""
    STOPPED.append(line)
    say(line, err=True)
    return typer.Exit(130)


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


def finish(flight: Flight, folder: Path, figures: bool, page: bool = False) -> None:
    """Write the files of a flight and print its numbers; neither a closed pipe nor Ctrl-C loses what was flown.

    Parameters
    ----------
    flight : Flight
    folder : Path
        For its files.
    figures : bool
        Whether figures are drawn.
    page : bool
        Whether the flight's page is written.
    """

    def tell() -> None:
        with contextlib.suppress(BrokenPipeError):  # told again below, once all is written
            say(str(flight.summary()))

    try:
        written = flight.write(folder, figures, page, tell)
    except KeyboardInterrupt:
        if flight.source:
            raise stopped(f"interrupted; {folder} holds the flight, but not all that was to be made of it") from None
        raise
    say(f"\nwrote {', '.join(path.name for path in written)} to {folder}")
    if flight.outcome.kind == "interrupted":
        raise stopped(f"interrupted; {folder} holds the flight up to {flight.outcome.time:g} s")
