"""From terms to LLVM's intermediate language: straight-line code on vectors of doubles, one flight per lane.

No flag allows the compiler to change a rounding, so that the same terms give the same bits whatever else is computed
beside them.
"""

from __future__ import annotations

import struct
from collections import Counter
from collections.abc import Iterable, Sequence
from typing import NamedTuple

from rotorfault.engine import elementary
from rotorfault.engine.trace import Term

_FUNCTIONS = {
    "sin": elementary.sine,
    "cos": elementary.cosine,
    "tan": elementary.tangent,
    "asin": elementary.arc_sine,
    "atan2": elementary.arc_tangent,
    "exp": elementary.exponential,
    "tanh": elementary.hyperbolic_tangent,
}
FLOPS = {"fma": 2, "fadd": 1, "fsub": 1, "fmul": 1, "fdiv": 1, "sqrt": 1}


class Code:
    """Straight-line code. Values are names; an instruction written twice is one.

    Parameters
    ----------
    lanes : int
        Flights per vector.
    prefix : str
        Of the names.
    """

    def __init__(self, lanes: int, prefix: str = "v") -> None:
        self.lanes, self._prefix = lanes, prefix
        self.vector, self.mask, self.integers = f"<{lanes} x double>", f"<{lanes} x i1>", f"<{lanes} x i64>"
        self.lines: list[str] = []
        self.counts: Counter[str] = Counter()
        self._names: dict[str, str] = {}

    def value(self, instruction: str, sort: str | None = None) -> str:
        """The name of what an instruction gives."""
        name = self._names.get(instruction)
        if name is None:
            name = self._names[instruction] = f"%{self._prefix}{len(self._names)}"
            self.lines.append(f"  {name} = {instruction}")
            self.counts[sort or instruction.partition(" ")[0]] += 1
        return name

    def constant(self, number: float) -> str:
        """A number in all lanes."""
        bits = struct.unpack("<Q", struct.pack("<d", number))[0]
        return f"splat (double 0x{bits:016X})"

    def integer(self, number: int) -> str:
        """A whole number in all lanes."""
        return f"splat (i64 {number})"

    def op(self, name: str, a: str, b: str) -> str:
        """fadd, fsub, fmul or fdiv."""
        return self.value(f"{name} {self.vector} {a}, {b}")

    def fma(self, a: str, b: str, c: str) -> str:
        """a b + c, rounded once."""
        v = self.vector
        return self.value(f"call {v} @llvm.fma.v{self.lanes}f64({v} {a}, {v} {b}, {v} {c})", "fma")

    def negative(self, a: str) -> str:
        """-a."""
        return self.value(f"fneg {self.vector} {a}")

    def _call(self, function: str, *arguments: str, sort: str) -> str:
        inside = ", ".join(f"{self.vector} {a}" for a in arguments)
        return self.value(f"call {self.vector} @llvm.{function}.v{self.lanes}f64({inside})", sort)

    def square_root(self, a: str) -> str:
        """sqrt a; NaN below zero."""
        return self._call("sqrt", a, sort="sqrt")

    def magnitude(self, a: str) -> str:
        """|a|."""
        return self._call("fabs", a, sort="logic")

    def with_sign_of(self, a: str, b: str) -> str:
        """a with the sign of b."""
        return self._call("copysign", a, b, sort="logic")

    def nearest(self, a: str) -> str:
        """The nearest whole number, the even one of two."""
        return self._call("rint", a, sort="round")

    def compare(self, predicate: str, a: str, b: str) -> str:
        """A mask: olt, ole, ogt, oeq, une, uno ..."""
        return self.value(f"fcmp {predicate} {self.vector} {a}, {b}")

    def compare_integer(self, predicate: str, a: str, b: str) -> str:
        """A mask: eq, ne, slt ..."""
        return self.value(f"icmp {predicate} {self.integers} {a}, {b}", "logic")

    def select(self, mask: str, a: str, b: str, kind: str = "number") -> str:
        """a where the mask is set, else b."""
        of = self.vector if kind == "number" else self.mask
        return self.value(f"select {self.mask} {mask}, {of} {a}, {of} {b}")

    def minimum(self, a: str, b: str) -> str:
        """The smaller; NaN if either is."""
        return self._extreme("olt", a, b)

    def maximum(self, a: str, b: str) -> str:
        """The larger; NaN if either is."""
        return self._extreme("ogt", a, b)

    def _extreme(self, predicate: str, a: str, b: str) -> str:
        # One instruction, which gives b where either is NaN: a number can be no NaN, and so stands first.
        if b.startswith("splat"):
            a, b = b, a
        taken = self.select(self.compare(predicate, a, b), a, b)
        return taken if a.startswith("splat") else self.select(self.compare("uno", a, a), a, taken)

    def integer_op(self, name: str, a: str, b: str) -> str:
        """add, sub, and, xor, shl, ashr."""
        return self.value(f"{name} {self.integers} {a}, {b}", "logic")

    def bits(self, a: str) -> str:
        """The bits of numbers as whole numbers."""
        return self.value(f"bitcast {self.vector} {a} to {self.integers}", "none")

    def number(self, a: str) -> str:
        """Numbers of their bits."""
        return self.value(f"bitcast {self.integers} {a} to {self.vector}", "none")

    def bit_set(self, a: str, bit: int) -> str:
        """A mask: whether a bit of whole numbers is set."""
        return self.compare_integer("ne", self.integer_op("and", a, self.integer(bit)), self.integer(0))

    def load(self, pointer: str, offset: int) -> str:
        """A vector at an offset in doubles."""
        place = self.value(f"getelementptr inbounds double, ptr {pointer}, i64 {offset}", "none")
        return self.value(f"load {self.vector}, ptr {place}, align 64")

    def broadcast(self, pointer: str, offset: int) -> str:
        """One double at an offset in all lanes."""
        place = self.value(f"getelementptr inbounds double, ptr {pointer}, i64 {offset}", "none")
        return self.in_all_lanes(self.value(f"load double, ptr {place}, align 8"))

    def in_all_lanes(self, one: str) -> str:
        """One double in all lanes."""
        none = f"{self.vector} poison"
        first = self.value(f"insertelement {none}, double {one}, i64 0", "none")
        zeros = f"<{self.lanes} x i32> zeroinitializer"
        return self.value(f"shufflevector {self.vector} {first}, {none}, {zeros}", "none")

    def store(self, number: str, pointer: str, offset: int) -> None:
        """Write a vector at an offset in doubles."""
        place = self.value(f"getelementptr inbounds double, ptr {pointer}, i64 {offset}", "none")
        self.lines.append(f"  store {self.vector} {number}, ptr {place}, align 64")
        self.counts["store"] += 1


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
    given : dict
        Term indices that are read as leaf ('par', row): computed before.
    merging : Merging
        Which operations become one.
    """

    def __init__(
        self, code: Code, leaves: dict[str, Leaf], given: dict[int, int], merging: Merging
    ) -> None:
        self.code, self._leaves, self._given, self._merging = code, leaves, given, merging
        self._numbers: dict[int, str] = {}
        self._masks: dict[int, str] = {}

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

    def _write(self, wanted: Term) -> None:
        """Write a term and all that it needs, arguments first; without recursion, for chains are long."""
        todo = [wanted]
        while todo:
            term = todo[-1]
            if term.op == "const" or term.index in self._numbers or term.index in self._masks:
                todo.pop()
                continue
            if term.index in self._given:
                self._numbers[term.index] = self._leaf("par", self._given[term.index])
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
        return list(term.args)

    def _there(self, term: Term) -> bool:
        return term.op == "const" or term.index in self._numbers or term.index in self._masks

    def _leaf(self, kind: str, row: int) -> str:
        leaf, code = self._leaves[kind], self.code
        if leaf.in_register:
            return code.in_all_lanes(leaf.place)
        return code.broadcast(leaf.place, row) if leaf.one_for_all else code.load(leaf.place, row * code.lanes)

    def _compute(self, term: Term) -> None:
        code, op, args = self.code, term.op, term.args
        if op in ("lt", "le"):
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

    def _arithmetic(self, op: str, args: tuple[Term, ...]) -> str:
        code = self.code
        if op in ("add", "sub"):
            return self._sum(op, *args)
        numbers = [self._number(a) for a in args]
        if op == "mul":
            return code.op("fmul", *numbers)
        if op == "div":
            if args[1].index in self._merging.divisors:
                return code.op("fmul", numbers[0], code.op("fdiv", code.constant(1.0), numbers[1]))
            return code.op("fdiv", *numbers)
        simple = {
            "neg": code.negative, "sqrt": code.square_root, "abs": code.magnitude,
            "min": code.minimum, "max": code.maximum, "round": code.nearest,
        }  # fmt: skip
        if op in simple:
            return simple[op](*numbers)  # type: ignore[operator]
        return _FUNCTIONS[op](code, *numbers)  # type: ignore[operator]


    def _sum(self, op: str, a: Term, b: Term) -> str:
        code, products = self.code, self._merging.products
        if a.index in products:
            c = self._number(b)
            return code.fma(*map(self._number, a.args), c if op == "add" else code.negative(c))
        if b.index in products:
            first, second = map(self._number, b.args)
            return code.fma(first if op == "add" else code.negative(first), second, self._number(a))
        return code.op("fadd" if op == "add" else "fsub", self._number(a), self._number(b))


def declarations(lanes: int) -> Iterable[str]:
    """Declarations of the intrinsics that `Code` calls."""
    v = f"<{lanes} x double>"
    for name, count in (("fma", 3), ("sqrt", 1), ("fabs", 1), ("copysign", 2), ("rint", 1)):
        yield f"declare {v} @llvm.{name}.v{lanes}f64({', '.join([v] * count)})"
