"""ULog: what PX4's own reader makes of it, in PX4's frames and with its motors."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from exported import FLIGHT, flight, mean_flight
from pyulog import ULog
from pyulog.px4 import PX4ULog

import rotorfault as rf
from rotorfault.results.airframe import PX4_ORDERS, Airframe, airframe_of, px4_order
from rotorfault.results.exporters.content import by_topic, columns


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> ULog:
    return ULog(str(flight().export(tmp_path_factory.mktemp("ulog") / "a.ulg")))


def test_every_signal_is_there_to_the_last_bit(log: ULog) -> None:
    assert not log.file_corruption
    data = flight().records()
    for topic, members in by_topic(columns(data)).items():
        found = log.get_dataset(f"rotorfault_{topic}").data
        assert np.array_equal(found["timestamp"], np.round(data["time"].values * 1e6))
        for column in members:
            name = column.field.lower()
            assert np.array_equal(found[name], column.values), column.name
            about = log.msg_info_dict[f"about.rotorfault_{topic}.{name}"]
            assert about.startswith(column.meaning)
            assert about.endswith(f"[{column.unit}]")


def test_attitude_and_rates_are_in_ned_and_frd(log: ULog) -> None:
    PX4ULog(log).add_roll_pitch_yaw(["vehicle_attitude_groundtruth", "vehicle_attitude"])
    for topic, ending in (("vehicle_attitude_groundtruth", ""), ("vehicle_attitude", "_estimated")):
        found = log.get_dataset(topic).data
        euler = flight().data[f"attitude{ending}"].values
        assert np.allclose(found["roll"], euler[:, 0], atol=1e-6)
        assert np.allclose(found["pitch"], -euler[:, 1], atol=1e-6)
        assert np.allclose(found["yaw"], -euler[:, 2], atol=1e-6)
    rates = log.get_dataset("vehicle_angular_velocity_groundtruth").data
    true = flight().data["body_rates"].values * (1.0, -1.0, -1.0)
    assert np.allclose([rates[f"xyz[{k}]"] for k in range(3)], true.T, rtol=1e-6)


def test_positions_are_north_east_down(log: ULog) -> None:
    found = log.get_dataset("vehicle_local_position_groundtruth").data
    place, speed = flight().data["position"].values, flight().data["velocity"].values
    for signal, names in ((place, "xyz"), (speed, ("vx", "vy", "vz"))):
        for k, (name, sign) in enumerate(zip(names, (1.0, -1.0, -1.0), strict=True)):
            assert np.allclose(found[name], sign * signal[:, k], rtol=1e-6, atol=1e-9)
    assert np.allclose(found["heading"], -flight().data["attitude"].values[:, 2], atol=1e-6)
    wanted = log.get_dataset("vehicle_local_position_setpoint").data
    assert (wanted["x"][0], wanted["y"][0], wanted["z"][0]) == pytest.approx((0.2, 0.1, -0.3))
    assert wanted["yaw"][0] == pytest.approx(-0.4)


def test_the_attitude_that_is_wanted_is_a_quaternion(log: ULog) -> None:
    PX4ULog(log).add_roll_pitch_yaw(["vehicle_attitude_setpoint:_d"])
    found = log.get_dataset("vehicle_attitude_setpoint").data
    wanted = flight().data["controller.attitude_command"].values
    assert np.allclose(found["roll_d"], wanted[:, 0], atol=1e-6)
    assert np.allclose(found["pitch_d"], -wanted[:, 1], atol=1e-6)
    thrust = flight().data["thrust_demand"].values / (4.0 * flight().data.attrs["thrust_max"])
    assert np.allclose(found["thrust_body[2]"], -thrust, rtol=1e-6)


def test_motors_have_the_numbers_of_px4(log: ULog) -> None:
    found = log.get_dataset("actuator_motors").data
    share = flight().data["thrust_command"].values / flight().data.attrs["thrust_max"]
    wanted = rf.convert("motors", share, "crazyflie-2.1", "px4")
    assert np.allclose([found[f"control[{motor}]"] for motor in range(4)], wanted.T, rtol=1e-6)
    assert np.isnan(found["control[4]"]).all()
    status = log.get_dataset("failure_detector_status").data
    flagged = flight().data["fault_flag"].values[:, 1] > 0.5
    assert flagged.any()
    (motor,) = np.flatnonzero(rf.convert("motors", [0, 1, 0, 0], "crazyflie-2.1", "px4"))
    assert np.array_equal(status["motor_failure_mask"] == 1 << motor, flagged)
    assert f"motor {motor + 1} is rotor 2" in log.msg_info_dict["rotorfault_motor_order"]


def test_parameters_describe_the_vehicle(log: ULog) -> None:
    found = log.initial_parameters
    assert (found["MAV_TYPE"], found["CA_ROTOR_COUNT"]) == (2, 4)
    x, y = found["CA_ROTOR0_PX"], found["CA_ROTOR0_PY"]
    assert x > 0.0
    assert y > 0.0  # to the right
    assert found["CA_ROTOR0_KM"] > 0.0  # turns counter-clockwise, as PX4's motor 1
    assert "SYS_AUTOSTART" not in found


def test_what_happened_is_logged_in_words(log: ULog) -> None:
    said = {each.message: (each.timestamp, each.log_level_str()) for each in log.logged_messages}
    assert said["rotor 2 loses 30 % of its thrust"] == (100_000, "WARNING")
    assert log.msg_info_dict["sys_name"] == "rotorfault"
    assert log.msg_info_dict["ver_sw"] == rf.__version__
    whole = "".join(log.msg_info_multiple_dict["rotorfault_configuration"][0])
    assert json.loads(whole)["vehicle"]["name"] == "crazyflie-2.1"


def test_every_works_and_mean_names_do_no_harm(tmp_path: Path) -> None:
    log = ULog(str(mean_flight().export(tmp_path / "a.ulg", every=5, units=False)))
    assert not log.file_corruption
    found = log.get_dataset("rotorfault_flight").data
    assert np.array_equal(found["script_alert_1_script"], np.sin(flight().data["time"].values[::5]))
    assert log.msg_info_dict["about.rotorfault_flight.thrust_1"] == "true thrust"


@pytest.mark.parametrize("name", PX4_ORDERS)
def test_an_airframe_of_px4_is_known_in_any_order(name: str) -> None:
    azimuth = np.radians(PX4_ORDERS[name])
    places = np.stack([np.cos(azimuth), -np.sin(azimuth), 0.0 * azimuth], axis=1)
    shuffled = np.random.default_rng(1).permutation(len(places))
    frame = Airframe("", places[shuffled], np.ones(len(places)), (), 1.0, 1.0, 0.01)
    order, found = px4_order(frame)
    assert found == name
    assert np.array_equal(places[shuffled][order], places)


def test_an_x_quadrotor_is_ordered_as_conversions_order_it() -> None:
    order, _ = px4_order(airframe_of(flight().records()))
    values = np.array([10.0, 20.0, 30.0, 40.0])
    assert np.array_equal(values[order], rf.convert("motors", values, "crazyflie-2.1", "px4"))


def test_rotors_elsewhere_keep_their_order() -> None:
    places = np.array([[1.0, 0.0, 0.0], [0.9, 0.1, 0.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.1, 1.0, 0.0]])
    order, found = px4_order(Airframe("", places, np.ones(5), (), 1.0, 1.0, 0.01))
    assert (order.tolist(), found) == ([0, 1, 2, 3, 4], "")


def test_a_flight_is_logged_without_a_vehicle(tmp_path: Path) -> None:
    data = flight().data.copy()
    data.attrs["configuration"] = "{}"
    known = rf.Flight(data, flight().outcome, flight().scores)
    log = ULog(str(known.export(tmp_path / "a.ulg")))
    assert log.initial_parameters["CA_ROTOR_COUNT"] == 0
    assert "actuator_motors" not in [each.name for each in log.data_list]
    assert FLIGHT["vehicle"] not in log.msg_info_multiple_dict
