"""A closed loop as a machine: compiled (or found compiled), loaded, and fed with arrays in its own layout."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple, final

import numpy as np

from rotorfault.base.progress import Busy
from rotorfault.engine import cache, native
from rotorfault.engine.batch import Batch
from rotorfault.engine.cache import Compiled
from rotorfault.engine.program import Program, program, same_for_all, trace
from rotorfault.maths.arrays import Array

_FUNCTIONS = (("prepare", 2, 1), ("fly", 4, 2))
_NOTHING = np.zeros(1)
_LOADED: dict[str, Machine] = {}


@final
class Machine:
    """The compiled program of a closed loop, with or without signals."""

    def __init__(self, compiled: Compiled) -> None:
        self.layout, self.operations = compiled.layout, compiled.operations
        self.lanes = native.lanes()
        self._native = native.Native(compiled.code, _FUNCTIONS)

    def prepare(self, parameters: Array) -> Array:
        """What is computed once per flight.

        Parameters
        ----------
        parameters : ndarray, shape (groups, rows of the parameters and `program.SEED`, lanes)

        Returns
        -------
        ndarray, shape (groups, prepared rows, lanes)
        """
        prepared = aligned((len(parameters), max(1, self.layout.prepared), self.lanes))
        self._native("prepare", parameters, prepared, len(parameters))
        return prepared

    def fly(self, state: Array, prepared: Array, shared: Array, signals: Array | None) -> None:
        """Take the state as many steps further as there are rows of the shared inputs, in place.

        Parameters
        ----------
        state : ndarray, shape (groups, rows of the state, lanes)
        prepared : ndarray
            From `prepare`.
        shared : ndarray, shape (steps, shared rows)
        signals : ndarray, shape (groups, steps, rows of the signals, lanes), or None
            Written here, where the program has signals.
        """
        out = _NOTHING if signals is None else signals
        self._native("fly", state, prepared, shared, out, len(state), len(shared))


class Machines(NamedTuple):
    """Finds the programs of one closed loop when they are first needed."""

    batch: Batch

    def get(self, with_signals: bool) -> Machine:
        """The program with or without signals, compiled if it is not yet."""
        form = "recording" if with_signals else "quiet"
        name = cache.key(self.batch.loop, native.compiler(), f"{form} {same_for_all(self.batch)}")
        written: Program | None = None
        if name is None:
            written = self._written(with_signals)
            name = cache.key_of_program(written.text, native.compiler())
        return loaded(name, lambda: compiled(written or self._written(with_signals), "the closed loop"))

    def _written(self, with_signals: bool) -> Program:
        return program(trace(self.batch, same_for_all(self.batch)), native.lanes(), with_signals)


def loaded(name: str, make: Callable[[], Compiled]) -> Machine:
    """The machine of this name, loaded once; what it runs is made if it is not kept.

    Parameters
    ----------
    name : str
    make : callable
        Compiles it.
    """
    if name not in _LOADED:
        _LOADED[name] = Machine(cache.get(name, make))
    return _LOADED[name]


def compiled(written: Program, what: str) -> Compiled:
    """The object code of a program.

    Parameters
    ----------
    written : Program
    what : str
        It is of, for who waits.
    """
    with Busy(f"compiling {what} (once for its parts, then kept)"):
        return Compiled(native.compile_text(written.text), written.layout, dict(written.operations))


def aligned(shape: tuple[int, ...]) -> Array:
    """An array of zeros that begins where a vector may be loaded at once, on a line of the cache."""
    count = int(np.prod(shape))
    raw = np.zeros(count + 8)
    skipped = (-raw.ctypes.data // 8) % 8
    return raw[skipped : skipped + count].reshape(shape)


def grouped(rows: Array, lanes: int) -> Array:
    """Rows of flights (rows, N) in the machine's layout (groups, rows, lanes).

    Spare lanes fly the last flight again: zeros could cost time in denormal arithmetic.
    """
    groups = -(-rows.shape[1] // lanes)
    padded = np.pad(rows, ((0, 0), (0, groups * lanes - rows.shape[1])), mode="edge")
    out = aligned((groups, len(rows), lanes))
    out[:] = padded.reshape(len(rows), groups, lanes).transpose(1, 0, 2)
    return out


def ungrouped(groups: Array, flights: int) -> Array:
    """The rows (rows, N) of the machine's layout."""
    return np.ascontiguousarray(groups.transpose(1, 0, 2).reshape(groups.shape[1], -1)[:, :flights])
