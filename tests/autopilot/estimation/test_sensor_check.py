"""Sensors that have stopped: how often a sound one is taken for frozen, how soon a frozen one is, what flies on."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import rotorfault as rf
from rotorfault.autopilot.estimation import CheckInputs, Repeats
from rotorfault.engine import have_simd
from rotorfault.maths.geometry import Vec3
from rotorfault.maths.rotation import Quat
from rotorfault.model.block import Context
from rotorfault.model.sensor_model import SensorModel, SensorNoise, Timing
from rotorfault.model.signals import Reading, Readings
from rotorfault.model.vehicle_file import load_vehicle
from rotorfault.scenario.library import load_scenario

ENGINE = "simd" if have_simd() else "python"
DT, END, VEHICLE = 0.001, 34.9, load_vehicle("hummingbird").vehicle
GYRO = SensorNoise(1e-3, limit=END)
ALIKE = 1.0 / (2.0 * math.sqrt(math.pi))  # chance that a number repeats, at most


class Checked:
    """A check and what it has seen of readings that come one after the other."""

    def __init__(self, model: SensorModel, first: Readings, **settings: Any) -> None:
        self.made = Repeats(Repeats.Settings(**settings))
        self.numbers = self.made.parameters(Context(VEHICLE, DT, model))
        self.memory = self.made.initial(CheckInputs(first), self.numbers)
        self(first)

    def __call__(self, readings: Readings) -> Readings:
        self.memory, given, self.signals = self.made.step(self.memory, CheckInputs(readings), self.numbers, DT)
        return given


def gyro(x: Any, y: Any, z: Any, valid: float = 1.0) -> Readings:
    return Readings(rates=Reading(Vec3(x, y, z), valid))


def test_readings_in_steps_as_coarse_as_their_noise_repeat_as_often_as_computed() -> None:
    draw = np.random.default_rng(1)
    for numbers in (1, 3):
        # Of different true values, somewhere between two steps each.
        truth = draw.uniform(-5.0, 5.0, size=(numbers, 400_000))
        one, other = (np.round(truth + draw.normal(size=truth.shape)) for _ in range(2))
        share = (one == other).all(axis=0).mean()
        assert 0.8 * ALIKE**numbers < share < 1.02 * ALIKE**numbers


def test_sound_sensors_are_held_for_frozen_no_more_often_than_wanted() -> None:
    """At a rate that can be seen: once in a thousand readings of a number, in steps of the noise."""
    draw, flights, steps = np.random.default_rng(2), 2_000, 300
    truth = draw.uniform(-5.0, 5.0, size=flights)

    def reading() -> Readings:
        return Readings(pressure_altitude=Reading(np.round(truth + draw.normal(size=flights))))

    model = SensorModel(pressure_altitude=SensorNoise(1.0))
    checked = Checked(model, reading(), rate=3600.0)
    begun, before = 0.0, np.zeros(flights)
    for _ in range(steps):
        checked(reading())
        now = checked.signals.frozen  # type: ignore[attr-defined]
        begun, before = begun + float((now * (1.0 - before)).sum()), now
    assert 1e-4 < begun / (flights * steps) < 1e-3


@pytest.mark.parametrize(("rate", "late"), [(0.01, 6), (36.0, 4)])
def test_a_frozen_gyro_is_found_after_as_many_readings_as_it_takes(rate: float, late: int) -> None:
    """By hand: 3.6e6 readings an hour, so n with 3 n ln(1/p) = ln(3.6e6/rate): 5.2 at 0.01/h, 3.03 at 36/h."""
    assert late == math.ceil(math.log(3.6e6 / rate) / (3.0 * math.log(1.0 / ALIKE)))
    checked, draw = Checked(SensorModel(rates=GYRO), gyro(0.0, 0.0, 0.0), rate=rate), np.random.default_rng(3)
    for _ in range(20):
        assert checked(gyro(*draw.normal(size=3))).rates.valid == 1.0  # type: ignore[union-attr]
    still = gyro(*draw.normal(size=3))
    found = [checked(still).rates for _ in range(1 + late + 3)]  # the first of them is new
    assert [one.valid for one in found] == [1.0] * late + [0.0] * 4  # type: ignore[union-attr]
    assert [one.age for one in found[late:]] == pytest.approx([DT * (late + k) for k in range(4)])  # type: ignore[union-attr]
    again = checked(gyro(*draw.normal(size=3))).rates
    assert (again.valid, again.age) == (1.0, 0.0)  # type: ignore[union-attr]


def test_what_is_cut_to_the_range_repeats_and_is_sound() -> None:
    checked = Checked(SensorModel(rates=GYRO), gyro(END, -END, END))
    for _ in range(100):
        assert checked(gyro(END, -END, END)).rates.valid == 1.0  # type: ignore[union-attr]
    draw = np.random.default_rng(4)
    for _ in range(100):
        assert checked(gyro(END, *draw.normal(size=2))).rates.valid == 1.0  # type: ignore[union-attr]


def test_only_what_arrives_counts_and_what_has_no_noise_is_never_frozen() -> None:
    """A reading is held between two arrivals; an attitude has three numbers that may be off, not four."""
    slow = Timing(10, 0)
    model = SensorModel(
        position=SensorNoise(1e-3, slow), attitude=SensorNoise(1e-2, slow), rates=GYRO._replace(std=0.0)
    )
    still = Readings(Reading(Vec3(1.0, 2.0, 3.0)), (), Reading(Quat.identity()), Reading(Vec3(0.0, 0.0, 0.0)))
    checked, valid = Checked(model, still), []
    for k in range(1, 81):
        arrives = 1.0 if k % 10 == 0 else 0.0
        given = checked(
            still._replace(
                position=Reading(still.position.value, arrives), attitude=Reading(Quat.identity(), arrives)
            )  # type: ignore[union-attr]
        )
        valid += [(given.position.valid, given.attitude.valid)] if arrives else []  # type: ignore[union-attr]
        assert given.rates.valid == 1.0  # type: ignore[union-attr]
    # By hand: 3.6e5 readings an hour, 3 n ln(1/p) = ln(3.6e7): 4.6.
    assert valid == [(1.0, 1.0)] * 4 + [(0.0, 0.0)] * 4


def test_sensors_of_which_nothing_is_known_pass() -> None:
    checked = Checked(SensorModel(), gyro(1.0, 2.0, 3.0))
    assert checked(gyro(1.0, 2.0, 3.0)) == gyro(1.0, 2.0, 3.0)


def test_real_sensors_are_checked_and_others_are_not() -> None:
    kinds = {
        name: load_scenario("hover-fault", {"sensors": name}).sensor_check.kind  # type: ignore[attr-defined]
        for name in ("ideal", "noisy", "mocap", "gps-consumer", "crazyflie")
    }
    assert kinds == {"ideal": "off", "noisy": "off"} | dict.fromkeys(
        ("mocap", "gps-consumer", "crazyflie"), "repeats"
    )


def test_a_frozen_gyro_is_flown_without_and_no_rotor_is_blamed() -> None:
    settings: dict[str, Any] = {
        "vehicle": "hummingbird", "controller.preset": "hummingbird", "sensors": "mocap", "duration": 5.0,
        "wind": {"kind": "dryden", "wind_at_6m": 5.0, "velocity_W": [3.0, 2.0, 0.0]},
        "fault": [{"kind": "sensor_freeze", "sensor": "gyro", "start": 2.0, "end": 4.0}],
    }  # fmt: skip
    flight = rf.fly("hover-fault", settings=settings, engine=ENGINE)
    assert flight.outcome.survived
    assert not flight.data["fault_flag"].values.any()
    frozen, time = flight.data["sensor_check.frozen"].values, flight.data["time"].values
    assert set(frozen[(time < 1.9) | (time > 4.1)]) == {0.0}
    assert set(frozen[(time > 2.02) & (time < 3.99)]) == {1.0}
    believed = rf.fly("hover-fault", settings=settings | {"sensor_check": "off"}, engine=ENGINE)
    assert not believed.outcome.survived, "what it is for"
