"""The normal numbers of `rotorfault.engine.noise` as straight-line vector code: no memory, no state, no branch."""

from __future__ import annotations

from rotorfault.engine.code import Code
from rotorfault.engine.elementary import logarithm, sine_and_cosine_of_turn
from rotorfault.engine.noise import PARITY, PER_BLOCK, ROTATIONS, ROUNDS, Stream, counter_word

_WHOLE = 2.0**52  # added to a whole number below it, leaves it in the lowest bits


def normal(code: Code, seed: str, index: str, step: str, stream: Stream, number: int) -> str:
    """One of the numbers of a stream at a step.

    Parameters
    ----------
    code : Code
    seed, index, step : str
        Whole numbers, 0 to 2^52, as doubles.
    stream : Stream
    number : int
        Which of the stream's.
    """
    block, place = divmod(number, PER_BLOCK)
    words = _threefry(code, _bits(code, step), counter_word(stream, block), _bits(code, seed), _bits(code, index))
    word = words[place // 2]
    # 32 bits each, put under the exponent of 2^52.
    exponent = code.integer(0x4330 << 48)
    high = code.number(code.integer_op("or", code.integer_op("lshr", word, code.integer(32)), exponent))
    low = code.number(code.integer_op("or", code.integer_op("and", word, code.integer(0xFFFFFFFF)), exponent))
    whole, scale = code.constant(_WHOLE), code.constant(2.0**-32)
    u1 = code.op("fmul", code.op("fadd", code.op("fsub", high, whole), code.constant(0.5)), scale)
    turn = code.op("fmul", code.op("fsub", low, whole), scale)
    radius = code.square_root(code.op("fmul", logarithm(code, u1), code.constant(-2.0)))
    sine, cosine = sine_and_cosine_of_turn(code, turn)
    return code.op("fmul", radius, sine if place % 2 else cosine)


def _bits(code: Code, whole: str) -> str:
    """A whole number below 2^52 as an integer."""
    shifted = code.bits(code.op("fadd", whole, code.constant(_WHOLE)))
    return code.integer_op("and", shifted, code.integer((1 << 52) - 1))


def _threefry(code: Code, step: str, second: int, seed: str, index: str) -> tuple[str, str]:
    def add(a: str, b: str) -> str:
        return code.integer_op("add", a, b)

    parity = code.integer_op("xor", code.integer(PARITY), code.integer_op("xor", seed, index))
    keys = (seed, index, parity)
    a, b = add(step, seed), add(index, code.integer(second))
    for r in range(ROUNDS):
        a = add(a, b)
        b = code.integer_op("xor", code.rotated(b, ROTATIONS[r % 8]), a)
        if r % 4 == 3:
            s = (r + 1) // 4
            a, b = add(a, keys[s % 3]), add(add(b, keys[(s + 1) % 3]), code.integer(s))
    return a, b
