"""Flights in the files of other tools, read back with those tools' own libraries."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest
import scipy.io
from command_line import assert_refused, run
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

import rotorfault as rf
from rotorfault.base.errors import FileWarning
from rotorfault.results import exporters
from rotorfault.results.events import events
from rotorfault.results.exporters.foxglove import along
from rotorfault.results.flight_data import FlightData

Values = NDArray[np.float64]
NASTY = ["<script>", "a\nb", "🚁", "\u202eleft", "'\"", "x" * 10_000, "", "..", "/", "\x1b[31m", "\\", "%s{0}"]
FLAT = ("thrust_demand", "yaw_reference")
WIDE = ("position", "thrust", "quaternion", "loss_believed", "controller.sigma_attitude", "controller.gain_angle")


@pytest.fixture(scope="module")
def flight() -> rf.Flight:
    """An X quadrotor with noise, wind and a fault, so that nothing is zero."""
    fault = {"kind": "step", "rotor": 2, "time": 0.2, "loss": 0.3}
    settings: dict[str, Any] = {
        "duration": 0.5, "vehicle": "hummingbird", "controller.preset": "hummingbird", "sensors": "noisy",
        "fault": [fault], "wind": {"kind": "constant", "velocity_W": [3.0, 1.0, 0.2]},
        "start.attitude": [0.1, 0.2, 0.3],
    }  # fmt: skip
    return rf.fly("hover-fault", settings=settings)


def values_of(flight: rf.Flight, name: str) -> Values:
    return np.asarray(flight.data[name].values, dtype=float).reshape(len(flight.data.time), -1)


def test_parquet_has_every_bit_and_units(flight: rf.Flight, tmp_path: Path) -> None:
    table = pq.read_table(flight.export(tmp_path / "a.parquet"))
    np.testing.assert_array_equal(table["time [s]"], flight.data.time)
    np.testing.assert_array_equal(table["velocity_y [m/s]"], values_of(flight, "velocity")[:, 1])
    field = table.schema.field("thrust_1 [N]")
    assert field.metadata[b"units"] == b"N"
    assert field.metadata[b"long_name"] == b"true thrust"
    assert table.schema.metadata[b"scenario"] == b"hover-fault"
    assert "thrust_1" in pq.read_schema(flight.export(tmp_path / "b.parquet", units=False)).names


@pytest.mark.parametrize("name", [*FLAT, *WIDE])
def test_mat_has_every_bit_and_units(flight: rf.Flight, tmp_path: Path, name: str) -> None:
    content = scipy.io.loadmat(flight.export(tmp_path / "a.mat"), simplify_cells=True)
    slot, _, short = name.rpartition(".")
    signal = content[slot or "flight"][short]
    np.testing.assert_array_equal(np.reshape(signal["value"], (len(flight.data.time), -1)), values_of(flight, name))
    assert signal["unit"] == flight.data[name].attrs["units"]
    assert signal["meaning"] == flight.data[name].attrs["long_name"]
    assert content["about"]["scenario"] == "hover-fault"


def messages(path: Path) -> dict[str, list[tuple[int, dict[str, Any]]]]:
    """Messages of an MCAP by topic, with their times in ns."""
    reader = pytest.importorskip("mcap.reader", reason="needs mcap")
    found: dict[str, list[tuple[int, dict[str, Any]]]] = {}
    with path.open("rb") as file:
        for schema, channel, message in reader.make_reader(file).iter_messages():
            assert schema.encoding == "jsonschema"
            json.loads(schema.data)
            found.setdefault(channel.topic, []).append((message.log_time, json.loads(message.data)))
    return found


def test_mcap_has_every_bit(flight: rf.Flight, tmp_path: Path) -> None:
    found = messages(flight.export(tmp_path / "a.mcap"))
    times = [stamp for stamp, _ in found["/flight"]]
    assert times == [round(t * 1e9) for t in flight.data.time.values]
    for name in ("position", "quaternion"):
        got = [list(message[name].values()) for _, message in found["/flight"]]
        np.testing.assert_array_equal(got, values_of(flight, name))
    assert [message["thrust_demand"] for _, message in found["/flight"]] == values_of(flight, "thrust_demand")[
        :, 0
    ].tolist()
    got = [list(message["sigma_attitude"].values()) for _, message in found["/controller"]]
    np.testing.assert_array_equal(got, values_of(flight, "controller.sigma_attitude"))


def test_mcap_has_what_foxglove_draws(flight: rf.Flight, tmp_path: Path) -> None:
    path = flight.export(tmp_path / "a.mcap")
    found = messages(path)
    stamp, last = found["/tf"][-1]
    record = int(np.argmin(np.abs(flight.data.time.values - stamp / 1e9)))
    assert list(last["translation"].values()) == values_of(flight, "position")[record].tolist()
    w, *xyz = values_of(flight, "quaternion")[record]
    assert list(last["rotation"].values()) == [*xyz, w]
    (entity,) = found["/vehicle"][0][1]["entities"]
    assert len(entity["cylinders"]) == len(entity["texts"]) == 4
    arrow = found["/thrust"][-1][1]["entities"][0]["arrows"][1]
    reach = max(np.hypot(a.x.value, a.y.value) for a in rf.load_vehicle("hummingbird").rotor)
    most = rf.load_vehicle("hummingbird").thrust_max.value
    length = arrow["shaft_length"] + arrow["head_length"]
    assert length == pytest.approx(1.5 * reach * values_of(flight, "thrust")[record, 1] / most)
    turned = arrow["pose"]["orientation"]
    up = Rotation.from_quat([turned[key] for key in "xyzw"]).apply([1.0, 0.0, 0.0])
    assert up == pytest.approx([0.0, 0.0, 1.0])
    assert [log["message"] for _, log in found["/events"]] == [event.text for event in events(flight.records())]


@pytest.mark.parametrize("axis", [(0.0, 0.0, 1.0), (-0.433, 0.25, 0.866), (0.0, -0.6, -0.8), (-1.0, 0.0, 0.0)])
@pytest.mark.parametrize("force", [2.0, -1.0])
def test_arrows_of_thrust_lie_along_the_axes_of_tilted_rotors(axis: tuple[float, ...], force: float) -> None:
    turned = along((axis[0], axis[1], axis[2]), force < 0.0)
    found = Rotation.from_quat([turned[key] for key in "xyzw"]).apply([1.0, 0.0, 0.0])
    assert found == pytest.approx(np.sign(force) * np.array(axis), abs=1e-3)


def test_the_layout_for_foxglove_names_what_is_there(flight: rf.Flight, tmp_path: Path) -> None:
    path = flight.export(tmp_path / "a.mcap")
    layout = json.loads((tmp_path / "a.foxglove.json").read_text())
    flight.export(path)  # the same once more
    (tmp_path / "a.foxglove.json").write_text("somebody's own")
    with pytest.warns(FileWarning, match=r"a\.foxglove\.json: was there already and is kept"):
        flight.export(path)
    assert (tmp_path / "a.foxglove.json").read_text() == "somebody's own"
    _, message = messages(path)["/flight"][0]
    paths = [each["value"] for panel in layout["configById"].values() for each in panel.get("paths", [])]
    assert len(paths) >= 17
    for each in paths:
        field, column = each.removeprefix("/flight.").split(".")
        assert isinstance(message[field][column], float)

    def leaves(node: Any) -> list[str]:
        return [node] if isinstance(node, str) else leaves(node["first"]) + leaves(node["second"])

    assert set(leaves(layout["layout"])) == set(layout["configById"])


def test_rerun_reads_every_bit(flight: rf.Flight, tmp_path: Path) -> None:
    chunk = pytest.importorskip("rerun.chunk", reason="needs rerun-sdk")
    path = flight.export(tmp_path / "a.rrd")
    found: dict[str, Any] = {}
    for each in chunk.RrdReader(str(path)).stream():
        batch = each.to_record_batch()
        for name in batch.schema.names:
            if name != "rerun.controls.RowId":
                found.setdefault(str(each.entity_path), {}).setdefault(name, []).append(
                    batch.column(name).to_pylist()
                )

    def rows(entity: str, column: str) -> list[Any]:
        return [row for part in found[entity][column] for row in part]

    for k, column in enumerate("xyz"):
        got = np.array(rows(f"/signals/flight/velocity/{column}", "Scalars:scalars"), dtype=float)[:, 0]
        np.testing.assert_array_equal(got, values_of(flight, "velocity")[:, k])
    times = [row.total_seconds() for row in rows("/signals/flight/velocity/x", "time")]
    assert times == pytest.approx(flight.data.time.values.tolist())
    # What is drawn is in single precision.
    translation = np.array(rows("/world/vehicle", "Transform3D:translation"))[:, 0]
    np.testing.assert_allclose(translation, values_of(flight, "position"), rtol=1e-6, atol=1e-6)
    quaternion = np.array(rows("/world/vehicle", "Transform3D:quaternion"))[:, 0]
    np.testing.assert_allclose(quaternion, np.roll(values_of(flight, "quaternion"), -1, axis=1), rtol=1e-6, atol=1e-6)
    assert rows("/signals/flight/velocity", "unit") == [["m/s"]]
    texts = [row[0] for row in rows("/events", "TextLog:text")]
    assert texts == [event.text for event in events(flight.records())]
    assert chunk.RrdReader(str(path)).blueprints()


@pytest.fixture(scope="module")
def ulog(flight: rf.Flight, tmp_path_factory: pytest.TempPathFactory) -> Any:
    pyulog = pytest.importorskip("pyulog", reason="needs pyulog")
    return pyulog.ULog(str(flight.export(tmp_path_factory.mktemp("ulog") / "a.ulg")))


def topic(ulog: Any, name: str, *fields: str) -> Values:
    data = ulog.get_dataset(name).data
    return np.column_stack([data[field] for field in fields])


def test_ulog_has_px4s_topics_in_px4s_frames(flight: rf.Flight, ulog: Any) -> None:
    flip = np.array([1.0, -1.0, -1.0])
    for ending, what in (("", "_estimated"), ("_groundtruth", "")):
        place = topic(ulog, f"vehicle_local_position{ending}", "x", "y", "z")
        np.testing.assert_allclose(place, values_of(flight, f"position{what}") * flip, rtol=1e-6)
        rates = topic(ulog, f"vehicle_angular_velocity{ending}", "xyz[0]", "xyz[1]", "xyz[2]")
        np.testing.assert_allclose(rates, values_of(flight, f"body_rates{what}") * flip, rtol=1e-6)
    # An arrow of the body is the same arrow of the world in both frames.
    q = topic(ulog, "vehicle_attitude_groundtruth", *(f"q[{k}]" for k in range(4)))
    theirs, ours = (Rotation.from_quat(each, scalar_first=True) for each in (q, values_of(flight, "quaternion")))
    arrow = np.array([0.3, -0.5, 0.8])
    np.testing.assert_allclose(theirs.apply(arrow * flip) * flip, ours.apply(arrow), atol=1e-6)
    asked = topic(ulog, "vehicle_attitude_setpoint", *(f"q_d[{k}]" for k in range(4)))
    angles = Rotation.from_quat(asked, scalar_first=True).as_euler("ZYX")[:, ::-1]
    np.testing.assert_allclose(angles, values_of(flight, "controller.attitude_command") * flip, atol=1e-6)
    thrust = topic(ulog, "vehicle_thrust_setpoint", "xyz[2]")
    most = 4.0 * flight.data.attrs["thrust_max"]
    np.testing.assert_allclose(thrust, -values_of(flight, "thrust_demand") / most, rtol=1e-6)
    np.testing.assert_array_equal(
        ulog.get_dataset("vehicle_attitude").data["timestamp"], np.rint(flight.data.time * 1e6)
    )


def test_ulog_has_all_signals_to_the_last_bit(flight: rf.Flight, ulog: Any) -> None:
    np.testing.assert_array_equal(
        topic(ulog, "rotorfault_flight", "thrust_demand"), values_of(flight, "thrust_demand")
    )
    fields = [f"thrust[{k}]" for k in range(4)]
    np.testing.assert_array_equal(topic(ulog, "rotorfault_flight", *fields), values_of(flight, "thrust"))
    gains = [f"gain_angle[{k}]" for k in range(9)]
    np.testing.assert_array_equal(
        topic(ulog, "rotorfault_controller", *gains), values_of(flight, "controller.gain_angle")
    )
    units = json.loads(ulog.msg_info_dict["rotorfault_signals"])
    assert units["velocity"][0] == "m/s"
    assert len(units) == len(flight.data.data_vars)


def test_ulog_has_motors_in_px4s_order_and_says_so(tmp_path: Path) -> None:
    pyulog = pytest.importorskip("pyulog", reason="needs pyulog")
    vehicle = rf.load_vehicle("crazyflie-2.1")
    settings = {"vehicle": "crazyflie-2.1", "controller.preset": "crazyflie", "duration": 0.1, "fault": []}
    flight = rf.fly("hover-fault", settings={**settings, "start.attitude": [0.1, 0.2, 0.3]})
    ulog = pyulog.ULog(str(flight.export(tmp_path / "a.ulg")))
    commands = topic(ulog, "actuator_motors", *(f"control[{k}]" for k in range(12)))
    assert np.isnan(commands[:, 4:]).all()
    corners = [
        (1, -1),
        (-1, 1),
        (1, 1),
        (-1, -1),
    ]  # front right, rear left, front left, rear right: x forward, y left
    for motor, corner in enumerate(corners):
        (rotor,) = (
            k for k, one in enumerate(vehicle.rotor) if (np.sign(one.x.value), np.sign(one.y.value)) == corner
        )
        share = values_of(flight, "thrust_command")[:, rotor] / vehicle.thrust_max.value
        np.testing.assert_allclose(commands[:, motor], share, rtol=1e-6)
        assert str(rotor + 1) in ulog.msg_info_dict["rotorfault_motors"]


def test_ulog_has_the_events_as_messages(flight: rf.Flight, ulog: Any) -> None:
    # Rotor 2 of the file, the rear one, is motor 4 of PX4's quad +; its topics count motors.
    told = [f"{e.text} (rotor 2 is motor 4)" if e.rotor == 2 else e.text for e in events(flight.records())]
    assert [message.message for message in ulog.logged_messages] == told
    stamps = [message.timestamp for message in ulog.logged_messages]
    assert stamps == [round(event.time * 1e6) for event in events(flight.records())]
    assert not ulog.file_corruption


def test_ulog_of_a_plus_frame_has_px4s_order_for_it(tmp_path: Path) -> None:
    pyulog = pytest.importorskip("pyulog", reason="needs pyulog")
    flown = rf.fly("paper-set-point", settings={"duration": 0.05})
    log = pyulog.ULog(str(flown.export(tmp_path / "a.ulg")))
    # PX4's quad +: right, left, front, rear; ours: front, rear, right, left.
    assert "quadrotor +: motors 1 to 4 are rotors 3, 4, 1, 2" in log.msg_info_dict["rotorfault_motors"]
    motors = topic(log, "actuator_motors", *(f"control[{k}]" for k in range(4)))
    np.testing.assert_allclose(motors, values_of(flown, "thrust_command")[:, [2, 3, 0, 1]] / 8.68, rtol=1e-6)


def test_ulog_says_what_px4_says_of_a_vehicle_and_its_failures(tmp_path: Path) -> None:
    pyulog = pytest.importorskip("pyulog", reason="needs pyulog")
    flown = rf.fly("paper-set-point", settings={"duration": 2.0})
    log = pyulog.ULog(str(flown.export(tmp_path / "a.ulg")))
    assert not log.file_corruption
    known = log.initial_parameters
    assert (known["MAV_TYPE"], known["CA_ROTOR_COUNT"]) == (2, 4)
    # PX4's motor 1 of a quad + is on the right; ours there turns counter-clockwise.
    assert [known[f"CA_ROTOR0_{name}"] for name in ("PX", "PY")] == pytest.approx([0.0, 0.42])
    assert known["CA_ROTOR0_KM"] == pytest.approx(0.0382550)
    assert known["CA_ROTOR2_KM"] == pytest.approx(-0.0382550)
    status = log.get_dataset("failure_detector_status").data
    # Rotors 1 and 3, front and right, are motors 3 and 1.
    assert status["motor_failure_mask"][-1] == 0b101
    flags = values_of(flown, "fault_flag") > 0.5
    assert np.array_equal(status["motor_failure_mask"] & 1 > 0, flags[:, 2])
    assert np.array_equal(status["fd_motor"] > 0, flags.any(axis=1))
    whole = "".join(log.msg_info_multiple_dict["rotorfault_configuration"][0])
    assert json.loads(whole) == json.loads(flown.data.attrs["configuration"])


def test_events_are_those_of_all_records_however_few_are_written(flight: rf.Flight, tmp_path: Path) -> None:
    few = messages(flight.export(tmp_path / "few.mcap", every=50))
    wanted = [event.text for event in events(flight.records())]
    assert [log["message"] for _, log in few["/events"]] == wanted


READERS: dict[str, Callable[[Path], int]] = {
    "csv": lambda path: len(path.read_text().splitlines()) - 1,
    "parquet": lambda path: pq.read_table(path).num_rows,
    "mat": lambda path: len(scipy.io.loadmat(path)["time"]),
    "mcap": lambda path: len(messages(path)["/flight"]),
    "ulog": lambda path: len(
        pytest.importorskip("pyulog").ULog(str(path)).get_dataset("rotorfault_flight").data["timestamp"]
    ),
}


@pytest.mark.parametrize("form", READERS)
def test_every_nth_record_is_written(flight: rf.Flight, tmp_path: Path, form: str) -> None:
    path = tmp_path / f"a{exporters.ENDINGS[form]}"
    flight.export(path, every=7)
    assert READERS[form](path) == -(-len(flight.data.time) // 7)


@pytest.mark.parametrize("form", exporters.FORMATS)
@pytest.mark.parametrize("name", NASTY)
def test_names_of_others_do_no_harm(flight: rf.Flight, tmp_path: Path, form: str, name: str) -> None:
    short = flight.records().isel(time=slice(0, 3))
    variables = {
        **short.variables,
        name or "empty": short["position"]._replace(attrs={"units": name, "long_name": name, "frame": name}),
        f"{name}.{name}": short["thrust"]._replace(attrs={"units": name}),
    }
    attributes = {**short.attrs, "scenario": name, "controller": name, name or "empty": name}
    data = FlightData(variables, short.coordinates, attributes)
    path = tmp_path / f"a{exporters.ENDINGS[form]}"
    exporters.write(data, path)
    if form in READERS:
        assert READERS[form](path) >= 3
    assert {each.name for each in tmp_path.iterdir()} <= {path.name, "a.foxglove.json"}


def test_a_missing_library_is_named_with_what_brings_it(
    flight: rf.Flight, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import sys

    for library, form in (("mcap.writer", "mcap"), ("rerun", "rrd")):
        monkeypatch.setitem(sys.modules, library, None)
        with pytest.raises(rf.InputError, match=r"pip install -e '\.\[export\]'"):
            flight.export(tmp_path / f"a.{form}")
    assert not list(tmp_path.iterdir())


def test_the_command_takes_the_format_or_the_ending(flight: rf.Flight, tmp_path: Path) -> None:
    source = flight.save(tmp_path / "flight.nc")
    assert run("export", str(source), "--to", "parquet").stdout == f"wrote {tmp_path / 'flight.parquet'}\n"
    assert run("export", str(source), "--out", str(tmp_path / "b.ulg")).stdout == f"wrote {tmp_path / 'b.ulg'}\n"
    assert_refused(run("export", str(source)), "csv, parquet, mat, mcap, rrd, ulog")
    assert_refused(run("export", str(source), "--to", "bag"), "format")
    assert_refused(run("export", str(source), "--out", str(tmp_path / "b.xyz")), "ending")
    assert_refused(run("export", str(source), "--to", "mat", "--every", "0"), "every")
