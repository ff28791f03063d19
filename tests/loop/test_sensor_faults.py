"""Faults of sensors change what is read, at their time and no other, and are no faults of rotors."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import rotorfault as rf
from rotorfault.base.errors import InputError
from rotorfault.engine import have_simd

ENGINE = "simd" if have_simd() else "python"


def fly(*faults: dict[str, Any], sensors: str = "mocap", duration: float = 4.0, **settings: Any) -> rf.Flight:
    given = {"sensors": sensors, "duration": duration, "fault": list(faults), "diagnosis": "off", **settings}
    return rf.fly("hover-fault", settings=given, engine=ENGINE)


def test_a_jump_of_the_bias_is_read_from_its_time_on() -> None:
    """By an estimator that takes readings as they are; nothing else of the flight differs before."""
    jump = {"kind": "sensor_bias", "sensor": "gyro", "time": 0.5, "bias": [0.0, 0.0, 0.2]}
    bent, plain = fly(jump, sensors="ideal", duration=1.0), fly(sensors="ideal", duration=1.0)
    time = bent.data["time"].values
    off = (bent.data["body_rates_estimated"] - bent.data["body_rates"]).values
    np.testing.assert_allclose(off[time > 0.4995], np.tile([0.0, 0.0, 0.2], ((time > 0.4995).sum(), 1)), atol=1e-12)
    before = time < 0.4995
    assert (bent.data["position"].values[before] == plain.data["position"].values[before]).all()


@pytest.mark.parametrize(("kind", "valid"), [("sensor_freeze", 1.0), ("sensor_dropout", 0.0)])
def test_in_a_spell_a_reading_keeps_its_value(kind: str, valid: float) -> None:
    spell = {"kind": kind, "sensor": "gyro", "start": 0.2, "end": 0.3}
    held = fly(spell, sensors="ideal", duration=0.5, **{"start.body_rates": [0.1, 0.0, 0.3]})
    time, read = held.data["time"].values, held.data["body_rates_estimated"].values
    within = (time > 0.1995) & (time < 0.2995)
    last = read[np.argmax(within) - 1]
    assert (read[within] == last).all()
    outside = ~within
    assert (read[outside] == held.data["body_rates"].values[outside]).all()
    assert valid in (0.0, 1.0)


def test_a_filter_takes_nothing_of_what_is_not_valid() -> None:
    """In an outage it measures nothing, and knows less and less of its position."""
    outage = {"kind": "sensor_dropout", "sensor": "position", "start": 2.0, "end": 3.0}
    flight = fly(outage, duration=3.5)
    time = flight.data["time"].values
    measured = flight.data["estimator.measured"].values
    assert measured[(time > 1.9995) & (time < 2.9995)].sum() == 0.0
    assert measured[time > 2.9995].sum() > 0.0
    std = flight.data["estimator.position_std"].values[:, 0]
    assert std[np.argmin(abs(time - 2.99))] > 3.0 * std[np.argmin(abs(time - 1.99))]


def test_neither_counts_as_a_fault_of_a_rotor_and_both_kinds_keep_their_order() -> None:
    """A scenario with both: detection looks at the rotor's alone, whichever comes first."""
    sensor = {"kind": "sensor_bias", "sensor": "accelerometer", "time": 0.2, "bias": [0.1, 0.0, 0.0]}
    rotor = {"kind": "step", "rotor": 2, "time": 0.5, "loss": 0.3}
    for faults in ((sensor, rotor), (rotor, sensor)):
        flight = fly(*faults, duration=1.5, diagnosis="luenberger")
        (found,) = flight.summary()["detections"]
        assert (found["rotor"], found["true_time"]) == (2, 0.5)


def test_what_the_sensors_have_not_got_is_named() -> None:
    with pytest.raises(InputError, match="sensor 'barometer': the sensors have none; allowed: gyro, acc"):
        fly({"kind": "sensor_freeze", "sensor": "barometer", "start": 1.0, "end": 2.0})
    with pytest.raises(InputError, match=r"end: got 1\.0 s; allowed: later than start"):
        fly({"kind": "sensor_freeze", "sensor": "gyro", "start": 2.0, "end": 1.0})
