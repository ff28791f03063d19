"""The command line. Modules that take time to load are loaded by the command that needs them."""

from __future__ import annotations

import os
import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from rotorfault.base import interrupts
from rotorfault.base.errors import InputError
from rotorfault.base.plain_text import one_line
from rotorfault.cli import campaign, convert, diagnose, export, fly, frames, look, new, studies, tune
from rotorfault.cli.app import STOPPED, app, say
from rotorfault.cli.usage import USAGE, refusal

__all__ = [
    "app",
    "campaign",
    "convert",
    "diagnose",
    "export",
    "fly",
    "frames",
    "look",
    "main",
    "new",
    "studies",
    "tune",
]

NARROWEST = 20  # columns of a terminal: below, tables have no room for a word
# What the system says where there is no memory left for a thread or a library.
_NO_MEMORY = ("can't start new thread", "Cannot allocate memory", "failed to map segment", "out of memory")


def main() -> None:
    """Entry point: errors of the user in one line with exit code 2, Ctrl-C in one line with 130."""
    with _surroundings(), interrupts.watched():
        code = _run()
        if interrupts.came() and code != 130:
            code = 130  # whatever it was taken for
        if code == 130 and not STOPPED:
            say("rotorfault: interrupted", err=True)
        STOPPED.clear()
    sys.exit(code)


def _run() -> int:
    try:
        return int(app(args=sys.argv[1:], standalone_mode=False) or 0)
    except USAGE as error:
        if len(sys.argv) < 2:  # nothing was asked for: what there is to ask for
            say(str(error), err=True)
            return 2
        return _refuse(refusal(error, sys.argv[1:]))
    except SystemExit as end:
        return end.code if isinstance(end.code, int) else int(end.code is not None)
    except InputError as error:
        return _refuse(str(error))
    except OSError as error:
        if _lacks_memory(error):
            return _refuse("there is not enough memory for this; end other programs, or fly less at once")
        # A full disk, most of all: whatever was being written is not there.
        where = "" if error.filename is None else f"{error.filename}: "
        return _refuse(f"{where}{error.strerror or error}; nothing of it was written")
    except KeyboardInterrupt:
        return 130
    except Exception as error:
        if interrupts.came():
            return 130
        if isinstance(error, MemoryError) or _lacks_memory(error):
            return _refuse("there is not enough memory for this; end other programs, or fly less at once")
        raise


def _refuse(message: str) -> int:
    if not interrupts.came():
        say(f"rotorfault: {one_line(message)}", err=True)
    return 2


def _lacks_memory(error: Exception) -> bool:
    return isinstance(error, (OSError, RuntimeError, ImportError)) and any(t in str(error) for t in _NO_MEMORY)


@contextmanager
def _surroundings() -> Iterator[None]:
    """What the program makes of where it runs, for as long as it does."""
    for stream in (sys.stdout, sys.stderr):
        # A terminal that knows few characters gets the others written out, and none is a reason to stop.
        if getattr(stream, "errors", None) in ("strict", "surrogateescape"):
            stream.reconfigure(errors="backslashreplace")  # type: ignore[union-attr]
    kept = {name: os.environ.get(name) for name in ("COLUMNS", "MPLBACKEND")}
    # Figures become files here; which window somebody wants elsewhere is none of our business.
    os.environ["MPLBACKEND"] = "agg"
    if not (kept["COLUMNS"] or "").isdigit() or int(kept["COLUMNS"] or 0) < NARROWEST:
        os.environ.pop("COLUMNS", None)
    with warnings.catch_warnings():
        shown = warnings.showwarning

        def show(message: Warning | str, category: type[Warning], *where: Any) -> None:
            if category.__module__.startswith("rotorfault."):
                say(f"warning: {one_line(str(message))}", err=True)
            else:
                shown(message, category, *where)

        warnings.showwarning = show  # type: ignore[assignment]
        try:
            yield
        finally:
            for name, value in kept.items():
                os.environ.pop(name, None) if value is None else os.environ.__setitem__(name, value)


if __name__ == "__main__":
    main()
