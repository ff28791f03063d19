"""Ctrl-C that cannot get lost.

Python raises `KeyboardInterrupt` wherever it happens to be. Where that is a finalizer or a function that C code
calls, nobody can catch it: Python prints it and goes on as if nothing had been. And a library that is being loaded
may take it for a failure of its own. So the command line remembers that Ctrl-C came, raises it anew where it was
dropped, and asks in long computations and at its end.
"""

from __future__ import annotations

import _thread
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sys import UnraisableHookArgs

AGAIN = 0.02  # s after which a dropped interrupt is raised anew: by then its finalizer is over

_came = threading.Event()


@contextmanager
def watched() -> Iterator[None]:
    """Watch for Ctrl-C in the main thread of a program; not where it is to be ignored, as after ``nohup``."""
    _came.clear()
    before, hook = signal.getsignal(signal.SIGINT), sys.unraisablehook
    if threading.current_thread() is not threading.main_thread() or before is signal.SIG_IGN:
        yield
        return
    signal.signal(signal.SIGINT, _raise)
    sys.unraisablehook = _again
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
        sys.unraisablehook = hook
        _came.clear()


def came() -> bool:
    """Whether Ctrl-C has come while somebody watches."""
    return _came.is_set()


def check() -> None:
    """Raise KeyboardInterrupt if Ctrl-C has come, and may have been dropped."""
    if _came.is_set():
        raise KeyboardInterrupt


@contextmanager
def held_back() -> Iterator[None]:
    """Let no Ctrl-C come, and none to the processes that are started meanwhile; one that came is raised at the end.

    A process that is starting cannot yet say what Ctrl-C means to it, and would print where it was.
    """
    late = False

    def note(number: int, frame: FrameType | None) -> None:
        nonlocal late
        late = True

    # Blocked for children, which inherit that, and noted for threads, which may take the signal in our place.
    handler = signal.getsignal(signal.SIGINT)
    ours = callable(handler) and threading.current_thread() is threading.main_thread()
    if ours:
        signal.signal(signal.SIGINT, note)
    blocks = hasattr(signal, "pthread_sigmask")
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT}) if blocks else set()
    try:
        yield
    finally:
        if blocks:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)
        if ours:
            signal.signal(signal.SIGINT, handler)
    if late:
        signal.raise_signal(signal.SIGINT)


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
