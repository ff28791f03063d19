"""The command line. Modules that take time to load are loaded by the command that needs them."""

from __future__ import annotations

import sys

import typer

from rotorfault.base.errors import InputError
from rotorfault.cli import campaign, export, fly, look, studies
from rotorfault.cli.app import app

__all__ = ["app", "campaign", "export", "fly", "look", "main", "studies"]


def main() -> None:
    """Entry point: errors of the user in one line with exit code 2, Ctrl-C with 130."""
    try:
        app(standalone_mode=True)
    except InputError as error:
        typer.echo(f"rotorfault: {error}", err=True)
        sys.exit(2)
    except OSError as error:
        # A full disk, most of all: whatever was being written is not there.
        where = "" if error.filename is None else f"{error.filename}: "
        typer.echo(f"rotorfault: {where}{error.strerror or error}; nothing of it was written", err=True)
        sys.exit(2)
    except KeyboardInterrupt:
        typer.echo("rotorfault: interrupted", err=True)
        sys.exit(130)


if __name__ == "__main__":
    main()
