"""Terms: the symbols on which the closed loop is run once, so that only its arithmetic is kept.

A `Term` carries + - * / and the functions of `rotorfault.maths.scalar`. Equal operations on equal arguments are the
same term, so what several equations share is computed once. Each term knows its *level*: 0 a number, 1 a function of
the flight's parameters alone, 2 anything that changes during a flight. Terms of level 1 are computed once per flight,
before it begins (see `rotorfault.engine.program`).

A division by a parameter becomes a multiplication by its reciprocal; against plain floats that differs by rounding
only.

As everywhere, a literal zero times anything is zero: sparse matrices cost nothing, and hide a NaN in the other
factor.

What is the same in all flights of a batch is chosen before they fly. A parameter that switches a part of the model
off (`Tape.absent`) is a zero that takes its part of the trace with it. That leaves the numbers as they are to the
last bit, for the rounding of the rest does not change: what was used by that which is gone still counts as used
(`rotorfault.engine.emit.merging`), a product is still rounded before it is added to what is not there, and a sum with
that is not taken for the other summand, which other sums may have.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, Union

from rotorfault.maths import scalar

Operand = Union["Term", float]

_TRUTHS = frozenset(("lt", "le", "and", "not"))
_FUNCTIONS: dict[str, Callable[..., float]] = {
    "sqrt": scalar.sqrt,
    "sin": scalar.sin,
    "cos": scalar.cos,
    "tan": scalar.tan,
    "asin": scalar.asin,
    "atan2": scalar.atan2,
    "exp": scalar.exp,
    "log": scalar.log,
    "tanh": scalar.tanh,
    "round": scalar.nearest,
}


class Tape:
    """All terms of one trace, each once."""

    def __init__(self) -> None:
        self.terms: list[Term] = []
        self._by_key: dict[tuple[Any, ...], Term] = {}

    def term(self, op: str, *args: Any) -> Term:
        """The term of this operation on these arguments (terms; for leaves, numbers)."""
        key = (op, *(arg.index if isinstance(arg, Term) else arg for arg in args))
        term = self._by_key.get(key)
        if term is None:
            term = self._by_key[key] = Term(self, len(self.terms), op, args)
            self.terms.append(term)
        return term

    def constant(self, value: float) -> Term:
        """The term of a number; 0.0 and -0.0 are two."""
        return self.term("const", float(value), math.copysign(1.0, value))

    def absent(self) -> Term:
        """Zero, in place of a parameter that switches a part of the model off in every flight."""
        return self.term("const", 0.0, 1.0, "absent")

    def leaves(self, kind: str, count: int) -> list[Term]:
        """Rows that are read: 'par' (parameters of the flight), 'state', 'shared' (inputs of each step)."""
        return [self.term(kind, i) for i in range(count)]

    def lift(self, value: Operand) -> Term:
        """A term for whatever takes part in an equation."""
        return value if isinstance(value, Term) else self.constant(value)


class Term:
    """A symbol with operators; see the module's docstring."""

    __slots__ = ("args", "index", "level", "op", "tape")
    __array_ufunc__ = None
    __hash__ = object.__hash__

    def __init__(self, tape: Tape, index: int, op: str, args: tuple[Any, ...]) -> None:
        self.tape, self.index, self.op, self.args = tape, index, op, args
        if op == "const":
            self.level = 0
        elif op == "par":
            self.level = 1
        elif isinstance(args[0], Term):
            self.level = max(arg.level for arg in args if isinstance(arg, Term))
        else:
            self.level = 2

    def __repr__(self) -> str:
        inside = ", ".join(f"t{a.index}" if isinstance(a, Term) else repr(a) for a in self.args)
        return f"{self.op}({inside})"

    def __bool__(self) -> bool:
        raise TypeError("a symbol has no truth value; use rotorfault.maths.scalar.select instead of 'if'")

    @property
    def truth(self) -> bool:
        """Whether it is a condition, 1 or 0 by nature."""
        return self.op in _TRUTHS

    @property
    def absent(self) -> bool:
        """Whether it stands for what no flight has."""
        return self.op == "const" and len(self.args) == 3

    @property
    def value(self) -> float | None:
        """The number, for a term of level 0."""
        return self.args[0] if self.op == "const" else None

    def __add__(self, other: Operand) -> Term:
        return add(self, self.tape.lift(other))

    def __radd__(self, other: Operand) -> Term:
        return add(self.tape.lift(other), self)

    def __sub__(self, other: Operand) -> Term:
        return subtract(self, self.tape.lift(other))

    def __rsub__(self, other: Operand) -> Term:
        return subtract(self.tape.lift(other), self)

    def __mul__(self, other: Operand) -> Term:
        return multiply(self, self.tape.lift(other))

    __rmul__ = __mul__

    def __truediv__(self, other: Operand) -> Term:
        return divide(self, self.tape.lift(other))

    def __rtruediv__(self, other: Operand) -> Term:
        return divide(self.tape.lift(other), self)

    def __neg__(self) -> Term:
        return negate(self)


