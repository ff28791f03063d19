"""A closed loop as a machine: compiled (or found compiled), loaded, and fed with arrays in its own layout."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable
from typing import NamedTuple, final

import numpy as np

from rotorfault.base.collector import no_collection
from rotorfault.base.progress import Busy
from rotorfault.engine import cache, native
from rotorfault.engine.batch import Batch
from rotorfault.engine.cache import Compiled
from rotorfault.engine.program import Program, program, same_for_all, trace
from rotorfault.maths.arrays import Array

# Steps of a group of lanes, each thread, that are flown by code that was made quickly: until then better code would
# have cost as long to make as it would have saved, or longer (benchmarks/compile_effort.py).
ENOUGH = 100_000
_FUNCTIONS = (("prepare", 2, 1), ("fly", 4, 2))
_NOTHING = np.zeros(1)
_LOADED: dict[str, Machine] = {}
_FLOWN: Counter[str] = Counter()  # steps, by name


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

    def get(self, with_signals: bool, steps: float = math.inf) -> Machine:
        """The program with or without signals, compiled if it is not yet.

        Parameters
        ----------
        with_signals : bool
        steps : float, optional
            Of a group of lanes that each thread will fly with it.
        """
        form = "recording" if with_signals else "quiet"
        name = cache.key(self.batch.loop, native.compiler(), f"{form} {same_for_all(self.batch)}")
        written: Program | None = None
        if name is None:
            written = self._written(with_signals)
            name = cache.key_of_program(written.text, native.compiler())
        return loaded(name, lambda: written or self._written(with_signals), "the closed loop", steps)

    def _written(self, with_signals: bool) -> Program:
        with no_collection():
            return program(trace(self.batch, same_for_all(self.batch)), native.lanes(), with_signals)


def loaded(name: str, written: Callable[[], Program], what: str, steps: float) -> Machine:
    """The machine of this name, loaded once; what it runs is compiled if it is not kept.

    Few steps are flown by code that was made quickly, until they have become many (`ENOUGH`). No number depends on
    which of the two it is.

    Parameters
    ----------
    name : str
    written : callable
        Writes the program.
    what : str
        It is of, for who waits.
    steps : float
        Of a group of lanes that each thread will fly.
    """
    _FLOWN[name] += steps  # type: ignore[assignment]  # may be infinite
    quickly = _FLOWN[name] <= ENOUGH and not cache.kept(name)
    if quickly:
        name = cache.digest_of(name, "made quickly")
    if name not in _LOADED:
        _LOADED[name] = Machine(cache.get(name, lambda: _compiled(written(), what, quickly)))
    return _LOADED[name]


def _compiled(written: Program, what: str, quickly: bool) -> Compiled:
    with Busy(f"compiling {what} (once for its parts, then kept)"):
        code = native.compile_text(written.text, quickly)
        return Compiled(code, written.layout, dict(written.operations))


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
