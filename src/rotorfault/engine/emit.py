"""From terms to straight-line code, and which operations become one."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from typing import Any, NamedTuple

from rotorfault.engine import elementary
from rotorfault.engine.code import Code
from rotorfault.engine.noise import Stream
from rotorfault.engine.random_code import normal
from rotorfault.engine.trace import Term

_FUNCTIONS: dict[str, Callable[..., str]] = {
    "sin": elementary.sine,
    "cos": elementary.cosine,
    "tan": elementary.tangent,
    "asin": elementary.arc_sine,
    "atan2": elementary.arc_tangent,
    "exp": elementary.exponential,
    "tanh": elementary.hyperbolic_tangent,
}


class Leaf(NamedTuple):
    """Where a kind of leaf is read from."""

    place: str  # pointer, or the register itself
    one_for_all: bool = False  # one double for all lanes
    in_register: bool = False


class Merging(NamedTuple):
    """Indices of terms that are not computed by themselves.

    How a number is rounded must not depend on what else is wanted of a trace, or a recorded flight would differ from
    one that is not: this is decided once, on the whole trace, and never by the compiler.
    """

    products: frozenset[int]  # fused into the one sum that uses them
    divisors: frozenset[int]  # of several quotients: one reciprocal serves them all


def merging(terms: Sequence[Term], outputs: Iterable[Term]) -> Merging:
    """What is merged in a trace with these terms and these outputs, whether wanted or not."""
    uses = Counter(term.index for term in outputs)
    divisors: Counter[int] = Counter()
    for term in terms:
        uses.update(arg.index for arg in term.args if isinstance(arg, Term))
        if term.op == "div" and term.level == 2:
            divisors[term.args[1].index] += 1
    return Merging(
        # A product that others see rounded is rounded for its sum too: a b - min(a b, c) is then never below zero.
        frozenset(t.index for t in terms if t.op == "mul" and t.level == 2 and uses[t.index] == 1),
        frozenset(index for index, count in divisors.items() if count > 1),
    )


class Emitter:
    """Writes terms into code, each once.

    Parameters
    ----------
    code : Code
    leaves : dict of Leaf
        Where each kind of leaf ('par', 'state', ...) is read from.
    computed : dict
        Term indices that are read as leaf ('par', row): computed before.
    merging : Merging
        Which operations become one.
    """

    def __init__(self, code: Code, leaves: dict[str, Leaf], computed: dict[int, int], merging: Merging) -> None:
        self.code, self._leaves, self._computed, self._merging = code, leaves, computed, merging
        self._numbers: dict[int, str] = {}
        self._masks: dict[int, str] = {}

    def write_all(self, outputs: Iterable[Term]) -> None:
        """Write all that some outputs need, in the order in which it was traced.

        What an equation needs was mostly computed just before it, so that fewer values wait in memory for their use
        than in an order found output by output.
        """
        needed: set[int] = set()
        todo = list(outputs)
        while todo:
            term = todo.pop()
            if term.op == "const" or term.index in needed:
                continue
            needed.add(term.index)
            if term.index not in self._computed:
                todo += [a for a in self._needed(term) if isinstance(a, Term)]
        tape = next(iter(outputs)).tape if needed else None
        for index in sorted(needed):
            assert tape is not None
            term = tape.terms[index]
            if isinstance(term.args[0], Term) and index not in self._computed:
                self._write(term)

    def number(self, term: Term) -> str:
        """The name of a term's value."""
        self._write(term)
        return self._number(term)

    def _number(self, term: Term) -> str:
        if term.op == "const":
            return self.code.constant(term.args[0])
        if term.index in self._numbers:
            return self._numbers[term.index]
        code = self.code  # a condition that is used as a number
        name = code.select(self._masks[term.index], code.constant(1.0), code.constant(0.0))
        self._numbers[term.index] = name
        return name

    def _mask(self, term: Term) -> str:
        if term.index not in self._masks:
            self._masks[term.index] = self.code.compare("une", self._number(term), self.code.constant(0.0))
        return self._masks[term.index]

    def _write(self, root: Term) -> None:
        """Write a term and all that it needs, arguments first; without recursion, for chains are long."""
        todo = [root]
        while todo:
            term = todo[-1]
            if term.op == "const" or term.index in self._numbers or term.index in self._masks:
                todo.pop()
                continue
            if term.index in self._computed:
                self._numbers[term.index] = self._leaf("par", self._computed[term.index])
            elif not isinstance(term.args[0], Term):
                self._numbers[term.index] = self._leaf(term.op, term.args[0])
            else:
                missing = [a for a in self._needed(term) if not self._there(a)]
                if missing:
                    todo += reversed(missing)
                    continue
                self._compute(term)
            todo.pop()

    def _needed(self, term: Term) -> list[Term]:
        """The terms whose values an operation takes."""
        if term.op in ("add", "sub"):
            fused = next((a for a in term.args if a.index in self._merging.products), None)
            if fused is not None:
                return [*fused.args, *(a for a in term.args if a is not fused)]
        return [a for a in term.args if isinstance(a, Term)]

    def _there(self, term: Term) -> bool:
        return term.op == "const" or term.index in self._numbers or term.index in self._masks

    def _leaf(self, kind: str, row: int) -> str:
        leaf, code = self._leaves[kind], self.code
        if leaf.in_register:
            return code.in_all_lanes(leaf.place)
        return code.broadcast(leaf.place, row) if leaf.one_for_all else code.load(leaf.place, row * code.lanes)

    def _compute(self, term: Term) -> None:
        code, op, args = self.code, term.op, term.args
        if op == "same":
            self._numbers[term.index] = self._number(args[0])
        elif op in ("lt", "le"):
            a, b = (self._number(x) for x in args)
            self._masks[term.index] = code.compare("olt" if op == "lt" else "ole", a, b)
        elif op == "and":
            a, b = (self._mask(x) for x in args)
            self._masks[term.index] = code.value(f"and {code.mask} {a}, {b}", "logic")
        elif op == "not":
            self._masks[term.index] = code.value(f"xor {code.mask} {self._mask(args[0])}, splat (i1 true)", "logic")
        elif op == "select":
            self._numbers[term.index] = code.select(self._mask(args[0]), self._number(args[1]), self._number(args[2]))
        else:
            self._numbers[term.index] = self._arithmetic(op, args)

    def _arithmetic(self, op: str, args: tuple[Any, ...]) -> str:
        code = self.code
        if op in ("add", "sub"):
            return self._sum(op, *args)
        if op == "normal":
            seed, index, step = (self._number(a) for a in args[:3])
            width, word, number = args[3:]
            return normal(code, seed, index, step, Stream(width, word), number)
        numbers = [self._number(a) for a in args]
        if op == "mul":
            return code.op("fmul", *numbers)
        if op == "div":
            if args[1].index in self._merging.divisors:
                return code.op("fmul", numbers[0], code.op("fdiv", code.constant(1.0), numbers[1]))
            return code.op("fdiv", *numbers)
        simple: dict[str, Callable[..., str]] = {
            "neg": code.negative, "sqrt": code.square_root, "abs": code.magnitude, "min": code.minimum,
            "max": code.maximum, "round": code.nearest,
        }  # fmt: skip
        return simple[op](*numbers) if op in simple else _FUNCTIONS[op](code, *numbers)

    def _sum(self, op: str, a: Term, b: Term) -> str:
        code, products = self.code, self._merging.products
        if a.index in products:
            c = self._number(b)
            first, second = map(self._number, a.args)
            return code.fma(first, second, c if op == "add" else code.negative(c))
        if b.index in products:
            first, second = map(self._number, b.args)
            return code.fma(first if op == "add" else code.negative(first), second, self._number(a))
        return code.op("fadd" if op == "add" else "fsub", self._number(a), self._number(b))
