"""Straight-line code in LLVM's intermediate language, on vectors of doubles, one flight per lane.

No flag allows the compiler to change a rounding, so that the same operations give the same bits whatever else is
computed beside them.
"""

from __future__ import annotations

import struct
from collections import Counter
from collections.abc import Iterable

NEVER = "%never"
"""A condition that never holds, which the compiler does not know; of functions with blocks."""
READING = ("load", "getelementptr", "insertelement", "shufflevector")


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
        self._read: list[str] = []  # instructions of this block that read memory, or what such a one gave
        self._written = 0

    def value(self, instruction: str, sort: str | None = None) -> str:
        """The name of what an instruction gives."""
        name = self._names.get(instruction)
        if name is None:
            name = self._names[instruction] = f"%{self._prefix}{self._written}"
            self._written += 1
            self.lines.append(f"  {name} = {instruction}")
            if instruction.startswith(READING):
                self._read.append(instruction)
            self.counts[sort or instruction.partition(" ")[0]] += 1
        return name

    def begin_block(self) -> None:
        """Begin a block, in which what was read from memory before is read again.

        Between the blocks is a way out that is never taken (`NEVER`): the compiler would join them otherwise.
        """
        label = f"{self._prefix}b{self._written}"
        self._written += 1
        self.lines += [f"  br i1 {NEVER}, label %done, label %{label}", f"{label}:"]
        for instruction in self._read:
            del self._names[instruction]
        self._read.clear()

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

    def minimum(self, a: str, b: str, is_number: bool = False) -> str:
        """The smaller; NaN if either is. Of a it may be known that it is a number."""
        return self._extreme("olt", a, b, is_number)

    def maximum(self, a: str, b: str, is_number: bool = False) -> str:
        """The larger; NaN if either is. Of a it may be known that it is a number."""
        return self._extreme("ogt", a, b, is_number)

    def _extreme(self, predicate: str, a: str, b: str, is_number: bool) -> str:
        # One instruction, which gives b where either is NaN: what can be no NaN stands first.
        if b.startswith("splat"):
            a, b = b, a
        taken = self.select(self.compare(predicate, a, b), a, b)
        known = is_number or a.startswith("splat")
        return taken if known else self.select(self.compare("uno", a, a), a, taken)

    def integer_op(self, name: str, a: str, b: str) -> str:
        """add, sub, and, or, xor, shl, lshr, ashr."""
        return self.value(f"{name} {self.integers} {a}, {b}", "logic")

    def rotated(self, a: str, left: int) -> str:
        """Whole numbers with their bits turned to the left."""
        n, v = self.lanes, self.integers
        return self.value(f"call {v} @llvm.fshl.v{n}i64({v} {a}, {v} {a}, {v} {self.integer(left)})", "logic")

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
        return self.value(f"load {self.vector}, ptr {place}, align {8 * self.lanes}")

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
        self.lines.append(f"  store {self.vector} {number}, ptr {place}, align {8 * self.lanes}")
        self.counts["store"] += 1


def declarations(lanes: int) -> Iterable[str]:
    """Declarations of the intrinsics that `Code` calls."""
    v = f"<{lanes} x double>"
    for name, count in (("fma", 3), ("sqrt", 1), ("fabs", 1), ("copysign", 2), ("rint", 1)):
        yield f"declare {v} @llvm.{name}.v{lanes}f64({', '.join([v] * count)})"
    whole = f"<{lanes} x i64>"
    yield f"declare {whole} @llvm.fshl.v{lanes}i64({whole}, {whole}, {whole})"


def over_groups(name: str, argument: str, read: int, written: int, lines: Iterable[str]) -> str:
    """A function that does the same for each group of lanes.

    Parameters
    ----------
    name : str
    argument : str
        Name of the pointer that `lines` read from; they write to ``%out``.
    read, written : int
        Numbers of a group there.
    lines : iterable of str
    """
    body = "\n".join(lines)
    return f"""
define void @{name}(ptr noalias readonly %{argument}0, ptr noalias %out0, i64 %groups) {{
entry:
  br label %each
each:
  %g = phi i64 [ 0, %entry ], [ %g1, %each ]
  %{argument}_at = mul i64 %g, {read}
  %{argument} = getelementptr inbounds double, ptr %{argument}0, i64 %{argument}_at
  %out_at = mul i64 %g, {written}
  %out = getelementptr inbounds double, ptr %out0, i64 %out_at
{body}
  %g1 = add i64 %g, 1
  %more = icmp slt i64 %g1, %groups
  br i1 %more, label %each, label %done
done:
  ret void
}}
"""
