"""What measured rotor speeds say: the lag, and a rotor that stands still; not what is wrong with themselves."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from rotorfault.autopilot.diagnosis import DiagnosisInputs, speeds
from rotorfault.autopilot.diagnosis.kalman import Belief, learned_elsewhere
from rotorfault.autopilot.diagnosis.speeds import SHARE, SpeedMemory, SpeedParameters
from rotorfault.autopilot.prediction import Expectation
from rotorfault.maths.geometry import PerRotor, zeros
from rotorfault.model.block import Context
from rotorfault.model.mixer import hover_thrust
from rotorfault.model.sensor_model import SensorModel, SensorNoise, Timing
from rotorfault.model.signals import Reading, Readings, at_rest, motion_of
from rotorfault.model.vehicle import rotor_speeds
from rotorfault.model.vehicle_file import load_vehicle

VEHICLE = load_vehicle("hummingbird").vehicle
HOVER = np.array([*hover_thrust(VEHICLE)], dtype=float)
W, K = float(VEHICLE.rotor_bandwidth), float(VEHICLE.thrust_coefficient)
T, EVERY, LATE, NOISE = 0.001, 2, 2, 5.0
LOOSE = 36_000.0  # per hour: borne so often that it is seen


def parameters(false_alarms: float = 0.1) -> SpeedParameters:
    sensors = SensorModel(rotor_speeds=SensorNoise(NOISE, Timing(EVERY, LATE)))
    made = speeds.speed_parameters(Context(VEHICLE, T, sensors), false_alarms, 0.1, 0.3)
    assert isinstance(made, SpeedParameters)
    return made


class Rotors:
    """True rotors with a lag of their own, written anew: flights beside each other."""

    def __init__(self, flights: int, bandwidth: float, share: float = 0.0, seed: int = 0) -> None:
        self.rng = np.random.default_rng(seed)
        self.thrust = np.repeat(HOVER[:, None], flights, axis=1)
        self.keep, self.share = math.exp(-W * bandwidth * T), share
        self.stuck: dict[int, float] = {}
        self.measured: list[np.ndarray] = []

    def step(self, command: np.ndarray) -> None:
        self.thrust = command + (self.thrust - command) * self.keep

    def read(self, k: int) -> Reading[PerRotor]:
        thrust = self.thrust.copy()
        for rotor, held in self.stuck.items():
            thrust[rotor] = held
        speed = (1.0 + self.share) * np.sqrt(thrust / K)
        self.measured.append(speed + NOISE * self.rng.normal(size=speed.shape))
        at = max(k - LATE, 0)
        at -= at % EVERY
        valid = float(k >= LATE and (k - LATE) % EVERY == 0)
        return Reading(PerRotor(*self.measured[at]), valid, (k - at) * T)


def watched(
    rotors: Rotors, command: Any, steps: int, p: SpeedParameters, silent: bool = False, stuck: Any = None
) -> list[SpeedMemory]:
    """What the memory is at each instant."""
    sent, seen = PerRotor(*HOVER), []
    memory: Any = None
    for k in range(steps):
        if stuck is not None and k == stuck[0]:
            rotors.stuck[stuck[1]] = stuck[2]
        reading = rotors.read(k)
        inputs = told(reading._replace(valid=0.0) if silent else reading, sent)
        memory = speeds.unread(inputs, p) if memory is None else memory
        memory, _ = speeds.read(memory, inputs, p, T)
        seen.append(memory)
        commanded = command(k)
        rotors.step(commanded)
        sent = PerRotor(*commanded)
    return seen


def told(reading: Reading[PerRotor], sent: PerRotor) -> DiagnosisInputs:
    """What a detector gets; of the motion nothing counts here."""
    hover, still = PerRotor(*HOVER), at_rest(9.81)
    motion = motion_of(still)
    expectation = Expectation(
        motion, motion, hover, hover, 0.0, rotor_speeds(VEHICLE, hover), PerRotor.all(0.0), zeros(), T
    )
    return DiagnosisInputs(still, expectation, sent, VEHICLE, Readings(rotor_speeds=reading))


def moving(flights: int, seed: int = 1) -> Any:
    """Commands that change by a fifth of hover thrust every 20 ms, unlike for each rotor."""
    rng = np.random.default_rng(seed)
    steps = [HOVER[:, None] * (1.0 + 0.2 * rng.uniform(-1.0, 1.0, (4, flights))) for _ in range(200)]
    return lambda k: steps[(k // 20) % 200]


@pytest.mark.parametrize("bandwidth", [0.75, 1.3])
def test_the_lag_of_each_rotor_is_learned_as_well_as_it_says(bandwidth: float) -> None:
    p = parameters()
    after = watched(Rotors(60, bandwidth, 0.02), moving(60), 1000, p)[-1]
    for rotor, lag in zip(after.rotors, after.lag, strict=True):
        std = math.sqrt(float(np.mean(rotor.of(1, 1))))
        assert std < 0.15 * 0.3  # a seventh of what was unknown at the start
        assert abs(float(np.mean(lag)) - math.log(bandwidth)) < 0.5 * std
        assert float(np.std(lag)) < 1.5 * std
        assert float(np.mean(rotor.mean[SHARE])) == pytest.approx(0.02, abs=2e-3)


@pytest.mark.parametrize("held", [0.4, 2.0])
def test_a_rotor_that_stands_still_is_seen_by_the_first_reading_that_shows_it(held: float) -> None:
    """Its speed is off by more than ten standard deviations, so one reading beats any number of onsets."""
    p, at = parameters(), 400
    seen = watched(Rotors(40, 1.0), moving(40), 440, p, stuck=(at, 2, held * HOVER[2]))
    assert max(float(np.max(one.apart[2])) for one in seen[: at + LATE]) < 0.5
    assert float(np.min(seen[at + LATE + EVERY - 1].apart[2])) > 0.99
    for other in (0, 1, 3):
        assert max(float(np.max(one.apart[other])) for one in seen) < 0.5


def test_one_that_sticks_where_it_turns_is_seen_once_its_command_has_moved() -> None:
    p, at = parameters(), 400
    seen = watched(Rotors(40, 1.0), moving(40), 700, p, stuck=(at, 0, HOVER[0]))
    assert float(np.mean(np.asarray(seen[-1].apart[0]) > 0.99)) > 0.9


def test_what_all_rotors_share_is_no_rotors_fault() -> None:
    """A battery that sags, or a sensor that is off, by a tenth of the speed at once."""
    p, rotors = parameters(), Rotors(40, 1.0)
    command = moving(40)

    def sags(k: int) -> Any:
        rotors.share = 0.0 if k < 400 else -0.1
        return command(k)

    seen = watched(rotors, sags, 600, p)
    assert max(float(np.max(one.apart.reduce(np.maximum))) for one in seen) < 0.5


def test_without_a_fault_it_exceeds_its_level_no_more_often_than_computed() -> None:
    p, steps, flights = parameters(LOOSE), 600, 400
    seen = watched(Rotors(flights, 1.0), lambda k: np.repeat(HOVER[:, None], flights, axis=1), steps, p)
    above = sum((np.asarray(one.evidence[i]) > p.level).astype(float) for one in seen for i in range(4))
    alarms = float((np.asarray(above) > 0).sum())
    wanted = LOOSE * flights * steps * T / 3600.0
    assert alarms <= wanted + 3.0 * math.sqrt(wanted)


def test_what_is_not_valid_says_nothing() -> None:
    p = parameters()
    after = watched(Rotors(1, 0.75), moving(1), 300, p, silent=True)[-1]
    assert [*after.lag] == [0.0] * 4
    assert [*after.apart] == [0.0] * 4
    assert [*after.unknown_lag(p)] == [1.0] * 4


def test_what_was_seen_is_forgotten_once_readings_stay_away() -> None:
    p, rotors = parameters(), Rotors(1, 1.0)
    memory = watched(rotors, moving(1), 420, p, stuck=(400, 1, 0.4 * HOVER[1]))[-1]
    assert float(np.min(memory.apart[1])) > 0.99
    silent = told(Reading(memory.still, 0.0, 0.01), PerRotor(*HOVER))
    for _ in range(2 * EVERY):
        memory, _ = speeds.read(memory, silent, p, T)
    assert not np.any([*memory.apart])


def test_who_does_not_measure_speeds_has_none_of_it() -> None:
    assert speeds.speed_parameters(Context(VEHICLE, T, SensorModel()), 0.1, 0.1, 0.3) == ()
    once = SensorModel(rotor_speeds=SensorNoise(NOISE, Timing(0)))
    assert speeds.speed_parameters(Context(VEHICLE, T, once), 0.1, 0.1, 0.3) == ()


def test_what_is_learned_elsewhere_is_a_measurement_of_all_states() -> None:
    """As NumPy's filter has it, that measures the element and counts it anew."""
    p, left, change = 0.09, 0.6, 0.2
    rows = ((2.0, 0.3, 0.1), (1.0, -0.2), (p,))
    after = learned_elsewhere(Belief((0.5, -0.1, 0.05), rows), 2, change, left, p)
    P = np.array([[2.0, 0.3, 0.1], [0.3, 1.0, -0.2], [0.1, -0.2, p]])
    told = 1.0 - left**2
    gain = P[:, 2] / (P[2, 2] + p * left**2 / told)
    mean = np.array([0.5, -0.1, 0.05]) + gain * (change / told - 0.05)
    P = P - np.outer(gain, P[2])
    scale = np.diag([1.0, 1.0, 1.0 / left])
    P, mean = scale @ P @ scale, (mean - [0.0, 0.0, change]) / [1.0, 1.0, left]
    np.testing.assert_allclose(after.mean, mean, rtol=1e-12)
    np.testing.assert_allclose([[after.of(i, j) for j in range(3)] for i in range(3)], P, rtol=1e-12)
    assert after.of(2, 2) == pytest.approx(p)  # what is left is as unknown as it was, in its own measure
