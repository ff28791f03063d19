"""An MCAP file, as Foxglove and Lichtblick read it.

``/tf``, ``/pose`` and ``/scene`` have Foxglove's own types (`foxglove_scene`), ``/events`` what happened, in words.
Each topic of rotorfault has a schema of its own: all signals of a record as doubles, with unit and meaning in the
schema, as comments of the fields, and in the metadata of the channel. Times of the log are those of the flight.
"""

from __future__ import annotations

import json
from pathlib import Path

from rotorfault.base.errors import missing_extra
from rotorfault.base.files import in_folder, write_atomically
from rotorfault.base.plain_text import printable
from rotorfault.base.progress import Bar
from rotorfault.results.exporters.content import SERIOUS, Content, by_topic, identifiers, number_columns
from rotorfault.results.exporters.doubles import field_names, messages, schema
from rotorfault.results.exporters.foxglove_scene import Scene, nanoseconds, timestamp

RATE = 50.0  # pictures of the vehicle a second; its pose is there for every record
LONGEST = 60  # characters of a topic


def write_mcap(content: Content, path: Path) -> None:
    """Write a flight as Foxglove reads it.

    Parameters
    ----------
    content : Content
    path : Path

    Raises
    ------
    MissingExtraError
        If Foxglove's library is not installed.
    """
    try:
        import foxglove
    except ImportError:
        raise missing_extra("the format mcap needs the package foxglove-sdk", "export") from None

    def write(temporary: Path) -> None:
        # Of its own, so that nobody else's channels get into the file.
        context = foxglove.Context()
        with foxglove.open_mcap(temporary, context=context) as file:
            file.write_metadata("rotorfault", {key: printable(text) for key, text in content.attributes().items()})
            _write_records(content, context, bar)

    with Bar("writing", len(content.time), "records") as bar:
        write_atomically(in_folder(path), write)


def _write_records(content: Content, context: object, bar: Bar) -> None:
    import foxglove
    from foxglove.channels import FrameTransformsChannel, LogChannel, PoseInFrameChannel, SceneUpdateChannel
    from foxglove.messages import Log, LogLevel

    assert isinstance(context, foxglove.Context)
    times = [nanoseconds(time) for time in content.time]
    scene = Scene(content)
    pictures = set(scene.moments(RATE))
    transforms, pose = FrameTransformsChannel("/tf", context=context), PoseInFrameChannel("/pose", context=context)
    picture, log = SceneUpdateChannel("/scene", context=context), LogChannel("/events", context=context)
    channels = []
    topics = by_topic(number_columns(content.data))
    for word, (topic, members) in zip(identifiers(topics, LONGEST), topics.items(), strict=True):
        fields = field_names(members)
        about = {name: one.about(content.units) for name, one in zip(fields[1:], members, strict=True)}
        whole = foxglove.Schema(
            name=f"rotorfault.{word}", encoding="protobuf", data=schema(word, fields, list(about.values()))
        )
        metadata = {"topic": printable(topic), "fields": json.dumps(about)}
        channel = foxglove.Channel(
            f"/{word}", schema=whole, message_encoding="protobuf", metadata=metadata, context=context
        )
        channels.append((channel, messages([content.time, *(one.values for one in members)])))
    picture.log(scene.paths(), log_time=times[0])
    said = list(content.events)

    def say(until: int) -> None:
        while said and nanoseconds(said[0].time) <= until:
            event = said.pop(0)
            level = LogLevel.Warning if event.kind in SERIOUS else LogLevel.Info
            line = Log(timestamp=timestamp(event.time), level=level, message=event.text, name=event.kind)
            log.log(line, log_time=nanoseconds(event.time))

    for at, time in enumerate(times):
        say(time)
        transforms.log(scene.transforms(at), log_time=time)
        pose.log(scene.pose(at), log_time=time)
        if at in pictures:
            picture.log(scene.vehicle(at), log_time=time)
        for channel, rows in channels:
            channel.log(rows[at].tobytes(), log_time=time)
        if at % 1000 == 0:
            bar.update(at)
    say(nanoseconds(max([content.time[-1], *(event.time for event in said)])))


def layout(content: Content) -> str:
    """A layout of Foxglove's and Lichtblick's for such a file: the scene, paths, rotors, losses and events.

    Parameters
    ----------
    content : Content

    Returns
    -------
    str
        JSON, to be imported in the app.
    """
    colours = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
    members = [column for column in number_columns(content.data) if column.topic == "flight"]
    named = dict(zip(((c.signal, c.component) for c in members), field_names(members)[1:], strict=True))
    word = identifiers(by_topic(number_columns(content.data)), LONGEST)[0]

    def plot(title: str, *signals: str) -> dict[str, object]:
        paths = [
            {
                "value": f"/{word}.{named[one.signal, one.component]}",
                "label": one.label(content.units),
                "enabled": True,
                "timestampMethod": "receiveTime",
            }
            for signal in signals
            for one in members
            if one.signal == signal
        ]
        for number, path in enumerate(paths):
            path["color"] = colours[number % len(colours)]
        look = {"showLegend": True, "legendDisplay": "floating", "xAxisVal": "timestamp"}
        return {"title": title, "paths": paths} | look

    panels: dict[str, object] = {
        "3D!scene": {
            "title": "flight",
            "followTf": "vehicle",
            "followMode": "follow-position",
            "cameraState": {"distance": 12.0 * content.airframe.arm, "phi": 65.0, "thetaOffset": 45.0, "fovy": 45.0,
                            "perspective": True, "near": 0.01, "far": 5000.0, "target": [0, 0, 0],
                            "targetOffset": [0, 0, 0], "targetOrientation": [0, 0, 0, 1]},
            "scene": {"transforms": {"showLabel": True, "axisScale": content.airframe.arm}},
            "topics": {"/scene": {"visible": True}, "/pose": {"visible": False}},
            "layers": {"grid": {"layerId": "foxglove.Grid", "visible": True, "instanceId": "grid", "size": 20,
                                "divisions": 20, "frameId": "world", "color": "#bbbbbb80"}},
        },
        "Plot!position": plot("position and reference (m)", "position", "position_reference"),
        "Plot!attitude": plot("attitude (rad)", "attitude"),
        "Plot!thrust": plot("thrust (N)", "thrust"),
        "Plot!loss": plot("true and believed loss", "loss_true", "loss_believed"),
        "RosOut!events": {"topicToRender": "/events", "searchTerms": [], "minLogLevel": 1},
    }  # fmt: skip

    def column(*names: str) -> object:
        first, *rest = names
        share = 100.0 / len(names)
        return first if not rest else {"first": first, "second": column(*rest), "direction": "column",
                                       "splitPercentage": share}  # fmt: skip

    left = {"first": "3D!scene", "second": "RosOut!events", "direction": "column", "splitPercentage": 75}
    right = column("Plot!position", "Plot!attitude", "Plot!thrust", "Plot!loss")
    arranged = {"first": left, "second": right, "direction": "row", "splitPercentage": 55}
    whole = {"configById": panels, "globalVariables": {}, "userNodes": {}, "playbackConfig": {"speed": 1},
             "layout": arranged}  # fmt: skip
    return json.dumps(whole, indent=1) + "\n"
