"""A silent accelerometer, and inertial units that measure less often than the loop: what the filter goes by then."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy.stats import chi2

import rotorfault as rf
from rotorfault.autopilot.estimation.unfelt import all_felt, force_of, unfelt_noise
from rotorfault.autopilot.estimation.unread import none_awaited, spoken
from rotorfault.engine import have_simd
from rotorfault.maths.geometry import PerRotor, Vec3
from rotorfault.model.sensor_model import Timing
from rotorfault.model.signals import Reading
from rotorfault.model.vehicle_file import load_vehicle

ENGINE = "simd" if have_simd() else "numpy"
VEHICLE = load_vehicle("hummingbird").vehicle
COMMON: dict[str, Any] = {
    "vehicle": "hummingbird", "controller.preset": "hummingbird",
    "wind": {"kind": "dryden", "wind_at_6m": 5.0, "velocity_W": [3.0, 2.0, 0.0]},
}  # fmt: skip


def test_a_force_that_is_not_read_follows_the_believed_thrust() -> None:
    """By hand: 0.5 kg, so that 0.1 N more of each of four rotors are 0.8 m/s^2 more."""
    first, read = Vec3(0.3, -0.2, 9.7), Vec3(5.0, 5.0, 5.0)
    before = all_felt(first, Timing(), VEHICLE, PerRotor.all(1.2))
    force, silent, _ = force_of(before, read, Reading(read, 1.0), Timing(), VEHICLE, PerRotor.all(1.3))
    assert ([*force], silent) == ([5.0, 5.0, 5.0], 0.0)
    force, silent, after = force_of(before, read, Reading(read, 0.0), Timing(), VEHICLE, PerRotor.all(1.3))
    assert silent == 1.0
    assert [*force] == pytest.approx([0.3, -0.2, 10.5])
    # A tenth of the weight's 9.81 m/s^2, for the 50 ms of the rotors' lag: a density of 0.981 sqrt(2 x 0.05).
    assert unfelt_noise(VEHICLE, 0.1) == pytest.approx(0.981 * math.sqrt(0.1))
    assert after.lift == pytest.approx(10.4)


def test_a_reading_stands_until_the_next_is_due() -> None:
    timing, heard = Timing(3, 0), []
    waited = none_awaited(timing)
    for k in range(12):
        there, waited = spoken(Reading(0.0, 1.0 if k in (0, 3, 9) else 0.0), waited, timing)
        heard.append(there)
    # That of instant 6 is missed: silent from there on until the one of instant 9.
    assert heard == [1.0] * 6 + [0.0] * 3 + [1.0] * 3


@pytest.mark.parametrize(("sensors", "most"), [("mocap", 0.1), ("gps-consumer", 0.6)])
def test_a_silent_accelerometer_is_flown_through(sensors: str, most: float) -> None:
    """Held as it was read last, it leads a median flight 1.65 and 2.6 m astray; sound ones go 0.03 and 0.25 m."""
    silent = {"kind": "sensor_dropout", "sensor": "accelerometer", "start": 2.0, "end": 7.0}
    flight = COMMON | {"sensors": sensors, "duration": 8.0, "fault": [silent]}
    many = rf.fly_many(
        "hover-fault", {"seed": range(1, 6)}, settings=flight, warn=False, engine=ENGINE,
        record=("position",), record_period=0.05,
    )  # fmt: skip
    off = np.sqrt(((many.signals - np.array([0.0, 0.0, 5.0])[:, None]) ** 2).sum(axis=1))
    assert np.median(off[40:].max(axis=0)) < most, "from 2 s on: it begins level, in wind"
    assert not np.asarray(many.table["false_alarms"]).any()


def test_an_inertial_unit_slower_than_the_loop_is_not_silent_in_between() -> None:
    """At 500 Hz in a loop of 1 kHz the filter is as sure as it should be, and learns the gyro's bias."""
    flight = COMMON | {"sensors": "mocap", "sensors.imu.rate": 500, "duration": 3.0, "fault": [], "diagnosis": "off"}
    many = rf.fly_many(
        "hover-fault", {"seed": range(1, 25)}, settings=flight, record_period=1.0, warn=False, engine=ENGINE,
        record=("sensors.gyro_bias", "estimator.gyro_bias", "estimator.gyro_bias_std"),
    )  # fmt: skip
    true, found, std = (many.signals[-1, 3 * k : 3 * k + 3] for k in range(3))
    squares = (((found - true) / std) ** 2).mean()
    low, high = chi2.ppf([1e-5, 1.0 - 1e-5], 72) / 72
    assert low < squares < high
    assert (std < 2e-3).all(), "from 9e-3 rad/s at the start"
