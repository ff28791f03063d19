"""Any pure function on records as machine code: traced once, compiled, called on arrays of arguments."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from typing import Any, final

import numpy as np

from rotorfault.engine import native
from rotorfault.engine.code import Code, declarations, over_groups
from rotorfault.engine.emit import Emitter, Leaf, merging
from rotorfault.engine.machine import aligned, grouped, ungrouped
from rotorfault.engine.trace import Tape
from rotorfault.maths.arrays import Array
from rotorfault.maths.records import flatten, unflatten


@final
class CompiledFunction:
    """A function of records of scalars, compiled.

    Parameters
    ----------
    function : callable
        Takes the arguments and returns a record; pure, on scalars.
    *arguments : record
        Give the shapes; their numbers are ignored.

    Attributes
    ----------
    operations : Counter
        Of one evaluation, by sort.
    """

    def __init__(self, function: Callable[..., Any], *arguments: Any) -> None:
        tape, lanes = Tape(), native.lanes()
        leaves = tape.leaves("in", len(flatten(arguments)))
        outputs = [tape.lift(x) for x in flatten(function(*unflatten(arguments, leaves)))]
        code = Code(lanes)
        emitter = Emitter(code, {"in": Leaf("%in")}, {}, merging(tape.terms, outputs))
        for row, name in enumerate([emitter.number(term) for term in outputs]):
            code.store(name, "%out", row * lanes)
        self._rows, self._lanes, self.operations = len(outputs), lanes, Counter(code.counts)
        evaluate = over_groups("evaluate", "in", len(leaves) * lanes, len(outputs) * lanes, code.lines)
        text = "\n".join([*declarations(lanes), evaluate])
        self._native = native.Native(native.compile_text(text), [("evaluate", 2, 1)])

    def __call__(self, rows: Array) -> Array:
        """Evaluate.

        Parameters
        ----------
        rows : ndarray, shape (leaves of the arguments, N)

        Returns
        -------
        ndarray, shape (leaves of the outcome, N)
        """
        rows = np.asarray(rows, dtype=float)
        arguments = grouped(rows, self._lanes)
        return ungrouped(self.evaluate(arguments), rows.shape[1])

    def evaluate(self, groups: Array, out: Array | None = None) -> Array:
        """Evaluate arguments in the machine's layout (see `grouped`), shape (groups, leaves, lanes).

        Nothing is rearranged, and nothing allocated where `out` is given.
        """
        out = aligned((len(groups), self._rows, self._lanes)) if out is None else out
        self._native("evaluate", groups, out, len(groups))
        return out

    def bound(self, groups: Array, out: Array) -> Callable[[], None]:
        """`evaluate` with its arguments, to be called again and again."""
        return self._native.bound("evaluate", groups, out, len(groups))
