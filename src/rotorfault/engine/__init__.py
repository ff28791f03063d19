"""Engines: run a batch of flights of one closed loop, on one number type each.

An engine is loaded when it is first asked for, so that llvmlite's absence costs nothing but its speed.
"""

from __future__ import annotations

import importlib
import importlib.util
from typing import cast

from rotorfault.base.errors import InputError, unknown
from rotorfault.engine.batch import Engine

ENGINES = {
    "simd": (
        "rotorfault.engine.simd",
        "machine code by LLVM: vector lanes, threads; the default",
    ),
    "numpy": ("rotorfault.engine.arrays", "NumPy arrays: batches without a compiler; a single flight is slow"),
    "python": ("rotorfault.engine.python", "Python floats: any controller, easy to step through"),
}


def have_simd() -> bool:
    """Whether llvmlite is installed."""
    return importlib.util.find_spec("llvmlite") is not None


def default_engine(count: int) -> str:
    """Fastest engine that is installed for a batch of so many flights."""
    if have_simd():
        return "simd"
    return "numpy" if count >= 16 else "python"


def load_engine(name: str) -> Engine:
    """Find an engine by name.

    Raises
    ------
    InputError
        If there is no such engine, or it needs llvmlite and that is not installed.
    """
    if name not in ENGINES:
        raise InputError(unknown("engine", name, list(ENGINES)))
    if name == "simd" and not have_simd():
        raise InputError("engine 'simd' needs llvmlite, not installed; use --engine numpy or --engine python")
    return cast("Engine", importlib.import_module(ENGINES[name][0]).run)
