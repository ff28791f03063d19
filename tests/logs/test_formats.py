"""Whatever a format allows: the right motor is named, or the log says what it cannot tell."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from log_formats import Rows, ardupilot_messages, dataflash, fields, geometry, px4_topics, ulog
from made_up_logs import FLIP, Flown, flown, write_betaflight, write_csv

from rotorfault.logs.commands import directions
from rotorfault.logs.diagnose import diagnosis_of
from rotorfault.logs.log import named_layout
from rotorfault.logs.read import read_log
from rotorfault.logs.verdict import LogDiagnosis

# Of PX4's former mixer for six motors in an X: roll, pitch, yaw of each, about forward, right, down, as it has them.
HEXA = np.array([[-1, 0, -1], [1, 0, 1], [0.5, 0.866025, -1], [-0.5, -0.866025, 1], [-0.5, 0.866025, 1],
                 [0.5, -0.866025, -1]])  # fmt: skip
NEWER = np.array(
    [np.sqrt(2.0 / 3.0), np.sqrt(2.0 / 3.0), 1.0]
)  # one scale of roll and pitch, of four motors for pitch
X = np.array([[-0.707107, 0.707107, 1], [0.707107, -0.707107, 1], [0.707107, 0.707107, -1],
              [-0.707107, -0.707107, -1]])  # fmt: skip


def lost(rotor: int, loss: float = 0.4, frame: str = "quad-x", seconds: float = 25.0, seed: int = 3) -> Flown:
    """A flight from 10 s on, in which a rotor loses thrust at 30 s."""
    return flown(seed=seed, rotor=rotor, loss=loss, seconds=seconds, frame=frame)


def setpoints(flight: Flown, mixer: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Torque and thrust that a mixer makes the commands of."""
    table = np.column_stack([mixer, np.ones(len(mixer))])
    found = np.linalg.lstsq(table, flight.command.T, rcond=None)[0].T
    return found[:, :3], found[:, 3]


def names(found: LogDiagnosis, rotor: int, onset: float = 30.0, loss: float = 0.4) -> None:
    first = found.probable
    assert (first.cause, first.rotor) == ("rotor loss", rotor), found.verdict
    assert first.probability > 0.9
    assert first.onset == pytest.approx(onset, abs=0.15)
    assert first.loss == pytest.approx(loss, abs=0.05)


def written(content: bytes, path: Path) -> LogDiagnosis:
    path.write_bytes(content)
    return diagnosis_of(read_log(path))


@pytest.fixture(scope="module")
def quad() -> Flown:
    return lost(1)


@pytest.fixture(scope="module")
def topics(quad: Flown) -> list[Rows]:
    return px4_topics(quad, *setpoints(quad, X))


# Betaflight


@pytest.mark.parametrize(
    "written_as",
    [
        {},
        {"header": False},
        {"pulses": False},
        {"pulses": False, "speeds": True},
        {"header": False, "units": ("s", "rad/s", "m/s2")},
        {"header": False, "units": ("us", "deg/s", "g")},
        {"outward": True},
    ],
    ids=lambda one: ",".join(map(str, one)) or "as a viewer writes it",
)
def test_a_blackbox_says_the_same_however_it_was_decoded(written_as: dict, quad: Flown, tmp_path: Path) -> None:
    log = read_log(write_betaflight(quad, tmp_path / "a.csv", **written_as))
    names(diagnosis_of(log), 3)  # rear left by its own numbers
    assert log.series["rates"].values[:, :2].std() == pytest.approx(quad.rates[:, :2].std(), rel=1e-3)
    assert np.linalg.norm(log.series["specific_force"].values, axis=1).mean() == pytest.approx(9.81, abs=0.2)
    assert log.series["command"].values.mean() == pytest.approx(quad.command.mean(), abs=0.003)