def add(a: Term, b: Term) -> Term:
    """a + b."""
    if b.absent:
        a, b = b, a
    if a.absent:
        return a.tape.term("add", *_ordered(a, b)) if _is_product(b) else a.tape.term("same", b)
    if a.value is not None and b.value is not None:
        return a.tape.constant(a.value + b.value)
    if b.value == 0.0:
        return a
    if a.value == 0.0:
        return b
    if a.op == "neg":
        return subtract(b, a.args[0])
    if b.op == "neg":
        return subtract(a, b.args[0])
    return a.tape.term("add", *_ordered(a, b))


def subtract(a: Term, b: Term) -> Term:
    """a - b."""
    if b.absent:
        return a.tape.term("sub", a, b) if _is_product(a) else a.tape.term("same", a)
    if a.absent:
        return a.tape.term("sub", a, b) if _is_product(b) else a.tape.term("same", negate(b))
    if a.value is not None and b.value is not None:
        return a.tape.constant(a.value - b.value)
    if b.value == 0.0:
        return a
    if a.value == 0.0:
        return negate(b)
    if a.value == 1.0 and b.truth:
        return b.args[0] if b.op == "not" else a.tape.term("not", b)
    if b.op == "neg":
        return add(a, b.args[0])
    return a.tape.term("sub", a, b)


def multiply(a: Term, b: Term) -> Term:
    """a b."""
    if b.absent:
        a, b = b, a
    if a.absent:
        a.tape.term("unused", b)
        return a
    if a.value is not None and b.value is not None:
        return a.tape.constant(a.value * b.value)
    if b.value is not None:
        a, b = b, a
    if a.value is not None:
        if a.value == 0.0:
            return a.tape.constant(0.0)
        if a.value == 1.0:
            return b
        if a.value == -1.0:
            return negate(b)
    if a.truth and b.truth:
        return a.tape.term("and", *_ordered(a, b))
    if a.op == "neg":
        return negate(multiply(a.args[0], b))
    if b.op == "neg":
        return negate(multiply(a, b.args[0]))
    return a.tape.term("mul", *_ordered(a, b))


def divide(a: Term, b: Term) -> Term:
    """a / b; by a parameter or a number it is a product with the reciprocal."""
    if a.absent:
        a.tape.term("unused", b)
        return a
    if a.value is not None and b.value is not None:
        if b.value == 0.0:
            return a.tape.constant(math.nan if a.value == 0.0 or math.isnan(a.value) else a.value * math.inf)
        return a.tape.constant(a.value / b.value)
    if a.value == 0.0:
        return a
    if b.level < 2 and a.value != 1.0:
        return multiply(a, divide(a.tape.constant(1.0), b))
    return a.tape.term("div", a, b)


def negate(a: Term) -> Term:
    """-a."""
    if a.absent:
        return a
    if a.value is not None:
        return a.tape.constant(-a.value)
    if a.op == "neg":
        return a.args[0]  # type: ignore[no-any-return]
    return a.tape.term("neg", a)


def _is_product(a: Term) -> bool:
    """Whether it would be fused into a sum."""
    return (a.args[0] if a.op == "neg" else a).op == "mul"


