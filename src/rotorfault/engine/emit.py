"""From terms to straight-line code, and which operations become one."""

from __future__ import annotations

import math
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
    "log": elementary.logarithm_anywhere,
    "tanh": elementary.hyperbolic_tangent,
}


# Terms of a block. With half or twice as many the paper's loop takes 1 % more instructions of the machine, and with
# one block for all 8 % (benchmarks/operations.py).
BLOCK = 200


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
        self._read: set[int] = set()

    def store_all(self, writes: Sequence[tuple[str, int, Term]]) -> None:
        """Write all that some outputs need, in the order in which it was traced, and store them.

        What an equation needs was mostly computed just before it, so that fewer values wait in memory for their use
        than in an order found output by output. An output that takes the place of a number of the state is stored
        once nothing reads that number any more. And what was read is read again in the next block, where it may take
        part in an operation as it lies in memory: kept in between, it would be written and read elsewhere.

        Parameters
        ----------
        writes : sequence of (str, int, Term)
            Pointer, row and value of each output. What lies at ``%state`` is read as leaf ('state', row).
        """
        if not writes:
            return
        tape = writes[0][2].tape
        needed = [
            index for index in self._all_needed(term for _, _, term in writes) if self._computes(tape.terms[index])
        ]
        at = self._when_stored(writes, [tape.terms[index] for index in needed])
        for count, index in enumerate(needed, start=1):
            self._write(tape.terms[index])
            for write in at.pop(index, ()):
                self._store(*write)
            if count % BLOCK == 0:
                self.code.begin_block()
                for read in self._read:
                    del self._numbers[read]
                self._read.clear()
        rest = [(pointer, row, self.number(term)) for late in at.values() for pointer, row, term in late]
        for pointer, row, name in rest:
            self.code.store(name, pointer, row * self.code.lanes)

    def _store(self, pointer: str, row: int, term: Term) -> None:
        self.code.store(self.number(term), pointer, row * self.code.lanes)

    def _all_needed(self, outputs: Iterable[Term]) -> list[int]:
        """Indices of all terms that some outputs need, in order."""
        needed: set[int] = set()
        todo = list(outputs)
        while todo:
            term = todo.pop()
            if term.op == "const" or term.index in needed:
                continue
            needed.add(term.index)
            if term.index not in self._computed:
                todo += self._needed(term)
        return sorted(needed)

    def _computes(self, term: Term) -> bool:
        """Whether a term takes an operation, and is not read."""
        return term.op != "const" and isinstance(term.args[0], Term) and term.index not in self._computed

    def _when_stored(
        self, writes: Iterable[tuple[str, int, Term]], terms: Iterable[Term]
    ) -> dict[float, list[tuple[str, int, Term]]]:
        """What is stored after which term, by its index; infinite for what is stored last of all."""
        last_read: dict[int, float] = {}
        for term in terms:
            for arg in self._needed(term):
                if arg.op == "state":
                    last_read[arg.args[0]] = term.index
        for _, _, term in writes:
            if term.op == "state":
                last_read[term.args[0]] = math.inf
        at: dict[float, list[tuple[str, int, Term]]] = {}
        for pointer, row, term in writes:
            read = last_read.get(row, -1) if pointer == "%state" else -1
            when = max(term.index, read) if self._computes(term) else math.inf
            at.setdefault(when, []).append((pointer, row, term))
        return at

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
                self._read.add(term.index)
            elif not isinstance(term.args[0], Term):
                self._numbers[term.index] = self._leaf(term.op, term.args[0])
                self._read.add(term.index)
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
        if op in ("min", "max"):
            # Parameters are numbers: what is not is refused before the flight.
            a, b = sorted(args, key=lambda arg: arg.level)
            extreme = code.minimum if op == "min" else code.maximum
            return extreme(self._number(a), self._number(b), is_number=a.level < 2)
        numbers = [self._number(a) for a in args]
        if op == "mul":
            return code.op("fmul", *numbers)
        if op == "div":
            if args[1].index in self._merging.divisors:
                return code.op("fmul", numbers[0], code.op("fdiv", code.constant(1.0), numbers[1]))
            return code.op("fdiv", *numbers)
        simple: dict[str, Callable[..., str]] = {
            "neg": code.negative, "sqrt": code.square_root, "abs": code.magnitude, "round": code.nearest,
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