@pytest.mark.parametrize("pulses", [True, False], ids=["pulses", "digital"])
def test_where_the_unit_of_motors_is_not_known_losses_are_told_for_both(pulses: bool, tmp_path: Path) -> None:
    """A table that begins in the air may have values from 900 to 2000 in either unit."""
    flight = lost(1, loss=0.3)
    flight = Flown(*(part[400:] for part in flight[:6]), flight.frame)
    found = diagnosis_of(read_log(write_betaflight(flight, tmp_path / "a.csv", header=False, pulses=pulses)))
    assert found.rotor == 3
    low, high = found.probable.interval or (0.0, 0.0)
    assert low < 0.31
    assert high > 0.29
    assert high - low > 0.05
    assert any("losses are told for both" in said for said in found.log.remarks)


def test_motors_that_tell_their_speeds_are_digital(tmp_path: Path) -> None:
    flight = lost(1, loss=0.3)
    flight = Flown(*(part[400:] for part in flight[:6]), flight.frame)
    log = read_log(write_betaflight(flight, tmp_path / "a.csv", header=False, pulses=False, speeds=True))
    assert "otherwise" not in log.series
    assert diagnosis_of(log).probable.loss == pytest.approx(0.3, abs=0.03)


def test_a_blackbox_of_six_motors_has_those_of_a_hexa_x(tmp_path: Path) -> None:
    flight = lost(0, frame="hexa-x")
    names(diagnosis_of(read_log(write_betaflight(flight, tmp_path / "a.csv", order=(3, 4, 5, 2, 0, 1)))), 5)


def test_motors_in_another_order_show_in_how_the_body_turns(tmp_path: Path) -> None:
    flight = flown(seed=3, rotor=1, loss=0.4, seconds=25.0, stirred=0.03)
    path = write_betaflight(flight, tmp_path / "a.csv", order=(0, 1, 2, 3))  # PX4's, and not Betaflight's
    found = diagnosis_of(read_log(path))
    names(found, 2)
    assert "rear left" in found.verdict
    assert any("by how the body turns" in remark for remark in found.log.remarks)


@pytest.mark.parametrize(
    ("line", "says"),
    [
        ("# motors = quad-betaflight", "as motors of quad-x would turn it"),
        ("# motors = quadx", "is no frame of 4 motors"),
        ("# motors = hexa-x", "is no frame of 4 motors"),
    ],
)
def test_a_wrong_line_of_motors_blames_nobody(line: str, says: str, tmp_path: Path) -> None:
    flight = flown(seed=3, rotor=0, loss=0.4, seconds=25.0, stirred=0.03)
    found = diagnosis_of(read_log(write_csv(flight, tmp_path / "a.csv", line)))
    assert "cannot tell" in found.verdict
    assert says in found.verdict
    assert found.rotor is None


def test_six_motors_of_nobody_knows_where_are_not_judged(tmp_path: Path) -> None:
    flight = lost(4, frame="hexa-x")
    assert "write a line" in diagnosis_of(read_log(write_csv(flight, tmp_path / "a.csv", ""))).verdict
    names(diagnosis_of(read_log(write_csv(flight, tmp_path / "b.csv"))), 5)


# PX4


@pytest.mark.parametrize("what", ["parameters", "former airframe", "motors alone"])
def test_a_hexarotor_of_px4(what: str, tmp_path: Path) -> None:
    flight = lost(2, frame="hexa-x")
    former = what == "former airframe"
    torque, thrust = setpoints(flight, HEXA if former else HEXA * NEWER)
    made = px4_topics(flight, torque, thrust)
    known = {"SYS_AUTOSTART": 6001.0, "MAV_TYPE": 13.0} if former else geometry("hexa-x")
    if former:
        both = np.column_stack([torque, thrust])[::2]
        made = [Rows("actuator_controls_0", fields("control", 4), made[0].time, both), *made[2:]]
    if what == "motors alone":
        twelve = np.hstack([flight.command, np.full((len(flight.time), 6), np.nan)])[::2]
        made = [Rows("actuator_motors", fields("control", 12), made[0].time, twelve), *made[2:]]
    found = written(ulog(made, known), tmp_path / "a.ulg")
    names(found, 3)
    at = found.log.series["command"]
    np.testing.assert_allclose(at.values, flight.command[::2][: len(at.time)], atol=2e-3)


