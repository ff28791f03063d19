"""Any pure function on records as machine code: traced once, compiled, called on arrays of arguments."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from typing import Any, final

import numpy as np

from rotorfault.engine import native
from rotorfault.engine.batch import Array
from rotorfault.engine.code import Code, declarations
from rotorfault.engine.emit import Emitter, Leaf, merging
from rotorfault.engine.machine import aligned, grouped, ungrouped
from rotorfault.engine.trace import Tape
from rotorfault.records import flatten, unflatten


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
        text = _MODULE.format(
            declarations="\n".join(declarations(lanes)),
            code="\n".join(code.lines),
            read=len(leaves) * lanes,
            written=len(outputs) * lanes,
        )
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


_MODULE = """
{declarations}

define void @evaluate(ptr noalias readonly %in0, ptr noalias %out0, i64 %groups) {{
entry:
  br label %each
each:
  %g = phi i64 [ 0, %entry ], [ %g1, %each ]
  %in_at = mul i64 %g, {read}
  %in = getelementptr inbounds double, ptr %in0, i64 %in_at
  %out_at = mul i64 %g, {written}
  %out = getelementptr inbounds double, ptr %out0, i64 %out_at
{code}
  %g1 = add i64 %g, 1
  %more = icmp slt i64 %g1, %groups
  br i1 %more, label %each, label %done
done:
  ret void
}}
"""
