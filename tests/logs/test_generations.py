"""Messages, topics and clocks of other firmware generations, on logs that are made up."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from log_formats import Rows, ardupilot_messages, dataflash, fields, geometry, px4_topics, ulog
from made_up_logs import FLIP, Flown, flown

from rotorfault.base.errors import InputError
from rotorfault.logs.commands import directions
from rotorfault.logs.diagnose import diagnosis_of
from rotorfault.logs.log import Log, Series, cleaned, named_layout
from rotorfault.logs.read import read_log

MIXER = directions(named_layout("quad-x", "")).T * FLIP
FRAME = {"FRAME_CLASS": 1.0, "FRAME_TYPE": 1.0}


@pytest.fixture(scope="module")
def quad() -> Flown:
    return flown(seed=3, rotor=1, loss=0.4, seconds=25.0)


@pytest.fixture(scope="module")
def messages(quad: Flown) -> list[Rows]:
    turned = quad.command - quad.command.mean(axis=1, keepdims=True)
    return ardupilot_messages(quad, turned @ np.linalg.pinv(0.5 * MIXER).T)


def read(content: bytes, path: Path) -> Log:
    path.write_bytes(content)
    return read_log(path)


def pulses_of(quad: Flown) -> np.ndarray:
    signal = (np.sqrt(0.35**2 + 4.0 * 0.65 * quad.command) - 0.35) / (2.0 * 0.65)
    return np.asarray(1000.0 + 1000.0 * (0.15 + 0.8 * signal))


# ArduPilot


def test_outputs_beyond_fourteen_are_in_messages_of_their_own(
    quad: Flown, messages: list[Rows], tmp_path: Path
) -> None:
    pulses = pulses_of(quad)[::4]
    time = quad.time[::4]
    first = Rows("RCOU", [(f"C{k}", "H") for k in (13, 14)], time, pulses[:, [2, 3]])
    second = Rows("RCO2", [(f"C{k}", "H") for k in (15, 18)], time[1:], pulses[1:, [0, 1]])
    wired = {"SERVO13_FUNCTION": 35.0, "SERVO14_FUNCTION": 36.0, "SERVO15_FUNCTION": 33.0, "SERVO18_FUNCTION": 34.0}
    log = read(dataflash([first, second, *messages[1:]], FRAME | wired, {}), tmp_path / "a.bin")
    output = log.series["output"]
    asked = Series(time, quad.command[::4]).at(output.time)
    assert output.values[5:-5] == pytest.approx(asked[5:-5], abs=0.02)
    assert diagnosis_of(log).rotor == 2


def test_an_esc_may_have_a_message_of_its_own(quad: Flown, messages: list[Rows], tmp_path: Path) -> None:
    time = quad.time[::10]
    each = [
        Rows(f"ESC{k + 1}", [("RPM", "f"), ("Curr", "f")], time, np.tile([1000.0 * (k + 1), 2.0], (len(time), 1)))
        for k in range(4)
    ]
    log = read(dataflash([*messages, *each], FRAME, {}), tmp_path / "a.bin")
    np.testing.assert_allclose(log.series["rpm"].values[0], [1000.0, 2000.0, 3000.0, 4000.0])


def test_raw_gyro_and_accelerometer_stand_in_for_the_imu(quad: Flown, messages: list[Rows], tmp_path: Path) -> None:
    imu = next(one for one in messages if one.name == "IMU")
    rest = [one for one in messages if one.name != "IMU"]
    names = [name for name, _ in imu.fields]
    at = [names.index(name) for name in ("GyrX", "GyrY", "GyrZ")]
    gyro = Rows("GYR", [imu.fields[k] for k in at], imu.time, imu.values[:, at])
    log = read(dataflash([*rest, gyro], FRAME, {}), tmp_path / "a.bin")
    assert log.series["rates"].values == pytest.approx(quad.rates[::4], abs=1e-6)
    assert diagnosis_of(log).rotor == 2


# PX4


def test_outputs_are_those_of_their_functions(quad: Flown, tmp_path: Path) -> None:
    """Without actuator_motors, pulses of outputs 1 to 4 drive motors 3, 1, 4, 2."""
    torque = (quad.command @ np.linalg.pinv(MIXER).T)[:, :3]
    made = [one for one in px4_topics(quad, torque, quad.command.mean(axis=1)) if one.name != "actuator_motors"]
    share = 1000.0 + 1000.0 * quad.command[::5]
    outputs = Rows("actuator_outputs", fields("output", 16), quad.time[::5],
                   np.hstack([share[:, [2, 0, 3, 1]], np.zeros((len(share), 12))]))  # fmt: skip
    functions = {f"PWM_MAIN_FUNC{k + 1}": 101.0 + motor for k, motor in enumerate([2, 0, 3, 1])}
    log = read(ulog([*made, outputs], geometry("quad-x") | functions), tmp_path / "a.ulg")
    assert log.series["output"].values == pytest.approx(quad.command[::5], abs=1e-3)


@pytest.mark.parametrize("scale", [1.0, 1000.0], ids=["shares", "thousandths"])
def test_outputs_of_a_simulation(scale: float, quad: Flown, tmp_path: Path) -> None:
    torque = (quad.command @ np.linalg.pinv(MIXER).T)[:, :3]
    made = [one for one in px4_topics(quad, torque, quad.command.mean(axis=1)) if one.name != "actuator_motors"]
    outputs = Rows("actuator_outputs_sim", fields("output", 16), quad.time[::5],
                   np.hstack([scale * quad.command[::5], np.zeros((len(quad.time[::5]), 12))]))  # fmt: skip
    log = read(ulog([*made, outputs], geometry("quad-x")), tmp_path / "a.ulg")
    assert log.series["output"].values == pytest.approx(quad.command[::5], abs=1e-3)


def test_a_sensors_own_gyro_does_where_no_other_is_logged(quad: Flown, tmp_path: Path) -> None:
    torque = (quad.command @ np.linalg.pinv(MIXER).T)[:, :3]
    made = [one for one in px4_topics(quad, torque, quad.command.mean(axis=1)) if "angular" not in one.name]
    gyro = Rows("sensor_gyro", [(axis, "float") for axis in "xyz"], quad.time, quad.rates * FLIP)
    log = read(ulog([*made, gyro], geometry("quad-x")), tmp_path / "a.ulg")
    assert log.series["rates"].values == pytest.approx(quad.rates, abs=1e-6)


# Clocks and kin


def test_a_counter_of_32_bits_that_begins_again_goes_on() -> None:
    time = 4250.0 + 0.01 * np.arange(9000)
    wrapped = np.where(time >= 2.0**32 * 1e-6, time - 2.0**32 * 1e-6, time)
    series, left_out = cleaned(Series(wrapped, np.ones((9000, 1))))
    assert left_out == 0
    assert series.time == pytest.approx(time)


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (
            b"H Product:Blackbox flight data recorder by Nicholas Sherlock\nH Data version:2\n" + bytes(200),
            "decode it",
        ),
        (b"FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format,Columns\n" * 3, "give the .bin"),
        (b"PK\x03\x04" + bytes(100), "unpack it"),
        (b'{\n "format": "rotorfault baseline 1"\n}', "behind --baseline"),
    ],
    ids=["raw blackbox", "text", "archive", "baseline"],
)
def test_what_is_no_log_yet_says_what_to_do(content: bytes, says: str, tmp_path: Path) -> None:
    path = tmp_path / ("a.json" if content[:1] == b"{" else "a.log")
    path.write_bytes(content)
    with pytest.raises(InputError, match=says):
        read_log(path)