@pytest.mark.parametrize(
    ("parameters", "says"),
    [
        ({"MAV_TYPE": 22.0}, "a VTOL"),
        ({"MAV_TYPE": 1.0}, "an aeroplane"),
        ({"CA_ROTOR_COUNT": 5.0, "CA_ROTOR4_AX": 1.0, "CA_ROTOR4_AZ": 0.0}, "CA_ROTOR4 does not pull up"),
    ],
)
def test_what_is_no_multirotor_is_not_judged(
    parameters: dict[str, float], says: str, topics: list[Rows], tmp_path: Path
) -> None:
    found = written(ulog(topics, geometry("quad-x") | parameters), tmp_path / "a.ulg")
    assert "cannot tell" in found.verdict
    assert says in found.verdict


def test_a_motor_without_a_number_is_stopped(tmp_path: Path) -> None:
    flight = lost(1, loss=1.0, seconds=22.0)
    motors = np.where((flight.time > 30.0)[:, None] & (np.arange(4) == 1), np.nan, flight.command)[::10]
    made = px4_topics(flight, *setpoints(flight, X))
    sent = Rows("actuator_motors", fields("control", 4), flight.time[::10], motors)
    for rest in (made, made[2:]):  # with set-points and without
        found = written(ulog([*rest, sent], geometry("quad-x")), tmp_path / "a.ulg")
        names(found, 2, loss=1.0)
        assert any("motor 2 is stopped" in said for said in found.own)


def moved(made: Sequence[Rows], begin: float, end: float, by: float) -> list[Rows]:
    """Topics whose clock is off for a while."""
    return [one._replace(time=one.time + np.where((one.time >= begin) & (one.time < end), by, 0.0)) for one in made]


def without(made: Sequence[Rows], begin: float, end: float) -> list[Rows]:
    """Topics with a dropout."""
    keep = [(one.time < begin) | (one.time >= end) for one in made]
    return [one._replace(time=one.time[k], values=one.values[k]) for one, k in zip(made, keep, strict=True)]


@pytest.mark.parametrize("by", [500.0, 1e6])
def test_a_clock_that_jumps_for_a_moment_takes_nothing_along(by: float, topics: list[Rows], tmp_path: Path) -> None:
    names(written(ulog(moved(topics, 20.0, 20.03, by), geometry("quad-x")), tmp_path / "a.ulg"), 2)


@pytest.mark.parametrize(("by", "onset"), [(100.0, 130.0), (-5.0, 25.0)])
def test_a_clock_that_jumps_for_good_splits_the_flight(
    by: float, onset: float, topics: list[Rows], tmp_path: Path
) -> None:
    found = written(ulog(moved(topics, 22.0, 1e9, by), geometry("quad-x")), tmp_path / "a.ulg")
    names(found, 2, onset)


def test_dropouts_are_no_end_of_a_flight_and_told_where_they_hide_an_onset(
    topics: list[Rows], tmp_path: Path
) -> None:
    names(written(ulog(without(topics, 25.0, 27.0), geometry("quad-x"), [25.0]), tmp_path / "a.ulg"), 2)
    found = written(ulog(without(topics, 29.9, 30.6), geometry("quad-x"), [29.9]), tmp_path / "b.ulg")
    names(found, 2, 30.6)
    assert any("nothing is logged from 29.88 to 30.60 s" in limit for limit in found.limits)


def test_commands_that_drop_out_alone_raise_no_alarm(tmp_path: Path) -> None:
    flight = flown(seed=4, seconds=25.0)
    made = px4_topics(flight, *setpoints(flight, X))
    cut = without(made[:2], 22.0, 24.0)
    found = written(ulog([*cut, *made[2:]], geometry("quad-x")), tmp_path / "a.ulg")
    assert found.probable.cause == "healthy"
    assert all(scan.alarm is None for scan in found.scans)


@pytest.mark.parametrize("gone", ["position", "acceleration"])
def test_topics_that_are_not_needed_may_be_missing(gone: str, topics: list[Rows], tmp_path: Path) -> None:
    made = [one for one in topics if gone not in one.name]
    names(written(ulog(made, geometry("quad-x")), tmp_path / "a.ulg"), 2)


