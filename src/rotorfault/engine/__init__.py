"""Engines: run a batch of flights of one closed loop, on one number type each.

An engine is loaded when it is first asked for, so that llvmlite's absence costs nothing but its speed.
"""

from __future__ import annotations

import importlib.util

from rotorfault.base.errors import InputError, unknown
from rotorfault.engine.batch import Engine

ENGINES = {
    "simd": "machine code by LLVM: vector lanes, threads; the default",
    "numpy": "NumPy arrays: batches without a compiler; a single flight is slow",
    "python": "Python floats: any controller, easy to step through",
}
"""A line about each engine, by name."""


def have_simd() -> bool:
    """Whether llvmlite is installed."""
    return importlib.util.find_spec("llvmlite") is not None


def default_engine(count: int) -> str:
    """Name of the fastest engine that is installed for a batch.

    Parameters
    ----------
    count : int
        Flights in the batch.
    """
    if have_simd():
        return "simd"
    return "numpy" if count >= 16 else "python"


def load_engine(name: str) -> Engine:
    """Find an engine by name.

    Parameters
    ----------
    name : str
        One of `ENGINES`.

    Raises
    ------
    InputError
        If there is no such engine, or it needs llvmlite and that is not installed.
    """
    if not isinstance(name, str) or name not in ENGINES:
        raise InputError(unknown("engine", name, list(ENGINES)))
    if name == "simd" and not have_simd():
        raise InputError("engine 'simd' needs llvmlite, not installed; use --engine numpy or --engine python")
    if name == "simd":
        # llvmlite need not be there.
        from rotorfault.engine import simd

        return simd.run
    if name == "numpy":
        from rotorfault.engine import arrays

        return arrays.run
    from rotorfault.engine import python

    return python.run
