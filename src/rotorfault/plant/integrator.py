r"""The classical fourth-order Runge-Kutta step, on records.

.. math:: x_{n+1} = x_n + \frac{h}{6}(k_1 + 2k_2 + 2k_3 + k_4)

Source: W. Kutta, "Beitrag zur näherungsweisen Integration totaler Differentialgleichungen", 1901. A fixed step, so
that every engine runs the same sequence of operations.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

from rotorfault.maths.records import flatten, unflatten
from rotorfault.maths.scalar import Scalar

R = TypeVar("R")
U = TypeVar("U")

# Multiplied, not divided: compiled code turns a division by a number into this, and then all engines round alike.
_SIXTH = 1.0 / 6.0


def rk4(derivative: Callable[[R, U], R], state: R, inputs: tuple[U, U, U], dt: Scalar) -> R:
    """State after one step.

    Parameters
    ----------
    derivative : callable
        Gives the time derivative of a state, as a record of the same shape, for a state and an input.
    state : record
    inputs : (3,) tuple
        What drives the system at the beginning, in the middle and at the end of the step.
    dt : scalar, s
        Step size.

    Returns
    -------
    record
        Of the shape of `state`; the local error is of order dt^5.
    """
    half, sixth = 0.5 * dt, _SIXTH * dt
    first, middle, last = inputs
    x = flatten(state)

    def ahead(k: list[Scalar], h: Scalar) -> R:
        return unflatten(state, [a + h * b for a, b in zip(x, k, strict=True)])

    k1 = flatten(derivative(state, first))
    k2 = flatten(derivative(ahead(k1, half), middle))
    k3 = flatten(derivative(ahead(k2, half), middle))
    k4 = flatten(derivative(ahead(k3, dt), last))
    slopes = [a + 2.0 * (b + c) + d for a, b, c, d in zip(k1, k2, k3, k4, strict=True)]
    return ahead(slopes, sixth)
