"""A pure step folded over rows of inputs, compiled: what flies in a loop looks at what was recorded elsewhere.

It is the program of a closed loop without a plant (`rotorfault.engine.program`): memory is its state, each row of
inputs what it shares, and what the step gives are its signals.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, final

import numpy as np

from rotorfault.base.collector import no_collection
from rotorfault.base.versions import source_digest
from rotorfault.engine import cache, native
from rotorfault.engine.machine import Machine, aligned, loaded
from rotorfault.engine.program import Layout, Program, Section, Traced, program
from rotorfault.engine.trace import Tape
from rotorfault.maths.arrays import Array
from rotorfault.maths.records import flatten, leaf_names, statics, unflatten

Step = Callable[[Any, Any, Any], tuple[Any, Any]]
"""Takes memory, inputs and parameters; gives memory and output. Pure, on scalars."""


@final
class Fold:
    """A step with its memory.

    Parameters
    ----------
    step : callable
        See `Step`.
    memory : record
        To begin with.
    inputs : record
        Gives the shape of a row; its numbers are ignored.
    parameters : record
    words : sequence of str, optional
        All that decides what the step computes, besides the source of this package and the shapes; where given, it
        need not be traced again once it is kept.

    Raises
    ------
    TypeError
        If the step does what cannot be traced, such as to branch on a value.
    """

    def __init__(
        self, step: Step, memory: Any, inputs: Any, parameters: Any, words: Sequence[str] | None = None
    ) -> None:
        def written() -> Program:
            with no_collection():
                return _program(step, memory, inputs, parameters)

        made: Program | None = None
        if words is None:
            made = written()
            name = cache.key_of_program(made.text, native.compiler())
        else:
            records = (memory, inputs, parameters)
            shapes = repr([(leaf_names(one), statics(one)) for one in records])
            name = cache.digest_of("fold", source_digest(), native.compiler(), shapes, *words)
        self._name, self._written = name, lambda: made or written()
        self._memory, lanes = memory, native.lanes()
        self._prepared = self._machine(0).prepare(_spread(np.array(flatten(parameters), dtype=float), lanes))
        self._state = _spread(np.array(flatten(memory), dtype=float), lanes)

    def _machine(self, steps: int) -> Machine:
        return loaded(self._name, self._written, "the step", steps)

    @property
    def memory(self) -> Any:
        """As it is now."""
        return unflatten(self._memory, self._state[0, :, 0].tolist())

    def __call__(self, rows: Array) -> Array:
        """Go on.

        Parameters
        ----------
        rows : ndarray, shape (steps, leaves of the inputs)

        Returns
        -------
        ndarray, shape (steps, leaves of the output)
        """
        machine = self._machine(len(rows))
        out = aligned((1, len(rows), machine.layout.signals, machine.lanes))
        machine.fly(self._state, self._prepared, np.ascontiguousarray(rows, dtype=float), out)
        return np.ascontiguousarray(out[0, :, :, 0])


def _spread(numbers: Array, lanes: int) -> Array:
    """Numbers of one in the layout of a machine: the same in every lane."""
    out = aligned((1, len(numbers), lanes))
    out[:] = numbers[None, :, None]
    return out


def _program(step: Step, memory: Any, inputs: Any, parameters: Any) -> Program:
    tape = Tape()
    before = unflatten(memory, tape.leaves("state", len(flatten(memory))))
    row = unflatten(inputs, tape.leaves("shared", len(flatten(inputs))))
    numbers = unflatten(parameters, tape.leaves("par", len(flatten(parameters))))
    after, output = step(before, row, numbers)
    writes = [("%state", k, tape.lift(x)) for k, x in enumerate(flatten(after))]
    signals = [tape.lift(x) for x in flatten(output)]
    layout = Layout(len(flatten(parameters)), 0, len(writes), len(flatten(inputs)), len(signals))
    return program(Traced((Section(tape, writes, signals),), 1, layout), native.lanes(), with_signals=True)