@pytest.mark.parametrize(
    ("gone", "says", "rotor"), [("angular", "no body rates", 2), ("thrust", "no commands of motors", None)]
)
def test_topics_that_are_needed_are_named(
    gone: str, says: str, rotor: int | None, topics: list[Rows], tmp_path: Path
) -> None:
    """Without rates a loss still shows in hover."""
    made = [one for one in topics if gone not in one.name]
    found = written(ulog(made, geometry("quad-x")), tmp_path / "a.ulg")
    assert found.rotor == rotor
    assert any(says in limit for limit in found.limits)


def test_of_two_instances_the_one_that_goes_on_is_taken(topics: list[Rows], tmp_path: Path) -> None:
    rates = next(one for one in topics if "angular" in one.name)
    dead = rates._replace(time=rates.time[:3], values=0.0 * rates.values[:3])
    rest = [one for one in topics if one is not rates]
    names(written(ulog([*rest, dead, rates._replace(instance=1)], geometry("quad-x")), tmp_path / "a.ulg"), 2)


def test_escs_are_those_of_their_functions(topics: list[Rows], tmp_path: Path) -> None:
    pairs = [
        (f"esc[{k}].{what}", "float") for k in range(8) for what in ("esc_rpm", "esc_current", "actuator_function")
    ]
    values = np.zeros((50, 24))
    for esc, motor in enumerate([2, 0, 3, 1]):  # which motor each ESC drives
        values[:, 3 * esc], values[:, 3 * esc + 2] = 1000.0 * (motor + 1), 101.0 + motor
    rows = Rows("esc_status", pairs, 15.0 + 0.1 * np.arange(50), values)
    content = ulog([*topics, rows], geometry("quad-x"))
    log = written(content, tmp_path / "a.ulg").log
    np.testing.assert_allclose(log.series["rpm"].values[0], [1000.0, 2000.0, 3000.0, 4000.0])


# ArduPilot


@pytest.mark.parametrize(("frame", "class_", "type_"), [("hexa-x", 2, 1), ("octa-x", 3, 1), ("octaquad-x", 4, 1)])
def test_more_motors_of_ardupilot(frame: str, class_: int, type_: int, tmp_path: Path) -> None:
    flight = lost(3, frame=frame)
    torque, _ = setpoints(flight, 0.5 * directions(named_layout(frame, "")).T * FLIP)
    content = dataflash(ardupilot_messages(flight, torque), {"FRAME_CLASS": class_, "FRAME_TYPE": type_}, {})
    names(written(content, tmp_path / "a.bin"), 4)


@pytest.fixture(scope="module")
def messages(quad: Flown) -> list[Rows]:
    return ardupilot_messages(quad, setpoints(quad, X / np.array([1.4142136, 1.4142136, 2.0]))[0])


FRAME = {"FRAME_CLASS": 1.0, "FRAME_TYPE": 1.0}


@pytest.mark.parametrize("parameters", [FRAME, {}, {"FRAME": 1.0}])
def test_frames_of_former_versions_and_of_none(
    parameters: dict[str, float], messages: list[Rows], tmp_path: Path
) -> None:
    names(written(dataflash(messages, parameters, {}), tmp_path / "a.bin"), 2)


@pytest.mark.parametrize(
    ("parameters", "text", "says"),
    [(FRAME, "ArduPlane V4.5.1 (1234abcd)", "a log of ArduPlane"), ({"FRAME_CLASS": 6.0}, "hello", "FRAME_CLASS 6")],
)
def test_other_vehicles_of_ardupilot_are_not_judged(
    parameters: dict[str, float], text: str, says: str, messages: list[Rows], tmp_path: Path
) -> None:
    assert says in written(dataflash(messages, parameters, {10.0: text}), tmp_path / "a.bin").verdict


