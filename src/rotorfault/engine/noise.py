r"""Random numbers of flights: standard normal numbers as a function of (seed, flight index, stream, step, number).

A counter-based generator, Threefry-2x64 with 20 rounds (Salmon, Moraes, Dror and Shaw, "Parallel random numbers: as
easy as 1, 2, 3", SC 2011), with the seed and the index of the flight as key and the step, the stream and the block of
numbers as counter: no state, so that flight 4711 alone has the numbers that it has in any batch, and any step can be
drawn without those before it. Each 64-bit word gives two uniform numbers of 32 bits and these, by Box and Muller,

.. math:: n_1 = \sqrt{-2\ln u_1}\,\cos 2\pi u_2, \qquad n_2 = \sqrt{-2\ln u_1}\,\sin 2\pi u_2

two normal ones, none of which is beyond 6.8 standard deviations. Here is the generator on NumPy arrays; machine code
has the same in `rotorfault.engine.random_code`, so that it need not be read from memory.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, final

import numpy as np
from numpy.typing import NDArray

from rotorfault.maths.arrays import Array

Words = NDArray[np.uint64]

ROTATIONS = (16, 42, 12, 31, 16, 32, 24, 21)
PARITY = 0x1BD11BDAA9FC1A22
ROUNDS = 20
PER_BLOCK = 4  # normal numbers of one call of the generator


class Stream(NamedTuple):
    """One of the streams of normal numbers of a flight."""

    width: int  # numbers a step
    word: int  # tells it from the others of the same flight


def counter_word(stream: Stream, block: int) -> int:
    """The second word of the counter; the first is the step."""
    return stream.word << 32 | block


def threefry(step: Words, second: Words, seed: Words, index: Words) -> tuple[Words, Words]:
    """Two random words for a counter (step, second) and a key (seed, index); broadcasts."""
    with np.errstate(over="ignore"):
        keys = (seed, index, np.uint64(PARITY) ^ seed ^ index)
        a, b = step + keys[0], second + keys[1]
        for r in range(ROUNDS):
            turn = ROTATIONS[r % 8]
            a = a + b
            b = a ^ (b << np.uint64(turn) | b >> np.uint64(64 - turn))
            if r % 4 == 3:
                s = (r + 1) // 4
                a, b = a + keys[s % 3], b + keys[(s + 1) % 3] + np.uint64(s)
    return a, b


def normals(seeds: Sequence[tuple[int, int]], stream: Stream, first: int, steps: int) -> Array:
    """Numbers of some steps of some flights.

    Parameters
    ----------
    seeds : sequence of (int, int)
        (Seed, index) of each flight.
    stream : Stream
    first, steps : int
        Number of the first step, and how many.

    Returns
    -------
    ndarray, shape (steps, numbers of the stream, N)
    """
    keys = np.array(seeds, dtype=np.uint64).reshape(-1, 2)
    step = np.arange(first, first + steps, dtype=np.uint64)[:, None]
    pairs: list[Array] = []
    for block in range(-(-stream.width // PER_BLOCK)):
        second = np.array(counter_word(stream, block), dtype=np.uint64)
        for word in threefry(step, second, keys[:, 0], keys[:, 1]):
            u1 = ((word >> np.uint64(32)).astype(np.float64) + 0.5) * 2.0**-32
            angle = (word & np.uint64(0xFFFFFFFF)).astype(np.float64) * (2.0**-31 * np.pi)
            radius = np.sqrt(-2.0 * np.log(u1))
            pairs += [radius * np.cos(angle), radius * np.sin(angle)]
    return np.stack(pairs[: stream.width], axis=1)


@final
class Noise:
    """The numbers of one stream of some flights, drawn in order of steps, in whatever pieces."""

    def __init__(self, seeds: Sequence[tuple[int, int]], stream: Stream) -> None:
        self._seeds, self._stream, self._step = seeds, stream, 0

    def draw(self, steps: int) -> Array:
        """Numbers of the next steps, shape (steps, numbers of the stream, N)."""
        first, self._step = self._step, self._step + steps
        return normals(self._seeds, self._stream, first, steps)
