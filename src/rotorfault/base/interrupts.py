"""Ctrl-C that cannot get lost.

Python raises `KeyboardInterrupt` wherever it happens to be. Where that is a finalizer or a function that C code calls,
nobody can catch it: Python prints it and goes on as if nothing had been. And a library that is being loaded may take it
for a failure of its own. So the command line remembers that Ctrl-C came, raises it anew where it was dropped, and asks
in long computations and at its end.
"""

from __future__ import annotations

import _thread
import signal
import sys
import threading
from types import FrameType
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sys import UnraisableHookArgs

AGAIN = 0.02  # s after which a dropped interrupt is raised anew: by then its finalizer is over

_came = threading.Event()


def install() -> None:
    """Watch for Ctrl-C, in the main thread of a program; nothing where it is to be ignored, as after ``nohup``."""
    if threading.current_thread() is not threading.main_thread():
        return
    if signal.getsignal(signal.SIGINT) is not signal.SIG_IGN:
        signal.signal(signal.SIGINT, _raise)
        sys.unraisablehook = _again


def came() -> bool:
    """Whether Ctrl-C has come since `install`."""
    return _came.is_set()


def check() -> None:
    """Raise KeyboardInterrupt if Ctrl-C has come and got lost."""
    if _came.is_set():
        raise KeyboardInterrupt


def _raise(number: int, frame: FrameType | None) -> None:
    _came.set()
    raise KeyboardInterrupt


def _again(dropped: UnraisableHookArgs) -> None:
    if issubclass(dropped.exc_type, KeyboardInterrupt):
        _came.set()
        timer = threading.Timer(AGAIN, _thread.interrupt_main)
        timer.daemon = True
        timer.start()
    else:
        sys.__unraisablehook__(dropped)
