"""Random numbers: the generator's published answers, their distribution, and the same numbers in machine code."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from engine_flights import OWN, every_engine, run, short
from scipy import stats

from rotorfault.autopilot.diagnosis import DIAGNOSIS, Diagnoser
from rotorfault.base.errors import InputError
from rotorfault.engine.noise import Noise, Stream, counter_word, normals, threefry
from rotorfault.flight.assembly import assemble
from rotorfault.maths.geometry import Vec3
from rotorfault.model.block import Block, Nothing, Record
from rotorfault.model.signals import Reading, Readings
from rotorfault.model.slot import Slot
from rotorfault.plant import SENSORS, WIND, Dryden
from rotorfault.plant.sensors import Noisy, SensorInputs, Sensors
from rotorfault.scenario.slots import SLOTS

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


# ------------------------------------------------------------------------------------------------ who draws from what


def test_slots_draw_from_streams_of_their_own() -> None:
    """For the steps and for the start: a bias drawn at the start must not be the noise of the first step."""
    words = [word for slot in SLOTS for word in slot.streams or ()]
    assert len(words) == len(set(words)) >= 4
    taken = Slot("twin", Twin, "belief", "", "twins", streams=(7, words[-1]))
    with pytest.raises(InputError, match=f"slot twin: stream {words[-1]} belongs to sensors; allowed: another word"):
        SLOTS.insert(taken, after="allocation")
    assert "twin" not in SLOTS


class Twin(Block[Any, Any, Nothing, Nothing]):
    """Of a kind that has no slot in the list."""


class Biased(Sensors[Vec3, Nothing]):
    """A bias of the position, drawn at the start of more numbers than a step has, and noise of the velocity."""

    normals = 3
    first_normals = 5

    def initial(self, inputs: SensorInputs, parameters: Nothing) -> Vec3:
        """The bias."""
        assert len(inputs.normals) == 5
        return Vec3.of(inputs.normals[2:])

    def step(self, memory: Vec3, inputs: SensorInputs, parameters: Nothing, dt: Any) -> tuple[Vec3, Readings, Record]:
        """Truth, bias and noise."""
        state = inputs.state
        readings = Readings(
            Reading(state.p_W + memory),
            Reading(state.v_W + Vec3.of(inputs.normals)),
            Reading(state.q_WB),
            Reading(state.omega_B),
        )
        return memory, readings, Nothing()


@every_engine
def test_what_is_drawn_at_the_start_is_not_drawn_again(engine: str) -> None:
    batch = assemble(short(duration=0.05, fault=[], seed=5), {SENSORS: Biased()})
    signals = run(batch, engine).signals[:, :, 0]
    own = {name: signals[:, OWN.place(name)] for name in ("position", "velocity")}
    bias = signals[:, OWN.place("position_estimated")] - own["position"]
    noise = signals[:, OWN.place("velocity_estimated")] - own["velocity"]
    np.testing.assert_allclose(bias, np.broadcast_to(bias[0], bias.shape), atol=1e-12)
    assert np.abs(noise - bias[0]).min() > 1e-6
    steps, start = SENSORS.streams
    np.testing.assert_allclose(bias[0], normals([(5, 0)], Stream(5, start), 0, 1)[0, 2:, 0], atol=1e-12)
    np.testing.assert_allclose(noise, normals([(5, 0)], Stream(3, steps), 0, 10)[:, :, 0], atol=1e-12)


class Silent(Biased):
    """Draws nothing at the start."""

    first_normals = 0

    def initial(self, inputs: SensorInputs, parameters: Nothing) -> Vec3:
        """No bias."""
        assert inputs.normals == ()
        return Vec3(0.0, 0.0, 0.0)


def test_a_part_may_draw_nothing_at_the_start() -> None:
    batch = assemble(short(duration=0.05, fault=[]), {SENSORS: Silent()})
    signals = run(batch, "python").signals[:, :, 0]
    np.testing.assert_array_equal(signals[:, OWN.place("position_estimated")], signals[:, OWN.place("position")])


class Gambler(Diagnoser[Nothing, Nothing]):
    """Asks for numbers where there are none."""

    normals = 2


def test_a_part_that_draws_where_nothing_is_to_be_had_is_refused() -> None:
    """It must not get another slot's numbers."""
    with pytest.raises(
        InputError, match=r"diagnosis Gambler asks for random numbers \(normals\).*'diagnosis' get none"
    ):
        assemble(short(), {DIAGNOSIS: Gambler()})


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
