"""Random numbers: the generator's published answers, their distribution, and the same numbers in machine code."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from rotorfault.engine.noise import Noise, Stream, counter_word, normals, threefry
from rotorfault.plant import SENSORS, WIND, Dryden
from rotorfault.plant.sensors import Noisy

SENSOR_NOISE = Stream(Noisy.normals, SENSORS.streams[0])
GUSTS = Stream(Dryden.normals, WIND.streams[0])
FIRST_GUST = Stream(Dryden.first_normals, WIND.streams[1])


@pytest.mark.parametrize(
    ("counter", "key", "answer"),
    [
        # Known answers of Threefry-2x64 with 20 rounds, as its authors give them.
        ((0, 0), (0, 0), (0xC2B6E3A8C2C69865, 0x6F81ED42F350084D)),
        ((2**64 - 1, 2**64 - 1), (2**64 - 1, 2**64 - 1), (0xE02CB7C4D95D277A, 0xD06633D0893B8B68)),
        (
            (0x243F6A8885A308D3, 0x13198A2E03707344),
            (0xA4093822299F31D0, 0x082EFA98EC4E6C89),
            (0x263C7D30BB0F0AF1, 0x56BE8361D3311526),
        ),
    ],
)
def test_known_answers(counter: tuple[int, int], key: tuple[int, int], answer: tuple[int, int]) -> None:
    found = threefry(*(np.array([word], dtype=np.uint64) for word in (*counter, *key)))
    assert tuple(int(word[0]) for word in found) == answer


def test_numbers_are_standard_normal() -> None:
    numbers = normals([(seed, 0) for seed in range(200)], SENSOR_NOISE, 0, 400)
    assert stats.kstest(numbers.ravel()[:200_000], "norm").pvalue > 0.001
    count = numbers.size
    assert abs(numbers.mean()) < 4.0 / np.sqrt(count)
    assert abs(numbers.var() - 1.0) < 4.0 * np.sqrt(2.0 / count)
    assert abs(stats.kurtosis(numbers.ravel())) < 4.0 * np.sqrt(24.0 / count)
    assert 4.0 < np.abs(numbers).max() < 6.8


def test_numbers_are_independent_in_every_direction() -> None:
    """Between the numbers of a step, from step to step, from flight to flight, of seeds and indices alike."""
    numbers = normals([(3, 0), (3, 1), (4, 0), (2**40, 0), (0, 3)], SENSOR_NOISE, 0, 4000)
    for rows in (numbers[:, :, 0].T, numbers[:, 0, :].T, np.array([numbers[k : k + 3990, 0, 0] for k in range(10)])):
        correlation = np.corrcoef(rows) - np.eye(len(rows))
        assert np.abs(correlation).max() < 5.0 / np.sqrt(rows.shape[1])
    squares = np.corrcoef(numbers[:, :, 0].T ** 2) - np.eye(12)
    assert np.abs(squares).max() < 5.0 / np.sqrt(4000)


def test_a_number_is_named_by_flight_stream_step_and_place_alone() -> None:
    seeds = [(7, 0), (7, 4711), (10**12, 3)]
    for stream in (SENSOR_NOISE, GUSTS, FIRST_GUST):
        together = normals(seeds, stream, 0, 30)
        np.testing.assert_array_equal(normals(seeds[1:2], stream, 11, 4)[:, :, 0], together[11:15, :, 1])
        pieces = Noise(seeds, stream)
        np.testing.assert_array_equal(np.concatenate([pieces.draw(1), pieces.draw(29)]), together)
    words = {counter_word(stream, block) for stream in (SENSOR_NOISE, GUSTS, FIRST_GUST) for block in range(3)}
    assert len(words) == 9


def test_machine_code_has_the_same_numbers() -> None:
    pytest.importorskip("llvmlite")
    from rotorfault.engine.function import CompiledFunction

    seeds = [(0, 0), (7, 4711), (10**12, 3), (2**33 + 7, 1)]

    def drawn(seed, index, step):  # type: ignore[no-untyped-def]
        return tuple(
            seed.tape.term("normal", seed, index, step, *stream, number)
            for stream in (SENSOR_NOISE, GUSTS)
            for number in range(stream.width)
        )

    compiled = CompiledFunction(drawn, 0.0, 0.0, 0.0)
    for step in (0, 1, 19_999, 3_600_000):
        rows = np.array([[seed, index, step] for seed, index in seeds], dtype=float).T
        wanted = np.concatenate([normals(seeds, stream, step, 1)[0] for stream in (SENSOR_NOISE, GUSTS)])
        np.testing.assert_allclose(compiled(rows), wanted, rtol=1e-14, atol=1e-14)
