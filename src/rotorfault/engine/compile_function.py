"""Any pure function on records, compiled as the closed loop is: for measurements and for use outside a flight."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import heyoka as hy
import numpy as np

from rotorfault.engine.batch import Array
from rotorfault.records import flatten, unflatten


def compile_function(function: Callable[..., Any], template_inputs: tuple[Any, ...]) -> Callable[..., Array]:
    """Compile a pure function on scalars for SIMD lanes.

    Parameters
    ----------
    function : callable
        Takes records and returns a record, by the functions of `rotorfault.scalar` and + - * / alone.
    template_inputs : tuple of records
        One per argument of the function. They give the shape; their numbers are ignored.

    Returns
    -------
    callable
        ``compiled(rows, outputs=None)`` takes an array (leaves of the inputs, N), or (leaves,) for a single case, in
        the order of `rotorfault.records.flatten`, and returns (leaves of the result, N) or (leaves,), written to
        `outputs` where given. Both must be contiguous and of float64. N should be a multiple of the number of lanes
        where results have to be the same to the last bit in any batch.
    """
    symbols = [hy.expression(f"x{i:03d}") for i in range(len(flatten(template_inputs)))]
    found = flatten(function(*unflatten(template_inputs, symbols)))
    compiled = hy.cfunc([x if isinstance(x, hy.expression) else hy.expression(float(x)) for x in found], symbols)

    def call(rows: Array, outputs: Array | None = None) -> Array:
        if outputs is None:
            return np.asarray(compiled(rows))
        compiled(rows, outputs=outputs)
        return outputs

    return call
