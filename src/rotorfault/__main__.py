"""The command line: ``python -m rotorfault``, and the program ``rotorfault``.

Loading takes half a second, in which nothing has been begun yet: a Ctrl-C then ends the program at once.
"""

from __future__ import annotations

import os
import signal
from types import FrameType


def main() -> None:
    """Entry point; see `rotorfault.cli.main`."""
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, _quit)
    from rotorfault.cli.main import main as run

    run()


def _quit(number: int, frame: FrameType | None) -> None:
    # No exception: a library that is being loaded could take it for a failure of its own.
    os.write(2, b"rotorfault: interrupted\n")
    os._exit(130)


if __name__ == "__main__":
    main()