def test_outputs_alone_do_with_any_mapping_and_without_parameters_of_motors(
    quad: Flown, messages: list[Rows], tmp_path: Path
) -> None:
    signal = (np.sqrt(0.35**2 + 4.0 * 0.65 * quad.command) - 0.35) / (2.0 * 0.65)  # MOT_THST_EXPO as it is by default
    pulses = 1000.0 + 1000.0 * (0.15 + 0.8 * signal)
    wired = np.hstack([0 * pulses[:, :1], pulses[:, [1, 0, 3, 2]], np.full((len(pulses), 3), 1500.0)])[::4]
    outputs = Rows("RCOU", [(f"C{k}", "H") for k in range(1, 9)], quad.time[::4], wired)
    mapping = {"SERVO2_FUNCTION": 34.0, "SERVO3_FUNCTION": 33.0, "SERVO4_FUNCTION": 36.0, "SERVO5_FUNCTION": 35.0}
    found = written(dataflash([outputs, *messages[1:]], FRAME | mapping, {}), tmp_path / "a.bin")
    names(found, 2)


def test_the_core_that_flew_is_believed(quad: Flown, messages: list[Rows], tmp_path: Path) -> None:
    filter_ = next(one for one in messages if one.name == "XKF1")
    rest = [one for one in messages if one.name != "XKF1"]
    astray = filter_._replace(values=filter_.values + np.array([0.0, *(30.0 * np.ones(6))]))
    flew = filter_._replace(values=filter_.values + np.array([1.0, *np.zeros(6)]))
    which = Rows("XKF4", [("C", "B"), ("PI", "b")], quad.time[::50], np.tile([0.0, 1.0], (len(quad.time[::50]), 1)))
    found = written(dataflash([*rest, astray, flew, which], FRAME, {}), tmp_path / "a.bin")
    names(found, 2)
    assert np.abs(found.log.series["velocity"].values).max() < 1.0
    former = filter_._replace(name="NKF1", fields=filter_.fields[1:], values=filter_.values[:, 1:])
    names(written(dataflash([*rest, former], FRAME, {}), tmp_path / "b.bin"), 2)


# Several flights


def one_after_another(first: Flown, second: Flown) -> Flown:
    """Both in one log, 20 s on the ground between."""
    later = first.time[-1] + 20.0 - second.time[0]
    parts = [np.concatenate([a, b + later * (k == 0)]) for k, (a, b) in
             enumerate(zip(first[:6], second[:6], strict=True))]  # fmt: skip
    return Flown(*parts)


@pytest.mark.parametrize("faulty", [0, 1])
def test_the_flight_with_the_loss_is_found_among_several(faulty: int, quad: Flown, tmp_path: Path) -> None:
    calm = flown(seed=4, seconds=20.0)
    both = one_after_another(quad, calm) if faulty == 0 else one_after_another(calm, quad)
    found = diagnosis_of(read_log(write_csv(both, tmp_path / "a.csv")))
    names(found, 2, 30.0 if faulty == 0 else 20.0 + calm.time[-1] + 20.0)


def test_a_propeller_that_broke_at_the_landing_shows_in_the_next_flight(tmp_path: Path) -> None:
    calm, weak = flown(seed=4, seconds=20.0), flown(seed=5, seconds=20.0, rotor=3, loss=0.4, onset=-1.0)
    found = diagnosis_of(read_log(write_csv(one_after_another(calm, weak), tmp_path / "a.csv")))
    names(found, 4, calm.time[-1] + 20.0)
    assert "the flights before" in found.probable.evidence
    again = flown(seed=6, seconds=20.0)
    sound = diagnosis_of(read_log(write_csv(one_after_another(calm, again), tmp_path / "b.csv")))
    assert sound.probable.cause == "healthy"


def test_a_log_that_begins_in_the_air_says_what_it_hides(tmp_path: Path) -> None:
    flight = flown(seed=6, rotor=2, loss=0.4, seconds=20.0, onset=2.5)
    found = diagnosis_of(read_log(write_csv(flight, tmp_path / "a.csv")))
    assert any("begins in flight" in limit for limit in found.limits)
    assert found.rotor in (None, 3)