def _ordered(a: Term, b: Term) -> tuple[Term, Term]:
    """The arguments of a commutative operation in one order, so that a b and b a are one term."""
    return (a, b) if a.index <= b.index else (b, a)


# ------------------------------------------------------------------------------ what `rotorfault.maths.scalar` calls


def _tape_of(*arguments: Operand) -> Tape:
    return next(argument.tape for argument in arguments if isinstance(argument, Term))


def function(name: str, *arguments: Operand) -> Term:
    """A function of `rotorfault.maths.scalar` of terms and numbers."""
    tape = _tape_of(*arguments)
    lifted = [tape.lift(argument) for argument in arguments]
    numbers = [term.value for term in lifted]
    if all(number is not None for number in numbers):
        return tape.constant(_FUNCTIONS[name](*numbers))
    if name in ("sin", "cos") and lifted[0].op == "atan2":
        return _of_an_arc_tangent(name, *lifted[0].args)
    return tape.term(name, *lifted)


def _of_an_arc_tangent(name: str, y: Term, x: Term) -> Term:
    """Sine or cosine of the angle of the point (x, y): a leg of the triangle over its hypotenuse.

    Sensors split attitudes into angles, and controllers join them again; with ideal sensors nothing of that need be
    computed.
    """
    square = x * x + y * y
    at_origin = less_equal(square, 0.0)  # not at NaN, which must come through
    over = 1.0 / function("sqrt", square)
    if name == "sin":
        return y.tape.lift(select(at_origin, 0.0, y * over))
    return y.tape.lift(select(at_origin, 1.0, x * over))


def less(a: Operand, b: Operand) -> Term:
    """Condition a < b."""
    return _compare("lt", a, b, lambda x, y: x < y)


def less_equal(a: Operand, b: Operand) -> Term:
    """Condition a <= b."""
    return _compare("le", a, b, lambda x, y: x <= y)


def _compare(op: str, a: Operand, b: Operand, holds: Callable[[float, float], bool]) -> Term:
    tape = _tape_of(a, b)
    x, y = tape.lift(a), tape.lift(b)
    if x.value is not None and y.value is not None:
        held = holds(x.value, y.value)
        return tape.absent() if not held and (x.absent or y.absent) else tape.constant(1.0 if held else 0.0)
    return tape.term(op, x, y)


def select(condition: Operand, a: Operand, b: Operand) -> Operand:
    """a where the condition is not 0, else b."""
    if not isinstance(condition, Term):
        return a if condition else b
    tape = condition.tape
    if condition.value is not None:
        return a if condition.value else b
    x, y = tape.lift(a), tape.lift(b)
    if x is y:
        return x
    if condition.truth and x.value == 1.0 and y.value == 0.0:
        return condition
    if condition.op == "not":
        condition, x, y = condition.args[0], y, x
    return tape.term("select", condition, x, y)


def minimum(a: Operand, b: Operand) -> Term:
    """The smaller of two, NaN if either is."""
    return _extreme("min", a, b)


def maximum(a: Operand, b: Operand) -> Term:
    """The larger of two, NaN if either is."""
    return _extreme("max", a, b)


def _extreme(op: str, a: Operand, b: Operand) -> Term:
    tape = _tape_of(a, b)
    z: Term
    low: Term
    x, y = _ordered(tape.lift(a), tape.lift(b))
    if x is y:
        return x
    if x.value is not None and y.value is not None:
        return tape.constant((scalar.minimum if op == "min" else scalar.maximum)(x.value, y.value))
    for one, other in ((x, y), (y, x)):
        if op == "min" and one.op == "max":
            # Put between two limits twice, min(max(z, low), high) with z that has been: it is z already.
            for z, low in (one.args, one.args[::-1]):
                if z.op == "min" and other in z.args and any(a.op == "max" and low in a.args for a in z.args):
                    return z
    return tape.term(op, x, y)


def absolute(a: Term) -> Term:
    """Magnitude."""
    if a.absent:
        return a
    return absolute(a.args[0]) if a.op in ("neg", "abs") else a.tape.term("abs", a)
