"""MCAP: what the library of the format and the decoder of Protocol Buffers read."""

from __future__ import annotations

import json
from collections import defaultdict
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from exported import flight, mean_flight
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

import rotorfault as rf
from rotorfault.results.export import foxglove_layout
from rotorfault.results.exporters.content import by_topic, colours, columns
from rotorfault.results.exporters.doubles import field_names


class Read:
    """All of a file: messages with their times, by topic."""

    def __init__(self, path: Path) -> None:
        self.messages: dict[str, list[Any]] = defaultdict(list)
        self.times: dict[str, list[int]] = defaultdict(list)
        with path.open("rb") as file:
            reader = make_reader(file, decoder_factories=[DecoderFactory()])
            summary = reader.get_summary()
            assert summary is not None
            self.channels = {channel.topic: channel for channel in summary.channels.values()}
            self.schemas = {c.topic: summary.schemas[c.schema_id] for c in summary.channels.values()}
            self.metadata = {each.name: each.metadata for each in reader.iter_metadata()}
            for _, channel, message, decoded in reader.iter_decoded_messages():
                self.messages[channel.topic].append(decoded)
                self.times[channel.topic].append(message.log_time)


@pytest.fixture(scope="module")
def read(tmp_path_factory: pytest.TempPathFactory) -> Read:
    return Read(flight().export(tmp_path_factory.mktemp("mcap") / "a.mcap"))


def test_every_signal_is_there_to_the_last_bit_at_its_time(read: Read) -> None:
    data = flight().records()
    time = np.round(data["time"].values * 1e9).astype(int).tolist()
    topics = by_topic(columns(data))
    assert {"flight", "controller", "diagnosis"} <= set(topics)
    for topic, members in topics.items():
        messages = read.messages[f"/{topic}"]
        assert read.times[f"/{topic}"] == time
        for name, column in zip(field_names(members)[1:], members, strict=True):
            assert np.array_equal([getattr(one, name) for one in messages], column.values), column.name


def test_units_are_in_the_schema_and_in_the_channel(read: Read) -> None:
    about = json.loads(read.channels["/flight"].metadata["fields"])
    assert about["thrust_2"] == "true thrust [N]"
    assert b"true position; world: x forward, y left, z up [m]" in read.schemas["/flight"].data
    assert read.schemas["/flight"].name == "rotorfault.flight"
    assert read.metadata["rotorfault"]["vehicle"] == "crazyflie-2.1"
    assert json.loads(read.metadata["rotorfault"]["configuration"])["duration"] == 0.5


def test_frames_are_those_of_the_flight_with_z_up(read: Read) -> None:
    data = flight().data
    names = {"/tf": "FrameTransforms", "/pose": "PoseInFrame", "/scene": "SceneUpdate", "/events": "Log"}
    assert all(read.schemas[topic].name == f"foxglove.{name}" for topic, name in names.items())
    for at in (0, 100, -1):
        vehicle, estimate, reference = read.messages["/tf"][at].transforms
        assert [t.child_frame_id for t in (vehicle, estimate, reference)] == ["vehicle", "estimate", "reference"]
        for transform, ending in ((vehicle, ""), (estimate, "_estimated")):
            place, turn = transform.translation, transform.rotation
            assert [place.x, place.y, place.z] == data[f"position{ending}"].values[at].tolist()
            assert [turn.w, turn.x, turn.y, turn.z] == data[f"quaternion{ending}"].values[at].tolist()
        assert reference.rotation.z == pytest.approx(np.sin(0.5 * 0.4))
    stamp = read.messages["/pose"][100].timestamp
    assert stamp.ToNanoseconds() == 200_000_000


def test_the_scene_has_every_rotor_where_it_is_coloured_by_its_loss(read: Read) -> None:
    paths, *vehicles = read.messages["/scene"]
    assert [entity.id for entity in paths.entities] == ["path flown", "path reference"]
    before, after = vehicles[0].entities[0], vehicles[-1].entities[0]
    assert (after.frame_id, after.frame_locked) == ("vehicle", True)
    rotors = rf.load_vehicle("crazyflie-2.1").rotor
    assert [(c.pose.position.x, c.pose.position.y) for c in after.cylinders] == [
        (rotor.x.value, rotor.y.value) for rotor in rotors
    ]
    assert len(after.arrows) == len(after.texts) == len(rotors)
    assert before.cylinders[1].color.r == 0.0
    assert after.cylinders[1].color.r == pytest.approx(colours(np.array(0.3))[0] / 255)
    assert after.cylinders[1].color.r > 0.9
    assert after.cylinders[0].color.r == 0.0
    lengths = np.array([arrow.shaft_length for arrow in after.arrows])
    thrust = flight().data["thrust"].values[-1]
    assert np.allclose(lengths / lengths[0], thrust / thrust[0])


def test_events_are_said_when_they_happen(read: Read) -> None:
    said = dict(zip((message.message for message in read.messages["/events"]), read.times["/events"], strict=True))
    assert said["rotor 2 loses 30 % of its thrust"] == 100_000_000


def test_every_and_units_are_choices(tmp_path: Path) -> None:
    few = Read(flight().export(tmp_path / "a.mcap", every=10, units=False))
    assert np.array_equal([m.time for m in few.messages["/flight"]], flight().data["time"].values[::10])
    assert len(few.messages["/tf"]) == len(few.messages["/flight"])
    assert json.loads(few.channels["/flight"].metadata["fields"])["thrust_2"] == "true thrust"


def test_mean_names_become_fields(tmp_path: Path) -> None:
    few = Read(mean_flight().export(tmp_path / "a.mcap", every=50))
    assert few.messages["/flight"][0].script_alert_1_script == 0.0
    assert set(few.channels) >= {"/x", "/position", "/flight", "/controller"}


def test_the_layout_shows_what_is_in_the_file(read: Read) -> None:
    layout = json.loads(foxglove_layout(flight().records()))
    plots = [panel for name, panel in layout["configById"].items() if name.startswith("Plot!")]
    values = [path["value"] for plot in plots for path in plot["paths"]]
    fields = set(read.messages["/flight"][0].DESCRIPTOR.fields_by_name)
    assert len(values) > 15
    assert {value.removeprefix("/flight.") for value in values} <= fields

    def leaves(part: Any) -> list[str]:
        return [part] if isinstance(part, str) else [*leaves(part["first"]), *leaves(part["second"])]

    assert sorted(leaves(layout["layout"])) == sorted(layout["configById"])
